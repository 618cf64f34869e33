# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion of all links of a mechanism, and what follows from it: loads, friction, regressor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism.description import PARAMETERS, Frame
from pprs_dynamics.physics.mechanism.state import StructureLoad
from pprs_dynamics.physics.mechanism.structure import Structure
from pprs_dynamics.physics.mechanism.tree_equations import (
    CONDITION,
    DETERMINANT,
    KIND,
    LOOP,
    OPEN_IN_MOTION,
    TRANSLATION,
    WORST_CONDITION,
    Data,
    Integers,
    JointFriction,
    Loads,
    residual,
)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """The motion of all links of a structure, at N samples.

    Parameters
    ----------
    structure : Structure
    rows : (N, K) array
        See `Evaluation.forward_kinematics`.
    """

    structure: Structure
    rows: Array

    @classmethod
    def of(cls, structure: Structure, position: Array, velocity: Array, acceleration: Array,
           start: Array | None = None, nearby: Array | None = None) -> LinkMotion:
        """Return the motion, or raise as `Mechanism.at`; see `Evaluation.forward_kinematics`."""
        rows, failed = structure.evaluation.forward_kinematics(
            position, velocity, acceleration, start, nearby)
        if failed >= 0:
            raise WorkspaceError(failed, 'the loops do not close for the positions of the drives',
                                 'must be within reach, on the way from home')
        found = cls(structure, rows)
        if len(structure.tables.passive):
            found._require_regular()
        found._require_closed()
        return found

    def part(self, samples: slice) -> LinkMotion:
        """Return the motion of some samples."""
        return LinkMotion(self.structure, self.rows[samples])

    @cached_property
    def motion(self) -> Data:
        """The motion by name."""
        return self.structure.evaluation.motion(self.rows)

    @property
    def condition(self) -> Array:
        """Condition number of the loops over that at home, (N,); 0 without loops."""
        home = self.structure.evaluation.at_home[CONDITION]
        condition: Array = self.motion.solution[:, CONDITION] / (home or 1.0)
        return condition

    def _require_regular(self) -> None:
        home = self.structure.evaluation.at_home[DETERMINANT]
        lost = ~(self.motion.solution[:, DETERMINANT] * home > 0)
        if lost.any():
            raise SingularityError(
                int(np.argmax(lost)), 'the motion leaves the assembly of home through a '
                'singularity', 'the determinant of the loops must keep its sign')
        condition = self.condition
        poor = ~(condition < WORST_CONDITION)
        if poor.any():
            worst = int(np.argmax(poor))
            raise SingularityError(
                worst, f'the loops are {condition[worst]:.3g} times worse conditioned than at home',
                f'must be below {WORST_CONDITION:g}: the drives nearly lose hold')

    def _require_closed(self) -> None:
        """Raise WorkspaceError where rows that others implied at home no longer follow from them.

        At a home where joints are in line, others become dependent than elsewhere.
        """
        t = self.structure.tables
        implied = np.arange(len(t.passive), len(t.rows))
        if not len(implied):
            return
        m = Data(*(np.moveaxis(array, 0, -1) for array in self.motion))  # equations on arrays
        residuals = np.stack([residual(t, m, int(r)) for r in implied], axis=-1)
        size = np.abs(residuals) / t.row_unit[implied]
        if np.all(size < OPEN_IN_MOTION):
            return
        sample = int(np.argmax(~np.all(size < OPEN_IN_MOTION, axis=1)))
        worst = int(np.argmax(size[sample]))
        row = implied[worst]
        by = abs(residuals[sample, worst])
        amount = (f'{1e3 * by:.3g} mm' if t.rows[row, KIND] == TRANSLATION
                  else f'{np.degrees(by):.3g} degrees')
        raise WorkspaceError(
            sample, f'the loop {self.structure.loops[t.rows[row, LOOP]].name} is open by {amount}',
            'must close as at home, where it follows from the other loops and joints alone: name a '
            'robot.home at which no links are in line')

    def frame_of(self, link: str) -> Frame:
        """Return the frames of a link in the base's, R (N, 3, 3) and p (N, 3)."""
        row, frame = self.structure.links[link]
        m = self.motion
        return Frame(m.R[:, row] @ frame.R, m.p[:, row] + m.R[:, row] @ frame.p)

    @cached_property
    def link_jacobians(self) -> tuple[Array, Array]:
        """Angular and linear velocity of links per rate of drives, (N, J + 1, 3, D)."""
        t, m = self.structure.tables, self.motion
        W, U = np.zeros((2, len(m.q), len(t.parent), 3, len(t.drives)))
        for j in range(1, len(t.parent)):
            i = t.parent[j]
            W[:, j] = W[:, i]
            U[:, j] = U[:, i] + np.cross(W[:, i], (m.p[:, j] - m.p[:, i])[..., None], axis=1)
            own = W if t.turns[j] else U
            own[:, j] += t.ratio[j] * (m.z[:, j, :, None]
                                       * m.drive_to_joint[:, t.coordinate[j], None, :])
        return W, U

    def loads(self, inertial: Array, gravity: Array, load: StructureLoad | None = None) -> Loads:
        """Return what joints and closures transmit without friction; see `Evaluation.forces`."""
        return self.structure.evaluation.forces(
            self.rows, inertial, gravity, {} if load is None else self.wrenches_of(load))

    def friction(self, loads: Loads, friction: JointFriction) -> Array:
        """Return the drives' efforts against friction of joints under loads, (N, D)."""
        return self.structure.evaluation.joint_friction(self.rows, loads, friction)

    @property
    def tool_velocity(self) -> Array:
        """Linear velocity of the tool's origin and angular velocity, in `base`, (N, 6)."""
        row, _ = self.structure.links[self.structure.tool]
        m = self.motion
        arm = self.frame_of(self.structure.tool).p - m.p[:, row]
        return np.concatenate((m.u[:, row] + np.cross(m.w[:, row], arm), m.w[:, row]), axis=1)

    def joint_position(self, joint: str) -> Array:
        """Return the position of a passive joint of the tree, (N,) [rad, m]."""
        t, row = self.structure.tables, self.structure.rows[joint]
        position: Array = t.ratio[row] * self.motion.q[:, t.coordinate[row]] + t.offset[row]
        return position

    def wrenches_of(self, load: StructureLoad) -> dict[int, tuple[Array, Array]]:
        """Return a load as wrenches that links apply, by the joints that move them."""
        t, m = self.structure.tables, self.motion
        row, _ = self.structure.links[self.structure.tool]
        arm = self.frame_of(self.structure.tool).p - m.p[:, row]
        force, moment = load.wrench[:, :3], load.wrench[:, 3:]
        found = {row: (force, moment + np.cross(arm, force))}
        for name, torque in load.torques.items():
            row = self.structure.rows[name]
            along = torque[:, None] * m.z[:, row]
            none = np.zeros_like(along)
            # What the link of a joint applies, the one that it hangs on takes back.
            for joint, sign in ((row, 1.0), (int(t.parent[row]), -1.0)):
                arm = m.p[:, row] - m.p[:, joint]
                force, moment = (none, sign * along) if t.turns[row] else (
                    sign * along, sign * np.cross(arm, along))
                before = found.get(joint, (none, none))
                found[joint] = (before[0] + force, before[1] + moment)
        return found

    def regressor(self, rows: Integers, gravity: Array) -> Array:
        """Return the derivatives of the efforts by the parameters of bodies, (N, D, 10 B)."""
        m = self.motion
        R = m.R[:, rows]

        def own(values: Array) -> Array:
            """Return vectors, or columns of vectors, in the axes of their bodies."""
            turned: Array = np.einsum('nbji,nbj...->nbi...', R, values)
            return turned

        W, U = (own(each[:, rows]) for each in self.link_jacobians)
        w, wd = own(m.w[:, rows])[..., None], own(m.wd[:, rows])[..., None]
        a = own(m.ud[:, rows] - gravity)[..., None]

        def cross(x: Array, y: Array) -> Array:
            return np.stack([x[:, :, (i + 1) % 3] * y[:, :, (i + 2) % 3]
                             - x[:, :, (i + 2) % 3] * y[:, :, (i + 1) % 3] for i in range(3)],
                            axis=2)

        samples, drives = len(m.q), U.shape[-1]
        found = np.empty((samples, drives, len(rows), PARAMETERS))
        found[..., 0] = np.sum(U * a, axis=2).transpose(0, 2, 1)
        moment = (cross(U, wd) + w * np.sum(U * w, axis=2, keepdims=True)
                  - U * np.sum(w * w, axis=2, keepdims=True) + cross(a, W))
        found[..., 1:4] = moment.transpose(0, 3, 1, 2)
        c = cross(W, w)
        for k, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
            column = W[:, :, i] * wd[:, :, j] + c[:, :, i] * w[:, :, j]
            if i != j:
                column = column + W[:, :, j] * wd[:, :, i] + c[:, :, j] * w[:, :, i]
            found[..., 4 + k] = column.transpose(0, 2, 1)
        return found.reshape(samples, drives, -1)
