# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Serial arms from a URDF: torques against a second engine, refusals, files."""

from __future__ import annotations

import os
import re
from pathlib import Path

import made_up_arm as arm
import mujoco
import numpy as np
import pytest
import yaml
from single_axis import TIME, axis, axis_motion

from pprs_dynamics import DriveModel, JointMotion, PprsError
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.model.model_writer import write_model

SAMPLES = 40


def states(seed: int = 1) -> JointMotion:
    random = np.random.default_rng(seed)
    return JointMotion(*random.uniform(-1, 1, size=(3, SAMPLES, 3)) * [[[1.5]], [[3]], [[8]]])


def mujoco_torques(text: str, motion: JointMotion, gravity: tuple[float, ...] = (0, 0, -9.81),
                   ) -> np.ndarray:
    """Return inverse dynamics by MuJoCo, which reads the same URDF by a parser of its own."""
    extension = '<mujoco><compiler balanceinertia="false" discardvisual="true"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(text.replace('</robot>', extension))
    model.opt.gravity = gravity
    model.opt.disableflags |= (mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    found = np.empty_like(motion.position)
    for k in range(len(motion)):
        data.qpos, data.qvel, data.qacc = (motion.position[k], motion.velocity[k],
                                           motion.acceleration[k])
        mujoco.mj_inverse(model, data)
        found[k] = data.qfrc_inverse
    return found


def test_torques_are_those_of_mujoco(tmp_path: Path) -> None:
    model = DriveModel.load(arm.write_arm(tmp_path))
    motion = states()
    assert model.drive_forces(motion).total == pytest.approx(
        mujoco_torques(arm.urdf(), motion), abs=1e-9)


def test_a_payload_is_a_body_more_to_mujoco(tmp_path: Path) -> None:
    mass, centre, inertia = 2.5, np.array([0.03, -0.05, 0.08]), (0.02, 0.03, 0.025)
    body = ('<link name="load"><inertial><mass value="2.5"/><origin xyz="0.03 -0.05 0.08"/>'
            '<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="grip" type="fixed"><parent link="flange"/><child link="load"/></joint>')
    model = DriveModel.load(arm.write_arm(tmp_path))
    values = dict(zip(('mass', 'x', 'y', 'z', 'xx', 'yy', 'zz'), (mass, *centre, *inertia),
                      strict=True))
    effect = PayloadMass.bound(model.robot).from_file(values)
    motion = states()
    state = effect.apply(model.mechanism(motion))
    assert state.rigid_force == pytest.approx(mujoco_torques(arm.urdf(more=body), motion), abs=1e-9)


def test_a_tilted_base_is_another_gravity_to_mujoco(tmp_path: Path) -> None:
    model = DriveModel.load(arm.write_arm(tmp_path))
    motion = states()
    tilted = BaseTilt({'x': 0.1, 'y': 0.0}).apply(model.mechanism(motion))
    gravity = (0.0, 9.81 * np.sin(0.1), -9.81 * np.cos(0.1))
    assert tilted.rigid_force == pytest.approx(
        mujoco_torques(arm.urdf(), motion, gravity), abs=1e-9)


def test_friction_armature_and_offset_add_up(tmp_path: Path) -> None:
    model = DriveModel.load(arm.write_arm(tmp_path))
    real = arm.real_arm(tmp_path, **{'robot.armature': (1.0, 2.0, 3.0)})
    motion = states()
    v = motion.velocity
    expected = (np.array([1, 2, 3]) * motion.acceleration
                + np.array(arm.FRICTION['friction.viscous']) * v
                + np.array(arm.FRICTION['friction.coulomb']) * np.tanh(v / 0.01)
                + np.array(arm.FRICTION['friction.offset']))
    assert real.drive_forces(motion).total - model.drive_forces(motion).total == pytest.approx(
        expected, abs=1e-9)


TRANSMISSION = ('<transmission name="t"><type>transmission_interface/DifferentialTransmission'
                '</type><joint name="turn"/><joint name="swing"/></transmission>')
FLOATING = ('<link name="world"/><joint name="free" type="floating"><parent link="world"/>'
            '<child link="stand"/></joint>')


@pytest.mark.parametrize(('text', 'words'), [
    (arm.urdf(mimic='<mimic joint="turn"/>'), "'swing', must .*mimic no other joint"),
    (arm.urdf(more=TRANSMISSION), 'transmission'), (arm.urdf(more=FLOATING), 'floating'),
    (arm.urdf(more='<link name="beam"/>'), 'two links beam'),
    (arm.urdf().replace('"1.5"', '"heavy"'), 'value of <mass> is "heavy", must be a finite'),
    (arm.urdf().replace('<mass value="1.5"/>', ''), 'without a <mass value')])
def test_what_is_not_covered_or_damaged_is_refused_in_a_sentence(
    tmp_path: Path, text: str, words: str,
) -> None:
    path = arm.write_arm(tmp_path, text)
    with pytest.raises(PprsError, match=words) as error:
        DriveModel.load(path)
    assert str(error.value).count('\n') == 0
    assert str(error.value).startswith(str(tmp_path))


def test_joints_that_share_a_transmission_need_the_turns_of_its_motors(tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path, arm.urdf(more=TRANSMISSION))
    way = 'friction: {motors: {MOTOR: {turn: 1.0, swing: 1.0}}}'
    with pytest.raises(ModelError, match=re.escape(way)):
        DriveModel.load(path)
    path = arm.write_arm(tmp_path, arm.urdf(more=TRANSMISSION),
                         friction__motors='{left: {turn: 1.0, swing: 1.0}}')
    model = DriveModel.load(path)
    assert model.robot.motors == {'left': (1.0, 1.0, 0.0)}


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ('tool: flange', 'tool: flansch', 'flansch.*be a link of the URDF'),
    ('base: stand', 'base: beam', r'that no joint moves, but swing \(revolute\) does'),
    ('urdf: made_up.urdf', 'urdf: none.urdf', 'none.urdf'),
    ('drives: [turn, swing, reach]', 'drives: []', r'drives is \[\], must be a list of names'),
    ('drives: [turn, swing, reach]', 'drives: [turn, swing, turn]', 'name each joint once'),
    ('drives: [turn, swing, reach]', 'drives: [turn, swing, reech]', 'did you mean reach'),
    ('base: stand', 'base: stand\n      gane: [1.0, 2.0, 3.0]', 'did you mean robot.gain'),
])
def test_a_mistake_in_the_file_is_one_sentence(tmp_path: Path, old: str, new: str,
                                               words: str) -> None:
    path = arm.write_arm(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(PprsError, match=words):
        DriveModel.load(path)


def test_a_file_keeps_its_urdf_wherever_it_is_written(tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path)
    (tmp_path / 'there').mkdir()
    written = tmp_path / 'there' / 'new.yaml'
    real = arm.real_arm(tmp_path)
    write_model(written, real.values, path)
    block = yaml.safe_load(written.read_text())['/**']['ros__parameters']
    assert block['robot']['urdf'] == os.path.join('..', 'made_up.urdf')
    assert block['friction']['coulomb'] == list(arm.FRICTION['friction.coulomb'])
    again = DriveModel.load(written)
    assert dict(again.values) == dict(real.values)
    motion = states()
    assert np.array_equal(again.drive_forces(motion).total, real.drive_forces(motion).total)


# A single axis: its forces, its files, and the same commands on recordings of one drive.

VALUES = dict(axis().values)
EQUAL = 1e-12


@pytest.mark.parametrize('gravity', [0.0, -9.81])
def test_the_force_is_the_textbooks(gravity: float) -> None:
    moved = axis_motion(TIME)
    forces = axis(**{'robot.gravity': (0.0, 0.0, gravity)}).drive_forces(moved)
    textbook = (20.0 * (moved.acceleration - gravity) + 40.0 * moved.velocity
                + 6.0 * np.tanh(moved.velocity / 0.001) - 2.0)
    np.testing.assert_allclose(forces.total, textbook, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sum(forces.parts.values()), forces.total, rtol=0, atol=EQUAL)


@pytest.mark.parametrize(('change', 'sentence'), [
    ({'links.mass': [0.0]}, 'move a body: no link that it moves has a mass'),
    ({'friction.coulomb': [-1.0]}, 'friction.coulomb is [-1.0]'),
    ({'effects.payload_mass.mass': 0.1}, 'be an effect that acts in a single axis'),
    ({'effects.viscous_friction.lift_1.coefficient': 1.0}, 'unknown drive lift_1 (known: axis)'),
])
def test_a_mistake_in_a_file_is_one_sentence(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(ModelError) as caught:
        DriveModel.from_parameters({**VALUES, **change})
    assert sentence in str(caught.value)
