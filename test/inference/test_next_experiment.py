# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The designed experiment: columns, paths, limits, criteria, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pprs_command import pprs

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.experiments.columns import ColumnPlan, FittedTerm
from pprs_dynamics.inference.experiments.criteria import (
    Contest,
    Explanation,
    Information,
    Precision,
    whitened,
)
from pprs_dynamics.inference.experiments.fourier_path import FourierPath
from pprs_dynamics.inference.experiments.motion_design import (
    NoMotionError,
    PlatformMotions,
    limits_of,
    random_motions,
)
from pprs_dynamics.inference.experiments.motion_design import (
    design as design_motion,
)
from pprs_dynamics.inference.experiments.motion_limits import MotionLimits
from pprs_dynamics.inference.experiments.next_experiment import (
    PurposeError,
    experiment_of,
    next_experiment,
)
from pprs_dynamics.inference.experiments.question import commissioning, question_after
from pprs_dynamics.inference.regression.base_columns import (
    ModelNumber,
    PresentCoefficient,
    PresentShape,
    ReversalShape,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.candidates import (
    CandidateSet,
    Component,
    EffectCandidate,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.table import ModelTable, Rival, Row
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.motion_files import read_poses
from pprs_dynamics.physics.model.parameter_file import default_parameters
from pprs_dynamics.physics.three_pprs.jacobians import condition_number

DURATION = 8.0
HARMONICS = np.array([[1, 2, 4], [1, 3, 5], [2, 3, 4], [1, 2, 3], [1, 4, 5], [2, 4, 5]])
FAMILY = FourierPath.at_rest(DURATION, HARMONICS, (0.0, 0.0, 0.5))
TOLERANT = {'tolerances.masses.payload': 0.05, 'tolerances.friction.drives.coulomb': 0.1}


@pytest.fixture(scope='module')
def model() -> DriveModel:
    return DriveModel.from_parameters({**default_parameters(), **TOLERANT})


@pytest.fixture(scope='module')
def parameters() -> np.ndarray:
    rng = np.random.default_rng(3)
    sizes = np.repeat((0.03, 0.08), FAMILY.size // 2)
    return sizes * rng.uniform(-1, 1, FAMILY.size)


def recorded(model: DriveModel, motion: PlatformMotion, seed: int, noise: float) -> Recording:
    """Return what perfect encoders and noisy efforts would record of a motion."""
    forces = model.drive_forces(motion)
    rng = np.random.default_rng(seed)
    return Recording.from_arrays('run', motion.time, forces.mechanism.position, None,
                                 forces.total + noise * rng.normal(size=forces.total.shape))


# Paths.

def test_a_path_starts_and_ends_at_rest_in_the_same_pose(parameters: np.ndarray) -> None:
    ends = FAMILY.with_parameters(parameters).motion(np.array([0.0, DURATION]))
    middle = FAMILY.with_parameters(parameters).motion(np.linspace(1.0, DURATION - 1.0, 50))
    assert np.allclose(ends.position, (0.0, 0.0, 0.5), atol=1e-12)
    assert np.allclose(np.abs(ends.orientation), (0.0, 0.0, 0.0, 1.0), atol=1e-12)
    for name in ('linear_velocity', 'angular_velocity', 'linear_acceleration',
                 'angular_acceleration'):
        assert np.abs(getattr(ends, name)).max() < 1e-12
        assert np.abs(getattr(middle, name)).max() > 0.01


def test_velocities_and_accelerations_are_those_of_the_poses(parameters: np.ndarray) -> None:
    time = np.linspace(0.0, DURATION, 4001)
    exact = FAMILY.with_parameters(parameters).motion(time)
    spline = PlatformMotion.from_poses(time, exact.position, exact.orientation)
    inside = slice(20, -20)  # a spline is poor at its ends
    for name, tolerance in (('linear_velocity', 1e-7), ('angular_velocity', 1e-5),
                            ('linear_acceleration', 1e-5), ('angular_acceleration', 1e-3)):
        assert np.allclose(getattr(exact, name)[inside], getattr(spline, name)[inside],
                           rtol=0, atol=tolerance)


# Columns and information.

TERMS = (
    FittedTerm(CATALOGUE['stribeck_friction'], 3, {'velocity': 0.02, 'exponent': 2.0}, ('force',),
               np.array([0.5])),
    FittedTerm(CATALOGUE['drive_spring'], 0, {}, ('stiffness', 'force'), np.array([10.0, 1.0])),
    FittedTerm(CATALOGUE['time_delay'], 4, {'delay': 0.004}, (), np.ones(1)),
    FittedTerm(CATALOGUE['homing_error'], 1, {}, ('zero',), np.array([0.001])),
    FittedTerm(CATALOGUE['base_tilt'], None, {}, ('x', 'y'), np.array([0.01, 0.0])))
EFFECTS = {'effects.active': ['viscous_friction', 'stribeck_friction', 'payload_mass',
                              'time_delay'],
           'effects.time_delay.lift_3.delay': 0.003,
           'effects.viscous_friction.lift_2.coefficient': 1.5,
           'effects.stribeck_friction.slide_2.force': 0.6,
           'effects.stribeck_friction.slide_2.velocity': 0.02,
           'effects.payload_mass.mass': 0.1,
           'uncertainties.time_delay.lift_3.delay': 0.001,
           'uncertainties.viscous_friction.lift_2.coefficient': 1.0,
           'uncertainties.stribeck_friction.slide_2.force': 1.0,
           'uncertainties.stribeck_friction.slide_2.velocity': 0.01,
           'uncertainties.payload_mass.mass': 0.1}


@pytest.fixture(scope='module')
def design(model: DriveModel, parameters: np.ndarray) -> Design:
    """Columns on a recording of a robot that has effects already."""
    model = DriveModel.from_parameters({**model.values, **EFFECTS})
    motion = FAMILY.with_parameters(parameters).motion(np.arange(0.0, DURATION, 0.002))
    return Design.of(model, [recorded(model, motion, 0, 0.0)])


def test_what_a_motion_would_tell_is_what_its_recording_tells(
    design: Design, parameters: np.ndarray,
) -> None:
    """The columns on a motion nobody made agree with those of the diagnosis on its recording."""
    path = FAMILY.with_parameters(parameters)
    regression = Regression(design.residuals, design.base)
    white = np.zeros((6, len(regression.noise_shapes.corners) + 1))
    white[:, 0] = 0.05 ** 2
    fit = regression.at((), white)
    plan = ColumnPlan.of_design(design, TERMS)
    information = Information(plan, regression.noise(fit))
    known = information.of_recordings(design, regression, fit) - information.prior()
    # Smoothing drops half a window at either end, and the transform a few samples more.
    time = design.recordings[0].time[:5 * len(regression.series[0])]
    columns = plan.on_motion(plan.model.drive_forces(path.motion(time)), time, 5)
    told = information.of_motion(columns, len(time) * 0.002)
    scale = np.sqrt(np.diag(known))
    assert np.diag(told) == pytest.approx(np.diag(known), rel=0.05)
    assert np.abs((told - known) / np.outer(scale, scale)).max() < 0.05
    assert {type(one) for one in plan.base} == {
        ModelNumber, ReversalShape, PresentCoefficient, PresentShape}


def test_a_drive_that_stood_may_turn_over_in_a_motion(
    design: Design, parameters: np.ndarray,
) -> None:
    """A recording of a drive that stands has no columns of its reversals; a motion has them."""
    stood = replace(design, base=tuple(
        one for one in design.base if not (isinstance(one, ReversalShape) and one.drive == 2)))
    time = np.arange(120) * DURATION / 120
    found = []
    for one in (design, stood):
        plan = ColumnPlan.of_design(one, ())
        forces = plan.model.drive_forces(FAMILY.with_parameters(parameters).motion(time))
        index, rows = plan.on_motion(forces, time)[2]
        mine = [k for k, at in enumerate(index) if isinstance(plan.base[at], ReversalShape)
                and plan.base[at].drive == 2]
        found.append(rows[mine])
        assert np.all(np.abs(rows[mine]).max(axis=1) > 0.01)
    assert np.array_equal(*found)


def test_few_samples_tell_nearly_the_same(model: DriveModel, parameters: np.ndarray) -> None:
    path = FAMILY.with_parameters(parameters)
    noise = NoiseSpectrum(np.array([1.7]), np.array([7e-4, 0.25]), 0.01)
    question = commissioning(model, [], 0.05)
    plan = replace(question.plan, terms=(TERMS[1], TERMS[4]))
    information = Information(plan, dict.fromkeys(range(6), noise))
    fine, coarse = np.arange(0, DURATION, 0.002), np.arange(120) * DURATION / 120
    full = information.of_motion(
        plan.on_motion(model.drive_forces(path.motion(fine)), fine, 5), DURATION)
    few = information.of_motion(
        plan.on_motion(model.drive_forces(path.motion(coarse)), coarse), DURATION)
    for k in [*plan.numbers, *range(len(plan.base), plan.size)]:
        assert few[k, k] == pytest.approx(full[k, k], rel=0.3)


def test_white_noise_counts_samples() -> None:
    noise = NoiseSpectrum(np.zeros(0), np.array([0.5 ** 2]), 0.01)
    wave = np.cos(2 * np.pi * 3 * np.arange(40) / 40)
    # 1000 samples of mean square 1/2 over a variance of 1/4.
    assert np.sum(whitened(wave, noise, 10.0) ** 2) == pytest.approx(2000)


# Criteria.

def _explained(name: str, index: tuple[int, ...], truth: list[float]) -> Explanation:
    return Explanation((name,), (), index, index, np.array(truth))


def test_misfit_is_what_least_squares_leaves() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(200, 5))
    truth, rival = _explained('a', (2, 3), [1.0, -2.0]), _explained('b', (4,), [1.0])
    force = columns[:, [2, 3]] @ (1.0, -2.0)
    rest = force - columns[:, [0, 1, 4]] @ np.linalg.lstsq(columns[:, [0, 1, 4]], force)[0]
    contest = Contest(truth, rival, (0, 1, 4))
    assert contest.misfit(columns.T @ columns) == pytest.approx(rest @ rest, rel=1e-6)


def test_a_rival_that_can_do_the_same_is_never_told() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(50, 2))
    columns = np.column_stack((columns, columns @ (1.0, 2.0)))
    contest = Contest(_explained('a', (2,), [3.0]), _explained('b', (0, 1), [1.0, 1.0]), (0, 1))
    assert contest.misfit(columns.T @ columns) < 1e-4


def test_a_rival_that_its_shape_says_all_of_is_not_scaled() -> None:
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(60, 3))
    # A delay of the wrong length does not become right by a factor.
    rival = Explanation(('time_delay',), (), (), (1,), np.ones(1))
    force, base = 3.0 * columns[:, 1] + columns[:, 0], columns[:, [2]]
    left = force - columns[:, 1]
    rest = left - base @ np.linalg.lstsq(base, left)[0]
    contest = Contest(_explained('a', (0, 1), [1.0, 3.0]), rival, (2,))
    assert contest.misfit(columns.T @ columns) == pytest.approx(rest @ rest, rel=1e-6)


def test_precision_is_the_scatter_of_estimates() -> None:
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(40, 3)) @ np.array([[1, 0.5, 0], [0, 1, 0.3], [0, 0, 1]])
    covariance = np.linalg.inv(columns.T @ columns)
    found = Precision((1, 2), (0,), np.array([0.1, 10.0])).deviations(columns.T @ columns)
    assert found == pytest.approx(np.sqrt(np.diag(covariance))[1:], rel=1e-6)


# Limits and search.

def test_use_of_limits_is_measured_against_what_the_margin_leaves(
    model: DriveModel, parameters: np.ndarray,
) -> None:
    time = np.linspace(0, DURATION, 500)
    forces = model.drive_forces(FAMILY.with_parameters(parameters).motion(time))
    limits = MotionLimits(velocity=0.4, margin=0.2, effort_reserve=1.0)
    uses = limits.uses(model, forces)
    state = forces.mechanism
    assert uses['velocity of lift_2'] == pytest.approx(
        np.abs(state.velocity[:, 4]).max() / (0.4 * 0.8))
    assert uses['effort of slide_1'] == pytest.approx(
        (np.abs(forces.total[:, 0]).max() + 1.0) / (model.limits.efforts[0] * 0.8))
    lower, upper = model.values['limits.lift_stroke']
    room = 0.8 * (upper - lower) / 2
    assert uses['stroke of lift_1'] == pytest.approx(
        np.abs(state.position[:, 3] - (lower + upper) / 2).max() / room)


def test_a_design_keeps_tight_limits_and_repeats_with_its_seed(model: DriveModel) -> None:
    """Every limit in turn is made the one that stops the motion."""
    tight = DriveModel.from_parameters({
        **model.values, 'limits.lift_stroke': (0.12, 0.30),
        'limits.effort': (9.0,) * 3 + (18.0,) * 3, 'limits.condition_number': 2.2,
        'limits.rod_sine': 0.45})
    motions = PlatformMotions(tight, MotionLimits(velocity=0.1, acceleration=0.5, tilt=0.1),
                              DURATION)

    def size(path: FourierPath) -> float:
        return float(np.abs(path.parameters).sum())

    found = design_motion(motions, size, 1)
    assert 0.8 < max(limits_of(motions, found).values()) <= 1.0
    assert size(found) > max(map(size, random_motions(motions, 1, 40)))
    time = np.linspace(0, DURATION, 8001)
    forces = tight.drive_forces(found.motion(time))
    assert np.abs(forces.mechanism.velocity).max() <= 0.09 + 1e-6
    assert np.abs(forces.mechanism.acceleration).max() <= 0.45 + 1e-5
    assert forces.mechanism.motion.tilt.max() <= 0.09 + 1e-6
    tight.limits.check_strokes(forces.mechanism.position)
    number = condition_number(tight.robot.geometry, forces.mechanism.links.J)
    assert number.max() <= 0.9 * 2.2 + 1e-3
    assert np.abs(forces.mechanism.links.chains.sin_u).min() >= 0.5
    tight.limits.check_efforts(forces.total)
    first, again, other = (random_motions(motions, seed, 1)[0] for seed in (1, 1, 2))
    assert np.array_equal(first.parameters, again.parameters)
    assert not np.array_equal(first.harmonics, other.harmonics)


def test_no_room_is_said(model: DriveModel) -> None:
    question = commissioning(replace(model, limits=model.limits.with_efforts(
        (1.0,) * 6)), [], 0.05)
    with pytest.raises(NoMotionError, match=r'no motion is allowed.*effort of lift'):
        PlatformMotions(question.model, MotionLimits(), DURATION)


def test_a_recording_is_needed_to_know_what_to_tell_apart(model: DriveModel) -> None:
    with pytest.raises(PurposeError, match='no recording is given'):
        next_experiment(model)


def test_a_design_that_cannot_separate_says_so(model: DriveModel) -> None:
    """Coulomb and load friction on a drive whose load hardly changes, by a hair's breadth."""
    terms = (FittedTerm(CATALOGUE['coulomb_friction'], 0, {}, ('force',), np.array([1e-3])),
             FittedTerm(CATALOGUE['load_friction'], 0, {}, ('coefficient',), np.array([1e-4])))
    question = commissioning(model, [], 0.05)
    plan = replace(question.plan, terms=terms)
    base = tuple(range(len(plan.base)))
    gram = np.zeros((plan.size, plan.size))
    gram[base, base] = 1.0
    both = [_explained(term.effect.name, (plan.places()[term].start,), list(term.values))
            for term in terms]
    contests = [Contest(a, b, (*base, *b.index)) for a, b in (both, both[::-1])]
    question = replace(question, kind='separate', plan=plan, known=gram,
                       subjects=()).with_contests(contests)
    motions = PlatformMotions(question.model, MotionLimits(), DURATION)
    (found,) = random_motions(motions, 0, 1)
    told = experiment_of(question, found, limits_of(motions, found))
    assert told.separates == ()
    assert told.to_dict()['does_not_separate'] == [['coulomb_friction', 'load_friction']]
    # Friction by load grows with a mass, a tenth of the platform's with its load: no motion needed.
    moved = model.values['masses.platform'] + model.values['masses.payload']
    assert told.load == pytest.approx(0.1 * moved, rel=0.35)
    assert f'the same motion once more with {told.load:g} kg more' in told.text
    assert told.to_dict()['told_by_load'] == [['coulomb_friction', 'load_friction']]
    assert 'hardly separate coulomb_friction from load_friction' in told.text
    # Thirty thousand times the effect is told from its rival.
    strong = [replace(one, truth=3e4 * one.truth) for one in both]
    question = question.with_contests(
        [Contest(a, b, (*base, *b.index)) for a, b in (strong, strong[::-1])])
    assert experiment_of(question, found, {}).separates == (('coulomb_friction', 'load_friction'),)


# From recordings to the question.

def test_rivals_of_a_diagnosis_become_contests(model: DriveModel, parameters: np.ndarray) -> None:
    """Coulomb friction on a drive, and friction by load."""
    robot = DriveModel.from_parameters({
        **model.values, 'effects.active': ['coulomb_friction'],
        'effects.coulomb_friction.lift_1.force': 0.6})
    time = np.arange(0.0, DURATION, 0.004)
    path = FAMILY.with_parameters(parameters)
    old = recorded(robot, path.motion(time), 1, 0.1)
    fits = FittedSets(Design.of(model, [old]), DECISIONS)
    fits.evaluate(())

    def fitted(name: str, *coefficients: str) -> CandidateSet:
        component = Component(CATALOGUE[name], 3, coefficients)
        return fits.evaluate((EffectCandidate.of([component]),))

    adopted = fitted('coulomb_friction', 'force')
    table = ModelTable(fits, fits)
    assert table.reported is adopted
    assert question_after(table, []).kind == 'estimate'
    other = fitted('load_friction', 'coefficient')
    question = question_after(ModelTable(fits, fits), [
        Rival(Row(fits, other), ('coulomb_friction',), ('load_friction',))])
    assert question.kind == 'separate'
    pairs = {(one.truth.name, one.rival.name) for one in question.contests}
    assert ('coulomb_friction', 'load_friction') in pairs
    assert ('load_friction', 'coulomb_friction') in pairs
    costs = {one.effects[0].name: one.cost for one in (adopted, other)}
    for contest in question.contests:
        assert contest.now == costs[contest.rival.name] - costs[contest.truth.name]
    # What the same motion tells again doubles the misfit and leaves the priors as they are.
    again = question.known + question.gram(path)
    for contest in question.contests:
        once = contest.misfit(question.known)
        assert once < contest.misfit(again) < 2.6 * once + 1.0
        assert contest.evidence(question.known, again) == pytest.approx(
            contest.now + contest.misfit(again) - once)


# The command.

@pytest.mark.slow
def test_commission_writes_poses_json_and_page(tmp_path: Path) -> None:
    done = pprs('next-experiment', '--purpose', 'commission', '--output', 'first.csv',
                '--duration', '5', '--json', 'first.json', '--report', 'first.html',
                '--velocity', '0.2', cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    motion = read_poses(tmp_path / 'first.csv', 100.0)
    assert motion.time is not None
    assert motion.time[-1] == pytest.approx(5.0)
    assert motion.is_closed()
    forces = DriveModel.load().drive_forces(motion)
    assert np.abs(forces.mechanism.velocity).max() <= 0.18 + 1e-6
    result = json.loads((tmp_path / 'first.json').read_text())
    assert result['separates'] == []
    assert result['question'] == 'commission'
    assert max(result['limits'].values()) <= 1.0
    assert {f'drive_inertia.{drive}.mass' for drive in DRIVES} <= {
        one['label'] for one in result['accuracy']}
    for one in result['accuracy']:
        assert one['std_after'] <= (one['std_before'] or np.inf) * (1 + 1e-6)
    known = {one['label']: one for one in result['accuracy']}
    # Platform and payload weigh alike: their sum is told, their shares are not.
    assert known['masses.payload']['std_after'] > 0.5 * known['masses.payload']['std_before']
    assert known['masses.lifts[1]']['std_before'] == pytest.approx(0.5 * 0.1 / 2.5)
    assert known['payload_mass.mass']['std_after'] < 0.1
    page = (tmp_path / 'first.html').read_text()
    assert 'The next experiment' in page
    assert 'http' not in page.split('plotly')[0]
