# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""docs/commands.md lists every key that commands write with --json."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import pytest
from documents import PROJECT, text_of

from pprs_dynamics.app.api.adopt import AdoptionRunResult
from pprs_dynamics.app.api.compare import ComparisonResult
from pprs_dynamics.app.commands import diagnose, info
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.loop import AdoptionRun
from pprs_dynamics.inference.diagnosis.comparison import Beside, Comparison
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect, RankedEffect, RankedSet
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.fit.base_fit import BaseFit, FittedNumber, Refit
from pprs_dynamics.inference.search.cost_terms import CostTerms
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.measurement.files.recording import DriveSummary, Summary

COMPARE, DIAGNOSE = 'From a recording to where the model fails', 'From where to why'
ADOPT = 'Add it, and watch the error fall'

# What writes keys, by the section of the page that lists them.
WRITERS: dict[str, tuple[Callable[..., Any], ...]] = {
    COMPARE: (Comparison.to_dict, ComparisonResult.to_dict, Beside.to_dict, Statement.to_dict,
              BaseFit.to_dict, FittedNumber.to_dict, info.run),
    DIAGNOSE: (Diagnosis.to_dict, FoundEffect.to_dict, RankedEffect.to_dict, RankedSet.to_dict,
               Estimate.to_dict, Calibration.to_dict, diagnose._adopt_all, AdoptionRun.to_dict,
               AdoptionRunResult.to_dict, Refit.to_dict),
    ADOPT: (Adoption.to_dict,)}
WRITTEN_WHOLE = {COMPARE: (Summary, DriveSummary), DIAGNOSE: (CostTerms,)}


def words_of(heading: str) -> set[str]:
    """Return the words that stand as code in a section of the page."""
    text = text_of(PROJECT / 'docs/commands.md')
    section = text.split(f'\n## {heading}\n')[1].split('\n## ')[0]
    return {word for code in re.findall(r'`([^`\n]+)`', section)
            for word in re.findall(r'\w+', code)}


@pytest.mark.parametrize('heading', WRITERS)
def test_every_key_of_the_json_is_listed(heading: str) -> None:
    keys = {key for writer in WRITERS[heading]
            for key in re.findall(r"'(\w+)': ", inspect.getsource(writer))}
    keys |= {one.name for kind in WRITTEN_WHOLE.get(heading, ()) for one in fields(kind)}
    assert keys, 'nothing is written'
    assert not sorted(keys - words_of(heading))
