# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion of the engine's mechanism along a given motion of its drives.

N samples are the first axis of every array.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError, SingularityError
from pprs_dynamics.simulation.closed_chains import DOFS, DRIVE_DOFS, ClosedChains
from pprs_dynamics.simulation.injected_effect import PlatformMoment


@dataclass(frozen=True)
class DrivenMotion:
    """Motion of the engine's mechanism along a motion of its drives.

    Parameters
    ----------
    time : (N,) array
    position, velocity, acceleration : (N, 6) arrays
        Of the drives [m, m/s, m/s^2].
    qpos, qvel, qacc : (N, 16), (N, 15), (N, 15) arrays
        Of all joints, in the engine's order.
    rotation : (N, 3, 3) array
        From `platform` to `base`.
    T_d, J_d_inverse, rates, axes : arrays
        See `closed_chains.Equations`.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    qpos: Array
    qvel: Array
    qacc: Array
    rotation: Array
    T_d: Array
    J_d_inverse: Array
    rates: Array
    axes: Array

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of_drives(cls, values: Mapping[str, Any], time: ArrayLike, position: ArrayLike,
                  velocity: ArrayLike, acceleration: ArrayLike) -> DrivenMotion:
        """Close the chains at every sample of a motion of the drives.

        Parameters
        ----------
        values : mapping
            Flat keys and values of a model file, of which the geometry is read.
        time : (N,) array_like
            Strictly increasing [s].
        position, velocity, acceleration : (N, 6) array_like
            [m, m/s, m/s^2].

        Raises
        ------
        MissingLibraryError
            Where mujoco is not installed.
        MotionError
            For shapes that do not fit together.
        SingularityError
            Where the mechanism cannot follow.
        """
        chains = ClosedChains(values)
        times = np.array(time, dtype=float)
        count = len(times)
        drives = [np.array(a, dtype=float) for a in (position, velocity, acceleration)]
        for name, array in zip(('position', 'velocity', 'acceleration'), drives, strict=True):
            if array.shape != (count, 6):
                raise MotionError(f'drive {name}', f'its shape is {array.shape}',
                                  f'be ({count}, 6)', 'shape')
        q, y, y_dot = drives
        chains.place_drives(q[0])
        qpos, rotation = np.empty((count, 16)), np.empty((count, 3, 3))
        qvel, qacc = np.empty((count, DOFS)), np.empty((count, DOFS))
        T_d, inverse = np.empty((count, 9, 6)), np.empty((count, 9, 9))
        rates, axes = np.empty((count, 18, 6)), np.empty((count, 9, 9))
        for k in range(count):
            try:
                if k:
                    h = times[k] - times[k - 1]
                    chains.engine.mj_integratePos(
                        chains.model, chains.qpos, qvel[k - 1] + h / 2 * qacc[k - 1], h)
                    chains.qpos[DRIVE_DOFS] = q[k]
                chains.close()
                qpos[k] = chains.qpos
                equations = chains.evaluate(y[k])
            except SingularityError as error:
                raise SingularityError(k, error.found, error.rule) from None
            qvel[k] = chains.qvel
            qacc[k] = equations.T.dot(y_dot[k]) + equations.g
            rotation[k], T_d[k], inverse[k] = chains.rotation, equations.T_d, equations.J_d_inverse
            rates[k], axes[k] = equations.rates, equations.axes
        return cls(times, q, y, y_dot, qpos, qvel, qacc, rotation, T_d, inverse, rates, axes)

    def platform_moment(self, sample: int) -> PlatformMoment:
        """Return the state of platform and rods at one sample."""
        qpos, qvel, rotation = self.qpos[sample], self.qvel[sample], self.rotation[sample]
        return PlatformMoment(float(self.time[sample]), qpos[9:12], rotation, qvel[9:12],
                              rotation @ qvel[12:], qpos[2:9:3])
