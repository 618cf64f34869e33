# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Inverse kinematics of a robot with loops: the drives' motion from that of the tool.

The tool's pose becomes six coordinates of the mechanism, three slides along the base's axes and
three turns about the tool's axes at home, tied to the tool by a closure of type `fixed`. Of these
coordinates as many are given as the robot has drives; the drives are then passive, and
`tree_evaluation.forward_kinematics` closes the loops for them as it does for the drives.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError, SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism.description import (
    CONTINUOUS,
    PARAMETERS,
    PRISMATIC,
    Frame,
    Joint,
    Loop,
)
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.structure import RANK, Structure, build_structure
from pprs_dynamics.physics.mechanism.tree_equations import Integers

COORDINATES = ('x', 'y', 'z', 'yaw', 'pitch', 'roll')
SLIDES = 3  # the first of them
AXES = np.eye(3)[[0, 1, 2, 2, 1, 0]]
POSE = 'tool_pose.'  # what the names of their joints begin with
# What a robot with less than six drives cannot choose may be off by this much [m, rad]: poses in
# messages are rounded, and a tool's frame is drawn to no better.
FOLLOWED = 1e-3


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
        m, (W, U) = at_home.motion, (each[0, row] for each in at_home.link_jacobians)
        self.home = Frame(m.R[0, row], m.p[0, row]) @ frame
        linear, angular = U + np.cross(W, m.R[0, row] @ frame.p, axis=0), W
        self.chosen = _independent(np.vstack((linear / structure.size,
                                              (self.home.R.T @ angular)[::-1])))
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
            each[:, self._drives].copy() for each in (found.q, found.v, found.a))
        return (JointMotion(position, velocity, acceleration, motion.time,
                            channels=motion.channels),
                found.q[:, self._own])

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
        places = (motion.position - self.home.p, motion.linear_velocity,
                  motion.linear_acceleration)
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


def _independent(rows: Array) -> Integers:
    """Return rows (6, D) that are independent, translations before rotations, in their order."""
    chosen: list[int] = []
    left = rows.copy()
    for first, last in ((0, SLIDES), (SLIDES, len(rows))):
        for _ in range(first, last):
            sizes = np.linalg.norm(left[first:last], axis=1)
            k = first + int(np.argmax(sizes))
            if len(chosen) == rows.shape[1] or not sizes[k - first] > RANK:
                break
            direction = left[k] / sizes[k - first]
            left = left - np.outer(left @ direction, direction)
            chosen.append(k)
    return np.sort(np.array(chosen, dtype=np.int64))


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
