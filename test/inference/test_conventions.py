# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Units, signs and order of drives: mistakes are recognised, and nothing else is called one."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
from pprs_command import pprs
from shared_cases import shared_case

from benchmarks.hidden import recordings
from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.readings.findings import OtherReading, columns_line
from pprs_dynamics.measurement.files.recording import Recording, read_recording, write_recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath
from pprs_dynamics.simulation.injection import NOT_IN_CATALOGUE, Choice

MODEL = DriveModel.load()
RATE, DURATION = 125.0, 8.0
NOISE = 0.05  # [N]
# Effects most like another unit or sign; the others are slow tests.
OFTEN = 'effort_gain', 'time_delay'
Arrays = tuple[Array, Array, Array, Array]


def robot(model: DriveModel = MODEL, seed: int = 0, path: str = 'excitation') -> Arrays:
    """Time, position, velocity and effort of a robot that may differ from the model."""
    rng = np.random.default_rng(seed)
    curve = Excitation(DURATION, seed) if path == 'excitation' else HelicalPath()
    motion = curve.motion(np.arange(0.0, curve.duration, 1 / RATE))
    forces = model.drive_forces(motion)
    state = forces.mechanism
    return (motion.time, np.round(state.position, 6),
            state.velocity + rng.normal(0, 1e-4, state.velocity.shape),
            forces.total + rng.normal(0, NOISE, forces.total.shape))


def recording(arrays: Arrays, drives: tuple[str, ...] = DRIVES) -> Recording:
    return Recording.from_arrays('run', *arrays, drives)


def told(arrays: Arrays) -> list[str]:
    return [finding.what for finding in find_mistakes(MODEL, recording(arrays))]


def scaled(time: float = 1.0, motion: float | list[float] = 1.0, effort: float | list[float] = 1.0,
           velocity: float | list[float] = 1.0) -> Callable[[Arrays], Arrays]:
    return lambda a: (a[0] * time, a[1] * motion, a[2] * motion * velocity, a[3] * effort)


def ordered(*columns: int) -> Callable[[Arrays], Arrays]:
    order = list(columns)
    return lambda a: (a[0], a[1][:, order], a[2][:, order], a[3][:, order])


MINUS, TIMES = 'looks like minus what the model says', 'times what the model says'
MISTAKES: dict[str, tuple[Callable[[Arrays], Arrays], list[str]]] = {
    'kN': (scaled(effort=1e-3), [f'effort of all drives looks like 0.001 {TIMES}, as if .* kN']),
    'sign of a slide': (scaled(effort=[1, -1, 1, 1, 1, 1]), [f'effort of slide_2 {MINUS}']),
    'ms': (scaled(time=1e3), ['times look like milliseconds: .* 1000 times too slow']),
    'lifts in mm': (scaled(motion=[1, 1, 1, 1e3, 1e3, 1e3]),
                    ['positions of lift_1, lift_2, lift_3 .*milli']),
    'a slide counts the other way': (
        scaled(motion=[-1, 1, 1, 1, 1, 1], effort=[-1, 1, 1, 1, 1, 1]),
        ['position of slide_1 looks negated', f'effort of slide_1 {MINUS}']),
    'mm/s': (scaled(velocity=1e3), ['velocity of all drives is 1000 times the derivative of the']),
    'lifts in mm/s': (scaled(velocity=[1, 1, 1, 1e3, 1e3, 1e3]),
                      ['velocity of lift_1, lift_2, lift_3 is 1000 times']),
    'lifts for slides': (ordered(3, 4, 5, 0, 1, 2), ['another order: .*slide_1 like lift_1']),
    'mm and kN': (scaled(motion=1e3, effort=1e-3), ['look like millimetres', 'as if .* kN'])}


def expect(found: list[str], patterns: list[str]) -> None:
    assert len(found) == len(patterns), found
    for text, pattern in zip(found, patterns, strict=True):
        assert re.search(pattern, text), (text, pattern)


@pytest.mark.parametrize('mistake', MISTAKES)
def test_a_mistake_is_said_in_one_sentence_each(mistake: str) -> None:
    change, patterns = MISTAKES[mistake]
    expect(told(change(robot())), patterns)


@pytest.mark.parametrize('mistake', ['kN', 'lifts for slides'])
def test_a_mistake_is_recognised_where_the_model_lacks_an_effect(mistake: str) -> None:
    lacking = DriveModel.from_parameters({**MODEL.values, 'masses.payload': 1.3, 'effects.active': [
        'viscous_friction'], 'effects.viscous_friction.slide_2.coefficient': 5.0})
    change, patterns = MISTAKES[mistake]
    expect(told(change(robot(lacking, 3))), patterns)


@pytest.mark.parametrize('path', [
    'excitation', pytest.param('helix', marks=pytest.mark.slow)])
def test_nothing_is_said_of_what_is_right(path: str) -> None:
    time, position, velocity, effort = robot(path=path)
    assert told((time + 1.7e9, position, velocity, effort)) == []
    assert find_mistakes(MODEL, Recording.from_arrays('bare', time, position)) == ()


@pytest.mark.parametrize('name', [
    name if name in OFTEN else pytest.param(name, marks=pytest.mark.slow)
    for name in (*recordings.IN_CATALOGUE, *NOT_IN_CATALOGUE)])
def test_no_hidden_effect_is_called_a_mistake(name: str) -> None:
    place = recordings.scene(11, 0.0, 6.0)
    run = place.inject([Choice(name, np.random.default_rng(4))])
    part, time = slice(recordings.LEAD, None), place.time
    effort = run.efforts[part] + np.random.default_rng(5).normal(0, 0.08, (len(time), 6))
    found = find_mistakes(place.model, Recording.from_arrays(
        name, time - time[0], np.round(run.position[part], 6), None, effort))
    assert found == ()


def test_a_gain_or_a_zero_that_the_catalogue_knows_is_no_unit() -> None:
    time, position, velocity, effort = robot()
    assert told((time, position, velocity, effort * 0.5)) == []
    assert told((time, position, velocity, effort * [1, 1, 0.5, 1, 0.5, 1])) == []
    assert told((time, position - np.eye(6)[0] * 0.03, velocity, effort)) == []


def test_a_recording_of_another_robot_is_told_nothing_false() -> None:
    other = DriveModel.from_parameters(
        {**MODEL.values, 'geometry.rod_length': 0.36, 'masses.payload': 3.0,
                         'friction.drives.coulomb': (0.2,) * 6})
    assert told(robot(other)) == []


def test_a_robot_at_rest_tells_the_sign_of_its_lifts_and_nothing_false() -> None:
    time, position, velocity, effort = robot()
    rest = (time, np.repeat(position[:1], len(time), axis=0), 0 * velocity,
            np.repeat(effort[:1], len(time), axis=0) + np.random.default_rng(2).normal(
                0, NOISE, effort.shape))
    assert told(rest) == []
    assert all(MINUS in text for text in told((*rest[:3], -rest[3])))


def test_drives_without_efforts_do_not_keep_others_from_being_told() -> None:
    time, position, velocity, effort = robot()
    effort[:, [0, 4]] = np.nan
    assert told((time, position, velocity, effort)) == []
    assert told((time, position, velocity, -effort)) == [
        'the effort of slide_2, slide_3, lift_1, lift_3 looks like minus what the model says']


def test_positions_far_out_of_their_stroke_tell_it_without_efforts() -> None:
    time, position, _, _ = robot()
    (finding,) = find_mistakes(MODEL, Recording.from_arrays('mm', time, 1e3 * position))
    assert 'look like millimetres' in finding.text


def test_commands_say_it_before_they_compare(tmp_path: Path) -> None:
    write_recording(tmp_path / 'minus.csv', recording(scaled(effort=-1.0)(robot())))
    write_recording(tmp_path / 'mm.csv', recording(scaled(motion=1e3)(robot())))
    for command in (('info',), ('compare', '--as-it-is')):
        done = pprs(*command, 'minus.csv', cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        said = ' '.join(done.stdout.split())
        assert 'the effort of all drives looks like minus what the model says' in said
        assert 'nothing wrong found' not in said
    done = pprs('info', 'mm.csv', cwd=tmp_path)
    assert 'look like millimetres' in ' '.join(done.stdout.split())
    # No mechanism follows such positions: the sentence is about their unit, not about a pose.
    for command in (('compare', 'mm.csv'), ('diagnose', 'mm.csv', '--validate', 'minus.csv'),
                    ('adopt', 'viscous_friction', 'mm.csv', '--output', 'x.yaml'),
                    ('next-experiment', 'mm.csv', '--output', 'x.csv')):
        done = pprs(*command, cwd=tmp_path)
        assert done.returncode == 1
        scales = ', '.join(f'{drive}: {{position_scale: 0.001}}' for drive in DRIVES)
        stopped = (f'pprs {command[0]}: mm.csv: the positions of all drives look like '
                   f'millimetres: if so, write into the model file  columns: {{{scales}}}; '
                   'if not, go on with --as-it-is\n')
        assert done.stderr == stopped


def arm_recording(model: DriveModel, motion: float | list[float] = 1.0,
                  effort: float | list[float] = 1.0,
                  changes: Callable[[Arrays], Arrays] | None = None,
                  ) -> Recording:
    run = arm.record(arm.real_arm(Path(model.source).parent), arm.motion(12.0))
    assert run.velocity is not None
    arrays = (run.time, run.position, run.velocity, run.effort)
    arrays = arrays if changes is None else changes(arrays)
    return recording(scaled(motion=motion, effort=effort)(arrays), model.drives)


def read_as_told(model: DriveModel, folder: Path, run: Recording) -> tuple[str, tuple[Defect, ...]]:
    """Return the line that is told, and what is told of the recording once it is written."""
    readings = [m for m in find_mistakes(model, run) if isinstance(m, OtherReading)]
    line = columns_line([scale for reading in readings for scale in reading.scales])
    write_recording(folder / 'run.csv', run)
    path = folder / 'corrected.yaml'
    path.write_text((folder / 'arm.yaml').read_text() + f'    {line}\n')
    corrected = DriveModel.load(path)
    return line, find_mistakes(corrected, read_recording(folder / 'run.csv', corrected.recorded))


ARM_MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    'degrees': ({'motion': [180 / np.pi, 180 / np.pi, 1.0]}, 'turn: {position_scale: 0.01745329}'),
    'degrees of one': ({'motion': [1.0, 180 / np.pi, 1.0]}, 'swing: {position_scale: 0.01745329}'),
    'millimetres': ({'motion': [1.0, 1.0, 1e3]}, 'reach: {position_scale: 0.001}'),
    'sign': ({'effort': -1.0}, 'swing: {effort_scale: -1}'),
    'a sign': ({'effort': [1.0, -1.0, 1.0]}, 'swing: {effort_scale: -1}')}


@pytest.mark.parametrize('mistake', ARM_MISTAKES)
def test_the_line_that_is_told_mends_a_recording_of_an_arm(mistake: str, tmp_path: Path) -> None:
    """The model has no friction, of which most of these efforts are."""
    model = DriveModel.load(arm.write_arm(tmp_path))
    change, entry = ARM_MISTAKES[mistake]
    line, left = read_as_told(model, tmp_path, arm_recording(model, **change))
    assert entry in line
    assert left == ()


def test_efforts_in_percent_are_told(tmp_path: Path) -> None:
    largest = np.array([400.0, 80.0, 30.0])
    text = arm.urdf()
    for limit in largest:
        text = text.replace('effort="200"', f'effort="{limit:g}"', 1)
    model = DriveModel.load(arm.write_arm(tmp_path, text))
    (finding,) = find_mistakes(model, arm_recording(model, effort=(100 / largest).tolist()), True)
    assert 'percent of a torque' in finding.what
    assert [value for _, _, value in finding.scales] == pytest.approx(largest / 100, rel=0.2)


OTHERS = {  # folder, model, recording, a clause of what is told, and signs of the efforts
    'sign': ('kuka_sign', 'iiwa_unflipped.yaml', 'dyn.csv.gz', 'effort of all drives .* minus'),
    'sign read': ('kuka_sign', 'iiwa.yaml', 'dyn.csv.gz', ''),
    'weak': ('kuka_sign', 'iiwa.yaml', 'dyn.csv.gz', 'effort of j6 .* minus', 1, 1, 1, 1, 1, -1, 1),
    'degrees': ('kr300_degrees', 'kr_deg.yaml', 'A.csv.gz', 'positions of all drives .* degrees'),
    'degrees read': ('kr300_degrees', 'kr.yaml', 'A.csv.gz', ''),
    'radians': ('false_units', 'nofric.yaml', 'r0.csv.gz', ''),
    'metres': ('false_units', 'v9b.yaml', 'v9b.csv.gz', ''),
    'degrees of an arm': ('wrong_tool_named_next', 'arm2.yaml', 'v19.csv.gz', 'like degrees')}


@pytest.mark.parametrize('case', OTHERS)
def test_recordings_of_other_people(case: str) -> None:
    folder, model_file, run, clause, *signs = OTHERS[case]
    model, whole = shared_case(folder, model_file, run)
    part = slice(len(whole.time) // 3, None)
    piece = Recording.from_arrays('piece', whole.time[part], whole.position[part], None,
                                  whole.effort[part] * (signs or [1]), model.drives)
    expect([mistake.what for mistake in find_mistakes(model, piece)], [clause] * bool(clause))
