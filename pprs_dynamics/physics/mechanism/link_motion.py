# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Motion of all links of a mechanism, and what follows from it: loads, friction, regressor.

It follows from the motion of the drives or, of a robot with loops, from that of the tool. The
tool's pose becomes six coordinates of the mechanism, three slides along the base's axes and three
turns about the tool's axes at home, tied to the tool by a closure of type `fixed`. Of these
coordinates as many are given as the robot has drives; the drives are then passive, and the loops
are closed for them as they are for the drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.errors import ModelError, SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.description import (
    CONTINUOUS,
    PARAMETERS,
    PRISMATIC,
    Frame,
    Joint,
    Loop,
)
from pprs_dynamics.physics.mechanism.evaluation import run
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.state import StructureLoad
from pprs_dynamics.physics.mechanism.structure import (
    RANK,
    Structure,
    build_structure,
    independent_rows,
    opening,
)

COORDINATES = ('x', 'y', 'z', 'yaw', 'pitch', 'roll')
NO_GUIDES = np.zeros(0, dtype=np.int64)
SLIDES = 3  # the first of them
AXES = np.eye(3)[[0, 1, 2, 2, 1, 0]]
POSE = 'tool_pose.'  # what the names of their joints begin with
# What a robot with less than six drives cannot choose may be off by this much [m, rad]: poses in
# messages are rounded, and a tool's frame is drawn to no better.
FOLLOWED = 1e-3


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
            raise WorkspaceError(failed, 'the loops do not close for drives at '
                                 f'{np.round(position[failed], 6).tolist()}',
                                 'must be within reach, on the way from home')
        found = cls(structure, rows)
        if len(structure.tables.passive):
            found._require_regular()
        found._require_closed()
        return found

    @cached_property
    def motion(self) -> tree.Data:
        """The motion by name."""
        return self.structure.evaluation.motion(self.rows)

    @property
    def condition(self) -> Array:
        """Condition number of the loops over that at home, (N,); 0 without loops."""
        home = self.structure.evaluation.at_home[tree.CONDITION]
        condition: Array = self.motion.solution[:, tree.CONDITION] / (home or 1.0)
        return condition

    def _require_regular(self) -> None:
        home = self.structure.evaluation.at_home[tree.DETERMINANT]
        lost = ~(self.motion.solution[:, tree.DETERMINANT] * home > 0)
        if lost.any():
            raise SingularityError(
                int(np.argmax(lost)), 'the motion departs from the assembly at home through a '
                'singularity', 'the determinant of the loops must keep its sign')
        condition = self.condition
        poor = ~(condition < tree.WORST_CONDITION)
        if poor.any():
            worst = int(np.argmax(poor))
            raise SingularityError(
                worst, f'the loops are {condition[worst]:.3g} times worse conditioned than at home',
                f'must be below {tree.WORST_CONDITION:g}: the drives nearly lose hold')

    def _require_closed(self) -> None:
        """Raise WorkspaceError where rows that others implied at home no longer follow from them.

        At a home where joints are in line, others become dependent than elsewhere.
        """
        t = self.structure.tables
        implied = np.arange(len(t.passive), len(t.rows))
        if not len(implied):
            return
        m = tree.Data(*(np.moveaxis(array, 0, -1) for array in self.motion))  # equations on arrays
        residuals = np.stack([tree.residual(t, m, int(r)) for r in implied], axis=-1)
        size = np.abs(residuals) / t.row_unit[implied]
        if np.all(size < tree.OPEN_IN_MOTION):
            return
        sample = int(np.argmax(~np.all(size < tree.OPEN_IN_MOTION, axis=1)))
        worst = int(np.argmax(size[sample]))
        row = implied[worst]
        amount = opening(t.rows[row, tree.KIND], residuals[sample, worst])
        loop = self.structure.loops[t.rows[row, tree.LOOP]]
        raise WorkspaceError(
            sample, f'the loop {loop.name} is open by {amount}',
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
        return tree.link_jacobians(self.structure.tables, self.motion, self.motion.drive_to_joint)

    def loads(self, inertial: Array, gravity: Array, load: StructureLoad | None = None,
              ) -> tree.Loads:
        """Return the frictionless loads of joints and closures.

        Parameters
        ----------
        inertial : (J + 1, 10) array
        gravity : (3,) array
        load : StructureLoad, optional
        """
        table, found = self._no_loads()
        for row, wrench in self.wrenches(load):
            found.f[:, row] += wrench[:, :3]
            found.n[:, row] += wrench[:, 3:]
        self.structure.evaluation.run(
            tree.FORCES | tree.KEPT, self.rows, bodies=(inertial, gravity), loads=table)
        return found

    def friction(self, loads: tree.Loads, friction: tree.JointFriction) -> Array:
        """Return the drives' efforts against friction of joints under loads, (N, D)."""
        efforts: Array = np.zeros((len(self.rows), len(self.structure.drives)))
        # Loads are everybody's: what is of one friction alone does not go through them.
        run(tree.oppose_friction, *self.structure.evaluation.packed, self.rows, loads.links,
            loads.loops, np.array(friction), np.empty(len(self.structure.home)), efforts)
        return efforts

    @property
    def tool_velocity(self) -> Array:
        """Linear velocity of the tool's origin and angular velocity, in `base`, (N, 6)."""
        row, m = self.structure.links[self.structure.tool][0], self.motion
        return np.concatenate(
            (m.u[:, row] + np.cross(m.w[:, row], self.tool_arm), m.w[:, row]), axis=1)

    @cached_property
    def tool_arm(self) -> Array:
        """The tool's origin from that of its joint, in `base`, (N, 3) [m]."""
        row, frame = self.structure.links[self.structure.tool]
        arm: Array = self.motion.R[:, row] @ frame.p
        return arm

    def joint_position(self, joint: str) -> Array:
        """Return the position of a passive joint of the tree, (N,) [rad, m]."""
        t, row = self.structure.tables, self.structure.rows[joint]
        position: Array = t.ratio[row] * self.motion.q[:, t.coordinate[row]] + t.offset[row]
        return position

    def wrenches(self, load: StructureLoad | None) -> list[tuple[int, Array]]:
        """Return joints whose links bear a load, and wrenches about their origins, (N, 6)."""
        t, m = self.structure.tables, self.motion
        found: list[tuple[int, Array]] = []
        if load is None:
            return found
        if np.any(load.wrench):
            row, _ = self.structure.links[self.structure.tool]
            force, moment = load.wrench[:, :3], load.wrench[:, 3:]
            found.append((row, np.hstack((force, moment + np.cross(self.tool_arm, force)))))
        for name, torque in load.torques.items():
            row = self.structure.rows[name]
            along = torque[:, None] * m.z[:, row]
            # What the link of a joint applies, the one that it hangs on takes back.
            for joint, force in ((row, along), (int(t.parent[row]), -along)):
                found.append((joint, np.hstack(
                    (0.0 * force, force) if t.turns[row] else
                    (force, np.cross(m.p[:, row] - m.p[:, joint], force)))))
        return found

    def changes_by_loads(
        self, loads: tree.Loads, friction: tree.JointFriction, guides: Integers, count: int,
        added: Sequence[tuple[Any, ...]], bodies: Sequence[Array],
        applied: Sequence[tuple[int, int]] = (), wrenches: Sequence[Array] = (),
        quantities: int = 1,
    ) -> Array:
        """Return changes by columns of bodies and wrenches, (count, N, quantities, D).

        To first order in them; see `tree_equations.changes_by_loads`.
        """
        t, samples, columns = self.structure.tables, len(self.rows), quantities * len(
            self.structure.drives)
        changes: Array = np.zeros((count, samples, columns))
        run(tree.changes_by_loads, *self.structure.evaluation.packed, self.rows, loads.links,
            loads.loops, np.array(friction), guides,
            np.array(added, dtype=np.int64).reshape(-1, 3),
            np.reshape(bodies, (-1, PARAMETERS + 3)),
            np.array(applied, dtype=np.int64).reshape(-1, 2),
            np.reshape(wrenches, (-1, samples, 6)),
            np.empty((len(self.structure.home), columns)),
            np.empty((len(t.closures), 3, columns)), np.empty((len(t.joints), 6, columns)), changes)
        return changes.reshape(count, samples, quantities, -1)

    def regressor(self, rows: Integers, gravity: Array) -> Array:
        """Return the derivatives of the efforts by the parameters of bodies, (N, D, 10 B)."""
        unit = np.hstack((np.eye(PARAMETERS), np.tile(-gravity, (PARAMETERS, 1))))
        added = [(k, row, tree.AS_LINK) for k, row in enumerate(np.repeat(rows, PARAMETERS))]
        found = self.changes_by_loads(self._no_loads()[1], tree.NO_FRICTION, NO_GUIDES, len(added),
                                      added, [*unit] * len(rows))
        return np.moveaxis(found[:, :, 0], 0, -1)

    def _no_loads(self) -> tuple[Array, tree.Loads]:
        sizes = self.structure.evaluation.sizes
        table = np.zeros((len(self.rows), tree.length_of(tree.Loads, sizes)))
        return table, tree.views(tree.Loads, sizes, table)


class ToolPose:
    """The motion of a robot's drives from that of its tool.

    Parameters
    ----------
    structure : Structure

    Attributes
    ----------
    chosen : int array
        Which of `COORDINATES` the drives follow; the others are then what they are.

    Raises
    ------
    ModelError
        Where the tool's pose does not determine the drives at home: of a robot without loops it
        does so in several ways, and a drive may not move the tool at all.
    """

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        t, home = structure.tables, structure.home
        row, frame = structure.links[structure.tool]
        q = home[None, t.drives]
        at_home = LinkMotion.of(structure, q, np.zeros_like(q), np.zeros_like(q))
        m, (W, U) = at_home.motion, (jacobian[0, row] for jacobian in at_home.link_jacobians)
        self.home = Frame(m.R[0, row], m.p[0, row]) @ frame
        linear, angular = U + np.cross(W, m.R[0, row] @ frame.p, axis=0), W
        self.chosen = independent_rows(
            np.vstack((linear / structure.size, (self.home.R.T @ angular)[::-1])),
            linear.shape[1], (np.s_[:SLIDES], np.s_[SLIDES:]), RANK)
        if not structure.loops or len(self.chosen) < len(t.drives):
            raise ModelError('robot.tool', structure.tool, 'be a link of a robot with loops whose '
                             'pose determines all drives, for a trajectory of its poses')
        self._tied = _tied_structure(structure, self.home, self.chosen)
        places = self._tied.coordinates.index
        self._own = np.array([places(name) for name in structure.coordinates])
        self._drives = self._own[t.drives]
        self._pose = np.array([places(f'{POSE}{name}') for name in COORDINATES])

    def drives(self, motion: PlatformMotion, closed: dict[Any, Array] | None = None,
               ) -> tuple[JointMotion, Array]:
        """Return the motion of the drives for that of the tool in the base.

        Parameters
        ----------
        motion : PlatformMotion
            Of the tool's origin and axes. Twists along what the robot cannot choose are not read.
        closed : dict of Structure to array, optional
            Coordinates at the last sample of another motion, by structure; brought up to date.

        Returns
        -------
        moved : JointMotion
        start : (N, C) array
            Closed coordinates of the robot.

        Raises
        ------
        WorkspaceError
            Where the tool cannot be there, in position or in attitude.
        SingularityError
            Where its pose does not determine the drives.
        """
        q, v, a = self._coordinates(motion)
        closed = {} if closed is None else closed
        try:
            tied = LinkMotion.of(
                self._tied, q[:, self.chosen], v[:, self.chosen], a[:, self.chosen],
                nearby=closed.get(self._tied))
        except SingularityError as error:
            raise SingularityError(
                error.sample, 'the pose of the tool does not determine the drives',
                'must be on the way from home without a singular pose') from None
        except WorkspaceError as error:
            raise WorkspaceError(error.sample, f'{self.structure.tool} cannot be at '
                                 f'{_in_words(motion, error.sample)}',
                                 'must be within reach, on the way from home') from None
        found = tied.motion
        self._require_followed(q, found.q[:, self._pose])
        if len(motion):
            closed[self._tied] = found.q[-1].copy()
        position, velocity, acceleration = (
            rows[:, self._drives].copy() for rows in (found.q, found.v, found.a))
        return (JointMotion(position, velocity, acceleration, motion.time), found.q[:, self._own])

    def _coordinates(self, motion: PlatformMotion) -> tuple[Array, Array, Array]:
        """Return the six coordinates of the motion with their derivatives, (N, 6) each.

        With R = R_home Rz(psi) Ry(theta) Rx(phi) and the angular velocity w in the axes of home:
        w = psi' z + theta' Rz y + phi' Rz Ry x. No number where theta is 90 degrees.
        """
        turn = self.home.R.T @ motion.rotation
        psi, phi = (np.arctan2(turn[:, 1, 0], turn[:, 0, 0]),
                    np.arctan2(turn[:, 2, 1], turn[:, 2, 2]))
        s_theta = -turn[:, 2, 0]
        c_theta = np.hypot(turn[:, 2, 1], turn[:, 2, 2])
        s, c = np.sin(psi), np.cos(psi)
        w_x, w_y, w_z = (motion.angular_velocity @ self.home.R).T
        e_x, e_y, e_z = (motion.angular_acceleration @ self.home.R).T
        with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
            across = w_y * c - w_x * s  # theta'
            d_phi = (w_x * c + w_y * s) / c_theta
            d_psi = w_z + d_phi * s_theta
            dd_theta = e_y * c - e_x * s - d_psi * (w_x * c + w_y * s)
            dd_phi = (e_x * c + e_y * s + (d_psi + d_phi * s_theta) * across) / c_theta
            dd_psi = e_z + dd_phi * s_theta + d_phi * across * c_theta
        angles = ((psi, np.arctan2(s_theta, c_theta), phi), (d_psi, across, d_phi),
                  (dd_psi, dd_theta, dd_phi))
        places = (motion.position - self.home.p, motion.linear_velocity, motion.linear_acceleration)
        q, v, a = (np.column_stack((place, *three))
                   for place, three in zip(places, angles, strict=True))
        return q, v, a

    def _require_followed(self, wanted: Array, found: Array) -> None:
        """Raise WorkspaceError where what the robot cannot choose is not as it was asked for."""
        off = np.abs(wanted - found)
        if np.all(off <= FOLLOWED):
            return
        sample, k = np.unravel_index(np.argmax(~(off <= FOLLOWED)), off.shape)
        unit = 'm' if k < SLIDES else 'rad'
        raise WorkspaceError(
            int(sample), f'{self.structure.tool} would have to be at {COORDINATES[k]} '
            f'{wanted[sample, k]:.4f} {unit} from home, but its {len(self.structure.drives)} '
            f'drives bring it to {found[sample, k]:.4f} {unit}', f'may be off by {FOLLOWED:g} '
            f'{unit}')


def _in_words(motion: PlatformMotion, sample: int) -> str:
    x, y, z = motion.position[sample]
    return (f'({x:.4g}, {y:.4g}, {z:.4g}) m, turned by '
            f'{np.degrees(np.hypot(motion.tilt[sample], motion.turn[sample])):.3g} degrees')


def _tied_structure(structure: Structure, home: Frame, chosen: Integers) -> Structure:
    """Return a structure with a chain of the pose's joints, those chosen as drives, to the tool.

    Parameters
    ----------
    structure : Structure
    home : Frame
        The tool's in the base.
    chosen : int array
    """
    given, (_, root) = structure.description, structure.links[structure.moved_by[0]]
    links, joints, parent = dict(given.links), dict(given.joints), structure.moved_by[0]
    frames = [Frame()] * len(COORDINATES)
    frames[0], frames[SLIDES] = root.inverse @ Frame(p=home.p), Frame(home.R)
    for k, (name, axis, frame) in enumerate(zip(COORDINATES, AXES, frames, strict=True)):
        kind, link = PRISMATIC if k < SLIDES else CONTINUOUS, f'{POSE}{name}'
        joints[link] = Joint(link, kind, parent, link, frame, axis)
        links[link], parent = np.zeros(PARAMETERS), link
    at = {name: float(structure.home[c]) for name, row in structure.rows.items()
          if joints[name].mimic is None and (c := structure.tables.coordinate[row]) >= 0}
    tie = Loop(f'{POSE}tie', 'fixed', structure.tool, Frame(), parent, Frame())
    return build_structure(
        replace(given, links=links, joints=joints), structure.base, structure.tool,
        tuple(f'{POSE}{COORDINATES[k]}' for k in chosen), (*structure.loops, tie),
        at | {f'{POSE}{name}': 0.0 for name in COORDINATES}, structure.poses,
        {name: position for name, position in structure.locked.items()
         if joints[name].mimic is None})
