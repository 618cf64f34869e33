# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Efforts that are no measurement are told as what they look like; what is measured never is.

Recordings are made here from what each kind is by definition: a controller's law of gravity, an
error of position, a measurement without weight; the truth is known by how they were made.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from made_once import diagnose
from shared_cases import shared_case
from single_axis import axis, axis_motion, axis_recording

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.inference.readings.check import find_mistakes, looks_like
from pprs_dynamics.inference.readings.findings import OtherReading, effort_looks_like
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation

RATE = 200.0  # [Hz]
DURATION = 20.0  # [s]
WITHOUT_GRAVITY = dict.fromkeys(('turn', 'swing', 'reach'), 'without_gravity')


@dataclass
class Run:
    """A machine, its motion and the parts of what its drives apply, (N, D) each."""

    model: DriveModel
    time: Array
    position: Array
    velocity: Array
    inertia: Array
    gravity: Array
    friction: Array

    @property
    def total(self) -> Array:
        return self.inertia + self.gravity + self.friction

    def of(self, effort: Array, noise: float = 0.005, seed: int = 0) -> Recording:
        """Return a recording of an effort, with noise as a share of each drive's largest."""
        random = np.random.default_rng(seed)
        size = noise * np.abs(effort).max(axis=0)
        return Recording.from_arrays(
            'run', self.time, self.position + random.normal(0, 1e-6, self.position.shape), None,
            effort + size * random.normal(size=effort.shape), self.model.drives)

    def kinds(self, effort: Array, noise: float = 0.005) -> dict[str, str] | None:
        return effort_looks_like([looks_like(self.model, [self.of(effort, noise)]).values()])


def run_of(model: DriveModel, motion: Any, still: Any) -> Run:
    forces, rest = model.drive_forces(motion), model.drive_forces(still)
    position, velocity, _ = forces.drive_motion
    rigid, gravity = (f.parts['rigid_body'] for f in (forces, rest))
    return Run(model, motion.time, position, velocity, rigid - gravity, gravity,
               forces.total - rigid)


def mechanism_run(folder: Path, **changes: Any) -> Run:
    model, moved = arm.real_arm(folder, **changes), arm.motion(DURATION, RATE)
    rest = np.zeros_like(moved.velocity)
    return run_of(model, moved, type(moved)(moved.position, rest, rest, moved.time))


def platform_run() -> Run:
    moved = Excitation(DURATION, 1).motion(np.arange(0, DURATION, 1 / RATE))
    rest = np.zeros_like(moved.linear_velocity)
    still = type(moved)(moved.position, moved.orientation, rest, rest, rest, rest, moved.time)
    return run_of(DriveModel.load(), moved, still)


def axis_run(gravity: float) -> Run:
    moved = axis_motion(np.arange(0, DURATION, 1 / RATE))
    rest = np.zeros_like(moved.velocity)
    return run_of(axis(**{'robot.gravity': (0.0, 0.0, gravity)}), moved,
                  JointMotion(moved.position, rest, rest, moved.time))


MACHINES = {'arm': mechanism_run, 'platform': lambda folder: platform_run(),
            'axis': lambda folder: axis_run(0.0), 'upright axis': lambda folder: axis_run(-9.81)}


@pytest.fixture(params=MACHINES)
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Run:
    made: Run = MACHINES[request.param](tmp_path)
    return made


def every(run: Run, kind: str) -> dict[str, str]:
    return dict.fromkeys(run.model.drives, kind)


def test_what_is_measured_is_called_so(run: Run) -> None:
    for noise in (1e-3, 0.01, 0.03):
        assert run.kinds(run.total, noise) is None


def test_a_model_that_is_off_makes_no_measurement_a_command(run: Run) -> None:
    """Masses by a quarter, friction by half, a constant: what models are off by."""
    assert run.kinds(1.25 * run.inertia + 0.8 * run.gravity + 1.5 * run.friction
                     + 0.1 * np.abs(run.total).max(axis=0)) is None


@pytest.mark.parametrize('gain', [0.05, -1.0])
def test_a_gain_and_a_sign_are_no_command(run: Run, gain: float) -> None:
    assert run.kinds(gain * run.total) is None


def test_a_law_of_gravity_is_a_command(run: Run) -> None:
    size = np.abs(run.total).max(axis=0)
    effort = 1.1 * run.gravity + 1e-3 * size * np.random.default_rng(3).normal(size=run.total.shape)
    found = find_mistakes(run.model, run.of(effort, 0.0))
    assert 'it looks like what a controller commands' in found[0].what


def test_what_drives_lag_behind_is_an_error_of_position(run: Run) -> None:
    assert run.kinds(0.05 * run.velocity) == every(run, 'position_error')


def test_what_a_stiff_controller_lags_behind_under_the_effort_is_one_too(run: Run) -> None:
    assert run.kinds(run.total / 2000) == every(run, 'position_error')


def test_no_noise_at_all_is_computed(run: Run) -> None:
    found = run.kinds(run.total, 0.0)
    assert found is not None
    assert set(found.values()) == {'noise_free'}


@pytest.mark.parametrize('machine', ['arm', 'platform', 'upright axis'])
def test_efforts_without_gravity_are_told_so(machine: str, tmp_path: Path) -> None:
    run = MACHINES[machine](tmp_path)
    found = run.kinds(run.total - run.gravity)
    assert found is not None
    assert set(found.values()) == {'without_gravity'}
    # With half of it there is gravity, and a payload or a mass may be missing.
    assert run.kinds(run.total - 0.7 * run.gravity) is None


def test_a_motion_that_shows_nothing_tells_nothing(tmp_path: Path) -> None:
    """So slowly that inertia is far below the noise."""
    model, moved = arm.real_arm(tmp_path), arm.motion(DURATION, RATE)
    slow = type(moved)(moved.position, moved.velocity / 30, moved.acceleration / 900,
                       moved.time * 30)
    forces = model.drive_forces(slow).total
    recording = Recording.from_arrays(
        'slow', slow.time, slow.position, slow.velocity,
        forces + np.random.default_rng(0).normal(0, 0.5, forces.shape), model.drives)
    assert find_mistakes(model, recording) == ()


def test_nothing_is_claimed_of_what_is_no_measurement(tmp_path: Path) -> None:
    run = mechanism_run(tmp_path)
    found = diagnose(run.model, [run.of(run.total - run.gravity)])
    assert found.verdict == 'unknown'
    assert found.effects == found.suspects == found.depends_on == ()
    assert found.to_dict()['effort_looks_like'] == WITHOUT_GRAVITY


@pytest.mark.parametrize('kind', ['drive_order', 'effort_unit'])
def test_what_was_read_wrongly_is_no_effect_whatever_explains_it(kind: str) -> None:
    real = axis({'coulomb_friction': {'force': 4.0}})
    doubt = OtherReading(kind, 1, 'the efforts look like those of another drive or unit')
    found = diagnose(axis(), [replace(axis_recording(real), findings=(doubt,))], as_it_is=True)
    assert found.verdict == 'unknown'
    assert [effect.name for effect in found.effects] == ['coulomb_friction']
    words = Sentences(found)
    assert words.headline.startswith('The efforts look like those of another drive or unit. ')
    assert words.command.startswith('pprs info ')


def test_effort_kind_says_that_gravity_was_taken_out(tmp_path: Path) -> None:
    run = mechanism_run(tmp_path)
    model = DriveModel.from_parameters(
        {**run.model.values, 'effort_kind': 'without_gravity'}, run.model.source)
    recording = run.of(run.total - run.gravity)
    assert looks_like(model, [recording]) == {}
    motion = arm.motion(DURATION, RATE)
    np.testing.assert_allclose(model.drive_forces(motion).total, run.total - run.gravity, atol=1e-9)


def test_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r'effort_kind is .*torque.*, must be one of measured, '):
        DriveModel.from_parameters({**DriveModel.load('config/single_axis.yaml').values,
                                    'effort_kind': 'torque'})


def test_commands_stop_or_say_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = mechanism_run(tmp_path)
    write_recording(tmp_path / 'run.csv', run.of(run.total - run.gravity))
    given = [str(tmp_path / 'run.csv'), '--model', str(tmp_path / 'arm.yaml')]
    for command in ('info', 'compare'):
        assert main([command, *given, '--json', str(tmp_path / 'said.json')]) == 0
        said = json.loads((tmp_path / 'said.json').read_text())
        assert said['effort_looks_like'] == WITHOUT_GRAVITY
        told = ' '.join(capsys.readouterr().out.split())
        assert 'as if gravity was already subtracted' in told
    assert 'without_gravity' in told
    for command in (('adopt', 'payload_mass'), ('fit',)):
        assert main([*command, *given, '--output', str(tmp_path / 'x.yaml')]) == 1
        assert 'effort_kind: without_gravity' in capsys.readouterr().err
        assert not (tmp_path / 'x.yaml').exists()


CASES_OF = {
    'controller_echo_real': [('gc.csv.gz', 'pend.yaml', {'command'})],
    'echo': [('v4a.csv.gz', 'arm2.yaml', {'position_error'}),
             ('v4b.csv.gz', 'arm2.yaml', {'noise_free'}), ('v4c.csv.gz', 'arm2.yaml', {'command'})],
    'gravity_free': [('v11.csv.gz', 'arm2.yaml', {'without_gravity'})],
    'adopt_traceback': [('run.csv.gz', 'pend.yaml', set())],
    'kuka_lag': [('j4_1_half.csv.gz', 'j4.yaml', set())],
    'payload_adopt': [('run.csv.gz', 'arm2.yaml', set())],
    'two_quadrant': [('v7b.csv.gz', 'arm2.yaml', set())],
    'stick_slip': [('v16.csv.gz', 'arm2.yaml', set())]}


@pytest.mark.parametrize('case', CASES_OF)
def test_other_peoples_recordings(case: str) -> None:
    for recording, model, kinds in CASES_OF[case]:
        read = shared_case(case, model, recording)
        found = find_mistakes(*read)
        assert {finding.kind for finding in found} == kinds, recording
