# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A robot as points, and lines between them, along a motion: what every drawing of it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

JOINED = 1e-6  # of the robot's size: joints closer than that are one point


@dataclass(frozen=True)
class Line:
    """From one point to another.

    Parameters
    ----------
    start, end : int
        Of the points.
    drive : int
        That moves along it or turns it; -1 for none.
    name : str
    """

    start: int
    end: int
    drive: int
    name: str


@dataclass(frozen=True)
class Skeleton:
    """F poses of a robot.

    Parameters
    ----------
    points : (F, P, 3) array
        In the base [m].
    lines : tuple of Line
    face : tuple of int
        Corners of the platform, or of whatever carries the load; empty where there are none.
    joints : dict of str to int
        Points by the names of joints.
    labels : dict of str to int
        Points at which the names of drives are written.
    """

    points: Array
    lines: tuple[Line, ...]
    face: tuple[int, ...]
    joints: dict[str, int]
    labels: dict[str, int]

    @classmethod
    def of(cls, model: DriveModel, motion: PlatformMotion | JointMotion) -> Skeleton:
        """Return the poses of a motion of a model."""
        return _of_links(model.mechanism(motion).links)


def _of_links(links: LinkMotion) -> Skeleton:
    s, m = links.structure, links.motion
    t, size = s.tables, s.size
    count = len(t.parent)
    points = [*np.moveaxis(m.p, 1, 0), *np.moveaxis(m.pA, 1, 0), *np.moveaxis(m.pB, 1, 0),
              links.frame_of(s.tool).p]
    driven = {s.rows[name]: d for d, name in enumerate(s.drives)}
    lines: list[Line] = []

    def join(row: int, end: int, joint: int, name: str) -> None:
        """Add a line from a joint to what hangs on its link, where the two are apart."""
        if np.linalg.norm(points[row][0] - points[end][0]) > JOINED * size:
            d = driven.get(joint, -1) if joint in driven and not t.turns[joint] else (
                driven.get(row, -1))
            lines.append(Line(row, end, d, name))

    for name, row in s.rows.items():
        join(int(t.parent[row]), row, row, name)
    on_tool = []
    tool, _ = s.links[s.tool]
    for k, loop in enumerate(s.loops):
        for row, end, link in ((int(t.loop_a[k]), count + k, loop.a),
                               (int(t.loop_b[k]), count + len(s.loops) + k, loop.b)):
            if row == tool:
                on_tool.append(end)
            else:
                join(row, end, -1, link)
    on_tool += [row for row in s.rows.values() if t.parent[row] == tool]
    if len(on_tool) < 3:
        for end in (*on_tool, len(points) - 1):
            join(tool, end, -1, s.tool)
        on_tool = []
    return Skeleton(np.stack(points, axis=1), tuple(lines), _around(points, on_tool), dict(s.rows),
                    {name: s.rows[name] for name in s.drives})


def _around(points: list[Array], corners: list[int]) -> tuple[int, ...]:
    """Return corners in their order about their centre, as seen along their common normal."""
    if not corners:
        return ()
    at = np.array([points[k][0] for k in corners])
    from_centre = at - at.mean(axis=0)
    _, _, axes = np.linalg.svd(from_centre)
    angle = np.arctan2(from_centre @ axes[1], from_centre @ axes[0])
    return tuple(corners[k] for k in np.argsort(angle))
