# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Every page of the package, of what is made up: quick to make, with something in every place."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
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
from pprs_dynamics.app.api.compare import ComparisonResult
from pprs_dynamics.app.api.diagnose import diagnosis_page
from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.api.next_experiment import ExperimentResult
from pprs_dynamics.app.commands.trend import fleet_page
from pprs_dynamics.app.fleet.recordings import write_rows
from pprs_dynamics.app.fleet.trend import fleet_trends
from pprs_dynamics.app.report.history_report import history_page
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.comparison import compare
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.inference.experiments.next_experiment import (
    Accuracy,
    ExpectedEvidence,
    Experiment,
)
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.ledger import Step

DAY = 86400  # [s]


def made_up_pages(folder: Path) -> dict[str, Page]:
    """Return all pages but that of the robot, by command."""
    diagnosis = made_up_diagnosis(
        effects=(found_effect('coulomb_friction', ('lift_2', 'slide_1')),),
        sets=ranked_sets('coulomb_friction', 'hysteresis'))
    words = word_diagnosis(diagnosis, GivenFiles(('my run.mcap',), ('other.mcap',)))
    return {
        'diagnosis': diagnosis_page(diagnosis, words, made_up_residuals(), ['my run.mcap']),
        'comparison': ComparisonResult(
            Inputs(DriveModel.load(), {}, {}), diagnosis.residuals, compare(diagnosis.residuals),
            ('so',)).page(),
        'adoption': _adoption(diagnosis.residuals), 'history': _history(),
        'experiment': _experiment(), 'fleet': _fleet(folder / 'store')}


def _adoption(before: Residuals) -> Page:
    model, after = DriveModel.load(), made_up_residuals()
    friction = found_effect('coulomb_friction').force
    with_it = replace(after, parts={'coulomb_friction': friction})
    return AdoptionResult(Inputs(model, {}, {}), Adoption(
        EffectRequest(CATALOGUE['coulomb_friction']), ('lift_2',), model, model, before, with_it,
        0.26, 0.052, VALIDATION, dict.fromkeys(DRIVES, NOISE),
        {'lift_2.force': Estimate(0.6, 0.01, 'N')},
        remarks=('the recordings call for time_delay, too',), calibrated=(calibration(),),
        rivals=('load_friction',), reason='the error on held-out data falls'),
        ).page()


def _history() -> Page:
    step = Step(
        effect='coulomb_friction', error_before=0.2, error_after=0.1, held_out_before=0.21,
        held_out_after=0.11, held_out_on='blocks', noise_floor=0.09, recordings=('a.csv', 'b.csv'),
        sha256=('0' * 64, 'f' * 64), spans=(0.0, 20.0, 5.0, 25.0),
        date='2026-11-21T08:00:00+00:00', version='0.1.0', forced=False, drives=('lift_1',),
        parameters=('lift_1.force',), values=(1.5,), std=(0.02,), units=('N',),
        measured=DRIVES, drive_errors_before=(0.1,) * 3 + (0.3,) * 3,
        drive_errors_after=(0.1,) * 6, calibrated=('masses.payload',))
    return history_page('better.yaml', [step, replace(step, effect='base_tilt', drives=())])


def _experiment() -> Page:
    path, model = Excitation(duration=4.0, seed=1), DriveModel.load()
    experiment = Experiment(
        'separate', ('coulomb_friction', 'load_friction'),
        (ExpectedEvidence('coulomb_friction', 'load_friction', 9.9, 120.0, 0.99),),
        (Accuracy('masses.payload', 'kg', 0.02, 0.01, 0.002),),
        {f'velocity of {name}': 0.1 * k + 0.3 for k, name in enumerate(DRIVES)}, 4.0, path.motion,
        model)
    return ExperimentResult(Inputs(model, {}, {}), experiment, path.motion(
        np.arange(0.0, 4.0, 0.01)), 'separate', 0, 100.0).page()


def _fleet(folder: Path) -> Page:
    rng = np.random.default_rng(7)
    for robot in ('a robot with a long name', 'b'):
        for day in range(30):
            write_rows(folder, f'{robot} {day}', [{
                'recording': f'{day}.csv', 'path': f'/{robot}/{day}.csv', 'robot': robot,
                'sha256': f'{robot} {day}', 'model': 'm', 'options': 'auto', 'version': '1',
                'time': datetime.fromtimestamp((20_000 + day) * DAY, UTC), 'drive': 'slide_2',
                'effect': 'coulomb_friction', 'parameter': 'force', 'std': 0.1, 'unit': 'N',
                'value': (day > 10) * (robot == 'b') + 0.05 * rng.normal()}])
    return fleet_page(fleet_trends(str(folder)))
