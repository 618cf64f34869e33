# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A motion replayed in MuJoCo by inverse dynamics of an exported file, against the model.

Closures of the file must be closed. They and dry friction are evaluated exactly here, not by the
engine's soft constraints.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.description import Frame
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.engine import load_engine
from pprs_dynamics.simulation.engine_state import OPEN, EngineState, add_sites
from pprs_dynamics.simulation.export.exported_robot import MJCF, ExportedRobot
from pprs_dynamics.simulation.injection import draw_motion

# The motion where no recording is given: rests, reverses every drive, and takes seconds.
DURATION = 8.0  # [s]
AT_ONCE = 1e-9  # [m/s, rad/s], a width of turning over above rounding and below any motion


def file_efforts(robot: ExportedRobot, text: str, kind: str, drives: JointMotion) -> Array:
    """Return the drives' efforts by a file along a motion, (N, D) [N m, N].

    Parameters
    ----------
    robot : ExportedRobot
    text : str
        The file's content.
    kind : {'urdf', 'mjcf'}
    drives : JointMotion
    """
    mujoco = load_engine('the replay of an exported model')
    structure, spec = robot.mechanism.structure, mujoco.MjSpec.from_string(text)
    if kind != MJCF:
        spec.option.gravity = robot.mechanism.gravity
    add_sites(spec, structure, {0: (spec.worldbody, Frame())} | {
        body.row: (spec.body(body.name), Frame()) for body in robot.bodies})
    model = spec.compile()
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    model.opt.disableflags |= (mujoco.mjtDisableBit.mjDSBL_CONTACT
                               | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    state = EngineState(mujoco, model, structure, Frame())
    data, closed = state.data, state.closed(
        robot.mechanism.at(drives.position, drives.velocity, drives.acceleration))
    needed = np.empty_like(closed.velocity)
    for k in range(len(drives)):
        data.qpos[:], data.qvel[:], data.qacc[:] = (
            closed.position[k], closed.velocity[k], closed.acceleration[k])
        mujoco.mj_inverse(model, data)
        off = np.abs(data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY])
        if off.max(initial=0.0) > OPEN:
            raise ModelError(f'the {kind} file', f'a closure is open by {off.max():.3g}',
                             'have the loops of the model: please report this model')
        # Dry friction by its law, in the place of the engine's constraints.
        needed[k] = (data.qfrc_inverse + data.qfrc_constraint
                     + model.dof_frictionloss * np.tanh(data.qvel / AT_ONCE))
    efforts: Array = np.einsum('nvd,nv->nd', closed.rates, needed)
    return efforts


def replay(model: DriveModel, robot: ExportedRobot, text: str, kind: str) -> tuple[Array, Array]:
    """Replay a short motion of the model in MuJoCo; see `file_efforts`.

    Returns
    -------
    error : (D,) array
        Root mean square of the model's efforts less those of the file [N, N m].
    effort : (D,) array
        Root mean square of the model's efforts.
    """
    motion = draw_motion(model, DURATION, 0)
    state = model.initial_state()
    forces = model.measured(model.drive_forces(motion, state), state)
    by_file = file_efforts(robot, text, kind, JointMotion(*forces.drive_motion))
    error, effort = (np.sqrt(np.mean(values ** 2, axis=0)) for values in (
        forces.total - by_file, forces.total))
    return error, effort
