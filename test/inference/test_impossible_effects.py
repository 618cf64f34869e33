# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What no machine can have is no finding, however well it fits."""

from __future__ import annotations

from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest
from made_once import diagnose
from random_states import smooth_motion
from shared_cases import shared_case
from single_axis import axis_motion

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose as diagnosing
from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, next_step
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.laws.hysteresis import presliding

MODEL = DriveModel.load('config/single_axis.yaml')
OWN = 'links.mass', 'friction.viscous', 'friction.coulomb'
MASS, VISCOUS, COULOMB = (MODEL.values[key][0] for key in OWN)
TIME = np.arange(0, 8.0, 0.005)
MOVED = axis_motion(TIME)
Q, SIGN = MOVED.position[:, 0], np.sign(MOVED.velocity)


def recorded(effort: Array) -> Recording:
    noise = np.random.default_rng(5).normal(0, 1.0, effort.shape)
    return Recording.from_arrays('run', TIME, MOVED.position, None, effort + noise, ('axis',))


@pytest.mark.parametrize('share', [0.8, 1.2])
@pytest.mark.parametrize(('name', 'key', 'own', 'column', 'shape'), [
    ('drive_inertia', 'mass', -MASS, MOVED.acceleration, {}),
    ('viscous_friction', 'coefficient', -VISCOUS, MOVED.velocity, {}),
    ('coulomb_friction', 'force', -COULOMB, SIGN, {}),
    ('stribeck_friction', 'force', -COULOMB, SIGN * np.exp(-(MOVED.velocity / 0.03) ** 2),
     {'velocity': 0.03, 'exponent': 2.0}),
    ('hysteresis', 'force', COULOMB, presliding(Q, 1e-3)[:, None] - SIGN, {'distance': 1e-3}),
    ('friction_drift', 'force', -COULOMB, SIGN * np.exp(-TIME / 4)[:, None], {'time': 4.0})])
def test_no_more_is_taken_away_than_there_is(name: str, key: str, own: float, column: Array,
                                             shape: dict[str, float], share: float) -> None:
    """What would leave less than nothing in some state is held at nothing there, at a cost."""
    recording = recorded(MODEL.drive_forces(MOVED).total + share * own * column)
    # The model's own numbers are known, so that what is missing is the effect's alone.
    exact = DriveModel.from_parameters({**MODEL.values, **dict.fromkeys(
        (f'tolerances.{key}' for key in OWN), 1e-6)})
    fits = FittedSets(Design.of(exact, [recording]), DECISIONS)
    component = Component.of(catalogue()[name], 0, shape, (key,))
    found = fits.evaluate((EffectCandidate.of([component]),))
    np.testing.assert_allclose(found.coefficients(component), min(share, 1.0) * own,
                               rtol=0.05 if share < 1 else 2e-2 if shape else 1e-9)
    rise = found.terms.feasibility
    assert rise == 0 if share < 1 else rise > DECISIONS.rival_margin
    assert fits.refused(found) == [component] * (share > 1)


def test_no_more_is_taken_off_rods_than_they_weigh() -> None:
    paper = DriveModel.load('config/paper.yaml')
    light = DriveModel.from_parameters({**paper.values, 'masses.rods': [0.1] * 3})
    heavy, less = (model.drive_forces(smooth_motion(TIME)) for model in (paper, light))
    effort = heavy.total + 4 * (less.total - heavy.total)  # as of rods of -0.2 kg
    fits = FittedSets(Design.of(paper, [Recording.from_arrays(
        'run', TIME, heavy.mechanism.position, None, effort, paper.drives)]), DECISIONS)
    component = Component.of(paper.bound(catalogue()['link_mass']), None, {}, ('rods.mass',))
    found = fits.evaluate((EffectCandidate.of([component]),))
    assert found.coefficients(component) == pytest.approx([-0.19])


def test_what_can_only_be_nothing_does_not_void_what_is_there() -> None:
    """One direction may have less than nothing by chance; the other is told all the same."""
    bare = DriveModel.from_parameters({**MODEL.values, 'friction.coulomb': [0.0]})
    forward = (1 + np.sign(MOVED.velocity)) / 2
    effort = bare.drive_forces(MOVED).total + COULOMB * forward + 0.1 * COULOMB * (1 - forward)
    fits = FittedSets(Design.of(bare, [recorded(effort)]), DECISIONS)
    both, component = (Component.of(catalogue()['asymmetric_friction'], 0, {}, names) for names in (
        ('force_forward', 'force_backward'), ('force_forward',)))
    held, without = (fits.evaluate((EffectCandidate.of([c]),)) for c in (both, component))
    assert held.coefficients(both)[1] == pytest.approx(0, abs=1e-9)
    assert held.coefficients(both)[0] == pytest.approx(COULOMB, rel=0.05)
    assert without.cost < held.cost
    assert fits.refused(held) == []


def test_a_ripple_longer_than_the_stroke_is_no_free_curve() -> None:
    """Amplitudes a thousand times the error could cancel within the stroke to any curve."""
    curve = 60 * MOVED.position + 2e4 * MOVED.position ** 3
    fits = FittedSets(Design.of(MODEL, [recorded(MODEL.drive_forces(MOVED).total + curve)]),
                      DECISIONS)
    ripple, spring = catalogue()['force_ripple'], catalogue()['drive_spring']

    def wave(pitch: float) -> Component:
        return Component.of(ripple, 0, {'pitch': pitch}, ripple.variants[-1])
    bent, line = wave(50 * np.ptp(MOVED.position)), Component.of(spring, 0, {}, spring.variants[0])
    long, straight = (fits.evaluate((EffectCandidate.of([part]),)) for part in (bent, line))
    size = root_mean_square(fits.design.residuals.error)
    assert np.abs(long.coefficients(*long.blocks)).max() < 20 * size
    assert straight.cost < long.cost
    # Of waves that come back the prior is the one of every other effect.
    short = wave(np.ptp(MOVED.position) / 10)
    usual = fits.regression.block(fits.components.term(short).rows).precision
    assert np.linalg.slogdet(fits.components.block(short).precision)[1] == pytest.approx(
        np.linalg.slogdet(usual)[1], abs=1.0)


def test_no_gain_beyond_what_a_drive_may_have_is_reported() -> None:
    """Mass and friction that all are too small explain as well what a gain of 1.9 would."""
    loose = DriveModel.from_parameters({**MODEL.values, 'tolerances.effort_gain.gain': 1.0})
    doubled = recorded(1.9 * MODEL.drive_forces(MOVED).total)
    found = diagnosing(loose, [doubled])
    names = {effect.name for effect in found.effects}
    assert names
    assert 'effort_gain' not in names
    fits = FittedSets(Design.of(loose, [doubled]), DECISIONS)
    component = Component.of(catalogue()['effort_gain'], 0, {}, ('gain',))
    alone = fits.evaluate((EffectCandidate.of([component]),))
    assert alone.coefficients(component) == pytest.approx([0.5])
    assert alone.terms.feasibility > DECISIONS.rival_margin
    assert fits.refused(alone) == [component]
    answer = adopt(loose, EffectRequest.of('effort_gain', loose), [doubled], diagnosis=found)
    assert not answer.adopted
    assert 'values of effort_gain that fit best are impossible' in answer.reason


@pytest.mark.slow
def test_a_late_effort_is_found_without_an_impossible_gain() -> None:
    """The fourth joint of an iiwa, whose torques are 60 to 70 ms late and its masses guesses."""
    model, recording = shared_case('kuka_lag', 'j4.yaml', 'j4_1_half.csv.gz')
    found = diagnose(model, [recording])
    assert found.verdict == 'unknown'
    names = {effect.name for effect in found.effects}
    assert names & {'effort_filter', 'time_delay'}
    assert 'effort_gain' not in names
    words, command = next_step(found, PLACEHOLDERS)
    assert words.startswith('The model has no friction yet')
    assert command.startswith('pprs fit')


def test_a_gain_that_a_drive_may_have_is_one() -> None:
    found = diagnose(MODEL, [recorded(1.2 * MODEL.drive_forces(MOVED).total)])
    assert [effect.name for effect in found.effects] == ['effort_gain']
    assert found.effects[0].parameters['axis.gain'].value == pytest.approx(0.2, abs=0.02)


def test_an_answer_with_which_the_error_rises_is_none(tmp_path: Path) -> None:
    """Radians that are called degrees: next to no motion, which linear forces are far from."""
    run = arm.record(arm.real_arm(tmp_path), arm.motion(8.0, seed=0), 0.2, 0)
    radians = np.array([np.pi / 180, np.pi / 180, 1.0])
    found = diagnose(DriveModel.load(tmp_path / 'arm.yaml'), [Recording.from_arrays(
        'run', run.time, run.position * radians, None, run.effort, run.drives)], as_it_is=True)
    if found.effects:
        assert root_mean_square(found.remaining) < root_mean_square(found.residuals.error)
    else:
        assert found.verdict == 'unknown'
        assert any(effect.objection for effect in found.unconfirmed)
    assert all(row.cost >= 0 for row in found.sets)
