# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Loops closed by the engine's own kinematics, and what they transmit.

J is the engine's Jacobian of the drives, the closures, coupled joints and locked joints, so that
J v = (v_a, 0). Positions come from Newton's method. The rates of all joints T are the columns of
J^+ that belong to the drives. Accelerations use J_dot v by differences along the motion. Of the
closures' forces only those of rows that determine passive joints are computed; which of several
redundant rows carries a load is not determined.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.mechanism.description import Frame
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.tree_equations import AXES, KIND, LOOP, TRANSLATION
from pprs_dynamics.simulation.engine_state import LEAST_SINGULAR, EngineState

CLOSED = 1e-11  # [m, rad], of Newton's last step
MOST_STEPS = 40
STRIDE = 0.05  # [m, rad] of a drive, from where loops were closed last
FEW_STEPS = 12  # after which derivatives are computed anew
MOVE = 1e-4  # [m, rad], by which a joint moves for derivatives of derivatives


class ClosedMotion(NamedTuple):
    """The engine's coordinates along a motion, its loops closed.

    Parameters
    ----------
    position, velocity, acceleration : (N, nq), (N, nv) and (N, nv) arrays
    rates : (N, nv, D) array
        Velocities per rate of each drive.
    """

    position: Array
    velocity: Array
    acceleration: Array
    rates: Array


class EngineLoops:
    """The closures and coupled joints of a mechanism in the engine.

    Parameters
    ----------
    state : EngineState
    links : mapping of int to int
        The engine's bodies by the joints that move them.
    frames : mapping of int to Frame
        Those of the bodies in the frames of their joints.
    """

    def __init__(self, state: EngineState, links: Mapping[int, int],
                 frames: Mapping[int, Frame]) -> None:
        self.state = state
        model, t = state.model, state.structure.tables
        self._rows, self._weights = t.rows, t.row_reals[:, :2].T
        self._slides = self._rows[:, KIND] == TRANSLATION
        # Of both sides of each closure: the body, and its frame there.
        self._bodies = np.array([[links[int(row)] for row in side]
                                 for side in (t.loop_a, t.loop_b)], dtype=int)
        self._R, self._p = np.array([t.a_R, t.b_R]), np.array([t.a_p, t.b_p])
        for side, rows in enumerate((t.loop_a, t.loop_b)):
            for k, row in enumerate(rows):
                own = frames[int(row)].inverse @ Frame(self._R[side, k], self._p[side, k])
                self._R[side, k], self._p[side, k] = own.R, own.p
        self._moves = _moved_by(model)[self._bodies]  # (2, L, nv)
        self._sign = self._moves[1].astype(float) - self._moves[0]
        self._coupled = [(*(int(model.jnt_qposadr[k]) for k in (a, b)),
                          *(int(model.jnt_dofadr[k]) for k in (a, b)), ratio, offset)
                         for a, b, ratio, offset in state.couplings
                         if model.jnt_dofadr[a] not in state.standing]
        self._couplings = np.zeros((len(self._coupled), model.nv))
        for row, (_, _, dof, leader, ratio, _) in zip(self._couplings, self._coupled, strict=True):
            row[dof], row[leader] = 1.0, -ratio
        self._places = [state.place(name) for name in state.structure.drives]
        given = [*state.drives, *state.standing.tolist()]
        self._given = np.zeros((len(given), model.nv))
        self._given[np.arange(len(given)), given] = 1.0
        self._inverse: Array | None = None

    @property
    def _count(self) -> int:
        return len(self._places)

    @cached_property
    def is_open(self) -> bool:
        """Whether the drives are all joints: nothing is to be closed."""
        return not (len(self._rows) or self._coupled) and len(self._given) == self.state.model.nv

    def frames(self) -> tuple[Array, Array]:
        """Return frames A and B of the closures in the world, (2, L, 3, 3) and (2, L, 3)."""
        data, bodies = self.state.data, self._bodies
        R, p = data.xmat[bodies].reshape(*bodies.shape, 3, 3), data.xpos[bodies]
        # The engine's world is the root of the description; what is fixed is so in the base.
        root, fixed = self.state.root.inverse, bodies == 0
        R[fixed], p[fixed] = root.R, root.p
        return R @ self._R, p + np.einsum('slij,slj->sli', R, self._p)

    def _axes(self, R: Array) -> tuple[Array, ...]:
        """Return the axes of each row, of A, B, A and B, (r, 3) each."""
        loops, axes = self._rows[:, LOOP], self._rows[:, AXES:AXES + 4].T
        return tuple(R[k % 2, loops, :, axes[k]] for k in range(4))

    def _leads(self, R: Array) -> Array:
        """Return what rows multiply relative velocities by: of points, or angular, (r, 3)."""
        a, b, c, d = self._axes(R)
        first, second = self._weights[..., None]
        leads: Array = np.where(self._slides[:, None], a,
                                first * cross(b, a) + second * cross(d, c))
        return leads

    def residuals(self, goal: Array) -> Array:
        """Return by how much drives (D,) are off, joints that stand, closures and couplings."""
        state = self.state
        qpos = state.data.qpos
        state.engine.mj_kinematics(state.model, state.data)
        R, p = self.frames()
        a, b, c, d = self._axes(R)
        first, second = self._weights
        closures = np.where(
            self._slides, np.sum(a * (p[1] - p[0])[self._rows[:, LOOP]], axis=1),
            first * np.sum(a * b, axis=1) + second * np.sum(c * d, axis=1))
        return np.concatenate((
            qpos[self._places] - goal, np.zeros(len(self._given) - self._count), closures,
            [qpos[place] - ratio * qpos[leader] - offset
             for place, leader, _, _, ratio, offset in self._coupled]))

    def relative(self, points: Array) -> tuple[Array, Array]:
        """Return the velocities of B's points and links against A's links, (L, 3, nv) each.

        Parameters
        ----------
        points : (L, 3) array
            In the world.
        """
        model, data = self.state.model, self.state.data
        turn, move = data.cdof[:, :3], data.cdof[:, 3:]
        about = data.subtree_com[model.body_rootid[model.dof_bodyid]]
        arms = points[:, None] - about
        linear = self._sign[..., None] * (move + cross(turn, arms))
        angular = self._sign[..., None] * turn
        return linear.transpose(0, 2, 1), angular.transpose(0, 2, 1)

    def derivatives(self) -> Array:
        """Return the derivatives of all residuals where the engine is, (r, nv)."""
        state = self.state
        state.engine.mj_kinematics(state.model, state.data)
        state.engine.mj_comPos(state.model, state.data)
        R, p = self.frames()
        linear, angular = self.relative(p[1])
        loops = self._rows[:, LOOP]
        moves = np.where(self._slides[:, None, None], linear[loops], angular[loops])
        return np.concatenate((self._given, np.einsum('ri,rin->rn', self._leads(R), moves),
                               self._couplings))

    def _solved(self) -> Array:
        J = self.derivatives()
        if J.shape[0] == J.shape[1]:
            try:
                inverse: Array = np.asarray(np.linalg.inv(J), dtype=float)
            except np.linalg.LinAlgError:
                pass  # closures say a thing twice
            else:
                if np.abs(inverse).max() < 1 / LEAST_SINGULAR:
                    return inverse
        return np.asarray(np.linalg.pinv(J, rcond=LEAST_SINGULAR), dtype=float)

    def forget(self) -> None:
        """Find derivatives anew where loops are closed next: the engine was put elsewhere."""
        self._inverse = None

    def close(self, goal: Array) -> None:
        """Move the engine to drives' positions (D,), its loops closed, from where it is.

        Raises
        ------
        WorkspaceError
            Where they do not close.
        """
        data = self.state.data
        start = data.qpos[self._places].copy()
        strides = max(1, int(np.ceil(np.max(np.abs(goal - start)) / STRIDE)))
        for k in range(1, strides + 1):
            self._newton(start + (goal - start) * k / strides)

    def _newton(self, goal: Array) -> None:
        state = self.state
        for n in range(MOST_STEPS):
            off = self.residuals(goal)
            if self._inverse is None or n >= FEW_STEPS:
                self._inverse = self._solved()
            step = -self._inverse @ off
            state.engine.mj_integratePos(state.model, state.data.qpos, step, 1.0)
            if np.max(np.abs(step), initial=0.0) < CLOSED:
                return
        self._inverse = None
        raise WorkspaceError(0, 'the loops do not close in the physics engine',
                             'must be within reach, on the way from home')

    def put(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Put the engine in a motion of the drives, (D,) each, and return all rates, (nv, D)."""
        state, data = self.state, self.state.data
        if self.is_open:
            data.qpos[self._places] = position
            data.qvel[state.drives], data.qacc[state.drives] = velocity, acceleration
            return self._given[:self._count].T
        self.close(position)
        there = data.qpos.copy()
        inverse = self._solved()
        rates: Array = inverse[:, :self._count]
        v = rates @ velocity
        fastest = np.max(np.abs(v), initial=0.0)
        drift = np.zeros(inverse.shape[1])
        if fastest > 0:
            step = MOVE / fastest
            for sign in (1.0, -1.0):
                state.engine.mj_integratePos(state.model, data.qpos, v, sign * step)
                drift += sign * (self.derivatives() @ v) / (2 * step)
                data.qpos[:] = there
        data.qvel[:] = v
        data.qacc[:] = rates @ acceleration - inverse @ drift
        self._inverse = inverse
        return rates

    def follow(self, motion: JointMotion) -> ClosedMotion:
        """Return the engine's motion along one of the drives, from the first sample on."""
        data, model = self.state.data, self.state.model
        q = np.empty((len(motion), model.nq))
        v, a = np.empty((2, len(motion), model.nv))
        rates = np.empty((len(motion), model.nv, self._count))
        for k in range(len(motion)):
            rates[k] = self.put(motion.position[k], motion.velocity[k], motion.acceleration[k])
            q[k], v[k], a[k] = data.qpos, data.qvel, data.qacc
        return ClosedMotion(q, v, a, rates)

    def transmitted(self, needed: Array, efforts: Array) -> Array:
        """Return what the closures transmit, force on B at its point and moment, (L, 6).

        Parameters
        ----------
        needed : (nv,) array
            Efforts of all joints of the tree, where the engine is.
        efforts : (D,) array
            Of the drives.
        """
        found = np.zeros((self._bodies.shape[1], 6))
        count = len(self.state.structure.tables.passive)
        if not count:
            return found
        first = len(self._given)
        J = self.derivatives()
        carrying = np.concatenate((J[self._count:first + count], J[first + len(self._rows):]))
        left = needed.copy()
        left[self.state.drives] -= efforts
        amounts = np.linalg.lstsq(carrying.T, left, rcond=LEAST_SINGULAR)[0]
        of_rows = amounts[first - self._count:][:count]
        leads = self._leads(self.frames()[0])
        for row, slides, lead, amount in zip(self._rows, self._slides, leads, of_rows,
                                             strict=False):
            part = slice(0, 3) if slides else slice(3, 6)
            found[row[LOOP], part] += amount * lead
        return found

    def apply(self, forces: Array) -> None:
        """Add the closures' forces (L, 6) to those on the engine's bodies."""
        data, at = self.state.data, self.frames()[1][1]
        for bodies, sign in zip(self._bodies, (-1.0, 1.0), strict=True):
            moments = forces[:, 3:] + cross(at - data.xipos[bodies], forces[:, :3])
            np.add.at(data.xfrc_applied, bodies, sign * np.concatenate(
                (forces[:, :3], moments), axis=1))


def cross(a: Array, b: Array) -> Array:
    """Return vector products of the last axis; NumPy's own takes five times as long for few."""
    product: Array = (a[..., [1, 2, 0]] * b[..., [2, 0, 1]]
                      - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])
    return product


def _moved_by(model: Any) -> np.typing.NDArray[np.bool_]:
    """Return which of the engine's velocities move each body, (bodies, nv)."""
    found = np.zeros((model.nbody, model.nv), dtype=bool)
    for body in range(1, model.nbody):
        first, count = int(model.body_dofadr[body]), int(model.body_dofnum[body])
        found[body] = found[model.body_parentid[body]]
        found[body, max(first, 0):max(first, 0) + count] = True
    return found
