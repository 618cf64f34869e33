# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pages of what is made up: quick to make, with something in every place."""

from __future__ import annotations

from dataclasses import replace

from made_up_diagnosis import (
    NOISE,
    calibration,
    found_effect,
    made_up_diagnosis,
    made_up_residuals,
    ranked_sets,
)

from pprs_dynamics import DriveModel
from pprs_dynamics.app.api.adopt import AdoptionResult
from pprs_dynamics.app.api.diagnose import diagnosis_page
from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.physics.effects.catalogue import CATALOGUE


def made_up_pages() -> dict[str, Page]:
    """Return the pages that have nearly all components, by name."""
    diagnosis = made_up_diagnosis(
        effects=(found_effect('coulomb_friction', ('lift_2', 'slide_1')),),
        sets=ranked_sets('coulomb_friction', 'hysteresis'))
    words = word_diagnosis(diagnosis, GivenFiles(('my run.mcap',), ('other.mcap',)))
    return {
        'diagnosis': diagnosis_page(diagnosis, words, made_up_residuals(), ['my run.mcap']),
        'adoption': _adoption(diagnosis.residuals)}


def _adoption(before: Residuals) -> Page:
    model, after = DriveModel.load(), made_up_residuals()
    friction = found_effect('coulomb_friction').force
    with_it = replace(after, parts={'coulomb_friction': friction})
    return AdoptionResult(Inputs(model, {}, {}), Adoption(
        EffectRequest(CATALOGUE['coulomb_friction']), ('lift_2',), model, model, before, with_it,
        0.26, 0.052, VALIDATION, dict.fromkeys(DRIVES, NOISE),
        {'lift_2.force': Estimate(0.6, 0.01, 'N')},
        remarks=('the recordings call for time_delay, too',), calibrated=(calibration(),),
        rivals=('load_friction',), reason='the error on held-out data falls')).page()
