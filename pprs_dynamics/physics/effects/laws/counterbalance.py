# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A spring or cylinder between two links, over a joint: (F_b + K l + A_b p) dl/dq.

It spans from a point on one link, at the distance b from the axis, to one on the other, at rho b;
l = sqrt(1 + rho^2 - 2 rho cos(q - q_0)) is its length over b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.mechanism.state import MECHANISM

PRESSURE = 'pressure'
# Over less of a turn [rad] it is a spring like any other.
LEAST_STROKE = 0.8
# Distances of the points from the axis, one over the other, and directions that are tried.
RATIOS, DIRECTIONS = (0.2, 0.4, 0.55, 0.7, 0.85), 24
SHORTEST, LONGEST = 0.05, 0.95
# Share by which the pull of a gas departs from a straight line over its stroke.
BEND = 0.2


class Counterbalance(DriveEffect):
    """Spring, gas or hydraulic cylinder that carries weight, between two links.

    Equation
    --------
    (F_b + K l + A_b p) dl/dq, l = sqrt(1 + rho^2 - 2 rho cos(q - q_0)), p its measured
    pressure

    Symptom
    -------
    A curve over the position of one joint, the same both ways, at any speed and with any load.
    It is zero where its ends are in line with the axis, steepest near that of these positions
    where both are on one side. It is like a mass on the link, but not with the sine of an
    angle from the vertical, nor in other joints.

    Causes
    ------
    The balancer of a heavy robot: springs, a gas cylinder, or a hydraulic cylinder with a gas
    accumulator. A gas spring at a door or an arm. Its pressure falls over the years.

    Confirmation
    ------------
    Read its pressure, or remove it with the arm supported: the error must be gone. Let the
    joint creep over its range, both ways, with two loads: the curve must not change.

    References
    ----------
    Jubien and Gautier, Global identification of spring balancer, dynamic parameters and drive
    gains of heavy industrial robots, IROS, 2013.
    """

    name = 'counterbalance'
    acts_in = frozenset({MECHANISM})
    linear = (Parameter('force', 'F_b', 'N m', 'pull at no length, times b; negative where it '
                        'pushes', -1e7, 1e7, scale=5.0),
              Parameter('stiffness', 'K', 'N m', 'stiffness times b^2', -1e7, 1e7, 0.0,
                        scale=5.0),
              Parameter('area', 'A_b', 'm^3', 'area of a piston times b, where its pressure is '
                        'measured', -10.0, 10.0, 0.0, scale=1e-5))
    shape = (Parameter('ratio', 'rho', '1', 'distance of the nearer point from the axis over that '
                       'of the farther', SHORTEST, LONGEST, scale=0.1),
             Parameter('position', 'q_0', 'rad', 'position at which both points are on one side, '
                       'in line with the axis', -100.0, 100.0, scale=0.3))
    variants = (('force', 'stiffness'), ('area',))
    scanned = ('force', 'stiffness')
    is_smooth = True

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (dl/dq, l dl/dq, p dl/dq); the last is 0 where no pressure was measured."""
        length, lever = _length(drive.position, shape['ratio'], shape['position'])
        pressure = np.nan_to_num(drive.channels.get(PRESSURE, np.zeros_like(length)))
        return (lever / length, lever, pressure * lever / length)

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return the nonlinear part of a gas's law: its pressure rises ever faster."""
        length, _ = _length(drive.position, shape['ratio'], shape['position'])
        share = (length - 1) / shape['ratio']  # -1 at the shortest, near 1 at the longest
        force, stiffness, measured = cls.columns(drive, **shape)
        bend = BEND * share ** 2
        return ((bend * force, bend * stiffness, np.zeros_like(measured)),)

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether the drive turns, and far enough."""
        return covered.turns and covered.stroke >= LEAST_STROKE

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return distances and directions."""
        return [{'ratio': ratio, 'position': float(place)} for ratio in RATIOS
                for place in np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)]


def _length(position: Array, ratio: Array | float, place: Array | float) -> tuple[Array, Array]:
    """Return the length, and its product with its derivative by the position."""
    angle = position - place
    return np.sqrt(1 + ratio ** 2 - 2 * ratio * np.cos(angle)), ratio * np.sin(angle)
