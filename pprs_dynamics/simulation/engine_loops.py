# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Loops closed by the engine's own kinematics, and the forces in them.

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
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.tree_equations import AXES, KIND, LOOP, TRANSLATION

LEAST_SINGULAR = 1e-8  # of the largest singular value; closures may say a thing twice


class EngineState:
    """The state of a model of MuJoCo whose joints are those of a structure.

    Parameters
    ----------
    engine : module
        MuJoCo.
    model : mujoco.MjModel
    structure : Structure
    root : Frame
        MuJoCo's world in the structure's base.
    """

    def __init__(self, engine: Any, model: Any, structure: Structure, root: Frame) -> None:
        self.engine, self.model, self.data = engine, model, engine.MjData(model)
        self.structure, self.root = structure, root
        self.joints = {int(k): name for k in range(model.njnt) if (name := model.joint(k).name)}
        self._numbers = {name: k for k, name in self.joints.items()}

    @cached_property
    def drives(self) -> list[int]:
        """Degrees of freedom of the drives."""
        return [self.dof(name) for name in self.structure.drives]

    def dof(self, joint: str) -> int:
        """Return the degree of freedom of a joint of one coordinate."""
        return int(self.model.jnt_dofadr[self.number(joint)])

    def place(self, joint: str) -> int:
        """Return where the position of a joint of one coordinate is among the engine's."""
        return int(self.model.jnt_qposadr[self.number(joint)])

    def number(self, joint: str) -> int:
        """Return the number of a joint in the engine."""
        return self._numbers[joint]

    @cached_property
    def standing(self) -> Array:
        """Degrees of freedom of joints that are locked or held."""
        structure = self.structure
        held = set(structure.mobility.held.tolist())
        standing = [int(self.model.jnt_dofadr[k]) for k, name in self.joints.items()
                    if name in structure.description.joints and self.model.jnt_type[k] != 0 and (
                        name not in structure.rows
                        or int(structure.tables.coordinate[structure.rows[name]]) in held)]
        return np.array(standing, dtype=int)

    @cached_property
    def couplings(self) -> list[tuple[int, int, float, float]]:
        """Joints that follow others, by MuJoCo: their numbers, ratio and offset of positions."""
        model, off = self.model, self.engine.mjtDisableBit.mjDSBL_EQUALITY
        found = []
        for e in range(0 if model.opt.disableflags & off else model.neq):
            if model.eq_type[e] == self.engine.mjtEq.mjEQ_JOINT and model.eq_active0[e]:
                a, b = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
                y, x = (float(model.qpos0[model.jnt_qposadr[k]]) for k in (a, b))
                offset, ratio = model.eq_data[e, :2].tolist()
                found.append((a, b, ratio, y + offset - ratio * x))
        return found

    @cached_property
    def rest(self) -> Array:
        """Positions of all joints where the drives are at 0, (nq,): locked ones within limits."""
        model, rest = self.model, self.model.qpos0.copy()
        for name, position in self.structure.locked.items():
            k, at = self.number(name), self.place(name)
            rest[at] = np.clip(position, *model.jnt_range[k]) if model.jnt_limited[k] else position
        for _ in self.couplings:  # chains of them
            for a, b, ratio, offset in self.couplings:
                if self.joints[a] in self.structure.locked:
                    at, of = (model.jnt_qposadr[k] for k in (a, b))
                    rest[at] = ratio * rest[of] + offset
        return rest

    @cached_property
    def _hinged(self) -> tuple[Array, Array, Array]:
        """Joints of one coordinate: places in `qpos` and `qvel`, and rows of the tables."""
        found = [(int(self.model.jnt_qposadr[k]), int(self.model.jnt_dofadr[k]),
                  self.structure.rows[name]) for k, name in self.joints.items()
                 if name in self.structure.rows]
        q, v, rows = np.array(found, dtype=int).reshape(-1, 3).T
        return q, v, rows

    @cached_property
    def _free(self) -> list[tuple[int, int, int]]:
        """Free joints, as `_hinged`."""
        return [(int(self.model.jnt_qposadr[k]), int(self.model.jnt_dofadr[k]),
                 self.structure.links[self.structure.description.joints[name].child][0])
                for k, name in self.joints.items()
                if self.model.jnt_type[k] == self.engine.mjtJoint.mjJNT_FREE]

    def put(self, m: Any, k: int) -> None:
        """Put positions, velocities and accelerations of sample k of a motion in place."""
        t, data = self.structure.tables, self.data
        data.qpos[:], data.qvel[:], data.qacc[:] = self.rest, 0.0, 0.0
        for q, v, row in self._free:
            R = self.root.R.T @ m.R[k, row]
            quaternion = np.empty(4)
            self.engine.mju_mat2Quat(quaternion, R.ravel())
            data.qpos[q:q + 3] = self.root.R.T @ (m.p[k, row] - self.root.p)
            data.qpos[q + 3:q + 7] = quaternion
            for own, (linear, angular) in ((data.qvel, (m.u, m.w)), (data.qacc, (m.ud, m.wd))):
                own[v:v + 3] = self.root.R.T @ linear[k, row]
                own[v + 3:v + 6] = m.R[k, row].T @ angular[k, row]
        at, dofs, rows = self._hinged
        c, ratio = t.coordinate[rows], t.ratio[rows]
        data.qpos[at] = ratio * m.q[k, c] + t.offset[rows]
        data.qvel[dofs], data.qacc[dofs] = ratio * m.v[k, c], ratio * m.a[k, c]

    def driven(self, needed: Array, rows: Array) -> Array:
        """Return the drives' efforts, (D,), that with forces of closures give what is needed.

        Parameters
        ----------
        needed : (nv,) array
            Efforts of all joints of the tree.
        rows : (r, nv) array
            Derivatives of the closures.
        """
        dofs = self.drives
        if not len(rows) and len(dofs) == self.model.nv:
            return needed[dofs]
        columns = np.zeros((self.model.nv, len(dofs) + len(rows)))
        columns[dofs, np.arange(len(dofs))] = 1.0
        columns[:, len(dofs):] = rows.T
        # Joints that stand are driven by whatever holds them.
        moved = np.setdiff1d(np.arange(self.model.nv), self.standing)
        return np.linalg.lstsq(columns[moved], needed[moved],
                               rcond=LEAST_SINGULAR)[0][:len(dofs)]


CLOSED = 1e-11  # [m, rad], of Newton's last step
MOST_STEPS = 40
STRIDE = 0.05  # [m, rad] of a drive, from where loops were closed last
FEW_STEPS = 12  # after which derivatives are computed anew
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of three axes, cyclically
MOVE = 1e-4  # [m, rad], by which a joint moves for derivatives of derivatives


class ClosedMotion(NamedTuple):
    """The engine's coordinates along a motion, with closed loops.

    Parameters
    ----------
    position, velocity, acceleration : (N, nq), (N, nv) and (N, nv) arrays
    rates : (N, nv, D) array
        Velocities of all joints per rate of each drive.
    turns : (N, L, 3, nv) array
        Angular velocities of link B against link A of each closure, per velocity of each joint.
    reactions : (N, L, 3, nv) array
        Force of each closure on link B per effort of each joint of the tree.
    """

    position: Array
    velocity: Array
    acceleration: Array
    rates: Array
    turns: Array
    reactions: Array


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
        self._turning, self._of_loop = np.flatnonzero(~self._slides), self._rows[:, LOOP]
        self._root = state.root.inverse
        # Of both sides of each closure: the body, and its frame there.
        self._bodies = np.array([[links[int(row)] for row in side]
                                 for side in (t.loop_a, t.loop_b)], dtype=int)
        self._R, self._p = np.array([t.a_R, t.b_R]), np.array([t.a_p, t.b_p])
        for side, rows in enumerate((t.loop_a, t.loop_b)):
            for k, row in enumerate(rows):
                own = frames[int(row)].inverse @ Frame(self._R[side, k], self._p[side, k])
                self._R[side, k], self._p[side, k] = own.R, own.p
        self._fixed = self._bodies == 0
        self._about = model.body_rootid[model.dof_bodyid]
        moves = _moved_by(model)[self._bodies].astype(float)  # (2, L, nv)
        self._sign = moves[1] - moves[0]
        hangs = np.eye(model.nbody)
        for body in range(model.nbody - 1, 0, -1):
            hangs[model.body_parentid[body]] += hangs[body]
        # 1 where a closure's force on its second link acts through a body, -1 on its first.
        self.behind = hangs[:, self._bodies[1]] - hangs[:, self._bodies[0]]  # (bodies, L)
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
        R[self._fixed], p[self._fixed] = self._root.R, self._root.p
        return R @ self._R, p + np.einsum('slij,slj->sli', R, self._p)

    def _axes(self, R: Array) -> tuple[Array, ...]:
        """Return the axes of rotating rows, of A, B, A and B, (r, 3) each."""
        rows = self._rows[self._turning]
        return tuple(R[k % 2, rows[:, LOOP], :, rows[:, AXES + k]] for k in range(4))

    def _leads(self, R: Array) -> Array:
        """Return the directions along which rows take velocities of points, or angular, (r, 3)."""
        leads: Array = R[0, self._of_loop, :, self._rows[:, AXES]]
        if len(self._turning):
            a, b, c, d = self._axes(R)
            first, second = self._weights[:, self._turning, None]
            leads[self._turning] = first * cross(b, a) + second * cross(d, c)
        return leads

    def residuals(self, goal: Array) -> Array:
        """Return by how much drives (D,) are off, joints that stand, closures and couplings."""
        state = self.state
        qpos = state.data.qpos
        state.engine.mj_kinematics(state.model, state.data)
        R, p = self.frames()
        along = R[0, self._of_loop, :, self._rows[:, AXES]]
        closures = np.einsum('ri,ri->r', along, (p[1] - p[0])[self._of_loop])
        if len(self._turning):
            a, b, c, d = self._axes(R)
            first, second = self._weights[:, self._turning]
            closures[self._turning] = (first * np.einsum('ri,ri->r', a, b)
                                       + second * np.einsum('ri,ri->r', c, d))
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
        data = self.state.data
        turn, move = data.cdof[:, :3], data.cdof[:, 3:]
        about = data.subtree_com[self._about]
        arms = points[:, None] - about
        linear = self._sign[..., None] * (move + cross(turn, arms))
        angular = self._sign[..., None] * turn
        return linear.transpose(0, 2, 1), angular.transpose(0, 2, 1)

    def derivatives(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of the residuals, (r, nv), and what they consist of.

        These are the directions of the closures' rows, and the angular velocities of link B
        against link A per velocity of each joint, (L, 3, nv).
        """
        state = self.state
        state.engine.mj_kinematics(state.model, state.data)
        state.engine.mj_comPos(state.model, state.data)
        R, p = self.frames()
        linear, turns = self.relative(p[1])
        leads, moves = self._leads(R), linear[self._of_loop]
        moves[self._turning] = turns[self._of_loop[self._turning]]
        J = np.concatenate((self._given, np.einsum('ri,rin->rn', leads, moves), self._couplings))
        return J, leads, turns

    def _solved(self, J: Array) -> Array:
        """Return the inverse of the derivatives, or the pseudo-inverse of redundant rows."""
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
                self._inverse = self._solved(self.derivatives()[0])
            step = -self._inverse @ off
            state.engine.mj_integratePos(state.model, state.data.qpos, step, 1.0)
            if np.max(np.abs(step), initial=0.0) < CLOSED:
                return
        self._inverse = None
        raise WorkspaceError(0, 'the loops do not close in the physics engine',
                             'must be within reach, on the way from home')

    def put(self, position: Array, velocity: Array, acceleration: Array) -> ClosedMotion:
        """Put the engine in a motion of the drives, (D,) each, and return it as one sample."""
        state, data = self.state, self.state.data
        nv, loops = state.model.nv, self._bodies.shape[1]
        if self.is_open:
            data.qpos[self._places] = position
            data.qvel[state.drives], data.qacc[state.drives] = velocity, acceleration
            none = np.zeros((loops, 3, nv))
            return _sample(data, self._given[:self._count].T, none, none)
        self.close(position)
        there = data.qpos.copy()
        J, leads, turns = self.derivatives()
        inverse = self._solved(J)
        rates: Array = inverse[:, :self._count]
        v = rates @ velocity
        fastest = np.max(np.abs(v), initial=0.0)
        drift = np.zeros(inverse.shape[1])
        if fastest > 0:
            step = MOVE / fastest
            for sign in (1.0, -1.0):
                state.engine.mj_integratePos(state.model, data.qpos, v, sign * step)
                drift += sign * (self.derivatives()[0] @ v) / (2 * step)
                data.qpos[:] = there
        data.qvel[:] = v
        data.qacc[:] = rates @ acceleration - inverse @ drift
        self._inverse = inverse
        return _sample(data, rates, turns, self._reactions(J, inverse, leads))

    def _reactions(self, J: Array, inverse: Array, leads: Array) -> Array:
        """Return the forces of the closures per effort of each joint, (L, 3, nv).

        By (J^-1)' efforts of the tree become those of the rows. Redundant rows carry nothing: which
        of them carries a load is not determined.
        """
        found = np.zeros((self._bodies.shape[1], 3, J.shape[1]))
        first, count = len(self._given), len(self.state.structure.tables.passive)
        if J.shape[0] != J.shape[1]:
            carrying = np.concatenate((J[:first + count], J[first + len(self._rows):]))
            inverse = np.asarray(np.linalg.pinv(carrying, rcond=LEAST_SINGULAR), dtype=float)
        rows = np.flatnonzero(self._slides[:count])
        np.add.at(found, self._of_loop[rows],
                  leads[rows, :, None] * inverse.T[first + rows, None])
        return found

    def follow(self, motion: JointMotion) -> ClosedMotion:
        """Return the engine's motion along one of the drives, from the first sample on."""
        return ClosedMotion(*map(np.concatenate, zip(*(
            self.put(*drives) for drives in zip(
                motion.position, motion.velocity, motion.acceleration, strict=True)),
            strict=True)))


def _sample(data: Any, rates: Array, turns: Array, reactions: Array) -> ClosedMotion:
    """Return the engine's state as a motion of one sample."""
    return ClosedMotion(*(np.array(each)[None] for each in (
        data.qpos, data.qvel, data.qacc, rates, turns, reactions)))


def cross(a: Array, b: Array) -> Array:
    """Return vector products of the last axis; NumPy's own takes five times as long for few."""
    product: Array = (a.take(NEXT, axis=-1) * b.take(LAST, axis=-1)
                      - a.take(LAST, axis=-1) * b.take(NEXT, axis=-1))
    return product


def _moved_by(model: Any) -> np.typing.NDArray[np.bool_]:
    """Return which of the engine's velocities move each body, (bodies, nv)."""
    found = np.zeros((model.nbody, model.nv), dtype=bool)
    for body in range(1, model.nbody):
        first, count = int(model.body_dofadr[body]), int(model.body_dofnum[body])
        found[body] = found[model.body_parentid[body]]
        found[body, max(first, 0):max(first, 0) + count] = True
    return found
