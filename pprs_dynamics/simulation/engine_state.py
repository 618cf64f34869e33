# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mechanism's motion in the engine's coordinates, and its closures there.

The model closes the loops; MuJoCo places the links itself and must find the loops closed. J is
MuJoCo's Jacobian of the drives, joints that stand, coupled joints and closures, so that
J v = (v_a, 0). The rates of all joints T are the columns of J^-1 that belong to the drives. Of the
closures only the rows that determine passive joints are in J; which of several redundant rows
carries a load is not determined.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.description import Frame
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.structure import Structure

SITE, TOOL = '_of_pprs_', 'tool'  # what names of sites of ours begin with; that of the tool
LEAST_SINGULAR = 1e-8  # of the largest singular value; closures may say a thing twice
OPEN = 1e-6  # [m, rad], by which MuJoCo may find a closure or a coupling open: rounding


class EngineMotion(NamedTuple):
    """A motion in the engine's coordinates, with closed loops.

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
        self.sites = {model.site(k).name.removeprefix(SITE): k for k in range(model.nsite)
                      if model.site(k).name.startswith(SITE)}
        self.joints = {int(k): name for k in range(model.njnt) if (name := model.joint(k).name)}
        self.numbers = {name: k for k, name in self.joints.items()}

    @cached_property
    def drives(self) -> list[int]:
        """Degrees of freedom of the drives."""
        return [self.dof(name) for name in self.structure.drives]

    def dof(self, joint: str) -> int:
        """Return the degree of freedom of a joint of one coordinate."""
        return int(self.model.jnt_dofadr[self.numbers[joint]])

    def place(self, joint: str) -> int:
        """Return where the position of a joint of one coordinate is among the engine's."""
        return int(self.model.jnt_qposadr[self.numbers[joint]])

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
        for name in self.structure.locked.keys() & self.numbers.keys():  # none is in an export
            k, at, position = self.numbers[name], self.place(name), self.structure.locked[name]
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

    def coordinates(self, links: LinkMotion) -> tuple[Array, Array, Array]:
        """Return positions (N, nq), velocities and accelerations (N, nv) of a motion."""
        t, m, root = self.structure.tables, links.motion, self.root
        position = np.tile(self.rest, (len(m.q), 1))
        velocity, acceleration = np.zeros((2, len(m.q), self.model.nv))
        for q, v, row in self._free:
            position[:, q:q + 3] = (m.p[:, row] - root.p) @ root.R
            position[:, q + 3:q + 7] = quaternion(root.R.T @ m.R[:, row])
            for own, linear, angular in ((velocity, m.u, m.w), (acceleration, m.ud, m.wd)):
                own[:, v:v + 3] = linear[:, row] @ root.R
                own[:, v + 3:v + 6] = np.einsum('nji,nj->ni', m.R[:, row], angular[:, row])
        at, dofs, rows = self._hinged
        c, ratio = t.coordinate[rows], t.ratio[rows]
        position[:, at] = ratio * m.q[:, c] + t.offset[rows]
        velocity[:, dofs], acceleration[:, dofs] = ratio * m.v[:, c], ratio * m.a[:, c]
        return position, velocity, acceleration

    def closed(self, links: LinkMotion) -> EngineMotion:
        """Return a motion in the engine's coordinates.

        Raises
        ------
        ModelError
            Where a closure or a coupled joint of the model is open in the engine.
        """
        t, engine, model, data = self.structure.tables, self.engine, self.model, self.data
        position, velocity, acceleration = self.coordinates(links)
        samples, loops, nv = len(position), len(t.closures), model.nv
        frames, moves, turns = (np.zeros((samples, loops, *shape)) for shape in (
            (tree.OF_CLOSURE, 3), (3, nv), (3, nv)))
        linear, angular = np.empty((2, 3, nv))
        for n in range(samples if loops else 0):
            data.qpos[:] = position[n]
            engine.mj_kinematics(model, data)
            engine.mj_comPos(model, data)
            for k in range(loops):
                for side, R, p, sign in (('a', tree.A_R, tree.A_P, -1.0),
                                         ('b', tree.B_R, tree.B_P, 1.0)):
                    site = self.sites[f'{side}{k}']
                    frames[n, k, R:R + 3] = data.site_xmat[site].reshape(3, 3)
                    frames[n, k, p] = data.site_xpos[site]
                    engine.mj_jacSite(model, data, linear, angular, site)
                    moves[n, k] += sign * linear
                    turns[n, k] += sign * angular
        rows = t.rows[:len(t.passive)]
        of_loop, slides = rows[:, tree.LOOP], rows[:, tree.KIND] == tree.TRANSLATION
        # (samples, rows, 3)
        leads = frames[:, of_loop, tree.A_R:tree.A_R + 3, rows[:, tree.AXES]].swapaxes(0, 1)
        apart = frames[:, of_loop, tree.B_P] - frames[:, of_loop, tree.A_P]
        off = np.einsum('nri,nri->nr', leads, apart)
        m: Any = SimpleNamespace(loops=np.moveaxis(frames, 0, -1))  # equations on arrays
        for r in np.flatnonzero(~slides).tolist():
            leads[:, r], off[:, r] = np.array([*tree.row_axis(t, m, r)]).T, tree.residual(t, m, r)
        self._require_closed(position, off)
        first, drives = len(self._fixed_rows), len(self.drives)
        J = np.empty((samples, first + len(rows), nv))
        J[:, :first] = self._fixed_rows
        J[:, first:] = np.einsum('nri,nriv->nrv', leads, np.where(
            slides[:, None, None], moves[:, of_loop], turns[:, of_loop]))
        inverse = (np.linalg.inv(J) if J.shape[1] == nv
                   else np.linalg.pinv(J, rcond=LEAST_SINGULAR))
        # By J^-T efforts of the tree become those of the rows.
        reactions = np.zeros((samples, loops, 3, nv))
        for r in np.flatnonzero(slides).tolist():
            reactions[:, of_loop[r]] += leads[:, r, :, None] * inverse[:, None, :, first + r]
        return EngineMotion(position, velocity, acceleration, inverse[:, :, :drives], turns,
                            reactions)

    @cached_property
    def _fixed_rows(self) -> Array:
        """Derivatives of the drives, of joints that stand, and of coupled joints, (r, nv)."""
        dofs, standing = self.model.jnt_dofadr, self.standing.tolist()
        coupled = [(dofs[a], dofs[b], ratio) for a, b, ratio, _ in self.couplings
                   if dofs[a] not in standing]
        alone = [*self.drives, *standing]
        rows = np.zeros((len(alone) + len(coupled), self.model.nv))
        rows[np.arange(len(alone)), alone] = 1.0
        for row, (follower, leader, ratio) in zip(rows[len(alone):], coupled, strict=True):
            row[follower], row[leader] = 1.0, -ratio
        return rows

    def _require_closed(self, position: Array, off: Array) -> None:
        """Raise ModelError where a row of a closure (N, r), or a coupled joint, is open."""
        at = self.model.jnt_qposadr
        coupled = [position[:, at[a]] - ratio * position[:, at[b]] - offset
                   for a, b, ratio, offset in self.couplings]
        largest = np.abs(np.column_stack((off, *coupled))).max(axis=0, initial=0.0)
        if np.max(largest, initial=0.0) > OPEN:
            k = int(np.argmax(largest))
            name = (self.structure.loops[self.structure.tables.rows[k, tree.LOOP]].name
                    if k < off.shape[1] else self.joints[self.couplings[k - off.shape[1]][0]])
            raise ModelError(name, f'open by {largest[k]:.3g} in MuJoCo',
                             'be closed as in the model: please report this file')


def add_sites(spec: Any, structure: Structure, bodies: Mapping[int, tuple[Any, Frame]]) -> None:
    """Add sites for the tool and both sides of each closure to a specification of MuJoCo.

    Parameters
    ----------
    spec : mujoco.MjSpec
    structure : Structure
    bodies : mapping of int to (body, Frame)
        The body that each joint moves, 0 for the base, and its frame in the joint's.
    """
    t = structure.tables
    sites = {TOOL: structure.links[structure.tool]} | {
        f'{side}{k}': (int(row), Frame(R[k], p[k])) for side, rows, R, p in (
            ('a', t.loop_a, t.a_R, t.a_p), ('b', t.loop_b, t.b_R, t.b_p))
        for k, row in enumerate(rows)}
    for name, (row, frame) in sites.items():
        body, own = bodies[row]
        there = own.inverse @ frame
        body.add_site(name=f'{SITE}{name}', pos=there.p, quat=quaternion(there.R))


def quaternion(R: Array) -> Array:
    """Return MuJoCo's quaternions w x y z of rotations, (..., 4)."""
    return np.roll(Rotation.from_matrix(R).as_quat(), 1, axis=-1)
