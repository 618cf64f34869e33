# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mechanism's motion in MuJoCo: its joints by name, and what the drives do when loops hold."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.description import Frame
from pprs_dynamics.physics.mechanism.structure import Structure

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
