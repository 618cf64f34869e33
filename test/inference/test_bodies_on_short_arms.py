# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A load on arms that show only some of its numbers: one joint, or two in a plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from planar_arm import planar_arm

from pprs_dynamics import JointMotion
from pprs_dynamics.app.report.adoption_report import parameter_rows
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

NOISE = 0.05  # [N m]


def record(model: DriveModel, seed: int = 0, pace: float = 1.0) -> Recording:
    time = np.arange(1500) * 0.01 / pace ** 0.5
    rates = np.array([[0.31, 0.83], [0.47, 1.13]])[:, :len(model.drives)] * pace
    phase = 2 * np.pi * rates[:, None] * time[:, None] + np.arange(len(model.drives))
    size = np.array([0.9, 0.4])[:, None, None]
    turn = 2 * np.pi * rates[:, None]
    q, v, a = ((size * wave).sum(axis=0) for wave in (
        np.sin(phase), turn * np.cos(phase), -turn ** 2 * np.sin(phase)))
    total = model.drive_forces(JointMotion(q, v, a, time)).total
    rng = np.random.default_rng(seed)
    return Recording.from_arrays('made', time, q, velocity=v, drives=model.drives,
                                 effort=total + NOISE * rng.normal(size=total.shape))


@pytest.mark.parametrize('joints', [1, 2])
def test_a_load_is_found_and_adopted_where_a_motion_shows_it(joints: int, tmp_path: Path) -> None:
    """Half a kilogram half a metre from the axis: the arm with one joint has no other length."""
    model = planar_arm(tmp_path, joints)
    true = DriveModel.from_parameters({**model.values, 'effects.active': ['payload_mass'],
                        'effects.payload_mass.mass': 0.5, 'effects.payload_mass.z': -0.5},
                       model.source)
    recording = record(true)
    found = diagnose(model, [recording])
    assert [one.name for one in found.effects] == ['payload_mass']
    said = found.effects[0].parameters
    assert abs(said['mass'].value * said['z'].value + 0.25) < 0.01
    adoption = adopt(model, requested('payload_mass', model), [recording], diagnosis=found)
    assert adoption.adopted, adoption.reason
    assert adoption.held_out_after < 1.1 * NOISE


def test_a_slow_motion_tells_the_moment_of_a_load_and_not_its_mass(tmp_path: Path) -> None:
    """What holds 0.25 kg m may be any mass: only m c acts without acceleration."""
    model = planar_arm(tmp_path, 1)
    recording = record(DriveModel.from_parameters({
        **model.values, 'effects.active': ['payload_mass'], 'effects.payload_mass.mass': 0.5,
        'effects.payload_mass.z': -0.5}, model.source), pace=0.1)
    # At rest a weight on a joint and a spring on a lever hold alike.
    found = diagnose(model, [recording])
    assert {'payload_mass', 'counterbalance'} in map(set, found.indistinguishable)
    adoption = adopt(model, requested('payload_mass', model), [recording], diagnosis=found)
    assert adoption.adopted, adoption.reason
    mass, moment = adoption.parameters['mass'], adoption.moments['moment_z']
    assert mass.std > 0.1 * mass.value
    assert moment.std < 0.002
    assert abs(moment.value + 0.25) < 4 * moment.std
    assert adoption.to_dict()['moments']['moment_z']['unit'] == 'kg m'
    rows = dict(parameter_rows(adoption))
    assert rows['moment_z'].startswith('-0.2')
    assert rows['moment_z'].endswith('kg m')
    # Where the mass is as sure, mass and centre say it.
    quick = adopt(model, requested('payload_mass', model), [record(adoption.after)])
    assert 'moment_z' not in dict(parameter_rows(quick))


def test_the_interval_of_a_mass_has_every_centre_that_the_path_allows(tmp_path: Path) -> None:
    """0.48 kg at 0.15 m looks like 0.144 kg at the tool, 0.5 m from the axis."""
    planar_arm(tmp_path, 1)
    urdf, file = tmp_path / 'arm.urdf', tmp_path / 'arm.yaml'
    urdf.write_text(urdf.read_text().replace('</robot>', (
        '<link name="flange"/><joint name="fixed" type="fixed"><parent link="rod_1"/>'
        '<child link="flange"/><origin xyz="0 0 -0.5"/></joint></robot>')))
    file.write_text(file.read_text().replace('tool: rod_1', 'tool: flange'))
    model = DriveModel.load(file)
    recording = record(DriveModel.from_parameters({
        **model.values, 'effects.active': ['payload_mass'], 'effects.payload_mass.mass': 0.48,
        'effects.payload_mass.z': 0.35}, model.source), pace=0.1)
    adoption = adopt(model, requested('payload_mass', model), [recording])
    assert adoption.adopted, adoption.reason
    mass = adoption.parameters['mass']
    assert abs(mass.value - 0.48) < 2 * mass.std
