# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Exported files: simulators make of them what the model says, and what they lack is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest
from documents import checked
from single_axis import axis_values

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.simulation.export.exported_robot import (
    MJCF,
    URDF,
    TreePositions,
    export_robot,
    written,
)
from pprs_dynamics.simulation.export.replay import DURATION, replay
from pprs_dynamics.simulation.injection import draw_motion

NO_LOADS = {'friction.drives.coulomb': (0.0,) * 6, 'friction.revolute.coulomb': 0.0,
            'friction.spherical.coulomb': 0.0, 'friction.spherical.viscous': 0.0}


def text_of(model: Any, kind: str) -> str:
    return written(export_robot(model, kind), kind)


def replay_error(model: DriveModel, kind: str) -> float:
    robot = export_robot(model, kind)
    return float(replay(model, robot, written(robot, kind), kind)[0].max())


def without_loads(model: DriveModel, kind: str) -> float:
    """Return the error where the file holds all of the model: without dry friction and offsets."""
    dry = ('coulomb', 'offset', 'torque', 'spherical.viscous')
    return replay_error(DriveModel.from_parameters({
        key: np.multiply(value, 0.0).tolist() if key.startswith('friction.') and (
            key.endswith(dry) or 'joints.ball' in key) and not isinstance(value, str) else value
        for key, value in model.values.items()}, model.source), kind)


def exported(model: str | Path, kind: str, folder: Path, *more: str) -> tuple[Path, dict[str, Any]]:
    """Run the command and return the file and the JSON."""
    file, result = folder / f'robot.{"urdf" if kind == URDF else "xml"}', folder / 'result.json'
    assert main(['export', str(model), '--to', kind, '--output', str(file), '--json', str(result),
                 *more]) == 0
    return file, checked(result.read_text(), 'export')


def paper(**changes: Any) -> DriveModel:
    model = DriveModel.from_parameters({**DriveModel.load().values, **changes})
    return model


@pytest.mark.parametrize('more', [
    {'masses.centre': (0.01, -0.02, 0.03), 'masses.inertia': (5e-3, 6e-3, 1e-2, 1e-3, -5e-4, 2e-4),
     'geometry.platform_angles': (0.1, 2.2, 4.3)},
    {'masses.rods': (0.0, 0.3, 0.2), 'geometry.elbow': 'down', 'gravity': (0.3, -0.2, -9.7)},
    {'effects.active': ('payload_mass', 'payload_offset', 'link_mass', 'base_tilt'),
     'effects.payload_mass.mass': 0.4, 'effects.payload_offset.x': 0.01,
     'effects.payload_offset.y': 0.0, 'effects.payload_offset.z': 0.02,
     'effects.link_mass.rods.mass': 0.1, 'effects.base_tilt.x': 0.03, 'effects.base_tilt.y': -0.02},
    {'effects.active': ('viscous_friction', 'drive_inertia', 'drive_spring', 'joint_friction',
                        'joint_spring'),
     'effects.viscous_friction.lift_2.coefficient': 7.0,
     'effects.drive_inertia.slide_1.mass': 0.3,
     'effects.drive_spring.lift_1.stiffness': 20.0, 'effects.drive_spring.lift_1.position': 0.1,
     'effects.joint_friction.revolute.viscous': 0.05,
     'effects.joint_spring.revolute.stiffness': 0.2,
     'effects.joint_spring.revolute.position': 0.4},
], ids=['bodies', 'elbow down', 'effects on bodies', 'effects in joints'])
def test_mujoco_needs_the_forces_of_the_model_where_all_is_expressed(more: dict[str, Any]) -> None:
    """Replay is right: its error where something is not expressed is known below."""
    model = paper(**NO_LOADS, **more)
    assert export_robot(model, MJCF).not_expressed == ()
    assert replay_error(model, MJCF) < 1e-9


def test_what_is_not_expressed_is_named_and_is_what_is_missing(tmp_path: Path) -> None:
    file, result = exported('config/paper.yaml', MJCF, tmp_path)
    assert result['not_expressed'] == [
        'friction.drives.coulomb', 'friction.revolute.coulomb', 'friction.spherical.coulomb',
        'friction.spherical.viscous']
    assert result['replay_error'] > 0.1
    assert without_loads(paper(), MJCF) < 1e-9
    engine = mujoco.MjModel.from_xml_path(str(file))
    names = [engine.joint(k).name for k in range(engine.njnt)]
    assert sorted(names) == sorted(
        ['platform', *(f'{part}_{i}' for part in ('slide', 'lift', 'hinge') for i in (1, 2, 3))])
    assert {engine.body(f'{part}_{i}').name for part in ('slide', 'lift', 'rod')
            for i in (1, 2, 3)} <= {engine.body(k).name for k in range(engine.nbody)}
    assert [engine.actuator(k).name for k in range(engine.nu)] == list(DRIVES)


@pytest.mark.parametrize('name', ['hexapod', 'delta'])
@pytest.mark.parametrize('kind', [MJCF, URDF])
def test_robots_with_loops(name: str, kind: str, tmp_path: Path) -> None:
    file, result = exported(f'config/{name}.yaml', kind, tmp_path)
    model = DriveModel.load(f'config/{name}.yaml')
    assert without_loads(model, kind) < 1e-8
    # Read as any robot's file, it moves as the model's bodies do.
    own = {key: value for key, value in model.values.items()
           if not key.startswith(('robot.urdf', 'friction.joints'))
           and (kind == URDF or not key.startswith('robot.loops'))}
    base = 'world' if kind == MJCF else model.values['robot.base']
    again = DriveModel.from_parameters({**own, f'robot.{kind}': str(file), 'robot.base': base})
    motion = draw_motion(model, 3.0, 1)
    expected = model.drive_forces(motion).parts['rigid_body']
    assert again.drive_forces(motion).parts['rigid_body'] == pytest.approx(
        expected, abs=1e-8 * np.abs(expected).max())
    if kind == URDF:
        assert {'ball_1', 'ball_2'} & {name[:6] for name in result['not_expressed']}
        assert pinocchio.buildModelFromUrdf(str(file)).nv > 12


@pytest.mark.parametrize('kind', [MJCF, URDF])
@pytest.mark.parametrize('gravity', [4.0, -9.81])
def test_a_single_axis(kind: str, gravity: float, tmp_path: Path) -> None:
    write_model(tmp_path / 'axis.yaml', axis_values(95.109, 203.5, 20.394, -3.165, gravity, 3e-4))
    _, result = exported(tmp_path / 'axis.yaml', kind, tmp_path)
    is_standard = kind == MJCF or gravity == -9.81
    assert result['not_expressed'] == ['friction.offset'] + ['robot.gravity'] * (not is_standard)
    if not is_standard:
        return
    # The offset, and dry friction that turns over at once and not within 0.3 mm/s.
    v = draw_motion(DriveModel.load(tmp_path / 'axis.yaml'), DURATION, 0).velocity
    left = -3.165 + 20.394 * (np.tanh(v / 0.0003) - np.tanh(v / 1e-9))
    assert result['replay_error'] == pytest.approx(np.sqrt(np.mean(left ** 2)), abs=1e-3)


LINK = ('<link name="{}"><inertial><origin xyz="0.1 0.02 0"/><mass value="2"/><inertia ixx="0.02" '
        'iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>')
JOINT = ('<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin '
         'xyz="0.3 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2" upper="2"/></joint>')


@pytest.mark.parametrize('kind', [MJCF, URDF])
def test_a_locked_joint_is_rigid_in_the_file(kind: str, tmp_path: Path) -> None:
    (tmp_path / 'arm.urdf').write_text(
        '<robot name="arm"><link name="base"/>' + JOINT.format('elbow', 'base', 'upper')
        + LINK.format('upper') + JOINT.format('wrist', 'upper', 'hand') + LINK.format('hand')
        + '</robot>')
    (tmp_path / 'arm.yaml').write_text(
        '/**:\n  ros__parameters:\n    robot: {urdf: arm.urdf, base: base, tool: hand, '
        'drives: [elbow], locked: {wrist: 0.7}}\n')
    _, result = exported(tmp_path / 'arm.yaml', kind, tmp_path)
    assert result['replay_error'] < 1e-9


def test_a_body_that_cannot_be_is_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    text = Path('config/paper.yaml').read_text()
    (tmp_path / 'robot.yaml').write_text(text + '''
    effects:
      active: [platform_inertia]
      platform_inertia: {xx: 0.5, yy: 0.0, zz: 0.0}
''')
    assert main(['export', str(tmp_path / 'robot.yaml'), '--to', 'mjcf', '--output',
                 str(tmp_path / 'robot.xml')]) == 2
    said = capsys.readouterr().err
    assert said.startswith('pprs export: inertia of platform is')
    assert len(said.splitlines()) == 1
    assert not (tmp_path / 'robot.xml').exists()


def place_joints(robot: Any, data: Any, names: tuple[str, ...], position: np.ndarray) -> None:
    """Put Pinocchio's robot where joints are, by name; free bodies stay at home."""
    q = pinocchio.neutral(robot)
    for name, value in zip(names, position, strict=True):
        joint = robot.joints[robot.getJointId(name)]
        # Joints without limits are a cosine and a sine there.
        q[joint.idx_q:joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [np.cos(value), np.sin(value)])
    pinocchio.framesForwardKinematics(robot, data, q)


@pytest.mark.parametrize('name', ['hexapod', 'delta'])
def test_joints_and_free_bodies_of_the_urdf_meet_at_every_closure(name: str) -> None:
    model = DriveModel.load(f'config/{name}.yaml')
    structure = model.robot.structure
    tree = TreePositions(model)
    robot = pinocchio.buildModelFromXML(text_of(model, URDF))
    data = robot.createData()
    home = structure.home[structure.tables.drives]
    for shift in np.random.default_rng(3).uniform(-0.03, 0.03, (5, len(home))):
        pose = tree.at(home + shift)
        place_joints(robot, data, tree.names, pose.joints)
        place = {frame.name: data.oMf[k] for k, frame in enumerate(robot.frames)}
        # What robot_state_publisher leaves out is put where tf says that it is.
        for link, told in zip(tree.bodies, pose.bodies, strict=True):
            place[link] = place[tree.base] * pinocchio.XYZQUATToSE3(told)
        assert structure.loops
        for loop in structure.loops:
            np.testing.assert_allclose(place[loop.a].act(loop.frame_a.p),
                                       place[loop.b].act(loop.frame_b.p), atol=1e-9)
