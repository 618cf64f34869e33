# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of a mechanism's equations at samples, from each to the next.

All samples are on the branch that home is on.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.description import PARAMETERS
from pprs_dynamics.physics.mechanism.evaluation import run
from pprs_dynamics.physics.mechanism.tree_equations import (
    EFFORTS,
    FORCES,
    KEPT,
    MOTION,
    OF_DRIVE,
    WIDTH,
    Data,
    JointFriction,
    Loads,
    Model,
    evaluate,
    length_of,
    oppose_friction,
    packed_tables,
    views,
)

NOWHERE, NO_GRAVITY = np.zeros(4), np.zeros(3)
NO_FRICTION = JointFriction(*np.zeros((2, 0), dtype=np.int64), *np.zeros((4, 0)))


class InverseDynamicsResult(NamedTuple):
    """Drive efforts of N samples, and closed coordinates of robots without a closed form.

    Parameters
    ----------
    q : (N, C) array or None
        Closed coordinates.
    efforts : (EFFORTS, N, D) array
        By row: TOTAL, RIGID, DRIVE_FRICTION, JOINT_EFFORT and TRANSMITTED [N m, N]; see
        `closed_form` for the other rows of a 3-PPRS.
    motion : three (N, D) arrays
        Position, velocity and acceleration of the drives.
    """

    q: Any
    efforts: Array
    motion: Any


class Evaluation:
    """A mechanism's equations for what it is given.

    Parameters
    ----------
    t : Model
    home : (C,) array
        Closed coordinates.
    """

    def __init__(self, t: Model, home: Array) -> None:
        self.tables, self.home, self.packed = t, home, packed_tables(t)
        self.sizes = self.packed.sizes
        self._lengths = length_of(Data, self.sizes), length_of(Loads, self.sizes)
        self._friction = NO_FRICTION, np.array(NO_FRICTION)
        # Of stages that take no motion or no bodies, or give no efforts.
        drives = len(t.drives)
        self._no_motion, self._no_efforts = np.empty((3, 0, drives)), np.empty((EFFORTS, 0, drives))
        self._no_bodies = np.zeros((len(t.joints), PARAMETERS))
        self._no_actuators = np.zeros((OF_DRIVE, drives))
        self._no_actuators[WIDTH] = 1.0

    @cached_property
    def at_home(self) -> Array:
        """`Data.solution` at home, (4,)."""
        still = np.zeros((3, 1, len(self.tables.drives)))
        still[0] = self.home[self.tables.drives]
        rows, _ = self.forward_kinematics(*still)
        solution: Array = self.motion(rows).solution[0]
        return solution

    def motion(self, rows: Array) -> Data:
        """Return by name what rows of `forward_kinematics` hold."""
        return views(Data, self.sizes, rows)

    def forward_kinematics(self, q: Array, v: Array, a: Array, start: Array | None = None,
                           nearby: Array | None = None) -> tuple[Array, int]:
        """Return the motion of all links for positions, velocities and accelerations of the drives.

        Parameters
        ----------
        q, v, a : (N, D) arrays
        start : (N, C) array, optional
            Closed coordinates of the samples; the first one is walked to from there, instead of
            home.
        nearby : (C,) array, optional
            Closed coordinates of another motion: used where the first sample is within a stride
            of them and the loops stay assembled as at home, so that nothing depends on them.

        Returns
        -------
        rows : (N, K) array
        failed : int
            The first sample at which the loops do not close, or -1.
        """
        rows = np.zeros((len(q), self._lengths[0]))
        return rows, self._run(MOTION | KEPT, rows, np.array((q, v, a)), start, nearby)

    def forces(self, rows: Array, inertial: Array, gravity: Array,
               wrenches: Mapping[int, tuple[Array, Array]]) -> Loads:
        """Return what joints and closures transmit, for rows of `forward_kinematics`.

        Parameters
        ----------
        rows : (N, K) array
        inertial : (J + 1, 10) array
        gravity : (3,) array
        wrenches : mapping of int to (force, moment), (N, 3) each
            That links apply to the world, by the joints that move them, in the base's frame, about
            the origins of these joints [N, N m].
        """
        loads = np.zeros((len(rows), self._lengths[1]))
        o = views(Loads, self.sizes, loads)
        for joint, (force, moment) in wrenches.items():
            o.f[:, joint] += force
            o.n[:, joint] += moment
        self._run(FORCES | KEPT, rows, bodies=(inertial, gravity, loads))
        return o

    def joint_friction(self, rows: Array, loads: Loads, friction: JointFriction) -> Array:
        """Return the drives' efforts against friction of joints under loads, (N, D).

        Parameters
        ----------
        rows : (N, K) array
            See `forward_kinematics`.
        loads : Loads
        friction : JointFriction
        """
        found = np.zeros((len(rows), len(self.tables.drives)))
        # Loads are everybody's: what is of one friction alone does not go through them.
        run(oppose_friction, *self.packed, rows, loads.links, loads.loops, np.array(friction),
            np.empty(len(self.home)), found)
        return found

    def inverse_dynamics(self, motion: tuple[Array, Array, Array], inertial: Array,
                         gravity: Array, friction: JointFriction,
                         actuators: Array | None = None, start: Array | None = None,
                         nearby: Array | None = None) -> InverseDynamicsResult | None:
        """Return the efforts for a motion of the drives, in one pass that stores nothing else.

        Parameters
        ----------
        motion : three (N, D) arrays
            Position, velocity and acceleration of the drives.
        inertial : (J + 1, 10) array
        gravity : (3,) array
        friction : JointFriction
        actuators : (OF_DRIVE, D) array, optional
            See `actuator_efforts`; without it the drives have no rotor and no friction.
        start, nearby : (N, C) and (C,) arrays, optional
            See `forward_kinematics`.

        Returns
        -------
        InverseDynamicsResult or None
            None where a sample is out of reach or singular, which `forward_kinematics` says.
        """
        given, last = np.array(motion), self._friction
        if friction is not last[0]:
            last = self._friction = friction, np.array(friction)
        samples, drives = given.shape[1:]
        closed, efforts = np.empty((samples, len(self.home))), np.empty((EFFORTS, samples, drives))
        failed = self._run(
            MOTION | FORCES, np.empty((1, self._lengths[0])), given, start, nearby,
            (inertial, gravity, np.empty((1, self._lengths[1]))),
            (last[1], self._no_actuators if actuators is None else actuators, closed, efforts))
        return None if failed >= 0 else InverseDynamicsResult(closed, efforts, motion)

    def _run(self, stages: int, rows: Array, given: Array | None = None,
             start: Array | None = None, nearby: Array | None = None,
             bodies: tuple[Array, Array, Array] | None = None,
             results: tuple[Array, Array, Array, Array] | None = None) -> int:
        """Evaluate stages, and return the first sample that fails or -1; see `evaluate`."""
        warm = nearby is not None
        first = (nearby if nearby is not None else
                 self.home if start is None or not len(start) else start[0])
        return int(run(
            evaluate, *self.packed, self.home,
            self.at_home if warm or not stages & KEPT else NOWHERE, np.array(first),
            self._no_motion if given is None else given, rows,
            *(bodies or (self._no_bodies, NO_GRAVITY, np.empty((len(rows), self._lengths[1])))),
            *(results or (np.array(NO_FRICTION), self._no_actuators,
                          np.empty((len(rows), len(self.home))), self._no_efforts)), stages, warm))
