# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Structure of a mechanism: a description, its drives and its loops, as tables.

A floating joint is three slides and three turns about its home; a `<mimic>` joint shares the
coordinate of the joint that it follows.

Closures are rows. Independent rows and passive coordinates are chosen by QR decomposition with
pivoting at home. Lengths count in units of the mechanism's size there, so that metres and radians
compare.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.errors import ModelError, UnknownNameError
from pprs_dynamics.physics.mechanism import tree_equations as tree
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
from pprs_dynamics.physics.mechanism.vectors import rotation_matrix

X, Y, Z = range(3)
Row = tuple[int, tuple[int, int, int, int], tuple[float, float]]
# Files round angles such as pi / 2 to four digits; poorer conditions make no robot.
RANK = 1e-4  # of the largest singular value
OPEN = 1e-4  # of the size: by which a loop may be open at home, in rows that others imply
TRIES = 60  # Newton steps to home
LONGEST_STEP = 0.2  # of the size, or rad, in one of them
CLOSED_HOME = 1e-12  # of the size
# Drives move by these between closings when a motion is walked to.
STRIDE_TURN, STRIDE_SLIDE = 0.1, 0.1  # [rad], and of the mechanism's size
ROTATING = ('spherical', 'revolute', 'universal')  # closures whose friction is one of turns
SPIN = 0.02  # weight of how far a centre of mass moves when a held coordinate does


def _along(axis: int) -> Row:
    return tree.TRANSLATION, (axis, 0, 0, 0), (1.0, 0.0)


def _square(a: int, b: int) -> Row:
    return tree.ANGLE, (a, b, 0, 0), (1.0, 0.0)


def _turn(axis: int) -> Row:
    """Return the rotation about an axis: half of two products, zero only where frames agree."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    return tree.ANGLE, (j, k, k, j), (0.5, -0.5)


POINT = (_along(X), _along(Y), _along(Z))
ROWS: dict[str, tuple[Row, ...]] = {
    'spherical': POINT,
    'revolute': (*POINT, _square(X, Z), _square(Y, Z)),
    'universal': (*POINT, _square(X, Y)),
    'cylindrical': (_along(X), _along(Y), _square(X, Z), _square(Y, Z)),
    'prismatic': (_along(X), _along(Y), _turn(X), _turn(Y), _turn(Z)),
    'fixed': (*POINT, _turn(X), _turn(Y), _turn(Z)),
}


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom that the closures leave at home.

    Parameters
    ----------
    rows : int array
        Independent ones.
    passive, held : int arrays
        Coordinates that they determine, and passive ones that nothing does.
    home : (C,) array
        Closed coordinates.
    freedoms : int
        Degrees of freedom: coordinates less independent rows.
    condition : float
        Condition number of the derivatives of rows by passive coordinates.
    """

    rows: Integers
    passive: Integers
    held: Integers
    home: Array
    freedoms: int
    condition: float


class Closing:
    """Analyses closures.

    Parameters
    ----------
    t : Model
        With all rows; which coordinates are passive is not looked at.
    names : list of str
        Of the coordinates.
    loops : list of str
    """

    def __init__(self, t: tree.Model, names: list[str], loops: list[str]) -> None:
        self.t, self.names, self.loops = t, names, loops
        self.columns, self.rows = t.units[:, tree.MEASURE], 1 / t.row_unit

    def derivatives(self, q: Array) -> tuple[Array, Array]:
        """Return rows (r,) and their derivatives by all coordinates (r, C), in units of size."""
        residuals, J, _ = tree.constraint_jacobian(self.t, q, np.arange(len(q)))
        return residuals * self.rows, self.rows[:, None] * J * self.columns

    def home(self, q: Array, free: Integers) -> Array:
        """Return closed coordinates near `q` of which only the free ones are moved.

        Raises
        ------
        ModelError
            Where a loop does not close.
        """
        q = q.copy()
        for _ in range(TRIES):
            residuals, J = self.derivatives(q)
            if np.max(np.abs(residuals), initial=0.0) < CLOSED_HOME:
                break
            step = np.linalg.lstsq(J[:, free], -residuals, rcond=RANK)[0]
            step *= min(1.0, LONGEST_STEP / max(np.max(np.abs(step), initial=0.0), 1e-12))
            q[free] += step * self.columns[free]
        self._require_closed(q)
        return q

    def _require_closed(self, q: Array) -> None:
        t = self.t
        residuals, _, m = tree.constraint_jacobian(t, q, np.arange(len(q)))
        worst = np.abs(residuals * self.rows)
        if np.max(worst, initial=0.0) > OPEN:
            row = int(np.argmax(worst))
            name, kind = self.loops[t.rows[row, tree.LOOP]], t.rows[row, tree.KIND]
            raise ModelError('robot.loops', name, 'close at home: it is open by '
                             f'{opening(kind, residuals[row])}, and '
                             'no position of the passive joints nearby closes it (check frames, '
                             'lengths, and robot.home)')
        for k, name in enumerate(self.loops):
            kinds = {tuple(row[tree.AXES:]) for row in t.rows
                     if row[tree.LOOP] == k and row[tree.KIND] == tree.ANGLE}
            along = np.einsum('ij,ij->j', m.A[0, k], m.B[0, k])
            if (X, Z, 0, 0) in kinds and along[Z] < 0:
                raise ModelError('robot.loops', name, 'have both axes z the same way: they are '
                                 'opposite at home, turn one frame by pi about x')
            if (Y, Z, Z, Y) in kinds and np.min(along) < 0:
                raise ModelError('robot.loops', name, 'have both frames the same way round: one '
                                 'is half a turn off at home')

    def mobility(self, q: Array, drives: Integers, moves: Array) -> Mobility:
        """Return degrees of freedom and independent constraints at a closed home.

        Parameters
        ----------
        q : (C,) array
        drives : int array
            Coordinates that are driven.
        moves : (K, C) array
            Motion of the tool and of all centres of mass per rate of the coordinates, if each
            moved alone, in units of size.

        Raises
        ------
        ModelError
            Where the drives do not determine the motion, or are not independent.
        """
        _, J = self.derivatives(q)
        passive = np.setdiff1d(np.arange(len(q)), drives)
        J_p = J[:, passive]
        rank = _rank(J_p)
        freedoms = len(q) - _rank(J)
        redundant = _rank(J) - rank
        if redundant:
            raise ModelError(
                'robot.drives', [self.names[c] for c in drives], 'be independent: the loops leave '
                f'{freedoms} degrees of freedom at home to {len(drives)} drives, '
                f'{len(drives) - redundant} of which can be given')
        free = np.linalg.svd(J_p)[2][rank:].T if len(J_p) else np.eye(len(passive))
        if free.shape[1]:
            moved = np.linalg.norm(moves[:, passive] @ free, axis=0)
            if np.max(moved, initial=0.0) > RANK:
                # Of all free motions that one which moves most.
                _, _, V = np.linalg.svd(moves[:, passive] @ free)
                shares = np.abs(free @ V[0])
                names = [self.names[passive[k]] for k in np.argsort(-shares)
                         if shares[k] > 0.3 * shares.max()]
                raise ModelError(
                    'robot.drives', [self.names[c] for c in drives], 'determine the motion: '
                    f'{freedoms} degrees of freedom, {len(drives)} drives: '
                    f'{", ".join(names[:6])} can move while all drives '
                    'stand: drive them as well, or lock them under robot.locked')
        rows = passive[:0]
        determined = passive[:0]
        condition = 1.0
        if rank:
            rows = independent_rows(J_p, rank)
            chosen = independent_rows(J_p[rows].T, rank)
            determined = passive[chosen]
            condition = float(np.linalg.cond(J_p[np.ix_(rows, chosen)]))
        held = np.setdiff1d(passive, determined)
        return Mobility(rows, determined, held, q, freedoms, condition)


def opening(kind: int, residual: float) -> str:
    """Return by how much a row of a loop is open, with its unit."""
    return (f'{1e3 * abs(residual):.3g} mm' if kind == tree.TRANSLATION
            else f'{np.degrees(abs(residual)):.3g} degrees')


def _rank(J: Array) -> int:
    return int(np.linalg.matrix_rank(J, tol=RANK * np.linalg.norm(J, 2))) if J.size else 0


def independent_rows(rows: Array, most: int, groups: Sequence[slice] = (np.s_[:],),
                     least: float = 0.0) -> Integers:
    """Return rows (K, D) that are independent, by QR decomposition with pivoting, in their order.

    Parameters
    ----------
    rows : (K, D) array
    most : int
        Of the independent ones.
    groups : sequence of slice
        Of the rows; those of the first are chosen first.
    least : float
        Size of what a row adds to those that are chosen already.
    """
    chosen: list[int] = []
    left = rows.copy()
    for group in groups:
        for _ in rows[group]:
            sizes = np.linalg.norm(left[group], axis=1)
            k = int(np.argmax(sizes)) + (group.start or 0)
            if len(chosen) == most or not sizes.max() > least:
                break
            direction = left[k] / sizes.max()
            left = left - np.outer(left @ direction, direction)
            chosen.append(k)
    return np.sort(_integers(chosen))


def with_determined_coordinates(t: tree.Model, rows: Integers, passive: Integers, q: Array,
                                ) -> tree.Model:
    """Return tables whose first rows determine passive coordinates.

    Coordinates that few rows depend on come first: fewer zeros then fill up in the elimination.

    Parameters
    ----------
    t : Model
    rows, passive : int arrays
        As many independent rows as coordinates.
    q : (C,) array
        Home, where the loops close.
    """
    _, J, _ = tree.constraint_jacobian(t, q, passive)
    passive = passive[np.argsort(np.count_nonzero(J[rows], axis=0), kind='stable')]
    every = np.concatenate((rows, np.setdiff1d(np.arange(len(t.rows)), rows)))
    places, count = t.places.copy(), len(passive)
    places[t.drives] += 2 * count
    places[passive] = np.arange(count)
    return t._replace(rows=t.rows[every], row_reals=t.row_reals[every], passive=passive,
                      places=places)


@dataclass(frozen=True, eq=False)
class Structure:
    """A mechanism without its bodies.

    Parameters
    ----------
    description : Description
    tables : Model
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
    base, tool : str
    poses : mapping of str to Frame
        See `build_structure`.
    mobility : Mobility
    size : float
        Mean distance of joints and closures from the base [m].
    locked : dict of str to float
        Positions of joints that nothing moves [rad, m].
    lower, upper, speed, effort : (D,) arrays
        Limits of the drives; infinite where there are none.
    """

    description: Description
    tables: tree.Model
    drives: tuple[str, ...]
    kinds: tuple[str, ...]
    coordinates: tuple[str, ...]
    links: dict[str, tuple[int, Frame]]
    rows: dict[str, int]
    loops: tuple[Loop, ...]
    base: str
    tool: str
    poses: Mapping[str, Frame]
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
    def evaluation(self) -> tree.Evaluation:
        """Its equations."""
        return tree.Evaluation(self.tables, self.home)

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
    def held(self) -> tuple[str, ...]:
        """Coordinates that neither drives nor loops determine: they stand."""
        return tuple(self.coordinates[c] for c in self.mobility.held)

    @property
    def friction_rows(self) -> dict[str, tuple[int, int]]:
        """Joints that move and rotating loops: row of the joint or -1, number of the loop or -1."""
        held = set(self.mobility.held.tolist())
        joints = {name: (row, -1) for name, row in self.rows.items()
                  if int(self.tables.coordinate[row]) not in held}
        return joints | {loop.name: (-1, k) for k, loop in enumerate(self.loops)
                         if loop.kind in ROTATING}


@dataclass
class _Builder:
    """Tables under construction."""

    description: Description
    locked: Mapping[str, float]

    def __post_init__(self) -> None:
        self.parent, self.turns, self.coordinate = [0], [False], [-1]
        self.place, self.axis = [Frame()], [np.zeros(3)]
        self.gain = [(1.0, 0.0)]  # ratio and offset
        self.coordinates: list[str] = []
        self.slides: list[bool] = []
        self.start: list[float] = []
        self.rows: dict[str, int] = {}
        self.links: dict[str, tuple[int, Frame]] = {}
        self.stopped: dict[str, float] = {}

    def hang(self, base: str, home: Mapping[str, float], poses: Mapping[str, Frame]) -> None:
        """Hang all links on the base, joint by joint."""
        joints = self.description.joints
        below: dict[str, list[Joint]] = {}
        for joint in joints.values():
            below.setdefault(joint.parent, []).append(joint)
        root = self.description.root
        self.links[root] = (0, self._root(root, base))
        waiting = [root]
        followers: list[tuple[int, Joint]] = []
        while waiting:
            for joint in below.get(waiting.pop(0), []):
                row, frame = self.links[joint.parent]
                placed = frame @ joint.frame
                if self._is_locked(joint):
                    self.links[joint.child] = (row, frame @ self._locked_frame(joint))
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

    def _root(self, root: str, base: str) -> Frame:
        """Return the root's frame in the base's; no drive moves one against the other."""
        link, frame = base, Frame()
        while link != root:
            joint = self.description.hung[link]
            if not self._is_locked(joint):
                raise ModelError('robot.base', base, 'be a link that no joint moves, but '
                                 f'{joint.name} ({joint.kind}) does')
            frame, link = self._locked_frame(joint) @ frame, joint.parent
        return frame.inverse

    def _leader(self, joint: Joint) -> tuple[Joint, float, float]:
        """Return the joint that one follows in the end, itself by default; ratio and offset."""
        ratio, offset, leader = 1.0, 0.0, joint
        while leader.mimic is not None:
            offset, ratio = offset + ratio * leader.mimic.offset, ratio * leader.mimic.ratio
            leader = self.description.joints[leader.mimic.joint]
        return leader, ratio, offset

    def _is_locked(self, joint: Joint) -> bool:
        return joint.kind == FIXED or self._leader(joint)[0].name in self.locked

    def _locked_frame(self, joint: Joint) -> Frame:
        """Return the frame of the child of a locked joint in the parent's."""
        if joint.kind == FIXED:
            return joint.frame
        leader, ratio, offset = self._leader(joint)
        position = self.stopped[joint.name] = ratio * self.locked[leader.name] + offset
        return joint.frame @ moved_along(joint, position)

    def _add(self, parent: int, place: Frame, axis: Array, turns: bool) -> int:
        self.parent.append(parent)
        self.place.append(place)
        self.axis.append(axis)
        self.turns.append(turns)
        self.coordinate.append(-1)
        self.gain.append((1.0, 0.0))
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
                raise ModelError(f'robot.home.{joint.child}_pose', joint.child,
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
        leader, ratio, offset = self._leader(joint)
        if leader.name not in self.rows:
            raise ModelError('robot.urdf', joint.name,
                             f'mimic a joint that moves, not {leader.name}')
        self.coordinate[row] = self.coordinate[self.rows[leader.name]]
        self.gain[row] = ratio, offset

    def tables(self, loops: tuple[Loop, ...], drives: tuple[str, ...], size: float) -> tree.Model:
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
        driven = _integers([self.coordinate[self.rows[name]] for name in drives])
        places, slides = np.full(len(self.coordinates), -1), np.array(self.slides, dtype=bool)
        places[driven] = np.arange(len(driven))
        return tree.Model(
            joints=np.column_stack((self.parent, self.turns, self.coordinate)).astype(np.int64),
            passive=_integers([]), drives=driven, places=places,
            closures=_integers([(a, b, *ends) for (a, _, b, _), ends in zip(
                placed, pairwise(starts), strict=True)]).reshape(-1, 4),
            rows=_integers([(k, row[0], *row[1]) for k, row in rows]).reshape(-1, 6),
            path=_integers([*zip(joints, signs, strict=True)]).reshape(-1, 2),
            frames=np.array([[*frame.R, frame.p, axis, (*gain, 0.0)] for frame, axis, gain in zip(
                self.place, self.axis, self.gain, strict=True)]),
            units=np.column_stack((np.where(slides, STRIDE_SLIDE * size, STRIDE_TURN),
                                   np.where(slides, size, 1.0))),
            closure_frames=np.array([[*a.R, a.p, *b.R, b.p] for _, a, _, b in placed],
                                    dtype=float).reshape(-1, tree.OF_CLOSURE, 3),
            row_reals=np.array([(*row[2], size if row[0] == tree.TRANSLATION else 1.0)
                                for _, row in rows], dtype=float).reshape(-1, 3))

    def _on(self, loop: Loop, side: str) -> tuple[int, Frame]:
        link, frame = ((loop.a, loop.frame_a) if side == 'a' else (loop.b, loop.frame_b))
        if link not in self.links:
            raise UnknownNameError('link', link, self.links, f'robot.loops.{loop.name}.{side}.link')
        row, on = self.links[link]
        return row, on @ frame


def _integers(values: Sequence[Any]) -> Integers:
    return np.array(values, dtype=np.int64)


def build_structure(description: Description, base: str, tool: str, drives: tuple[str, ...],
                    loops: tuple[Loop, ...] = (), home: Mapping[str, float] | None = None,
                    poses: Mapping[str, Frame] | None = None,
                    locked: Mapping[str, float] | None = None) -> Structure:
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
    locked : mapping of str to float, optional
        Joints that do not move, and their positions; joints that mimic them do not move either.
        Without loops every joint that is not driven is locked: at home, else at the position of
        the description, else at that within its limits which is nearest to 0.

    Raises
    ------
    ModelError
        Where the description lacks what is named, loops do not close, or the drives do not
        determine the motion.
    """
    home, poses, locked = home or {}, poses or {}, locked or {}
    for key, name in (('base', base), ('tool', tool)):
        if name not in description.links:
            raise ModelError(f'robot.{key}', name, 'be a link of the URDF: '
                             f'{", ".join(list(description.links)[:40])}')
    if not loops:
        locked = {**_undriven(description, drives, home), **locked}
    build = _Builder(description, locked)
    _require_joints(description, drives, home, locked)
    build.hang(base, home, poses)
    if not build.links[tool][0]:
        raise ModelError('robot.tool', tool, 'be a link that robot.drives move')
    start = np.array(build.start)
    none = _integers([])
    size = _size(build.tables(loops, drives, 1.0), start)
    t = build.tables(loops, drives, size)
    closing = Closing(t, build.coordinates, [loop.name for loop in loops])
    named = [name for name in home if name in build.rows]
    free = np.array([name not in named or name not in drives for name in build.coordinates])
    q = _home(closing, start, free) if loops else start
    structure = Structure(
        description, t, drives,
        tuple(REVOLUTE if description.joints[name].kind in TURNING else PRISMATIC
              for name in drives), tuple(build.coordinates), build.links, build.rows, loops, base,
        tool, poses, Mobility(none, none, none, q, len(q), 1.0), size, build.stopped,
        *(np.array([getattr(description.joints[name], limit) for name in drives])
          for limit in ('lower', 'upper', 'speed', 'effort')))
    mobility = closing.mobility(q, t.drives, _moves(structure) * closing.columns)
    return replace(structure, mobility=mobility, tables=with_determined_coordinates(
        t, mobility.rows, mobility.passive, q))


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
        _, J = closing.derivatives(q)
        if _rank(J) > _rank(J[:, free]):  # those that are not free depend on each other
            return q
        raise


def _undriven(description: Description, drives: tuple[str, ...], home: Mapping[str, float],
              ) -> dict[str, float]:
    """Return the positions at which joints are locked that are neither driven nor mimic one."""
    found = {}
    for name, joint in description.joints.items():
        if joint.kind in (*TURNING, PRISMATIC) and joint.mimic is None and name not in drives:
            at = home.get(name, joint.start)
            found[name] = min(max(0.0, joint.lower), joint.upper) if at is None else at
    return found


def _require_joints(description: Description, drives: tuple[str, ...],
                    home: Mapping[str, float], locked: Mapping[str, float]) -> None:
    joints = description.joints
    if len(set(drives)) < len(drives):
        raise ModelError('robot.drives', list(drives), 'name each joint once')
    moving = [name for name, joint in joints.items() if joint.kind != FIXED]
    for key, names in (('robot.drives', drives), ('robot.home', home), ('robot.locked', locked)):
        for name in names:
            if name not in joints:
                raise UnknownNameError('joint', name, moving, key)
            if key != 'robot.home' and (joints[name].kind not in (*TURNING, PRISMATIC)
                                        or joints[name].mimic is not None):
                raise ModelError(key, name, 'be revolute, continuous or prismatic, and mimic no '
                                 'other joint, in the description')
    for name in locked:
        if name in drives:
            raise ModelError(f'robot.locked.{name}', locked[name],
                             f'not be given: robot.drives has {name} as well')
        lower, upper = joints[name].lower, joints[name].upper
        if not lower <= locked[name] <= upper:
            raise ModelError(f'robot.locked.{name}', locked[name],
                             f'be within its limits, {lower:g} to {upper:g}')


def _size(t: tree.Model, q: Array) -> float:
    """Return the mean distance of joints and closures from the base's origin [m]."""
    _, _, m = tree.constraint_jacobian(t, q, np.arange(len(q)))
    points = np.concatenate((m.p[0, 1:], m.pA[0], m.pB[0]))
    return max(float(np.mean(np.linalg.norm(points, axis=1))), 1e-3)


def _moves(structure: Structure) -> Array:
    """Return the tool's motion and that of all centres of mass per rate of each coordinate."""
    t, size, home = structure.tables, structure.size, structure.home
    _, _, m = tree.constraint_jacobian(t, home, np.arange(len(home)))
    W, U = (jacobian[0] for jacobian in tree.link_jacobians(t, m, np.eye(len(home))[None]))
    row, frame = structure.links[structure.tool]
    moves = [(U[row] + np.cross(W[row], m.R[0, row] @ frame.p, axis=0)) / size, W[row]]
    for body, parameters in enumerate(structure.inertial):
        if parameters[0] > 0:
            centre = m.R[0, body] @ (parameters[1:4] / parameters[0])
            moves.append(SPIN * (U[body] + np.cross(W[body], centre, axis=0)) / size)
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
    return Frame(rotation_matrix(x, y, z, w), np.array(pose[:3], dtype=float))
