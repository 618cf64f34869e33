# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The engine's own loops, reactions and friction of joints, held against the model's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import robots_with_loops as robots

from pprs_dynamics import DriveModel, JointMotion, WorkspaceError
from pprs_dynamics.physics.mechanism.passive_joints import friction_rows
from pprs_dynamics.simulation.engine import MechanismEngine
from pprs_dynamics.simulation.injection import draw_motion

ROBOTS = {'hexapod': robots.hexapod, 'delta': robots.delta, 'five_bar': robots.five_bar}


def rubbing(name: str, folder: Path) -> DriveModel:
    """Return a robot all of whose passive joints rub, with their loads and without."""
    names = friction_rows(DriveModel.load(ROBOTS[name]().write(folder)).robot.structure)
    return DriveModel.load(ROBOTS[name]().write(folder, {'joints': {
        one: {'viscous': 0.1, 'torque': 0.1, 'coulomb': 0.2, 'radius': 0.02} for one in names}}))


@pytest.mark.parametrize('name', ROBOTS)
def test_motion_reactions_and_friction_are_those_of_the_model(tmp_path: Path, name: str) -> None:
    model = rubbing(name, tmp_path)
    motion = draw_motion(model, 3.0, 2)
    forces, engine = model.drive_forces(motion), MechanismEngine(model)
    bodies = engine.torques(motion)
    largest = np.abs(forces.total).max()
    assert np.abs(bodies - forces.parts['rigid_body']
                  + model.robot.armature * motion.acceleration).max() < 1e-7 * largest
    (own,) = (one for one in model.effects if one.name == 'passive_friction')
    friction = engine.joint_friction(motion, own.table(model.robot, model.reversal))
    assert np.abs(friction).max() > 0.01 * largest
    assert np.abs(friction - forces.parts['passive_friction']).max() < 1e-6 * largest


@pytest.mark.parametrize('name', ['hexapod', 'delta'])
def test_the_engine_closes_loops_as_the_model_does(tmp_path: Path, name: str) -> None:
    model = rubbing(name, tmp_path)
    motion = draw_motion(model, 1.0, 3)
    expected = model.mechanism(motion).links.motion
    engine = MechanismEngine(model)
    engine.home()
    closed = engine.loops.follow(motion)
    t = model.robot.structure.tables
    for joint, row in model.robot.structure.rows.items():
        if joint not in engine.state.joints.values():
            continue
        at, dof = engine.state.place(joint), engine.state.dof(joint)
        for found, known, off in ((closed.position[:, at], expected.q, t.offset[row]),
                                  (closed.velocity[:, dof], expected.v, 0.0),
                                  (closed.acceleration[:, dof], expected.a, 0.0)):
            right = t.ratio[row] * known[:, t.coordinate[row]] + off
            assert np.abs(found - right).max() < 1e-6 * max(1.0, np.abs(right).max())


def test_beyond_reach_is_told(tmp_path: Path) -> None:
    model = rubbing('five_bar', tmp_path)
    engine = MechanismEngine(model)
    apart = np.array([[np.pi, 0.0]])
    with pytest.raises(WorkspaceError, match='loops do not close'):
        engine.closed(JointMotion(apart, 0 * apart, 0 * apart))
