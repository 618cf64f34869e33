# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A motion replayed in MuJoCo by inverse dynamics of an exported file, against the model.

Closures come from the file; those that URDF cannot hold are put back from the model first. Closures
and dry friction are evaluated exactly here, not by the engine's soft constraints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.physics.mechanism.description import Frame
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.engine import load_engine
from pprs_dynamics.simulation.engine_state import EngineState
from pprs_dynamics.simulation.export.exported_robot import ExportedRobot
from pprs_dynamics.simulation.export.expressed import AT_ONCE, MJCF, Expressed
from pprs_dynamics.simulation.export.writers import closures
from pprs_dynamics.simulation.injection import draw_motion

# The motion where no recording is given: rests, reverses every drive, and takes seconds.
DURATION, RATE = 8.0, 100.0  # [s, Hz]


class Replay:
    """The file in the engine, and the errors of all that was replayed.

    Parameters
    ----------
    expressed : Expressed
    robot : ExportedRobot
    text : str
        The file's content.
    kind : {'urdf', 'mjcf'}
    """

    def __init__(self, expressed: Expressed, robot: ExportedRobot, text: str, kind: str) -> None:
        self.expressed, self.robot = expressed, robot
        mujoco = self.engine = load_engine('the replay of an exported model')
        spec = mujoco.MjSpec.from_string(text)
        structure = robot.mechanism.structure
        if kind != MJCF:
            spec.option.gravity = robot.mechanism.gravity
            _close(mujoco, spec, robot)
        model = spec.compile()
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.opt.disableflags |= (mujoco.mjtDisableBit.mjDSBL_CONTACT
                                   | mujoco.mjtDisableBit.mjDSBL_LIMIT)
        self.state = EngineState(mujoco, model, structure, Frame())
        self.samples = 0
        self.squares = np.zeros((2, len(structure.drives)))

    def efforts(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the drives' efforts by the file, (N, D) [N m, N]."""
        mujoco, state = self.engine, self.state
        model, data = state.model, state.data
        m = self.robot.mechanism.at(position, velocity, acceleration).motion
        found = np.empty_like(position)
        for k in range(len(position)):
            state.put(m, k)
            mujoco.mj_inverse(model, data)
            closing = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
            rows = data.efc_J.reshape(-1, model.nv)[closing]
            # Dry friction by its law, in the place of the engine's constraints.
            needed = (data.qfrc_inverse + data.qfrc_constraint
                      + model.dof_frictionloss * np.tanh(data.qvel / AT_ONCE))
            found[k] = state.driven(needed, rows)
        return found

    def add(self, forces: Any) -> Array:
        """Replay the motion of forces of the model, and return the efforts by the file, (N, D)."""
        model = self.expressed.model
        motion = (JointMotion(*forces.drive_motion) if model.moves_joints
                  else forces.mechanism.motion)
        expected = model.drive_forces(motion).total
        efforts = self.efforts(*(np.ascontiguousarray(each) for each in forces.drive_motion))
        self.samples += len(efforts)
        for sums, other in zip(self.squares, (efforts, expected), strict=True):
            sums += np.sum((forces.total - other) ** 2, axis=0)
        return efforts


@dataclass(frozen=True)
class Replayed:
    """What a replay found.

    Parameters
    ----------
    drives : tuple of str
    units : tuple of str
        Of their efforts.
    error : (D,) array
        Root mean square of the model's efforts less those of the file [N, N m].
    expected : (D,) array
        The same by the model's own equations: of what the file does not express.
    effort : (D,) array
        Root mean square of the model's efforts.
    """

    drives: tuple[str, ...]
    units: tuple[str, ...]
    error: Array
    expected: Array
    effort: Array

    def to_dict(self) -> dict[str, Any]:
        """Return it as data for JSON."""
        by_drive = zip(self.drives, self.units, self.error.tolist(), self.expected.tolist(),
                       self.effort.tolist(), strict=True)
        return {
            'replay_error': root_mean_square(self.error),
            'expected_error': root_mean_square(self.expected),
            'effort': root_mean_square(self.effort),
            'drives': {name: {'unit': unit, 'replay_error': error, 'expected_error': expected,
                              'effort': effort}
                       for name, unit, error, expected, effort in by_drive}}


def replay_excitation(model: DriveModel, replay: Replay) -> Replayed:
    """Replay a short motion of the model itself."""
    state = model.initial_state()
    forces = model.measured(model.drive_forces(_excitation(model), state), state)
    replay.add(forces)
    error, expected, effort = (np.sqrt(sums / replay.samples) for sums in (
        *replay.squares, np.sum(forces.total ** 2, axis=0)))
    return Replayed(model.drives, tuple(unit.effort for unit in model.units), error, expected,
                    effort)


def _excitation(model: DriveModel) -> Any:
    time = np.arange(0.0, DURATION, 1 / RATE)
    if model.moves_joints:
        return draw_motion(model, DURATION, 0)
    return Excitation(duration=DURATION).motion(time)


def _close(mujoco: Any, spec: Any, robot: ExportedRobot) -> None:
    """Put back the closures and couplings that a URDF lacks, or that MuJoCo does not read."""
    structure = robot.mechanism.structure
    names = {body.row: body.name for body in robot.bodies}
    for name, sites, weld in closures(structure):
        for site, row, frame in sites:
            quaternion = np.empty(4)
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(frame.R).ravel())
            body = spec.body(names[row]) if row else spec.worldbody
            body.add_site(name=site, pos=frame.p, quat=quaternion)
        equality = spec.add_equality(name=name, name1=sites[0][0], name2=sites[1][0])
        equality.type = mujoco.mjtEq.mjEQ_WELD if weld else mujoco.mjtEq.mjEQ_CONNECT
        equality.objtype = mujoco.mjtObj.mjOBJ_SITE
    known = {equality.name1 for equality in spec.equalities}
    for name, leader, ratio, offset in structure.couplings:
        if name not in known:
            equality = spec.add_equality(name1=name, name2=leader)
            equality.type, equality.objtype = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
            equality.data[:2] = offset, ratio
