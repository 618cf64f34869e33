# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a diagnosis prints to go on with can be done: effects that are there, on several robots."""

from __future__ import annotations

import shlex
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from made_up_arm import motion, real_arm
from planar_arm import planar_arm

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import _parser
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles, next_step
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.paths import Excitation

pytestmark = pytest.mark.slow

NOISE = 0.1  # [N m, N]
FILES = GivenFiles(('run.csv',), model='robot.yaml')
DRIVE = {'pendulum': 'j1', 'planar arm': 'j2', 'spatial arm': 'swing', '3-PPRS': 'lift_2'}
HIDDEN = {
    'viscous_friction': {'{drive}.coefficient': 6.0}, 'coulomb_friction': {'{drive}.force': 2.0},
    'time_delay': {'{drive}.delay': 0.03}, 'effort_gain': {'{drive}.gain': 0.2},
    'payload_mass': {'mass': 0.6}, 'base_tilt': {'x': 0.04, 'y': 0.05}}

# What is named where so few joints may leave it ambiguous: a gain is heavier links, and a tilt is
# a torque over cos q, in these swings nearly an offset.
ALIKE = {('pendulum', 'effort_gain'): 'effort_gain', ('pendulum', 'base_tilt'): 'effort_offset',
         ('planar arm', 'effort_gain'): 'effort_gain', ('planar arm', 'base_tilt'): 'base_tilt'}


def robot(kind: str, folder: Path) -> DriveModel:
    if kind == '3-PPRS':
        return DriveModel.load()
    return real_arm(folder) if kind == 'spatial arm' else planar_arm(
        folder, 1 if kind == 'pendulum' else 2)


def record(model: DriveModel, kind: str) -> Recording:
    """Return ten seconds, with what the model has hidden."""
    if kind == '3-PPRS':
        time = np.arange(2000) * 0.005
        forces = model.measured(model.drive_forces(Excitation(10.0, 1).motion(time)))
        position = forces.mechanism.position
    else:
        moved = motion(10.0)
        count = len(model.drives)
        moved = JointMotion(*(one[:, -count - 1:-1] if count < 3 else one for one in (
            moved.position, moved.velocity, moved.acceleration)), moved.time)
        time, position = moved.time, moved.position
        forces = model.measured(model.drive_forces(moved))
    rng = np.random.default_rng(5)
    return Recording.from_arrays(kind, time, position, drives=model.drives, effort=(
        forces.total + NOISE * rng.standard_normal(position.shape)))


@pytest.mark.parametrize(('kind', 'name'), product(DRIVE, HIDDEN))
def test_what_is_there_is_adopted_by_the_command_that_is_printed(
    kind: str, name: str, tmp_path: Path,
) -> None:
    model = robot(kind, tmp_path)
    values = {f'effects.{name}.{key.format(drive=DRIVE[kind])}': value
              for key, value in HIDDEN[name].items()}
    if name == 'payload_mass' and kind in ('pendulum', 'planar arm'):
        values['effects.payload_mass.z'] = -0.5
    recording = record(DriveModel.from_parameters(
        {**model.values, 'effects.active': [name], **values},
                                   model.source), kind)
    found = diagnose(model, [recording])
    costs = [one.cost for one in found.sets]
    evidence = [one.evidence for one in found.candidates]
    assert costs == sorted(costs)
    assert evidence == sorted(evidence, reverse=True)

    _, command = next_step(found, FILES)
    words = shlex.split(command)[1:]
    asked = _parser(words).parse_args(words)
    if found.verdict == 'ambiguous':
        assert words[0] == 'next-experiment'
        assert ALIKE[kind, name] in {other for names in found.indistinguishable for other in names}
        return
    assert [one.name for one in found.effects] == [name]
    assert words[:2] == ['adopt', name]
    answer = adopt(model, requested(asked.effect, model), [recording], diagnosis=found)
    assert answer.adopted, answer.reason
    assert answer.held_out_after < answer.held_out_before
    assert answer.held_out_after < 1.1 * answer.noise_floor
