# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of people's machines, made up: held poses, slow joints, free motors, odd efforts."""

from __future__ import annotations

import json
import re
from pathlib import Path

import made_up_arm
import numpy as np
import pytest
from made_up_files import ARM, SLIDE, arm_efforts, motion

from pprs_dynamics.app.api.diagnose import diagnose
from pprs_dynamics.app.api.first_model import FirstModel, first_model
from pprs_dynamics.app.api.fit import fit
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.readings.findings import OtherReading
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.drive_model import DriveModel

DRIVES = ('shoulder', 'elbow')
MOTOR = ('<robot name="motor"><link name="base"/><joint name="motor" type="revolute"><parent '
         'link="base"/><child link="rotor"/><axis xyz="0 0 1"/><limit lower="-6.3" upper="6.3" '
         'effort="2" velocity="9"/></joint><link name="rotor"><inertial><mass value="0.3"/>'
         '<inertia ixx="0.001" iyy="0.001" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>'
         '</robot>')


@pytest.fixture
def arm(tmp_path: Path) -> DriveModel:
    (tmp_path / 'arm.urdf').write_text(ARM)
    return first_model(tmp_path / 'arm.urdf', output=tmp_path / 'arm.yaml').model


def run(seed: int = 0) -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and efforts of an arm in motion."""
    random = np.random.default_rng(seed)
    time, q, v, a = motion(random, 2, 1.0)
    return time, q, v, arm_efforts(q, v, a) + random.normal(0, 0.03, q.shape)


def told(model: DriveModel, time: np.ndarray, q: np.ndarray, effort: np.ndarray) -> str:
    """Return all mistakes of a recording as one text."""
    found = find_mistakes(model, Recording.from_arrays('run', time, q, None, effort, model.drives))
    return '; '.join(finding.what for finding in found)


@pytest.mark.parametrize(('static_friction', 'samples', 'pause', 'noise', 'head'), [
    (0.0, 30, 3.0, 2e-5, 't,q1,q2,tau1,tau2'), (0.6, 30, 3.0, 2e-5, ''), (0.0, 1, 5.0, 0.0, ''),
    (0.0, 30, 0.6, 0.0, 't,q1,q2,tau1,tau2'), (0.0, 1, 0.0, 2e-5, 'q1,q2,tau1,tau2')])
def test_held_poses_show_the_offset_of_a_sensor(
    static_friction: float, samples: int, pause: float, noise: float, head: str, tmp_path: Path,
) -> None:
    """One row for each pose or many, with and without times between them, names and noise."""
    random = np.random.default_rng(3)
    poses = np.repeat(random.uniform(-1.5, 1.5, (40, 2)), samples, axis=0)
    time = np.repeat(pause * np.arange(40), samples) + np.tile(np.arange(samples) / 50, 40)
    effort = arm_efforts(poses, 0 * poses, 0 * poses) + random.normal(0.0, 0.05, poses.shape)
    effort[:, 1] += 1.3
    # A drive stands anywhere between its limits of static friction.
    effort += np.repeat(static_friction * random.uniform(-1, 1, (40, 2)), samples, axis=0)
    np.savetxt(tmp_path / 'run.csv', np.column_stack([time, poses + random.normal(
        0, noise, poses.shape), effort])[:, not pause:], delimiter=',', comments='', header=head)
    (tmp_path / 'arm.urdf').write_text(ARM)
    first = first_model(tmp_path / 'arm.urdf', [tmp_path / 'run.csv'], tmp_path / 'arm.yaml')
    assert not first.questions
    answer = diagnose(first.model, read_recording(tmp_path / 'run.csv', first.model.recorded))
    effect, = answer.effects
    assert effect.name == 'effort_offset'
    assert effect.parameters['elbow.force'].value == pytest.approx(
        1.3, abs=0.02 + 0.35 * static_friction)


def test_friction_of_a_joint_at_some_milliradians_per_second_is_found(
    arm: DriveModel, tmp_path: Path,
) -> None:
    time = np.arange(6000) / 50
    w = 2 * np.pi * np.array([0.011, 0.017])
    q = np.column_stack([0.05 * np.sin(w[0] * time), 0.06 * np.sin(w[1] * time + 1)])
    v = np.column_stack([0.05 * w[0] * np.cos(w[0] * time), 0.06 * w[1] * np.cos(w[1] * time + 1)])
    effort = arm_efforts(q, 0 * q, 0 * q) + [4.0, 2.0] * np.tanh(v / 2e-4) + [150.0, 60.0] * v
    slow = Recording.from_arrays('slow', time, q, None, effort + np.random.default_rng(1).normal(
        0, 0.03, q.shape), DRIVES)
    base = fit(arm, slow).model
    assert base.values['friction.coulomb'] == pytest.approx((4.0, 2.0), rel=0.05)
    assert base.values['friction.viscous'] == pytest.approx((150.0, 60.0), rel=0.1)


@pytest.mark.parametrize('constant', [True, False])
def test_limits_of_a_motor_that_turns_freely_say_nothing(constant: bool, tmp_path: Path) -> None:
    (tmp_path / 'motor.urdf').write_text(MOTOR)
    model = first_model(tmp_path / 'motor.urdf', output=tmp_path / 'motor.yaml').model
    time = np.arange(2000) / 200
    v = 7.0 * np.tanh(time) if constant else 40 * np.sin(3 * time)
    q, a = np.cumsum(v)[:, None] / 200, np.gradient(v, time)
    effort = 0.003 * a + 0.02 * np.tanh(v / 0.1) + 1e-3 * v
    effort += np.random.default_rng(0).normal(0, 1e-3, len(v))
    assert told(model, time, q, effort[:, None]) == ''


def first_of(folder: Path, urdf: str, *columns: np.ndarray) -> FirstModel:
    """Return the first model of a robot with one joint and a run of times, positions, efforts."""
    (folder / 'robot.urdf').write_text(urdf)
    np.savetxt(folder / 'run.csv', np.column_stack(columns), delimiter=',', comments='',
               header='time,pos,force')
    return first_model(folder / 'robot.urdf', [folder / 'run.csv'], folder / 'robot.yaml')


def test_velocities_of_a_motor_in_another_unit_show_no_rate(tmp_path: Path) -> None:
    (tmp_path / 'motor.urdf').write_text(MOTOR)
    _, q, v, a = motion(np.random.default_rng(5), 1, 1.2)
    np.savetxt(tmp_path / 'run.csv', np.column_stack([
        np.degrees(q), v * 30 / np.pi, 0.003 * a + 0.01 * v]), delimiter=',', comments='',
        header='angle,speed,torque')
    with pytest.raises(PprsError, match=r'16\.7 samples per second: give --rate'):
        first_model(tmp_path / 'motor.urdf', [tmp_path / 'run.csv'], tmp_path / 'motor.yaml')


@pytest.mark.parametrize('true', [1.0, 10.0])
def test_the_inertia_of_a_motor_without_weight_is_no_unit_of_its_torque(
    true: float, tmp_path: Path,
) -> None:
    """A tenth of the inertia in the URDF has the same data as efforts in kgf cm."""
    time, q, v, a = motion(np.random.default_rng(5), 1, 1.2)
    effort = true * (0.003 * a + 0.01 * v + 0.02 * np.tanh(v / 0.05))
    effort += np.random.default_rng(1).normal(0, 1e-3, q.shape)
    first = first_of(tmp_path, MOTOR.replace('6.3', '2.5'), time, q, effort)
    assert not first.columns.get('motor', {}).get('effort_scale')
    assert ('all is as the model file says' in ''.join(first.questions)) == (true != 1)


@pytest.mark.parametrize(('factor', 'words'), [
    (-10.197, 'in kgf cm'), (11.0, 'in kgf cm'), (8.0, 'it looks like currents in amperes'),
    (150.0, 'gain: [0.00667, '), (101.0, 'in N cm'), (1e-3, 'in kN m')])
def test_a_common_factor_is_a_unit_only_near_its_constant(
    arm: DriveModel, factor: float, words: str,
) -> None:
    time, q, _, effort = run(1)
    found = told(arm, time, q, effort * factor)
    assert words in found
    assert factor != 8.0 or 'kgf' not in found


@pytest.mark.parametrize('seed', range(2))
def test_motions_as_efforts_are_in_no_unit(arm: DriveModel, seed: int) -> None:
    time, q, v, _ = run(seed)
    lag = told(arm, time, q, 0.05 * v + np.random.default_rng(seed).normal(0, 1e-3, q.shape))
    assert 'an error of position' in lag
    for quantity, values in ('position', q), ('velocity', v):
        assert f'is the recorded {quantity}, and must be a force' in told(arm, time, q, values)
    assert 'kN' not in lag


def test_errors_of_position_of_the_platform_are_no_kilonewtons() -> None:
    moved = Excitation(10.0, 2).motion(np.arange(0, 10.0, 0.005))
    model = DriveModel.load()
    forces = model.drive_forces(moved)
    random = np.random.default_rng(1)
    position, effort = (values + 1e-5 * np.abs(values).max(axis=0) * random.normal(
        size=values.shape) for values in (forces.drive_motion[0], forces.total / 2000))
    assert 'an error of position' in told(model, moved.time, position, effort)


@pytest.mark.parametrize('constant', [0.04, 15.0])
def test_efforts_far_from_the_inertia_of_a_lying_slide_are_a_question(
    constant: float, tmp_path: Path,
) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 1, 0.15)
    force = 8 * a + 15 * v + 6 * np.tanh(v / 0.005) + np.random.default_rng(4).normal(
        0, 0.03, q.shape)
    lying = SLIDE.replace('axis xyz="0 0 1"', 'axis xyz="1 0 0"')
    first = first_of(tmp_path, lying, time, q, force / constant)
    assert 'effort_scale' in ''.join(first.questions)


def test_angles_in_degrees_beside_lengths_in_millimetres_are_read(tmp_path: Path) -> None:
    model = DriveModel.load(made_up_arm.write_arm(tmp_path))
    time, q, v, a = motion(np.random.default_rng(2), 3, 1.0)
    size, unit = np.array([0.8, 0.6, 0.25]), np.array([np.pi / 180, np.pi / 180, 1e-3])
    force = made_up_arm.real_arm(tmp_path).drive_forces(
        JointMotion(q * size, v * size, a * size, time)).total
    effort = force + np.random.default_rng(3).normal(0, 0.1, q.shape)
    found = find_mistakes(model, Recording.from_arrays(
        'run', time, q * size / unit, None, effort, model.drives))
    scales = {drive: value for finding in found if isinstance(finding, OtherReading)
              for drive, _, value in finding.scales}
    assert scales == pytest.approx(dict(zip(model.drives, unit, strict=True)))


def test_recorded_velocities_decide_between_units_of_positions(
    arm: DriveModel, tmp_path: Path,
) -> None:
    """Amperes make ticks of another size as likely by the efforts alone."""
    time, q, v, effort = run(5)
    unit = 2 * np.pi / 1024
    found = find_mistakes(arm, Recording.from_arrays(
        'run', time, np.round(q / unit), v, effort / [11.1, 25.7], DRIVES))
    assert f'{unit:.7g}' in '; '.join(
        f.line + str(f.scales) for f in found if isinstance(f, OtherReading))


@pytest.mark.parametrize('bit', [9, 10])
def test_magnitudes_with_a_bit_for_their_sign_are_told_of_all_drives(
    bit: int, arm: DriveModel,
) -> None:
    time, q, _, effort = run(4)
    effort += np.random.default_rng(6).normal(0, [0.0, 0.4], q.shape)
    load = np.round(np.abs(effort) * 450 / np.abs(effort).max(axis=0)) + 2 ** bit * (effort < 0)
    assert told(arm, time, q, load).startswith(
        f'the effort of all drives looks like a magnitude whose sign is bit {bit}')


def test_degrees_from_another_zero_are_beyond_the_limits(tmp_path: Path) -> None:
    (tmp_path / 'arm.urdf').write_text(ARM.replace('er="3', 'er="1.5').replace('"-3"', '"-1.5"'))
    model = first_model(tmp_path / 'arm.urdf', output=tmp_path / 'arm.yaml').model
    time, q, _, effort = run(7)
    found = told(model, time, np.degrees(q + np.array([0, np.pi / 2])), effort)
    assert '-90 degrees (elbow) are to be added' in found.partition('look like degrees')[2]
    found = told(model, time, q + np.array([-np.pi / 2, np.pi / 2]), effort)
    assert {'90 degrees (shoulder)', '-90 degrees (elbow)'} <= {*re.findall(
        r'-?90 degrees \(\w+\)', found)}


@pytest.mark.parametrize('zeros', [(1, 2), (1, -1), (-1, 2)])
def test_two_zeros_that_are_off_are_found_together(zeros: tuple[int, int], arm: DriveModel) -> None:
    time, q, _, effort = run(6)
    found = told(arm, time, q - np.pi / 2 * np.array(zeros), effort)
    assert [int(angle) for angle in re.findall(r'(-?\d+) degrees \(', found)] == [
        90 * zero for zero in zeros]


@pytest.mark.parametrize('seed', [3, 4])
def test_two_units_and_a_zero_that_are_wrong_are_found_together(seed: int, arm: DriveModel) -> None:
    time, q, _, effort = run(seed)
    found = told(arm, 1e6 * time, np.degrees(q - (np.pi / 2, 0.0)), effort)
    assert all(what in found for what in (
        'like degrees', 'like microseconds', '90 degrees (shoulder)'))


def test_what_a_driver_calls_an_external_torque_is_one(tmp_path: Path) -> None:
    time, q, v, effort = run()
    (tmp_path / 'arm.urdf').write_text(ARM)
    for columns, kind in (({'tau_ext': 0.01 * effort}, 'external'),
                          ({'tau_ext': 0.01 * effort, 'tau_J': effort}, 'measured')):
        named = {'q': q, 'dq': v, **columns}
        np.savetxt(tmp_path / 'run.csv', np.column_stack([time, *named.values()]), delimiter=',',
                   comments='', header='t,' + ','.join(
                       f'{name}{k}' for name in named for k in (1, 2)))
        first = first_model(tmp_path / 'arm.urdf', [tmp_path / 'run.csv'], tmp_path / 'a.yaml')
        assert first.model.effort_kind == kind
        assert first.has_efforts == (kind == 'measured')


@pytest.mark.parametrize('form', ['entries', 'lists', 'lines'])
def test_a_log_in_json_is_a_table(form: str, tmp_path: Path) -> None:
    time, q, v, effort = (values.tolist() for values in run())
    (tmp_path / 'arm.urdf').write_text(ARM)
    rows = [{'timestamp': t, 'state': {'q1': a, 'q2': b}, 'load1': c, 'load2': d}
            for t, (a, b), (c, d) in zip(time, q, effort, strict=True)]
    content = {'entries': {'kp': 3, 'entries': rows, 'log': [{'x': 1}]},
               'lists': {'t': time, 'q': q, 'dq': v, 'tau': effort, 'gains': [1.0, 2.0]}}
    path = tmp_path / 'log.json'
    path.write_text('\n'.join(map(json.dumps, rows)) if form == 'lines'
                    else json.dumps(content[form]))
    first = first_model(tmp_path / 'arm.urdf', [path], tmp_path / 'a.yaml')
    read = read_recording(path, first.model.recorded)
    np.testing.assert_allclose(read.position, q)
    np.testing.assert_allclose(read.effort, effort)
    path.write_text('{"text": "no table"}')
    with pytest.raises(UnreadableFileError, match='contains no table'):
        read_recording(path, first.model.recorded)


@pytest.mark.parametrize('factor', [1.0, 180 / np.pi])
def test_errors_of_a_model_are_no_other_reading(factor: float, tmp_path: Path) -> None:
    """A load, wrong masses, friction and a gain: asked about is the unit of positions alone."""
    model = DriveModel.load(made_up_arm.write_arm(tmp_path))
    own = model.robot.moved_mass
    for seed in range(6):
        random = np.random.default_rng(seed)
        masses = np.array(model.robot.inertial) * np.exp(random.normal(0, 0.3, (3, 1)))
        real = made_up_arm.real_arm(tmp_path, **{
            'links.mass': tuple(masses[:, 0]), 'links.moment': tuple(masses[:, 1:4].ravel()),
            'effects.active': ['payload_mass'],
            'effects.payload_mass.mass': own * float(10 ** random.uniform(-1, 0.3))})
        time, q, v, a = motion(random, 3, 1.0)
        size = [0.8, 0.6, 0.25]
        force = real.drive_forces(JointMotion(q * size, v * size, a * size, time)).total
        effort = random.uniform(0.7, 1.5) * force + random.normal(0, 0.1, q.shape)
        found = find_mistakes(model, Recording.from_arrays(
            'run', time, q * size * [factor, factor, 1.0], None, effort, model.drives))
        others = [finding for finding in found if isinstance(finding, OtherReading)]
        assert {scale[1:] for finding in others for scale in finding.scales} <= (
            set() if factor == 1 else {('position_scale', 1 / factor)}), others
        assert bool(others) == (factor != 1)


def test_gravity_is_upside_down_and_bodies_that_balance_each_other_are_not(
    arm: DriveModel, tmp_path: Path,
) -> None:
    random = np.random.default_rng(2)
    time, q, v, a = motion(random, 2, 1.0)
    still, noise = np.zeros_like(q), random.normal(0, 0.03, q.shape)
    hanging = arm_efforts(q, v, a) - 2 * arm_efforts(q, still, still)
    assert 'gravity in the base is (0, 0, 9.81)' in told(arm, time, q, hanging + noise)
    # A counterweight of half as much again takes more than all weight from the shoulder.
    balanced = ARM.replace('xyz="0 0 0.2"', 'xyz="0 0 -0.2"')
    head, elbow, tail = balanced.partition('<joint name="elbow"')
    (tmp_path / 'arm.urdf').write_text(head + elbow + tail.replace('xyz="0 1 0"', 'xyz="0 0 1"'))
    model = first_model(tmp_path / 'arm.urdf', output=tmp_path / 'balanced.yaml').model
    own = np.array(model.robot.inertial) * [[1.5], [1 / 1.5]]
    real = DriveModel.from_parameters({**model.values, 'links.mass': tuple(own[:, 0]), (
        'links.moment'): tuple(own[:, 1:4].ravel())}, model.source)
    force = real.drive_forces(JointMotion(q, v, a, time)).total
    assert told(model, time, q, force + 0.9 * np.tanh(v / 0.005) + 0.4 * v + noise) == ''


def test_a_joint_that_moves_no_inertia_is_not_driven(tmp_path: Path) -> None:
    tip = ('<joint name="roll" type="revolute"><parent link="fore"/><child link="tip"/><axis '
           'xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="6"/></joint><link '
           'name="tip"><inertial><mass value="0.2"/><origin xyz="0 0 0.04"/><inertia ixx="0" '
           'iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>')
    (tmp_path / 'arm.urdf').write_text(ARM.replace('</robot>', tip))
    first = first_model(tmp_path / 'arm.urdf', output=tmp_path / 'arm.yaml')
    assert first.model.drives == DRIVES
    assert any(note.startswith('roll: no link') for note in first.notes)
