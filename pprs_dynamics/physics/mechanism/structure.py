# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Structure of a mechanism: a description, its drives and its loops, as tables.

A floating joint is three slides and three turns about its home; a `<mimic>` joint shares the
coordinate of the joint that it follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.mechanism.closures import ROWS, Closing, Mobility
from pprs_dynamics.physics.mechanism.description import (
    FIXED,
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    TURNING,
    Description,
    Frame,
    Joint,
    Loop,
    inertial_in,
    moved_along,
)
from pprs_dynamics.physics.mechanism.elimination import determining, given
from pprs_dynamics.physics.mechanism.tree_equations import TRANSLATION, Integers, Tables
from pprs_dynamics.physics.mechanism.tree_evaluation import Evaluation, survey

# Drives move by these between closings when a motion is walked to.
STRIDE_TURN, STRIDE_SLIDE = 0.1, 0.1  # [rad], and of the mechanism's size
SPIN = 0.02  # weight of how far a centre of mass moves when a held coordinate does


@dataclass(frozen=True, eq=False)
class Structure:
    """A mechanism without its bodies.

    Parameters
    ----------
    description : Description
    tables : Tables
        Their drives are in the model's order.
    drives : tuple of str
    kinds : tuple of str
        `revolute` or `prismatic`, of the drives.
    coordinates : tuple of str
        Names of the coordinates, by joint.
    links : dict of str to (int, Frame)
        Joint that moves each link, 0 for the base, and the link's frame in the joint's.
    rows : dict of str to int
        Joints by name.
    loops : tuple of Loop
    tool : str
    mobility : Mobility
    size : float
        Mean distance of joints and closures from the base [m].
    locked : dict of str to float
        Positions of joints that nothing moves [rad, m].
    lower, upper, speed, effort : (D,) arrays
        Limits of the drives; infinite where there are none.
    """

    description: Description
    tables: Tables
    drives: tuple[str, ...]
    kinds: tuple[str, ...]
    coordinates: tuple[str, ...]
    links: dict[str, tuple[int, Frame]]
    rows: dict[str, int]
    loops: tuple[Loop, ...]
    tool: str
    mobility: Mobility
    size: float
    locked: dict[str, float]
    lower: Array
    upper: Array
    speed: Array
    effort: Array

    @property
    def home(self) -> Array:
        """Closed coordinates, (C,)."""
        return self.mobility.home

    @cached_property
    def evaluation(self) -> Evaluation:
        """Its equations."""
        return Evaluation(self.tables, self.home)

    @cached_property
    def inertial(self) -> Array:
        """Inertial parameters of what each joint moves up to the next, (J + 1, 10)."""
        inertial = np.zeros((len(self.tables.parent), PARAMETERS))
        for link, parameters in self.description.links.items():
            row, frame = self.links[link]
            if row and np.any(parameters):
                inertial[row] += inertial_in(frame, parameters)
        return inertial

    @cached_property
    def moved_by(self) -> dict[int, str]:
        """The first link that hangs on each joint, by joint."""
        names: dict[int, str] = {}
        for link, (row, _) in self.links.items():
            names.setdefault(row, link)
        return names

    @property
    def couplings(self) -> list[tuple[str, str, float, float]]:
        """Coupled joints: name, the free joint that each follows, ratio and offset."""
        t, joints = self.tables, self.description.joints
        leaders = {int(t.coordinate[row]): name for name, row in self.rows.items()
                   if joints[name].mimic is None}
        return [(name, leaders[int(t.coordinate[row])], float(t.ratio[row]), float(t.offset[row]))
                for name, row in self.rows.items() if joints[name].mimic is not None]

    def room(self, widest: float) -> tuple[Array, Array]:
        """Return the middle of the drives' motion and the way to either side, (D,) each.

        Of a robot with loops the middle is home: the middles of all ranges may be no pose.

        Parameters
        ----------
        widest : float
            Beyond which ranges do not count [rad, m].
        """
        lower, upper = np.maximum(self.lower, -widest), np.minimum(self.upper, widest)
        middle = self.home[self.tables.drives] if self.loops else (lower + upper) / 2
        return middle, np.maximum(np.minimum(upper - middle, middle - lower), 0.0)

    @property
    def turning(self) -> tuple[str, ...]:
        """Drives that turn."""
        return tuple(name for name, kind in zip(self.drives, self.kinds, strict=True)
                     if kind == REVOLUTE)

    @property
    def held(self) -> tuple[str, ...]:
        """Coordinates that neither drives nor loops determine: they stand."""
        return tuple(self.coordinates[c] for c in self.mobility.held)

    @property
    def passive(self) -> tuple[str, ...]:
        """Joints that no drive moves by itself, in the order of the tables."""
        driven = set(self.tables.drives.tolist())
        return tuple(name for name, row in self.rows.items()
                     if int(self.tables.coordinate[row]) not in driven)


@dataclass
class _Builder:
    """Tables under construction."""

    description: Description
    drives: tuple[str, ...]
    lock_others: bool
    block: str

    def __post_init__(self) -> None:
        self.parent, self.turns, self.coordinate = [0], [False], [-1]
        self.place, self.axis = [Frame()], [np.zeros(3)]
        self.ratio, self.offset = [1.0], [0.0]
        self.coordinates: list[str] = []
        self.slides: list[bool] = []
        self.start: list[float] = []
        self.rows: dict[str, int] = {}
        self.links: dict[str, tuple[int, Frame]] = {}
        self.locked: dict[str, float] = {}

    def hang(self, base: str, home: Mapping[str, float], poses: Mapping[str, Frame]) -> None:
        """Hang all links on the base, joint by joint."""
        joints = self.description.joints
        below: dict[str, list[Joint]] = {}
        for joint in joints.values():
            below.setdefault(joint.parent, []).append(joint)
        children = {joint.child for joint in joints.values()}
        root = next(link for link in self.description.links if link not in children)
        self.links[root] = (0, self._root(root, base, home))
        waiting = [root]
        followers: list[tuple[int, Joint]] = []
        while waiting:
            for joint in below.get(waiting.pop(0), []):
                row, frame = self.links[joint.parent]
                placed = frame @ joint.frame
                if self._is_locked(joint):
                    self.links[joint.child] = (row, frame @ self._locked_frame(joint, home))
                elif joint.kind == FLOATING:
                    self._float(joint, row, frame, placed, poses)
                else:
                    added = self._add(row, placed, joint.axis, joint.kind in TURNING)
                    self.rows[joint.name] = added
                    self.links[joint.child] = (added, Frame())
                    if joint.mimic is None:
                        self._coordinate(added, joint.name, home.get(joint.name, joint.start),
                                         joint.lower, joint.upper)
                    else:
                        followers.append((added, joint))
                waiting.append(joint.child)
        for added, joint in followers:
            self._follow(added, joint)

    def _root(self, root: str, base: str, home: Mapping[str, float]) -> Frame:
        """Return the root's frame in the base's; no drive moves one against the other."""
        link, frame = base, Frame()
        hung = {joint.child: joint for joint in self.description.joints.values()}
        while link != root:
            joint = hung[link]
            if not self._is_locked(joint):
                raise ModelError(f'{self.block}.base', base,
                                 f'be a link that none of {self.block}.'
                                 f'{"joints" if self.lock_others else "drives"} moves')
            frame, link = self._locked_frame(joint, home) @ frame, joint.parent
        return frame.inverse

    def _is_locked(self, joint: Joint) -> bool:
        if joint.kind == FIXED:
            return True
        leader = joint
        while leader.mimic is not None:
            leader = self.description.joints[leader.mimic.joint]
        return self.lock_others and leader.name not in self.drives

    def _locked_frame(self, joint: Joint, home: Mapping[str, float]) -> Frame:
        """Return the frame of the child of a locked joint in the parent's."""
        if joint.kind in (FIXED, FLOATING):
            return joint.frame
        position = self.locked[joint.name] = self._locked_position(joint, home)
        return joint.frame @ moved_along(joint, position)

    def _locked_position(self, joint: Joint, home: Mapping[str, float]) -> float:
        """Return the position of home, of the file, or the one within limits nearest to 0."""
        if joint.mimic is not None:
            leader = self.description.joints[joint.mimic.joint]
            return joint.mimic.ratio * self._locked_position(leader, home) + joint.mimic.offset
        position = home.get(joint.name, joint.start)
        return min(max(0.0, joint.lower), joint.upper) if position is None else position

    def _add(self, parent: int, place: Frame, axis: Array, turns: bool) -> int:
        self.parent.append(parent)
        self.place.append(place)
        self.axis.append(axis)
        self.turns.append(turns)
        self.coordinate.append(-1)
        self.ratio.append(1.0)
        self.offset.append(0.0)
        return len(self.parent) - 1

    def _coordinate(self, row: int, name: str, start: float | None, lower: float = -np.inf,
                    upper: float = np.inf) -> None:
        self.coordinate[row] = len(self.coordinates)
        self.coordinates.append(name)
        self.slides.append(not self.turns[row])
        if start is None:
            start = 0.0 if lower <= 0 <= upper else (lower + upper) / 2
        self.start.append(float(start))

    def _float(self, joint: Joint, parent: int, frame: Frame, placed: Frame,
               poses: Mapping[str, Frame]) -> None:
        """Add slides along the parent's axes and turns about the child's at home."""
        if joint.child in poses:
            if parent:
                raise ModelError(f'{self.block}.home.{joint.child}_pose', joint.child,
                                 'hang on the base: its pose is in `base`')
            placed = poses[joint.child]
        row = parent
        for k, letter in enumerate('xyz'):
            at = Frame(frame.R, placed.p) if k == 0 else Frame()
            row = self._add(row, at, np.eye(3)[k], False)
            self._coordinate(row, f'{joint.name}.{letter}', None)
        turn = frame.R.T @ placed.R
        for k, letter in zip((2, 1, 0), ('yaw', 'pitch', 'roll'), strict=True):
            row = self._add(row, Frame(turn) if k == 2 else Frame(), np.eye(3)[k], True)
            self._coordinate(row, f'{joint.name}.{letter}', None)
        self.links[joint.child] = (row, Frame())

    def _follow(self, row: int, joint: Joint) -> None:
        ratio, offset = 1.0, 0.0
        leader, seen = joint, {joint.name}
        while leader.mimic is not None:
            offset, ratio = offset + ratio * leader.mimic.offset, ratio * leader.mimic.ratio
            leader = self.description.joints[leader.mimic.joint]
            if leader.name in seen:
                raise ModelError(f'{self.block}.urdf', joint.name, 'mimic no joint that mimics it')
            seen.add(leader.name)
        if leader.name not in self.rows:
            raise ModelError(f'{self.block}.urdf', joint.name,
                             f'mimic a joint that moves, not {leader.name}')
        self.coordinate[row] = self.coordinate[self.rows[leader.name]]
        self.ratio[row], self.offset[row] = ratio, offset

    def tables(self, loops: tuple[Loop, ...], size: float) -> Tables:
        """Return tables with all rows of the loops, and no passive coordinates yet."""
        placed = [(*self._on(loop, 'a'), *self._on(loop, 'b')) for loop in loops]
        rows = [(k, row) for k, loop in enumerate(loops) for row in ROWS[loop.kind]]
        starts, joints, signs = [0], [], []
        for a, _, b, _ in placed:
            of_a, of_b = path_to_base(self.parent, a), path_to_base(self.parent, b)
            for path, other, sign in ((of_b, of_a, 1), (of_a, of_b, -1)):
                for row in path:
                    if row not in other:
                        joints.append(row)
                        signs.append(sign)
            starts.append(len(joints))
        driven = _integers([self.coordinate[self.rows[name]] for name in self.drives])
        none = _integers([])
        return given(Tables(
            joints=np.column_stack((self.parent, self.turns, self.coordinate)).astype(np.int64),
            passive=none, drives=driven, places=none,
            closures=_integers([(a, b, *ends) for (a, _, b, _), ends in zip(
                placed, pairwise(starts), strict=True)]).reshape(-1, 4),
            rows=_integers([(k, row[0], *row[1]) for k, row in rows]).reshape(-1, 6),
            path=_integers([*zip(joints, signs, strict=True)]).reshape(-1, 2),
            starts=np.zeros((1, 3), dtype=np.int64), swap=none, below=none, right=none,
            frames=_vectors(each for frame, axis in zip(self.place, self.axis, strict=True)
                            for each in (*frame.R, frame.p, axis)),
            ratio=np.array(self.ratio), offset=np.array(self.offset),
            stride=np.array([STRIDE_SLIDE * size if self.slides[c] else STRIDE_TURN
                             for c in driven]),
            closure_frames=_vectors(each for _, a, _, b in placed
                                    for each in (*a.R, a.p, *b.R, b.p)),
            row_reals=_vectors((*row[2], size if row[0] == TRANSLATION else 1.0)
                               for _, row in rows),
            passive_unit=np.zeros(0)), driven, len(self.coordinates))

    def _on(self, loop: Loop, side: str) -> tuple[int, Frame]:
        link, frame = ((loop.a, loop.frame_a) if side == 'a' else (loop.b, loop.frame_b))
        if link not in self.links:
            raise UnknownNameError('link', link, self.links, f'robot.loops.{loop.name}.{side}.link')
        row, on = self.links[link]
        return row, on @ frame


def _integers(values: Sequence[Any]) -> Integers:
    return np.array(values, dtype=np.int64)


def _vectors(rows: Iterable[Any]) -> Array:
    return np.array([*rows], dtype=float).reshape(-1, 3)


def build_structure(description: Description, base: str, tool: str, drives: tuple[str, ...],
                    loops: tuple[Loop, ...] = (), home: Mapping[str, float] | None = None,
                    poses: Mapping[str, Frame] | None = None, *, block: str = 'robot',
                    lock_others: bool = False) -> Structure:
    """Return the structure of a mechanism.

    Parameters
    ----------
    description : Description
    base, tool : str
        Links: the one that stands, and the one that carries the load.
    drives : tuple of str
        Joints that are driven.
    loops : tuple of Loop
    home : mapping of str to float, optional
        Positions of joints near which the loops close.
    poses : mapping of str to Frame, optional
        Of links on floating joints, in the base.
    block : str
        Of the model file, for errors.
    lock_others : bool
        True where joints that are not driven are locked: at home, else at the position of the file,
        else at that within their limits which is nearest to 0.

    Raises
    ------
    ModelError
        Where the description lacks what is named, loops do not close, or the drives do not
        determine the motion.
    """
    home, poses = home or {}, poses or {}
    for key, name in (('base', base), ('tool', tool)):
        if name not in description.links:
            raise ModelError(f'{block}.{key}', name, 'be a link of the URDF: '
                             f'{", ".join(list(description.links)[:40])}')
    build = _Builder(description, drives, lock_others, block)
    _require_joints(description, drives, block, home)
    build.hang(base, home, poses)
    if not build.links[tool][0]:
        raise ModelError(f'{block}.tool', tool, f'be a link that {block}.'
                         f'{"joints" if lock_others else "drives"} move')
    start = np.array(build.start)
    none = _integers([])
    size = _size(build.tables(loops, 1.0), start)
    t = build.tables(loops, size)
    closing = Closing(t, np.array(build.slides), build.coordinates,
                      [loop.name for loop in loops], size)
    named = [name for name in home if name in build.rows]
    free = np.array([name not in named or name not in drives for name in build.coordinates])
    q = _home(closing, start, free) if loops else start
    structure = Structure(
        description, t, drives,
        tuple(REVOLUTE if description.joints[name].kind in TURNING else PRISMATIC
              for name in drives), tuple(build.coordinates), build.links, build.rows, loops, tool,
        Mobility(none, none, none, q, len(q), 1.0), size, build.locked,
        *(np.array([getattr(description.joints[name], limit) for name in drives])
          for limit in ('lower', 'upper', 'speed', 'effort')))
    mobility = closing.mobility(q, t.drives, _moves(structure) * closing.columns)
    units = np.where(build.slides, size, 1.0)
    return replace(structure, mobility=mobility, tables=determining(
        t, mobility.rows, mobility.passive, units, q))


def _home(closing: Closing, start: Array, free: Array) -> Array:
    """Return the closed coordinates; drives that were given move only where they contradict.

    What they contradict may be each other: mobility then says so.
    """
    try:
        return closing.home(start, np.flatnonzero(free))
    except ModelError as error:
        try:
            q = closing.home(start, np.arange(len(start)))
        except ModelError:
            raise error from None
        if closing.are_redundant(q, free):
            return q
        raise


def _require_joints(description: Description, drives: tuple[str, ...], block: str,
                    home: Mapping[str, float]) -> None:
    listed = f'{block}.{"joints" if block == "arm" else "drives"}'
    joints = description.joints
    if len(set(drives)) < len(drives):
        raise ModelError(listed, list(drives), 'name each joint once')
    moving = [name for name, joint in joints.items() if joint.kind != FIXED]
    for name, joint in joints.items():
        if block == 'arm' and joint.kind == FLOATING:
            raise ModelError('arm.urdf', description.path, 'be of a robot with a fixed base, of '
                             f'revolute and prismatic joints: {name} is floating (where '
                             'loops hold it, describe the robot by a robot block: docs/robots.md)')
    for name in drives:
        if name not in joints:
            raise ModelError(listed, name, 'be joints of the URDF: '
                             f'{", ".join(moving[:40]) or MISSING}')
        joint = joints[name]
        if joint.kind not in (*TURNING, PRISMATIC):
            raise ModelError(listed, name, 'be revolute, continuous or prismatic, but is of the '
                             f'type {joint.kind} in the description')
        if joint.mimic is not None:
            raise ModelError(listed, name, f'move by itself, but mimics {joint.mimic.joint} in '
                             'the URDF')
    for name in home:
        if name not in joints:
            raise UnknownNameError('joint', name, moving, f'{block}.home')


def _size(t: Tables, q: Array) -> float:
    """Return the mean distance of joints and closures from the base's origin [m]."""
    _, _, m = survey(t, q, np.arange(len(q)))
    points = np.concatenate((m.p[0, 1:], m.pA[0], m.pB[0]))
    return max(float(np.mean(np.linalg.norm(points, axis=1))), 1e-3)


def _moves(structure: Structure) -> Array:
    """Return the tool's motion and that of all centres of mass per rate of each coordinate."""
    t, size = structure.tables, structure.size
    _, _, m = survey(t, structure.home, np.arange(len(structure.home)))
    row, frame = structure.links[structure.tool]
    points = [(row, m.p[0, row] + m.R[0, row] @ frame.p, True)]
    for body, parameters in enumerate(structure.inertial):
        if parameters[0] > 0:
            centre = m.R[0, body] @ (parameters[1:4] / parameters[0])
            points.append((body, m.p[0, body] + centre, False))
    moves = []
    for carrier, point, is_tool in points:
        linear, angular = np.zeros((2, 3, len(structure.home)))
        for j in path_to_base(t.parent, carrier):
            c, z = int(t.coordinate[j]), t.ratio[j] * m.z[0, j]
            if t.turns[j]:
                angular[:, c] += z
                linear[:, c] += np.cross(z, point - m.p[0, j])
            else:
                linear[:, c] += z
        moves.append(linear / size if is_tool else SPIN * linear / size)
        if is_tool:
            moves.append(angular)
    return np.concatenate(moves)


def path_to_base(parent: Sequence[int] | Integers, row: int) -> list[int]:
    """Return the joints from one up to the base, which is 0, by the parent of each."""
    path = []
    while row:
        path.append(row)
        row = int(parent[row])
    return path


def pose_frame(pose: tuple[float, ...]) -> Frame:
    """Return the frame of x y z qx qy qz qw, the quaternion of any length."""
    x, y, z, w = np.array(pose[3:]) / np.linalg.norm(pose[3:])
    R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                  [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                  [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return Frame(R, np.array(pose[:3], dtype=float))
