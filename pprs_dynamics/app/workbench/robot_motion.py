# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot's joints along a recording, with the error of every drive, to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.three_pprs.inverse_kinematics import joint_positions

MOST_POSES = 600


@dataclass(frozen=True)
class RobotMotion:
    """F poses.

    Parameters
    ----------
    angles : tuple of float
        Of the chains about z [rad].
    time : (F,) array
        Of the residuals [s].
    joints : (F, 3, 3, 3) array
        Slide, joint C and joint A of every chain in `base` [m]; second axis: which, third: chain.
    before, now : (F, D) array
        Error of the drives there, rms over the samples until the next pose [N].
    """

    angles: tuple[float, ...]
    time: Array
    joints: Array
    before: Array
    now: Array


def robot_motion(session: Session, most: int = MOST_POSES) -> RobotMotion:
    """Return the poses of all recordings, one after the other.

    Raises
    ------
    SessionError
        For a model of another mechanism.
    """
    model = session.model
    if not isinstance(model, DriveModel):
        raise SessionError(f'{model.title} is not drawn, only the 3-PPRS is')
    chosen = np.unique(np.linspace(0, len(session.data) - 1, most).astype(int))
    joints, first = [], 0
    for one in session.fits.design.reconstructions:
        starts = one.treat.starts
        here = chosen[(chosen >= first) & (chosen < first + len(starts))] - first
        first += len(starts)
        assert isinstance(one.motion, PlatformMotion)
        if len(here):
            found = joint_positions(model.robot.geometry, one.motion[starts[here]])
            joints.append(np.stack((found.foot, found.elbow, found.tip), axis=1))
    angles = tuple(float(angle) for angle in model.values['geometry.chain_angles'])
    return RobotMotion(angles, session.data.time[chosen], np.concatenate(joints),
                       _rms_between(session.before, chosen), _rms_between(session.now, chosen))


def _rms_between(error: Array, chosen: np.typing.NDArray[np.int_]) -> Array:
    known = np.isfinite(error)
    squares = np.add.reduceat(np.where(known, error, 0.0) ** 2, chosen, axis=0)
    counts = np.add.reduceat(known.astype(float), chosen, axis=0)
    means: Array = np.sqrt(squares / np.maximum(counts, 1.0))
    return means
