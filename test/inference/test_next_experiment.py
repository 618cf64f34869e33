# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The designed experiment: columns, paths, limits, criteria, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pandas as pd
import pytest
from model_recordings import record, with_effects

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.experiments import motion_design
from pprs_dynamics.inference.experiments.motion_design import Motions, NoMotionError, room
from pprs_dynamics.inference.experiments.motion_design import design as design_motion
from pprs_dynamics.inference.experiments.next_experiment import (
    FittedTerm,
    Information,
    whitened,
)
from pprs_dynamics.inference.regression.base_columns import (
    LoadOfFriction,
    ModelNumber,
    PresentParameter,
    ReversalShape,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.candidates import Component
from pprs_dynamics.measurement.files.recording import read_recording, write_recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.joint_motion import JointSeries
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import default_parameters

DURATION = 8.0
HARMONICS = 5
TOLERANT = {'tolerances.masses.payload': 0.05, 'tolerances.friction.drives.coulomb': 0.1}


@pytest.fixture(scope='module')
def model() -> DriveModel:
    return DriveModel.from_parameters({**default_parameters(), **TOLERANT})


@pytest.fixture(scope='module')
def series(model: DriveModel) -> JointSeries:
    rng = np.random.default_rng(3)
    return JointSeries(0.015 * rng.uniform(-1, 1, (6, JointSeries.size(HARMONICS))),
                       room(model)[0], DURATION, HARMONICS)


def moved(model: DriveModel, series: JointSeries, time: np.ndarray) -> PlatformMotion:
    return Motions(model, DURATION).sampled(series, time)


# Paths.

def test_a_path_starts_and_ends_at_rest_in_the_same_pose(
    model: DriveModel, series: JointSeries,
) -> None:
    ends = moved(model, series, np.array([0.0, DURATION]))
    middle = moved(model, series, np.linspace(1.0, DURATION - 1.0, 50))
    for pose in (ends.position, ends.orientation):
        assert np.allclose(pose[0], pose[1], rtol=0, atol=1e-9)
    for name in ('linear_velocity', 'angular_velocity', 'linear_acceleration',
                 'angular_acceleration'):
        assert np.abs(getattr(ends, name)).max() < 1e-9
        assert np.abs(getattr(middle, name)).max() > 0.01


# Columns and information.

TERMS = tuple(FittedTerm(Component.of(CATALOGUE[key], *of), np.array(c)) for key, *of, c in (
    ('stribeck_friction', 3, {'velocity': 0.02, 'exponent': 2.0}, ('force',), [0.5]),
    ('drive_spring', 0, {}, ('stiffness', 'force'), [10.0, 1.0]),
    ('time_delay', 4, {'delay': 0.004}, (), [1.0]),
    ('homing_error', 1, {}, ('zero',), [0.001]),
    ('base_tilt', None, {}, ('x', 'y'), [0.01, 0.0])))
EFFECTS = {'viscous_friction': {'lift_2.coefficient': 1.5},
           'stribeck_friction': {'slide_2.force': 0.6, 'slide_2.velocity': 0.02},
           'payload_mass': {'mass': 0.1}, 'time_delay': {'lift_3.delay': 0.003}}
KNOWN = {'viscous_friction': {'lift_2.coefficient': 1.0},
         'stribeck_friction': {'slide_2.force': 1.0, 'slide_2.velocity': 0.01},
         'payload_mass': {'mass': 0.1}, 'time_delay': {'lift_3.delay': 0.001}}


@pytest.fixture(scope='module')
def design(model: DriveModel, series: JointSeries) -> Design:
    """Columns on a recording of a robot that has effects already."""
    model = with_effects(model, EFFECTS, KNOWN)
    motion = moved(model, series, np.arange(0.0, DURATION, 0.002))
    return Design.of(model, [record(model, motion=lambda _: motion, time=motion.time)])


def test_what_a_motion_would_tell_is_what_its_recording_tells(
    design: Design, series: JointSeries,
) -> None:
    """The columns on a motion nobody made agree with those of the diagnosis on its recording."""
    regression = Regression(design.residuals, design.base)
    white = np.zeros((6, len(regression.noise_shapes.corners) + 1))
    white[:, 0] = 0.05 ** 2
    fit = regression.at((), white)
    information = Information(design.given, design.model, series, TERMS, regression.noise(fit))
    known = information.of_recordings(design, regression, fit) - information.prior()
    # Smoothing drops half a window at either end, and the transform a few samples more.
    time = design.recordings[0].time[:5 * len(regression.series[0])]
    told = information.of_motion(information.on_motion(series, time, 5))
    scale = np.sqrt(np.diag(known))
    assert np.diag(told) == pytest.approx(np.diag(known), rel=0.05)
    assert np.abs((told - known) / np.outer(scale, scale)).max() < 0.05
    assert {type(column) for column in information.base} == {
        LoadOfFriction, ModelNumber, ReversalShape, PresentParameter}


def test_white_noise_counts_samples() -> None:
    noise = NoiseSpectrum(np.zeros(0), np.array([0.5 ** 2]), 0.01)
    wave = np.cos(2 * np.pi * 3 * np.arange(40) / 40)
    # 1000 samples of mean square 1/2 over a variance of 1/4.
    assert np.sum(whitened(wave, noise, 0.25) ** 2) == pytest.approx(2000)


# Limits and search.


def test_a_design_keeps_tight_limits_and_repeats_with_its_seed(
    model: DriveModel, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every limit in turn is made the one that stops the motion."""
    for name, value in (('STEPS', 40), ('SLIDE_SPEED', 0.1), ('ACCELERATION', 0.5), ('TILT', 0.1)):
        monkeypatch.setattr(motion_design, name, value)
    tight = DriveModel.from_parameters({
        **model.values, 'limits.lift_stroke': (0.12, 0.30),
        'limits.effort': (9.0,) * 3 + (18.0,) * 3, 'limits.condition_number': 2.2,
        'limits.rod_sine': 0.45})
    motions = Motions(tight, DURATION)

    def size(series: JointSeries) -> float:
        return float(np.abs(series.coefficients).sum())

    drawn = motions.drawn(1, 10)
    found = design_motion(motions, drawn, size, 1)
    assert 0.8 < max(motions.uses(found).values()) <= 1.0
    assert size(found) > max(map(size, drawn))
    time = np.linspace(0, DURATION, 8001)
    forces = motions.forces(found, time)
    assert np.abs(forces.mechanism.velocity).max() <= 0.09 + 1e-6
    assert np.abs(forces.mechanism.acceleration).max() <= 0.45 + 1e-5
    assert tight.robot.variables(forces.mechanism)['platform_tilt'].max() <= 0.09 + 1e-6
    tight.limits.check_strokes(forces.mechanism.position)
    links = forces.mechanism.links
    number = tight.robot.condition_number(tight.robot.jacobian(links))
    assert number.max() <= 0.9 * 2.2 + 1e-3
    assert np.abs(np.sin(tight.robot.rods(links)[0])).min() >= 0.5
    tight.limits.check_efforts(forces.total)
    first, again, other = (motions.drawn(seed, 1)[0].coefficients for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_no_room_is_said(model: DriveModel) -> None:
    weak = replace(model, limits=model.limits.with_efforts((1.0,) * 6))
    with pytest.raises(NoMotionError, match=r'no motion is allowed.*effort of lift'):
        Motions(weak, DURATION)


# Motions that excite an arm: within its limits, at rest at both ends, and worth their time.

CORNER = 0.03  # share of a period in which the speed changes
NOISE = 1.5  # [N m, N], white: so much that the corners do not tell


@pytest.fixture(scope='module')
def arm_model(tmp_path_factory: pytest.TempPathFactory) -> DriveModel:
    return arm.real_arm(tmp_path_factory.mktemp('arm'))


def played(path: Path) -> JointMotion:
    """Return the motion of a CSV file."""
    table = pd.read_csv(path)
    return JointMotion(*(table[[f'{joint}/{name}' for joint in arm.JOINTS]].to_numpy()
                         for name in ('position', 'velocity', 'acceleration')),
                       table['time'].to_numpy())


def test_the_command_writes_what_a_controller_can_play_within_the_limits(
    arm_model: DriveModel, tmp_path: Path,
) -> None:
    path, answer = tmp_path / 'arm.yaml', tmp_path / 'next.json'
    write_model(path, arm_model.values, arm_model.source)
    assert main(['next-experiment', '--model', str(path), '--purpose', 'commission', '--output',
                 str(tmp_path / 'next.csv'), '--json', str(answer)]) == 0
    motion, tree = played(tmp_path / 'next.csv'), arm_model.robot.structure
    assert len(motion.position) == 2001
    assert np.all(np.abs(motion.position) <= 0.901 * np.minimum(tree.upper, np.pi))
    assert np.all(np.abs(motion.velocity) <= 0.901 * tree.speed)
    assert np.all(np.abs(motion.acceleration) <= 0.901 * 5.0)
    assert np.all(np.abs(arm_model.drive_forces(motion).total) <= 0.91 * tree.effort)
    told = json.loads(answer.read_text())
    assert max(told['limits'].values()) <= 1.001
    assert 0 < told['determined'] <= told['total']


@pytest.fixture(scope='module')
def one_speed(arm_model: DriveModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which swing hardly changes its speed: what lacks there is open."""
    folder = tmp_path_factory.mktemp('one_speed')
    period, rate = 8.0, 100.0
    time = np.arange(0, 40, 1 / rate)
    phase = (time / period) % 1
    # There and back at constant speed, with rounded corners: viscous friction looks like dry.
    corner = CORNER
    speed = np.tanh((np.minimum(phase, 1 - phase)) / (corner / 3)) * np.tanh(
        (0.5 - phase) / (corner / 3))
    q = np.zeros((3, len(time), 3))
    for joint, size in enumerate((0.3, 0.3, 0.05)):
        v = size * speed
        q[0, :, joint] = np.concatenate(([0.0], np.cumsum((v[1:] + v[:-1]) / 2 / rate)))
        q[1, :, joint], q[2, :, joint] = v, np.gradient(v, 1 / rate)
    viscous = list(arm_model.values['friction.viscous'])
    viscous[1] += 6.0
    real = DriveModel.from_parameters(
        {**arm_model.values, 'friction.viscous': tuple(viscous)}, arm_model.source)
    path = folder / 'run.csv'
    write_recording(path, arm.record(real, JointMotion(*q, time), NOISE))
    return path


def test_a_motion_is_designed_that_tells_rivals_apart(
    arm_model: DriveModel, one_speed: Path, tmp_path: Path,
) -> None:
    path, answer = tmp_path / 'arm.yaml', tmp_path / 'next.json'
    write_model(path, arm_model.values, arm_model.source)
    output, page = tmp_path / 'next.csv', tmp_path / 'next.html'
    assert main(['next-experiment', str(one_speed), '--model', str(path), '--output', str(output),
                 '--json', str(answer), '--report', str(page)]) == 0
    told = json.loads(answer.read_text())
    assert told['question'] == 'separate'
    asked = {frozenset(pair) for pair in told['separates'] + told['does_not_separate']}
    assert any('viscous_friction' in pair for pair in asked)
    assert told['separates']
    assert told['expected_evidence'] > 20
    assert max(told['limits'].values()) <= 1.001
    assert 'N m' in page.read_text()
    # The promise is kept: the rival falls behind in a diagnosis of both runs.
    real = DriveModel.from_parameters({**arm_model.values, 'friction.viscous': tuple(
        np.add(arm_model.values['friction.viscous'], (0, 6.0, 0)))}, arm_model.source)
    second = tmp_path / 'second.csv'
    write_recording(second, arm.record(real, played(output), NOISE, seed=1))
    found = diagnose(arm_model, [read_recording(one_speed, arm_model.drives),
                                 read_recording(second, arm_model.drives)])
    assert [effect.name for effect in found.effects] == ['viscous_friction']
    assert found.indistinguishable == ()
