# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Equations of a tree of joints with loop closures, over tables, and their evaluation at samples.

Every statement works on elements of tables. Row 0 of all tables of joints is the base.

A closure is a joint cut open. Its rows r(q) = 0 hold translations along axes of frame A, and
angles between axes of A and of B. With passive coordinates p and drives a, J = dr/dq = [J_p J_a]:

    J_p v_p = -J_a v_a,   J_p a_p = -(J_a a_a + drift),   T = dv/dv_a = [-J_p^-1 J_a; 1]
    tau = T' RNEA(q, v, a),   J_p' lambda = tau_p

References
----------
R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 8.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, cached_property
from math import ceil, cos, sin, tanh
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.description import PARAMETERS
from pprs_dynamics.physics.mechanism.evaluation import run
from pprs_dynamics.physics.mechanism.vectors import (
    Vector,
    block,
    dot,
    elements,
    minus,
    plus,
    product,
    sign_over_speed,
    sqrt,
    times,
)

Integers = np.typing.NDArray[np.int_]

TRANSLATION, ANGLE = 0, 1  # kinds of rows
# Rows of tables of vectors: of a joint's frame, a closure's frames, a link's motion, a closure's
# motion, and forces; a frame's orientation is three rows.
PLACE_R, PLACE_P, AXIS, GAIN, OF_FRAME = 0, 3, 4, 5, 6
A_R, A_P, B_R, B_P, OF_CLOSURE = 0, 3, 4, 7, 8
R, P, Z, W, U, WD, UD, OF_LINK = 0, 3, 4, 5, 6, 7, 8, 9
FORCE, MOMENT, OF_FORCES = 0, 1, 2
# Columns of tables of whole numbers.
PARENT, TURNS, COORDINATE = 0, 1, 2
LOOP_A, LOOP_B, PATH_START, PATH_END = 0, 1, 2, 3
LOOP, KIND, AXES = 0, 1, 2
JOINT, SIGN = 0, 1
COLUMN, LINK, MOVES = 0, 1, 2
STANDS, AS_LINK, WITH_DRIVE = 0, 1, 2  # how bodies move; the last plus the drive's number
UNIT = 2  # column of `row_reals`
STRIDE, MEASURE = 0, 1  # columns of `units`
Q, V, A = 0, 1, 2  # rows of `Data.motion`
# Of `Data.solution`.
OPEN, DETERMINANT, CONDITION, STEPS = 0, 1, 2, 3
# Rows of the parameters of drives, and of the efforts that follow from them.
ARMATURE, VISCOUS, COULOMB, COEFFICIENT, OFFSET, WIDTH, GUIDE, OF_DRIVE = 0, 1, 2, 3, 4, 5, 6, 7
TOTAL, RIGID, DRIVE_FRICTION, JOINT_EFFORT, TRANSMITTED, LOAD, EFFORTS = 0, 1, 2, 3, 4, 5, 6
# Names of the numbers of rows of the tables, and of the columns of some.
SIZES = ('joints', 'coordinates', 'drives', 'passive', 'loops', 'rows', 'path', 'width')
FIRST_OF_REALS = 'frames'  # of the tables: whole numbers come before
N = TypeVar('N', bound=tuple[Any, ...])
CLOSED = 1e-7  # [m, rad] of a row and of the last Newton step, after which the error is its square
MOST_STEPS = 25  # of Newton
LONGEST_STEP = 0.3  # [m, rad] of a coordinate in a Newton step
MOST_STRIDES = 400  # of the drives from where a motion was closed last
WARM_STEPS = 6  # of Newton, in which loops close that were closed within a stride
# Condition number of the loops, lengths in units of the mechanism's size, over that at home.
WORST_CONDITION = 300.0
# Of the size: by which rows may be open that others imply at home. Roundings of a file add up.
OPEN_IN_MOTION = 1e-3
TINY = 1e-300
# Stages of an evaluation, added up: the motion; forces of bodies and closures, and friction of
# joints. Where rows are kept there is one for each sample, else one that all use in turn. Started,
# each sample has coordinates of its own, near which its loops close.
MOTION, FORCES, KEPT, STARTED = 1, 2, 4, 8


def _vector(k: int) -> Any:
    return np.s_[..., k, :]


def _matrix(k: int) -> Any:
    return np.s_[..., k:k + 3, :]


# Parts of tables by the names under which they are read.
PARTS: dict[str, tuple[str, Any]] = {
    'parent': ('joints', np.s_[..., PARENT]), 'turns': ('joints', np.s_[..., TURNS]),
    'coordinate': ('joints', np.s_[..., COORDINATE]), 'loop_a': ('closures', np.s_[..., LOOP_A]),
    'loop_b': ('closures', np.s_[..., LOOP_B]), 'row_unit': ('row_reals', np.s_[..., UNIT]),
    # Of a joint: orientation and origin in its parent, axis, ratio and offset to its coordinate.
    'place_R': ('frames', _matrix(PLACE_R)), 'place_p': ('frames', _vector(PLACE_P)),
    'axis': ('frames', _vector(AXIS)), 'ratio': ('frames', np.s_[..., GAIN, 0]),
    'offset': ('frames', np.s_[..., GAIN, 1]),
    # Of a closure: frames A and B in their links.
    'a_R': ('closure_frames', _matrix(A_R)), 'a_p': ('closure_frames', _vector(A_P)),
    'b_R': ('closure_frames', _matrix(B_R)), 'b_p': ('closure_frames', _vector(B_P)),
    # Of all coordinates: position, velocity and acceleration.
    'q': ('motion', np.s_[..., Q, :]), 'v': ('motion', np.s_[..., V, :]),
    'a': ('motion', np.s_[..., A, :]),
    # Of a joint's link: orientation, origin, axis, angular and linear velocity and acceleration.
    'R': ('links', _matrix(R)), 'p': ('links', _vector(P)), 'z': ('links', _vector(Z)),
    'w': ('links', _vector(W)), 'u': ('links', _vector(U)), 'wd': ('links', _vector(WD)),
    'ud': ('links', _vector(UD)),
    # Of a closure: orientation and origin of its frames A and B.
    'A': ('loops', _matrix(A_R)), 'pA': ('loops', _vector(A_P)), 'B': ('loops', _matrix(B_R)),
    'pB': ('loops', _vector(B_P)),
    # What joints and closures transmit: force, and moment about the joint's origin.
    'f': ('links', _vector(FORCE)), 'n': ('links', _vector(MOMENT)), 'F': ('loops', _vector(FORCE))}


def _read(tables: tuple[Any, ...], name: str) -> Any:
    """Return a part of tables by its name: (..., k) of a column, else (..., k, 3), (..., k, 3, 3).

    Raises
    ------
    AttributeError
        For a name that they have not.
    """
    table, part = PARTS.get(name, ('', ()))
    if table not in tables._fields:  # type: ignore[attr-defined]
        raise AttributeError(f'{type(tables).__name__} has no {name}')
    return getattr(tables, table)[part]


class Model(NamedTuple):
    """A mechanism as tables; joints are 1 .. J, in an order in which parents come first.

    They are few: what compiled functions take costs by the number of arrays.

    Parameters
    ----------
    joints : (J + 1, 3) int array
        Parent, whether it turns, coordinate.
    frames : (J + 1, OF_FRAME, 3) array
        Frame at position 0 in the parent's, axis in the joint's, and ratio and offset: a joint's
        position is ratio q[coordinate] + offset.
    passive, drives : int arrays
        Coordinates that closures determine, and those that are given.
    places : (C,) int array
        Column of each coordinate in `Data.system`, or -1.
    units : (C, 2) array
        By which it moves between closings as a drive, and the unit in which conditioning is judged.
    closures : (L, 4) int array
        Joints whose links it connects; where its path begins and ends.
    closure_frames : (L, OF_CLOSURE, 3) array
        Frames A and B there.
    rows : (r, 6) int array
        Closure, kind, and four axes. Translation along the first (axis of A); angle: axis of A,
        axis of B, and a second pair. The first rows, as many as passive coordinates, determine
        these; the others follow from them at home.
    row_reals : (r, 3) array
        Weights of the two pairs; the mechanism's size for lengths, 1 for angles: the unit.
    path : (K, 2) int array
        Joints between closures' two links, and 1 on the side of B, -1 on that of A.
    """

    joints: Annotated[Integers, 'joints', 3]
    passive: Annotated[Integers, 'passive']
    drives: Annotated[Integers, 'drives']
    places: Annotated[Integers, 'coordinates']
    closures: Annotated[Integers, 'loops', 4]
    rows: Annotated[Integers, 'rows', 6]
    path: Annotated[Integers, 'path', 2]
    frames: Annotated[Array, 'joints', OF_FRAME, 3]
    units: Annotated[Array, 'coordinates', 2]
    closure_frames: Annotated[Array, 'loops', OF_CLOSURE, 3]
    row_reals: Annotated[Array, 'rows', 3]

    def __getattr__(self, name: str) -> Any:
        return _read(self, name)


class Data(NamedTuple):
    """Motion of joints and links; per sample, vectors in the base's frame.

    Parameters
    ----------
    motion : (3, C) array
        Position q, velocity v and acceleration a of all coordinates.
    links : (J + 1, OF_LINK, 3) array
        Orientation, origin, axis, angular and linear velocity and acceleration of each joint's
        link, at its origin.
    loops : (L, OF_CLOSURE, 3) array
        Frames of the closures.
    drive_to_joint : (C, D) array
        T: rates of all coordinates per rate of each drive.
    system : (passive, 2 passive + D + 1) array
        J_p during its elimination, J_p^-1, J_p^-1 J_a, and a column for rows.
    solution : (4,) array
        Largest row before the last step (OPEN); determinant and condition number of J_p; steps of
        Newton in the last stride.
    """

    motion: Annotated[Any, 3, 'coordinates']
    links: Annotated[Any, 'joints', OF_LINK, 3]
    loops: Annotated[Any, 'loops', OF_CLOSURE, 3]
    drive_to_joint: Annotated[Any, 'coordinates', 'drives']
    system: Annotated[Any, 'passive', 'width']
    solution: Annotated[Any, 4]

    def __getattr__(self, name: str) -> Any:
        return _read(self, name)


class Loads(NamedTuple):
    """Forces of N samples; per sample, in the base's frame.

    Parameters
    ----------
    links : (J + 1, OF_FORCES, 3) array
        What each joint transmits to its link: force, and moment about its origin.
    loops : (L, OF_FORCES, 3) array
        What the link of A does to that of B in each closure: force and moment.
    tau : (C,) array
        Efforts of the tree's coordinates: of the bodies, then against friction of joints.
    efforts : (D,) array
        Of the drives.
    """

    links: Annotated[Any, 'joints', OF_FORCES, 3]
    loops: Annotated[Any, 'loops', OF_FORCES, 3]
    tau: Annotated[Any, 'coordinates']
    efforts: Annotated[Any, 'drives']

    def __getattr__(self, name: str) -> Any:
        return _read(self, name)


class JointFriction(NamedTuple):
    """Friction of passive joints and closures, each (F,).

    joint, loop : int arrays
        One of both; the other is -1.
    viscous [N m s/rad, N s/m], torque [N m, N], lever [m, 1] : arrays
        Dry friction is torque + lever load.
    width : array
        In which sgn turns over [rad/s, m/s].
    """

    joint: Any
    loop: Any
    viscous: Any
    torque: Any
    lever: Any
    width: Any


@cache
def _shapes(kind: type) -> dict[str, tuple[str | int, ...]]:
    """Return the shapes that the fields of tables are annotated with, by name."""
    return {name: hint.__metadata__
            for name, hint in get_type_hints(kind, include_extras=True).items()}


def _sizes_of(t: Model) -> Integers:
    """Return the numbers that `SIZES` names, of tables."""
    found = {name: rows for table, shape in _shapes(Model).items()
             for name, rows in zip(shape, getattr(t, table).shape, strict=True)}
    found['width'] = 2 * len(t.passive) + len(t.drives) + 1
    return np.array([found[name] for name in SIZES], dtype=np.int64)


class PackedTables(NamedTuple):
    """Tables as rows of numbers: their sizes, whole numbers, and others."""

    sizes: Integers
    integers: Integers
    reals: Array


def packed_tables(t: Model) -> PackedTables:
    """Return tables as rows of numbers."""
    first = Model._fields.index(FIRST_OF_REALS)
    return PackedTables(_sizes_of(t), np.concatenate([np.ravel(values) for values in t[:first]]),
                        np.concatenate([np.ravel(values) for values in t[first:]]))


def length_of(kind: type, sizes: Integers) -> int:
    """Return how many numbers a row of a named tuple has."""
    return _places(kind, tuple(sizes.tolist()))[-1][1]


def views(kind: Callable[..., N], sizes: Integers, table: Array) -> N:
    """Return the arrays in rows (N, K) by name, the samples first."""
    return kind(*(table[:, start:end].reshape(len(table), *shape) for start, end, shape in _places(
        kind, tuple(sizes.tolist()))))


@cache
def _places(kind: type, sizes: tuple[int, ...]) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
    by_name = dict(zip(SIZES, sizes, strict=True))
    found, start = [], 0
    for shape in _shapes(kind).values():
        numbers = tuple(by_name[n] if isinstance(n, str) else n for n in shape)
        found.append((start, start + math.prod(numbers), numbers))
        start += math.prod(numbers)
    return tuple(found)


def _reader(kind: type) -> Callable[..., Any]:
    """Return a function that makes a named tuple of views of a row, for compiled code.

    Its source is written out: Numba makes named tuples only where all their elements are.
    """
    lines = ['def read(sizes, row, more):', '    at = 0', *(
        f'    {name} = sizes[{k}]' for k, name in enumerate(SIZES))]
    for name, shape in _shapes(kind).items():
        if name == FIRST_OF_REALS:
            lines.append('    at = 0')
        source = 'more' if kind is Model and _is_real(name) else 'row'
        lines += [f'    of_{name} = block({source}, at, ({", ".join(map(str, shape))},))',
                  f'    at += {" * ".join(map(str, shape))}']
    lines.append(f'    return Kind({", ".join(f"of_{name}" for name in _shapes(kind))})')
    namespace: dict[str, Any] = {'Kind': kind, 'block': block, '__name__': __name__}
    exec('\n'.join(lines), namespace)
    read: Callable[..., Any] = namespace['read']
    return read


def _is_real(name: str) -> bool:
    return Model._fields.index(name) >= Model._fields.index(FIRST_OF_REALS)


read_tables, read_motion, read_loads = (_reader(kind) for kind in (Model, Data, Loads))


def vector(table: Any, j: int, k: int) -> Vector:
    """Return row k of a joint or closure as a vector."""
    return Vector(table[j, k, 0], table[j, k, 1], table[j, k, 2])


def column(table: Any, j: int, k: int, c: int) -> Vector:
    """Return column c of the matrix that begins with row k of a joint or closure."""
    return Vector(table[j, k, c], table[j, k + 1, c], table[j, k + 2, c])


def put(table: Any, j: int, k: int, v: Vector) -> None:
    """Write a vector to row k of a joint or closure."""
    table[j, k, 0], table[j, k, 1], table[j, k, 2] = v.x, v.y, v.z


def put_column(table: Any, j: int, k: int, c: int, v: Vector) -> None:
    """Write a vector to column c of the matrix that begins with row k of a joint or closure."""
    table[j, k, c], table[j, k + 1, c], table[j, k + 2, c] = v.x, v.y, v.z


def increase(table: Any, j: int, k: int, v: Vector) -> None:
    """Add a vector to row k of a joint or closure."""
    table[j, k, 0] += v.x
    table[j, k, 1] += v.y
    table[j, k, 2] += v.z


def length(v: Vector) -> Any:
    """Return |v|."""
    return sqrt(dot(v, v))


def turned(table: Any, j: int, k: int, v: Vector) -> Vector:
    """Return the matrix that begins with row k of a joint or closure times a vector."""
    return Vector(dot(vector(table, j, k), v), dot(vector(table, j, k + 1), v),
                  dot(vector(table, j, k + 2), v))


def turned_back(table: Any, j: int, k: int, v: Vector) -> Vector:
    """Return the transpose of the matrix that begins with row k times a vector."""
    x, y, z = vector(table, j, k), vector(table, j, k + 1), vector(table, j, k + 2)
    return plus(plus(times(v.x, x), times(v.y, y)), times(v.z, z))


def square(x: Any) -> Any:
    """Return x^2."""
    return x * x


def larger(x: Any, y: Any) -> Any:
    """Return the larger of two numbers; NaN where x is."""
    return y if x < y else x


def solve(table: Any, size: int, first: int, last: int) -> Any:
    """Solve A X = B, columns first to last, in place of B; return the determinant of A.

    A is in the first columns, which are destroyed. Elimination with partial pivoting, which passes
    over the zeros: a leg's rows know its own joints and those of the platform.
    """
    determinant = 1.0
    for k in range(size):
        pivot = k
        for r in range(k + 1, size):
            if abs(table[r, k]) > abs(table[pivot, k]):
                pivot = r
        if pivot != k:
            determinant = -determinant
            for c in range(k, size):
                table[k, c], table[pivot, c] = table[pivot, c], table[k, c]
            for c in range(first, last):
                table[k, c], table[pivot, c] = table[pivot, c], table[k, c]
        determinant *= table[k, k]
        scale = 1.0 / table[k, k]
        for r in range(k + 1, size):
            if table[r, k] != 0.0:
                share = table[r, k] * scale
                for c in range(k + 1, size):
                    table[r, c] -= share * table[k, c]
                for c in range(first, last):
                    table[r, c] -= share * table[k, c]
    for k in range(size - 1, -1, -1):
        for n in range(k + 1, size):
            if table[k, n] != 0.0:
                for c in range(first, last):
                    table[k, c] -= table[k, n] * table[n, c]
        scale = 1.0 / table[k, k]
        for c in range(first, last):
            table[k, c] *= scale
    return determinant


def update_frame_placements(t: Model, m: Data) -> None:
    """Place joints and frames of closures for the coordinates."""
    links, frames = m.links, t.frames
    for r in range(3):
        for c in range(3):
            links[0, R + r, c] = 1.0 if r == c else 0.0
        links[0, P, r] = links[0, Z, r] = 0.0
    for j in range(1, len(t.joints)):
        i = t.joints[j, PARENT]
        s = frames[j, GAIN, 0] * m.motion[Q, t.joints[j, COORDINATE]] + frames[j, GAIN, 1]
        axis = vector(frames, j, AXIS)
        origin = plus(vector(links, i, P), turned(links, i, R, vector(frames, j, PLACE_P)))
        z = turned(links, i, R, turned(frames, j, PLACE_R, axis))
        if t.joints[j, TURNS]:
            # Columns of the rotation about the axis, each taken to the base.
            C, S = cos(s), sin(s)
            e = times(1.0 - C, axis)
            columns = (
                Vector(C + e.x * axis.x, e.y * axis.x + S * axis.z, e.z * axis.x - S * axis.y),
                Vector(e.x * axis.y - S * axis.z, C + e.y * axis.y, e.z * axis.y + S * axis.x),
                Vector(e.x * axis.z + S * axis.y, e.y * axis.z - S * axis.x, C + e.z * axis.z))
            for c in range(3):
                put_column(links, j, R, c,
                           turned(links, i, R, turned(frames, j, PLACE_R, columns[c])))
        else:
            origin = plus(origin, times(s, z))
            for c in range(3):
                put_column(links, j, R, c, turned(links, i, R, column(frames, j, PLACE_R, c)))
        put(links, j, P, origin)
        put(links, j, Z, z)
    for k in range(len(t.closures)):
        for side in range(2):
            j, own = t.closures[k, side], side * B_R
            put(m.loops, k, own + A_P, plus(vector(links, j, P), turned(
                links, j, R, vector(t.closure_frames, k, own + A_P))))
            for c in range(3):
                put_column(m.loops, k, own, c,
                           turned(links, j, R, column(t.closure_frames, k, own, c)))


def residual(t: Model, m: Data, r: int) -> Any:
    """Return a row's value: by how much a closure is open [m, rad]."""
    k, i, loops = t.rows[r, LOOP], t.rows[r, AXES], m.loops
    if t.rows[r, KIND] == TRANSLATION:
        return dot(column(loops, k, A_R, i), minus(vector(loops, k, B_P), vector(loops, k, A_P)))
    j, g, h = t.rows[r, AXES + 1], t.rows[r, AXES + 2], t.rows[r, AXES + 3]
    return (t.row_reals[r, 0] * dot(column(loops, k, A_R, i), column(loops, k, B_R, j))
            + t.row_reals[r, 1] * dot(column(loops, k, A_R, g), column(loops, k, B_R, h)))


def row_axis(t: Model, m: Data, r: int) -> Vector:
    """Return the axis by which a row multiplies the relative velocity: of points, or angular."""
    k, i, loops = t.rows[r, LOOP], t.rows[r, AXES], m.loops
    if t.rows[r, KIND] == TRANSLATION:
        return column(loops, k, A_R, i)
    j, g, h = t.rows[r, AXES + 1], t.rows[r, AXES + 2], t.rows[r, AXES + 3]
    return plus(
        times(t.row_reals[r, 0], product(column(loops, k, B_R, j), column(loops, k, A_R, i))),
        times(t.row_reals[r, 1], product(column(loops, k, B_R, h), column(loops, k, A_R, g))))


def jacobian(t: Model, m: Data, places: Any, table: Any) -> None:
    """Fill in the derivatives of the first rows, as many as the table has.

    Parameters
    ----------
    t, m : Model, Data
    places : (C,) int array
        Column of each coordinate in the table, or -1.
    table : (r, K) array
        Columns of no coordinate become zero.
    """
    for r in range(len(table)):
        for c in range(table.shape[1]):
            table[r, c] = 0.0
        k, of_points = t.rows[r, LOOP], t.rows[r, KIND] == TRANSLATION
        e = row_axis(t, m, r)
        # Per rate of a joint on the side of B: e' (z x (p_B - p)), e' z, or nothing.
        moment = product(vector(m.loops, k, B_P), e)
        for n in range(t.closures[k, PATH_START], t.closures[k, PATH_END]):
            j = t.path[n, JOINT]
            turns = t.joints[j, TURNS]
            if not (of_points or turns):
                continue
            z = vector(m.links, j, Z)
            along = dot(z, minus(moment, product(vector(m.links, j, P), e))) if (
                of_points and turns) else dot(z, e)
            c = places[t.joints[j, COORDINATE]]
            if c >= 0:
                table[r, c] += t.path[n, SIGN] * t.frames[j, GAIN, 0] * along


def close_loops(t: Model, m: Data, start: Any, goal: Any) -> bool:
    """Close the loops for the drives' positions `goal`, walked from closed coordinates `start`.

    In each stride Newton's method moves the passive coordinates until the loops close. Frames and
    the loops' Jacobian are those of the last coordinates.

    Returns
    -------
    bool
        False where the loops do not close on the way.
    """
    count, motion, system = len(t.passive), m.motion, m.system
    last = system.shape[1] - 1
    for c in range(len(start)):
        motion[Q, c] = start[c]
    m.solution[OPEN] = m.solution[STEPS] = need = size = 0.0
    for d in range(len(t.drives)):
        c = t.drives[d]
        motion[Q, c] = goal[d]
        need = larger(need, abs(goal[d] - start[c]) / t.units[c, STRIDE])
    if count and not need < MOST_STRIDES:
        m.solution[OPEN] = need + 1.0
        return False
    strides = max(1, ceil(need)) if count else 1
    for k in range(1, strides + 1):
        for d in range(len(t.drives)):
            c = t.drives[d]
            motion[Q, c] = goal[d] + (1.0 - k / strides) * (start[c] - goal[d])
        is_closed = not count
        for n in range(1 + MOST_STEPS):
            update_frame_placements(t, m)
            jacobian(t, m, t.places, system)
            if is_closed or n == MOST_STEPS:
                break
            m.solution[STEPS] = 1.0 + n
            size = 0.0
            for r in range(count):
                system[r, last] = residual(t, m, r)
                size = larger(size, abs(system[r, last]))
            solve(system, count, last, last + 1)
            step = 0.0
            for r in range(count):
                step = larger(step, abs(system[r, last]))
            share = LONGEST_STEP / larger(step, LONGEST_STEP)
            for r in range(count):
                motion[Q, t.passive[r]] -= share * system[r, last]
            is_closed = larger(step, size) < CLOSED
        if not size < CLOSED:
            break
    m.solution[OPEN] = size
    return bool(size < CLOSED)


def is_near(t: Model, start: Any, goal: Any) -> bool:
    """Return whether all drives are within a stride of a goal (D,) at coordinates `start`."""
    near = True
    for d in range(len(t.drives)):
        near = near and abs(goal[d] - start[t.drives[d]]) < t.units[t.drives[d], STRIDE]
    return near


def is_regular_and_closed(t: Model, m: Data, at_home: Any) -> bool:
    """Return whether the loops are assembled as at home, well conditioned, and all closed.

    Parameters
    ----------
    t, m : Model, Data
    at_home : (4,) array
        `m.solution` there.
    """
    if len(t.passive) and not (
            m.solution[DETERMINANT] * at_home[DETERMINANT] > 0.0
            and m.solution[CONDITION] < WORST_CONDITION * at_home[CONDITION]):
        return False
    for r in range(len(t.passive), len(t.rows)):
        if not abs(residual(t, m, r)) < OPEN_IN_MOTION * t.row_reals[r, UNIT]:
            return False
    return True


def forward_kinematics(t: Model, m: Data, v: Any, a: Any) -> None:
    """Fill in all that follows from `close_loops`, and velocities and accelerations of drives.

    Parameters
    ----------
    t : Model
    m : Data
        After `close_loops`.
    v, a : (D,) arrays
    """
    count, drives = len(t.passive), len(t.drives)
    T, motion, system, passive = m.drive_to_joint, m.motion, m.system, t.passive
    last = system.shape[1] - 1
    for c in range(len(T)):
        motion[V, c] = motion[A, c] = 0.0
        for d in range(drives):
            T[c, d] = 0.0
    for d in range(drives):
        motion[V, t.drives[d]], motion[A, t.drives[d]] = v[d], a[d]
        T[t.drives[d], d] = 1.0
    m.solution[DETERMINANT] = m.solution[CONDITION] = 0.0
    if count:
        there = 0.0
        for r in range(count):
            x = 0.0
            for c in range(count):
                x = x + square(system[r, c] * t.units[passive[c], MEASURE])
            system[r, count + r] = 1.0
            there = there + x / square(t.row_reals[r, UNIT])
        m.solution[DETERMINANT] = solve(system, count, count, last)
        # The condition number takes all of the inverse, so that it serves for the rest as well.
        back = 0.0
        for c in range(count):
            x = 0.0
            for r in range(count):
                x = x + square(system[c, count + r] * t.row_reals[r, UNIT])
            back = back + x / square(t.units[passive[c], MEASURE])
            for d in range(drives):
                T[passive[c], d] = -system[c, 2 * count + d]
        m.solution[CONDITION] = sqrt(there * back)
        for c in range(count):
            x = 0.0
            for d in range(drives):
                x = x + T[passive[c], d] * v[d]
            motion[V, passive[c]] = x
    velocities(t, m)
    for again in range(2 if count else 1):
        # First without those of passive coordinates: they undo what the rows accelerate then.
        if again:
            for r in range(count):
                system[r, last] = row_acceleration(t, m, r)
            for c in range(count):
                x = 0.0
                for r in range(count):
                    x = x + system[c, count + r] * system[r, last]
                motion[A, passive[c]] = -x
        accelerations(t, m)


def predict(t: Model, m: Data, goal: Any, start: Any) -> None:
    """Extrapolate closed coordinates to the next drive positions, to second order.

    The passive coordinates move by T dq + drift dt^2 / 2, where drift = a_p - T a is quadratic in
    the drives' velocity v and dt = v' dq / v' v.

    Parameters
    ----------
    t, m : Model, Data
    goal : (D,) array
        Drive positions within a stride.
    start : (C,) array
        Closed coordinates of the sample; overwritten by the extrapolation.
    """
    T, motion, speed, along = m.drive_to_joint, m.motion, 1e-300, 0.0
    for d in range(len(t.drives)):
        v = motion[V, t.drives[d]]
        speed += v * v
        along += v * (goal[d] - start[t.drives[d]])
    half = 0.5 * square(along / speed)
    for p in range(len(t.passive)):
        c = t.passive[p]
        drift, move = motion[A, c], 0.0
        for d in range(len(t.drives)):
            drift -= T[c, d] * motion[A, t.drives[d]]
            move += T[c, d] * (goal[d] - start[t.drives[d]])
        start[c] += move + half * drift
    for d in range(len(t.drives)):
        start[t.drives[d]] = goal[d]


def velocities(t: Model, m: Data) -> None:
    """Fill in the velocities of the links."""
    links = m.links
    for c in range(3):
        links[0, W, c] = links[0, U, c] = 0.0
    for j in range(1, len(t.joints)):
        i = t.joints[j, PARENT]
        w = vector(links, i, W)
        arm = minus(vector(links, j, P), vector(links, i, P))
        u = plus(vector(links, i, U), product(w, arm))
        own = times(t.frames[j, GAIN, 0] * m.motion[V, t.joints[j, COORDINATE]],
                    vector(links, j, Z))
        if t.joints[j, TURNS]:
            w = plus(w, own)
        else:
            u = plus(u, own)
        put(links, j, W, w)
        put(links, j, U, u)


def accelerations(t: Model, m: Data) -> None:
    """Fill in the accelerations of the links."""
    links = m.links
    for c in range(3):
        links[0, WD, c] = links[0, UD, c] = 0.0
    for j in range(1, len(t.joints)):
        i = t.joints[j, PARENT]
        k, ratio, z = t.joints[j, COORDINATE], t.frames[j, GAIN, 0], vector(links, j, Z)
        w, wd = vector(links, i, W), vector(links, i, WD)
        arm = minus(vector(links, j, P), vector(links, i, P))
        ud = plus(plus(vector(links, i, UD), product(wd, arm)), product(w, product(w, arm)))
        own = times(ratio * m.motion[A, k], z)
        turning = product(w, times(ratio * m.motion[V, k], z))
        if t.joints[j, TURNS]:
            wd = plus(plus(wd, own), turning)
        else:
            ud = plus(plus(ud, own), times(2.0, turning))
        put(links, j, WD, wd)
        put(links, j, UD, ud)


def _point(links: Any, j: int, at: Vector) -> Any:
    """Return velocity and acceleration of a link's point at a place."""
    arm, w = minus(at, vector(links, j, P)), vector(links, j, W)
    v = product(w, arm)
    return (plus(vector(links, j, U), v),
            plus(plus(vector(links, j, UD), product(vector(links, j, WD), arm)), product(w, v)))


def _turning(links: Any, j: int, direction: Vector) -> Any:
    """Return first and second derivative of a direction fixed in a link."""
    w = vector(links, j, W)
    v = product(w, direction)
    return v, plus(product(vector(links, j, WD), direction), product(w, v))


def row_acceleration(t: Model, m: Data, r: int) -> Any:
    """Return the second derivative of a row by time."""
    k, loops, total = t.rows[r, LOOP], m.loops, 0.0
    if t.rows[r, KIND] == TRANSLATION:
        e = column(loops, k, A_R, t.rows[r, AXES])
        p_a, p_b = vector(loops, k, A_P), vector(loops, k, B_P)
        de, dde = _turning(m.links, t.closures[k, LOOP_A], e)
        v_a, a_a = _point(m.links, t.closures[k, LOOP_A], p_a)
        v_b, a_b = _point(m.links, t.closures[k, LOOP_B], p_b)
        return (dot(e, minus(a_b, a_a)) + 2.0 * dot(de, minus(v_b, v_a))
                + dot(dde, minus(p_b, p_a)))
    for pair in range(2):
        a = column(loops, k, A_R, t.rows[r, AXES + 2 * pair])
        b = column(loops, k, B_R, t.rows[r, AXES + 2 * pair + 1])
        da, dda = _turning(m.links, t.closures[k, LOOP_A], a)
        db, ddb = _turning(m.links, t.closures[k, LOOP_B], b)
        total = total + t.row_reals[r, pair] * (dot(dda, b) + dot(a, ddb) + 2.0 * dot(da, db))
    return total


def inverse_dynamics(t: Model, m: Data, inertial: Any, gravity: Any, o: Loads) -> None:
    """Add the forces that move the bodies, `inertial` (J + 1, 10), and the efforts that follow.

    `o.links` holds what links apply to the world in addition to them.
    """
    g, links = Vector(gravity[0], gravity[1], gravity[2]), m.links
    for j in range(1, len(t.joints)):
        force, moment = body_wrench(links, j, inertial, j, minus(vector(links, j, UD), g),
                                    vector(links, j, W), vector(links, j, WD))
        increase(o.links, j, FORCE, force)
        increase(o.links, j, MOMENT, moment)
    for c in range(len(o.tau)):
        o.tau[c] = 0.0
    for j in range(len(t.joints) - 1, 0, -1):
        i = t.joints[j, PARENT]
        f, n = vector(o.links, j, FORCE), vector(o.links, j, MOMENT)
        along = dot(vector(links, j, Z), n if t.joints[j, TURNS] else f)
        o.tau[t.joints[j, COORDINATE]] += t.frames[j, GAIN, 0] * along
        arm = minus(vector(links, j, P), vector(links, i, P))
        increase(o.links, i, FORCE, f)
        increase(o.links, i, MOMENT, plus(n, product(arm, f)))
    project_to_actuators(t.passive, t.drives, m.drive_to_joint, o)


def body_wrench(links: Any, j: int, inertial: Any, k: int, a: Vector, w: Vector, wd: Vector) -> Any:
    """Return force, and moment about the origin of link j, that move the body in row k.

    Parameters
    ----------
    links : (J + 1, OF_LINK, 3) array
    j : int
    inertial : (n, 10) array
    k : int
    a, w, wd : Vector
        Acceleration of the link's origin less gravity, angular velocity and acceleration.
    """
    h = turned(links, j, R, Vector(inertial[k, 1], inertial[k, 2], inertial[k, 3]))
    force = plus(plus(times(inertial[k, 0], a), product(wd, h)), product(w, product(w, h)))
    spin = plus(_inertia_times(links, j, inertial, k, wd),
                product(w, _inertia_times(links, j, inertial, k, w)))
    return force, plus(spin, product(h, a))


def _inertia_times(links: Any, j: int, inertial: Any, k: int, v: Vector) -> Vector:
    x, y, z = turned_back(links, j, R, v)
    xx, xy, yy = inertial[k, 4], inertial[k, 5], inertial[k, 6]
    xz, yz, zz = inertial[k, 7], inertial[k, 8], inertial[k, 9]
    return turned(links, j, R, Vector(
        xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z))


def project_to_actuators(passive: Any, driven: Any, T: Any, o: Loads) -> None:
    """Fill in the drives' efforts T' tau for efforts of the tree's coordinates."""
    for d in range(len(driven)):
        x = o.tau[driven[d]]
        for c in range(len(passive)):
            x = x + T[passive[c], d] * o.tau[passive[c]]
        o.efforts[d] = x


def constraint_forces(t: Model, m: Data, o: Loads) -> None:
    """Fill in what the closures transmit, and with them the joints."""
    count, system = len(t.passive), m.system
    for k in range(len(o.loops)):
        for c in range(3):
            o.loops[k, FORCE, c] = o.loops[k, MOMENT, c] = 0.0
    for r in range(count):
        x = 0.0
        for c in range(count):
            x = x + system[c, count + r] * o.tau[t.passive[c]]
        kind = FORCE if t.rows[r, KIND] == TRANSLATION else MOMENT
        increase(o.loops, t.rows[r, LOOP], kind, times(x, row_axis(t, m, r)))
    for k in range(len(t.closures)):
        F, N = vector(o.loops, k, FORCE), vector(o.loops, k, MOMENT)
        p_b = vector(m.loops, k, B_P)
        for s in range(t.closures[k, PATH_START], t.closures[k, PATH_END]):
            j, sign = t.path[s, JOINT], 1.0 * t.path[s, SIGN]
            arm = minus(p_b, vector(m.links, j, P))
            increase(o.links, j, FORCE, times(-sign, F))
            increase(o.links, j, MOMENT, times(-sign, plus(N, product(arm, F))))


def actuator_efforts(drives: Any, v: Any, a: Any, efforts: Any) -> None:
    """Fill in rigid-body effort, drive friction and the total of D drives.

    The motor accelerates its rotor on its own side of the gear.

    Parameters
    ----------
    drives : (OF_DRIVE, D) array
        Armature [kg m^2, kg], viscous and Coulomb friction, friction per load, offset, width of
        the sign, and the joint across whose guide the load rubs, or 0: that of the gear.
    v, a : (D,) arrays
        Velocities and accelerations of the drives.
    efforts : (EFFORTS, D) array
        JOINT_EFFORT, TRANSMITTED and LOAD are given, the other rows are filled in.
    """
    for d in range(len(v)):
        efforts[RIGID, d] = efforts[TRANSMITTED, d] + drives[ARMATURE, d] * a[d]
        dry = drives[COULOMB, d] + drives[COEFFICIENT, d] * efforts[LOAD, d]
        efforts[DRIVE_FRICTION, d] = (drives[VISCOUS, d] * v[d]
                                      + dry * tanh(v[d] / drives[WIDTH, d]))
        efforts[TOTAL, d] = (efforts[RIGID, d] + efforts[DRIVE_FRICTION, d] + drives[OFFSET, d]
                             + efforts[JOINT_EFFORT, d])


def joint_friction(t: Model, m: Data, o: Loads, rubbing: Any) -> None:
    """Fill in the drives' efforts against friction of passive joints, with their loads.

    The moment in a closure acts on both of its links: it is felt in the joints between them.

    Parameters
    ----------
    t, m, o : Model, Data, Loads
    rubbing : (6, F) array
        A `JointFriction`.
    """
    of_tree, links = o.tau, m.links
    for c in range(len(of_tree)):
        of_tree[c] = 0.0
    for k in range(rubbing.shape[1]):
        j, g, viscous, torque = int(rubbing[0, k]), int(rubbing[1, k]), rubbing[2, k], rubbing[3, k]
        lever, width = rubbing[4, k], rubbing[5, k]
        if j >= 0:
            c, ratio = t.joints[j, COORDINATE], t.frames[j, GAIN, 0]
            rate = ratio * m.motion[V, c]
            across = product(vector(o.links, j, FORCE), vector(links, j, Z))
            dry = torque + lever * length(across)
            of_tree[c] += ratio * (viscous * rate + dry * tanh(rate / width))
        else:
            relative = minus(vector(links, t.closures[g, LOOP_B], W),
                             vector(links, t.closures[g, LOOP_A], W))
            dry = torque + lever * length(vector(o.loops, g, FORCE))
            moment = times(viscous + dry * sign_over_speed(length(relative), width), relative)
            for n in range(t.closures[g, PATH_START], t.closures[g, PATH_END]):
                i = t.path[n, JOINT]
                if t.joints[i, TURNS]:
                    ratio = t.frames[i, GAIN, 0]
                    of_tree[t.joints[i, COORDINATE]] += t.path[n, SIGN] * ratio * dot(
                        vector(links, i, Z), moment)
    project_to_actuators(t.passive, t.drives, m.drive_to_joint, o)


def evaluate(sizes: Any, integers: Any, reals: Any, home: Any, at_home: Any, start: Any,
             given: Any, motions: Any, inertial: Any, gravity: Any, loads: Any, rubbing: Any,
             actuators: Any, closed: Any, efforts: Any, stages: int, nearby: bool) -> int:
    """Evaluate the stages at each sample in turn; see `Evaluation`.

    Return the first sample that fails, or -1.
    """
    t = elements(read_tables(sizes, integers, reals))
    for s in range(len(closed)):
        at = s if stages & KEPT else 0
        m = elements(read_motion(sizes, motions[at], reals))
        o = elements(read_loads(sizes, loads[at], reals))
        if stages & MOTION:
            q = given[0, s]
            if stages & STARTED:
                for c in range(len(home)):
                    start[c] = closed[s, c]
            # First from coordinates of another motion, then from the last sample, then from home.
            is_closed = is_regular = False
            for trial in range(0 if nearby and s == 0 else 1, 3):
                if trial > 0 or is_near(t, start, q):
                    is_closed = close_loops(t, m, start, q)
                if is_closed:
                    forward_kinematics(t, m, given[1, s], given[2, s])
                    is_regular = is_regular_and_closed(t, m, at_home)
                    if trial > 0 or (m.solution[STEPS] <= WARM_STEPS and is_regular):
                        break
                is_closed = False
                for c in range(len(home)):
                    start[c] = home[c]
            if not is_closed:
                return s
            for c in range(len(home)):
                closed[s, c] = start[c] = m.motion[Q, c]
            if s + 1 < len(closed) and is_near(t, start, given[0, s + 1]):
                predict(t, m, given[0, s + 1], start)
            if not (stages & KEPT or is_regular):
                return s
        if stages & FORCES:
            if not stages & KEPT:
                for k in range(len(o.links)):
                    for c in range(3):
                        o.links[k, FORCE, c] = o.links[k, MOMENT, c] = 0.0
            inverse_dynamics(t, m, inertial, gravity, o)
            constraint_forces(t, m, o)
            if not stages & KEPT:
                own = efforts[:, s]
                for d in range(given.shape[2]):
                    own[TRANSMITTED, d], j = o.efforts[d], int(actuators[GUIDE, d])
                    own[LOAD, d] = abs(o.efforts[d]) if j == 0 else length(product(
                        vector(o.links, j, FORCE), vector(m.links, j, Z)))
                joint_friction(t, m, o, rubbing)
                for d in range(given.shape[2]):
                    own[JOINT_EFFORT, d] = o.efforts[d]
                actuator_efforts(actuators, given[1, s], given[2, s], own)
    return -1


def oppose_friction(sizes: Any, integers: Any, reals: Any, motions: Any, links: Any, loops: Any,
                    rubbing: Any, of_tree: Any, efforts: Any) -> None:
    """Fill in the drives' efforts (N, D) against friction of joints under their loads."""
    t = elements(read_tables(sizes, integers, reals))
    for s in range(len(efforts)):
        m = elements(read_motion(sizes, motions[s], reals))
        o = Loads(links[s], loops[s], of_tree, efforts[s])
        joint_friction(t, m, o, rubbing)


# --- changes of efforts by changes of loads ---------------------------------------------------


def virtual_motions(t: Model, m: Data, f: Any, F: Any, rubbing: Any, guides: Any, rates: Any,
                    held: Any, moved: Any) -> None:
    """Fill in the motions of links by which wrenches on them change what the drives feel.

    By virtual work: the power of a wrench on column r of its link's motion is the change of
    quantity r. Quantities are, of D drives each, the transmitted efforts; the efforts against
    friction of joints; and the loads of guides. The latter two follow the size of the force
    across a joint, whose derivative is a slide along that force; slides move closures, and those
    the passive coordinates.

    Parameters
    ----------
    t, m : Model, Data
    f, F : arrays
        `Loads.links` and `Loads.loops`.
    rubbing : (6, F) array
        A `JointFriction`.
    guides : (D,) or (0,) int array
        Joints whose loads are wanted.
    rates : (C, R) array
        Of the coordinates; with R = D, 2 D or 3 D the first quantities are found.
    held : (L, 3, R) array
        Slides of closures.
    moved : (J + 1, 6, R) array
        Linear velocity of each link's origin, and angular velocity.
    """
    T, links, drives, columns = m.drive_to_joint, m.links, len(t.drives), rates.shape[1]
    for c in range(len(rates)):
        for r in range(columns):
            rates[c, r] = T[c, r] if r < drives else 0.0
    for table in (held, moved):
        for j in range(len(table)):
            for x in range(table.shape[1]):
                for r in range(columns):
                    table[j, x, r] = 0.0
    if columns > drives:
        for k in range(rubbing.shape[1]):
            j, g = int(rubbing[0, k]), int(rubbing[1, k])
            lever, width = rubbing[4, k], rubbing[5, k]
            if j >= 0:
                c, ratio = t.joints[j, COORDINATE], t.frames[j, GAIN, 0]
                share = lever * ratio * tanh(ratio * m.motion[V, c] / width)
                along = times(share, direction_across(f, links, j))
                for d in range(drives):
                    _slide(moved, j, drives + d, times(T[c, d], along))
            else:
                force = vector(F, g, FORCE)
                relative = minus(vector(links, t.closures[g, LOOP_B], W),
                                 vector(links, t.closures[g, LOOP_A], W))
                share = lever * sign_over_speed(length(relative), width) / larger(
                    length(force), TINY)
                for n in range(t.closures[g, PATH_START], t.closures[g, PATH_END]):
                    i = t.path[n, JOINT]
                    if t.joints[i, TURNS]:
                        along = times(share * t.path[n, SIGN] * t.frames[i, GAIN, 0] * dot(
                            vector(links, i, Z), relative), force)
                        for d in range(drives):
                            _slide(held, g, drives + d, times(T[t.joints[i, COORDINATE], d], along))
    for d in range(len(guides)):
        _slide(moved, guides[d], 2 * drives + d, direction_across(f, links, guides[d]))
    for g in range(len(held)):
        for n in range(t.closures[g, PATH_START], t.closures[g, PATH_END]):
            j, sign = t.path[n, JOINT], 1.0 * t.path[n, SIGN]
            for x in range(3):
                for r in range(drives, columns):
                    held[g, x, r] -= sign * moved[j, x, r]
    for row in range(len(t.passive)):
        if t.rows[row, KIND] == TRANSLATION and columns > drives:
            g, e = t.rows[row, LOOP], row_axis(t, m, row)
            for c in range(len(t.passive)):
                f_x, f_y, f_z = times(m.system[c, len(t.passive) + row], e)
                for r in range(drives, columns):
                    rates[t.passive[c], r] += (
                        f_x * held[g, 0, r] + f_y * held[g, 1, r] + f_z * held[g, 2, r])
    for j in range(1, len(t.joints)):
        i, c, ratio = t.joints[j, PARENT], t.joints[j, COORDINATE], t.frames[j, GAIN, 0]
        z, arm = vector(links, j, Z), minus(vector(links, j, P), vector(links, i, P))
        turns = 1.0 if t.joints[j, TURNS] else 0.0
        e, v = times(ratio * turns, z), times(ratio * (1.0 - turns), z)
        for r in range(columns):
            own, x, y, w = rates[c, r], moved[i, 3, r], moved[i, 4, r], moved[i, 5, r]
            moved[j, 0, r] += moved[i, 0, r] + y * arm.z - w * arm.y + own * v.x
            moved[j, 1, r] += moved[i, 1, r] + w * arm.x - x * arm.z + own * v.y
            moved[j, 2, r] += moved[i, 2, r] + x * arm.y - y * arm.x + own * v.z
            moved[j, 3, r], moved[j, 4, r] = x + own * e.x, y + own * e.y
            moved[j, 5, r] = w + own * e.z


def direction_across(f: Any, links: Any, j: int) -> Vector:
    """Return the unit vector of a joint's force across its axis; 0 without any."""
    z = vector(links, j, Z)
    across = product(vector(f, j, FORCE), z)
    return times(1.0 / larger(length(across), TINY), product(z, across))


def _slide(table: Any, j: int, r: int, v: Vector) -> None:
    table[j, 0, r] += v.x
    table[j, 1, r] += v.y
    table[j, 2, r] += v.z


def changes_by_loads(sizes: Any, integers: Any, reals: Any, motions: Any, links: Any, loops: Any,
                     rubbing: Any, guides: Any, added: Any, bodies: Any, applied: Any,
                     wrenches: Any, rates: Any, held: Any, moved: Any, changes: Any) -> None:
    """Add up changes of what the drives feel by columns of bodies and wrenches on links.

    Parameters
    ----------
    motions, links, loops : arrays
        Rows of `forward_kinematics`, and the loads, of N samples.
    rubbing, guides : arrays
        See `virtual_motions`, as `rates`, `held` and `moved`, of which there is one for all.
    added : (n, 3) int array
        Column, link, and how the body moves.
    bodies : (n, 13) array
        Inertial parameters, and the acceleration of the body in addition.
    applied : (w, 2) int array
        Column and link of each wrench.
    wrenches : (w, N, 6) array
        That links apply: force, and moment about their origin.
    changes : (K, N, R) array
        Of the quantities of `virtual_motions`.
    """
    t = elements(read_tables(sizes, integers, reals))
    for s in range(len(motions)):
        m = elements(read_motion(sizes, motions[s], reals))
        virtual_motions(t, m, links[s], loops[s], rubbing, guides, rates, held, moved)
        for n in range(len(added)):
            j, d = added[n, LINK], added[n, MOVES] - WITH_DRIVE
            moves = 1.0 if d + WITH_DRIVE == AS_LINK else 0.0
            a, wd = times(moves, vector(m.links, j, UD)), times(moves, vector(m.links, j, WD))
            if d >= 0:
                a = Vector(moved[j, 0, d], moved[j, 1, d], moved[j, 2, d])
                wd = Vector(moved[j, 3, d], moved[j, 4, d], moved[j, 5, d])
            pull = Vector(bodies[n, 10], bodies[n, 11], bodies[n, 12])
            force, moment = body_wrench(m.links, j, bodies, n, plus(a, pull),
                                        times(moves, vector(m.links, j, W)), wd)
            _add_power(moved, j, force, moment, changes, added[n, COLUMN], s)
        for n in range(len(applied)):
            w = wrenches[n]
            _add_power(moved, applied[n, LINK], Vector(w[s, 0], w[s, 1], w[s, 2]),
                       Vector(w[s, 3], w[s, 4], w[s, 5]), changes, applied[n, COLUMN], s)


def _add_power(moved: Any, j: int, force: Vector, moment: Vector, changes: Any, k: int, s: int,
               ) -> None:
    for r in range(moved.shape[2]):
        changes[k, s, r] += (
            force.x * moved[j, 0, r] + force.y * moved[j, 1, r] + force.z * moved[j, 2, r]
            + moment.x * moved[j, 3, r] + moment.y * moved[j, 4, r] + moment.z * moved[j, 5, r])


def constraint_jacobian(t: Model, q: Array, columns: Integers) -> tuple[Array, Array, Data]:
    """Return all rows and their derivatives by some coordinates, (r,) and (r, K), at one place."""
    sizes = packed_tables(t).sizes
    m = views(Data, sizes, np.zeros((1, length_of(Data, sizes))))
    m.q[0] = q
    sample = type(m)(*(array[0].data for array in m))
    places = np.full(len(q), -1)
    places[columns] = np.arange(len(columns))
    update_frame_placements(t, sample)
    residuals = np.array([residual(t, sample, r) for r in range(len(t.rows))])
    J = np.zeros((len(t.rows), len(columns)))
    jacobian(t, sample, places, J)
    return residuals, J, m


def link_jacobians(t: Model, m: Data, rates: Array) -> tuple[Array, Array]:
    """Return angular and linear velocity of links per unit of K motions, (N, J + 1, 3, K) each.

    Parameters
    ----------
    t, m : Model, Data
        Of N samples.
    rates : (N, C, K) array
        Of the coordinates in each motion.
    """
    W, U = np.zeros((2, len(rates), len(t.parent), 3, rates.shape[2]))
    for j in range(1, len(t.parent)):
        i = t.parent[j]
        W[:, j] = W[:, i]
        U[:, j] = U[:, i] + np.cross(W[:, i], (m.p[:, j] - m.p[:, i])[..., None], axis=1)
        own = W if t.turns[j] else U
        own[:, j] += t.ratio[j] * (m.z[:, j, :, None] * rates[:, t.coordinate[j], None, :])
    return W, U


# --- evaluation at samples, from each to the next ------------------------------------------------

NOWHERE, NO_GRAVITY = np.zeros(4), np.zeros(3)
NO_FRICTION = JointFriction(*np.zeros((2, 0), dtype=np.int64), *np.zeros((4, 0)))


class InverseDynamicsResult(NamedTuple):
    """Drive efforts of N samples, and closed coordinates of robots without a closed form.

    Parameters
    ----------
    q : (N, C) array or None
        Closed coordinates.
    efforts : (EFFORTS, N, D) array
        By row: TOTAL, RIGID, DRIVE_FRICTION, JOINT_EFFORT, TRANSMITTED and LOAD [N m, N]; see
        `closed_form` for the other rows of a 3-PPRS.
    motion : three (N, D) arrays
        Position, velocity and acceleration of the drives.
    """

    q: Any
    efforts: Array
    motion: Any


class Evaluation:
    """A mechanism's equations for what it is given.

    Parameters
    ----------
    t : Model
    home : (C,) array
        Closed coordinates.
    """

    def __init__(self, t: Model, home: Array) -> None:
        self.tables, self.home, self.packed = t, home, packed_tables(t)
        self.sizes = self.packed.sizes
        self._lengths = length_of(Data, self.sizes), length_of(Loads, self.sizes)
        # Of stages that take no motion or no bodies, or give no efforts.
        drives = len(t.drives)
        self._no_motion, self._no_efforts = np.empty((3, 0, drives)), np.empty((EFFORTS, 0, drives))
        self._no_bodies = np.zeros((len(t.joints), PARAMETERS))
        self.no_actuators = np.zeros((OF_DRIVE, drives))
        self.no_actuators[WIDTH] = 1.0  # without rotors and friction

    @cached_property
    def at_home(self) -> Array:
        """`Data.solution` at home, (4,)."""
        still = np.zeros((3, 1, len(self.tables.drives)))
        still[0] = self.home[self.tables.drives]
        rows, _ = self.forward_kinematics(*still)
        solution: Array = self.motion(rows).solution[0]
        return solution

    def motion(self, rows: Array) -> Data:
        """Return by name what rows of `forward_kinematics` hold."""
        return views(Data, self.sizes, rows)

    def forward_kinematics(self, q: Array, v: Array, a: Array, start: Array | None = None,
                           nearby: Array | None = None) -> tuple[Array, int]:
        """Return the motion of all links for positions, velocities and accelerations of the drives.

        Parameters
        ----------
        q, v, a : (N, D) arrays
        start : (N, C) array, optional
            Closed coordinates near those of each sample, which is walked to from there.
        nearby : (C,) array, optional
            Closed coordinates of another motion: used where the first sample is within a stride
            of them and the loops stay assembled as at home, so that nothing depends on them.

        Returns
        -------
        rows : (N, K) array
        failed : int
            The first sample at which the loops do not close, or -1.
        """
        rows = np.empty((len(q), self._lengths[0]))
        return rows, self.run(MOTION | KEPT, rows, np.array((q, v, a)), start, nearby)

    def run(self, stages: int, rows: Array | None = None, given: Array | None = None,
            start: Array | None = None, nearby: Array | None = None,
            bodies: tuple[Array, Array] | None = None, loads: Array | None = None,
            results: tuple[Array, Array, Array, Array] | None = None) -> int:
        """Evaluate stages, and return the first sample that fails or -1.

        Parameters
        ----------
        stages : int
            Of MOTION, FORCES and KEPT.
        rows, loads : (N, K) arrays, optional
            Where stages are kept.
        given : (3, N, D) array, optional
            Position, velocity and acceleration of the drives.
        start, nearby : (N, C) and (C,) arrays, optional
            See `forward_kinematics`.
        bodies : (J + 1, 10) and (3,) arrays, optional
            Inertial parameters, and gravity.
        results : tuple of arrays, optional
            Friction of joints, see `joint_friction`; parameters of drives, see `actuator_efforts`;
            and what is filled in: closed coordinates (N, C) and efforts (EFFORTS, N, D).
        """
        warm = nearby is not None
        rows = np.empty((1, self._lengths[0])) if rows is None else rows
        results = results or (np.array(NO_FRICTION), self.no_actuators,
                              np.empty((len(rows), len(self.home))), self._no_efforts)
        if start is not None:
            results[2][:], stages = start, stages | STARTED
        return int(run(
            evaluate, *self.packed, self.home,
            self.at_home if warm or not stages & KEPT else NOWHERE,
            np.array(self.home if nearby is None else nearby),
            self._no_motion if given is None else given, rows,
            *(bodies or (self._no_bodies, NO_GRAVITY)),
            np.empty((len(rows), self._lengths[1])) if loads is None else loads,
            *results, stages, warm))
