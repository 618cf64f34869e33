# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A load on arms that show only some of its numbers: one joint, or two in a plane."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest
from model_recordings import with_effects
from planar_arm import planar_arm

from pprs_dynamics import JointMotion
from pprs_dynamics.app.api.adopt import parameter_rows
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.body_centres import find_centre
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.link_mass import LinkMass
from pprs_dynamics.physics.mechanism.description import body_at
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
    true = with_effects(model, {'payload_mass': {'mass': 0.5, 'z': -0.5}})
    recording = record(true)
    found = diagnose(model, [recording])
    assert [effect.name for effect in found.effects] == ['payload_mass']
    said = found.effects[0].parameters
    assert abs(said['mass'].value * said['z'].value + 0.25) < 0.01
    adoption = adopt(model, EffectRequest.of('payload_mass', model), [recording], diagnosis=found)
    assert adoption.adopted, adoption.reason
    assert adoption.held_out_after < 1.1 * NOISE


def test_a_slow_motion_tells_the_moment_of_a_load_and_not_its_mass(tmp_path: Path) -> None:
    """What holds 0.25 kg m may be any mass: only m c acts without acceleration."""
    model = planar_arm(tmp_path, 1)
    recording = record(with_effects(model, {'payload_mass': {'mass': 0.5, 'z': -0.5}}), pace=0.1)
    # At rest a weight on a joint and a spring on a lever hold alike.
    found = diagnose(model, [recording])
    assert {'payload_mass', 'counterbalance'} in map(set, found.indistinguishable)
    adoption = adopt(model, EffectRequest.of('payload_mass', model), [recording], diagnosis=found)
    assert adoption.adopted, adoption.reason
    mass, moment = adoption.parameters['mass'], adoption.moments['moment_z']
    assert mass.std > 0.1 * mass.value
    assert moment.std < 0.002
    assert abs(moment.value + 0.25) < 4 * moment.std
    assert adoption.to_dict()['moments']['moment_z']['unit'] == 'kg m'
    (_, values), = parameter_rows(adoption)
    assert 'moment_z -0.2' in values
    assert values.endswith('kg m')
    # Where the mass is as sure, mass and centre say it.
    quick = adopt(model, EffectRequest.of('payload_mass', model), [record(adoption.after)])
    assert 'moment_z' not in dict(parameter_rows(quick))['payload_mass']


def test_the_interval_of_a_mass_has_every_centre_that_the_path_allows(tmp_path: Path) -> None:
    """0.48 kg at 0.15 m looks like 0.144 kg at the tool, 0.5 m from the axis."""
    planar_arm(tmp_path, 1)
    urdf, file = tmp_path / 'arm.urdf', tmp_path / 'arm.yaml'
    urdf.write_text(urdf.read_text().replace('</robot>', (
        '<link name="flange"/><joint name="fixed" type="fixed"><parent link="rod_1"/>'
        '<child link="flange"/><origin xyz="0 0 -0.5"/></joint></robot>')))
    file.write_text(file.read_text().replace('tool: rod_1', 'tool: flange'))
    model = DriveModel.load(file)
    recording = record(with_effects(model, {'payload_mass': {'mass': 0.48, 'z': 0.35}}), pace=0.1)
    adoption = adopt(model, EffectRequest.of('payload_mass', model), [recording])
    assert adoption.adopted, adoption.reason
    mass = adoption.parameters['mass']
    assert abs(mass.value - 0.48) < 2 * mass.std


# A body far from its link's centre: its columns hold its inertia.

MASS = 4.0


def columns(tmp_path: Path) -> tuple[DriveModel, type[LinkMass], np.ndarray, tuple]:
    """Return a model, bodies on its links, their columns (k, N, 3), and the states of these."""
    model = DriveModel.load(arm.write_arm(tmp_path))
    kind, states = model.bound(LinkMass), tuple(np.random.default_rng(2).uniform(-1, 1, (3, 25, 3)))
    none = model.robot.torques(*states)
    return model, kind, np.stack([
        kind.at({c.name: 1.0}).changed(model.robot).torques(*states) - none
        for c in kind.coefficients]), states


def test_the_columns_about_a_centre_are_exact_for_a_body_there(tmp_path: Path) -> None:
    model, kind, rows, states = columns(tmp_path)
    link, centre, *_ = kind.places[0]
    away = np.array([0.3, -0.2, 0.5])
    there = {f'{link}.mass': MASS, **{f'{link}.moment_{axis}': MASS * d
                                      for axis, d in zip('xyz', away, strict=True)}}
    c = np.array([there.get(c.name, 0.0) for c in kind.coefficients])
    heavier = model.robot.with_body(link, body_at(MASS, tuple(centre + away), np.zeros((3, 3))))
    expected = heavier.torques(*states) - model.robot.torques(*states)
    about = kind.rows_about(f'{link}.', rows, away)
    assert np.tensordot(c, about, 1) == pytest.approx(expected, abs=1e-9)
    # Without its inertia it would be another force.
    assert np.abs(np.tensordot(c, rows, 1) - expected).max() > 0.1 * np.abs(expected).max()


def test_a_body_is_the_same_about_whichever_centre_its_columns_are(tmp_path: Path) -> None:
    model, kind, rows, states = columns(tmp_path)
    prefix, away = f'{kind.places[0].link}.', (0.3, -0.2, 0.5)
    fitted = {f'{prefix}{name}': value for name, value in {
        'mass': MASS, 'moment_x': 0.4, 'moment_y': -0.3, 'moment_z': 0.2,
        'xx': 0.5, 'yy': 0.6, 'zz': 0.4, 'xy': 0.02, 'xz': -0.03, 'yz': 0.01}.items()}
    names = [c.name for c in kind.coefficients]
    c = np.array([fitted.get(name, 0.0) for name in names])
    own = kind.about_own_centre(tuple(fitted), c, away)
    body = kind.at(dict(zip(names, own.tolist(), strict=True))).changed(model.robot)
    assert body.torques(*states) - model.robot.torques(*states) == pytest.approx(
        np.tensordot(c, kind.rows_about(prefix, rows, np.array(away)), 1), abs=1e-9)


def test_the_centre_is_found_from_the_error(tmp_path: Path) -> None:
    model = DriveModel.load(arm.write_arm(tmp_path))
    real = arm.real_arm(tmp_path)
    kind = model.bound(LinkMass)
    name = model.robot.body_names[1]
    link, centre, *_ = next(place for place in kind.places if place.link == name)
    prefix = f'{link}.'
    away = np.array([0.1, 0.3, -0.2])
    real = replace(real, robot=real.robot.with_body(
        link, body_at(MASS, tuple(centre + away), np.zeros((3, 3)))))
    design = Design.of(arm.real_arm(tmp_path), [arm.record(real, arm.motion(20.0), 0.01)])
    term = next(t for t in design.structure if t.effect is kind)
    found = find_centre(term, f'{prefix}mass', design.residuals.error,
                        dict.fromkeys(range(3), 1.0), design.given)
    assert found == pytest.approx(away, abs=0.02)
