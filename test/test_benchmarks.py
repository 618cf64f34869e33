# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Every benchmark can be imported, and those that are run tell what they take."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from benchmarks import mutants

PROJECT = Path(__file__).parents[1]
MODULES = sorted('.'.join(file.relative_to(PROJECT).with_suffix('').parts)
                 for file in (PROJECT / 'benchmarks').rglob('*.py') if file.stem != '__init__')
RUN_BY_MAKE = re.findall(r'-m (benchmarks[\w.]+)', (PROJECT / 'Makefile').read_text())


@pytest.mark.parametrize('name', MODULES)
def test_a_benchmark_imports_what_there_is(name: str) -> None:
    import_module(name)


def test_what_make_runs_is_there() -> None:
    assert len(RUN_BY_MAKE) > 8
    assert set(RUN_BY_MAKE) <= set(MODULES)


def test_mutants_have_tests_that_there_are() -> None:
    listed = mutants.listed()
    assert sum(len(entry['mutants']) for name, entry in listed.items()
               if name.startswith(('inference/search', 'inference/diagnosis'))) >= 40
    assert all((PROJECT / 'test' / name).is_file()
               for entry in listed.values() for name in entry['tests'])


@pytest.mark.slow
def test_mutants_are_mistakes_in_code_that_there_is() -> None:
    assert mutants.stale() == []


def test_a_score_tells_its_options_and_where_its_outcomes_go() -> None:
    shown = subprocess.run([sys.executable, '-m', 'benchmarks.scores.diagnosis', '--help'],
                           cwd=PROJECT, capture_output=True, text=True, timeout=60, check=True)
    assert '--scheduler' in shown.stdout
    assert 'output/score.jsonl' in shown.stdout
