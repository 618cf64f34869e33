# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables of a tree of joints with closures: what it is, how it moves, and what it transmits.

Row 0 of all tables of joints is the base. Tables are also packed as rows of numbers, because
compiled code takes few arrays faster than many: fields are annotated with names of sizes. Space
for a motion is a row per sample, or one row that every sample uses in turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_type_hints

import numpy as np

from pprs_dynamics.arrays import Array

Integers = np.typing.NDArray[np.int_]

TRANSLATION, ANGLE = 0, 1  # kinds of rows
# Rows of tables of vectors: of a joint's frame, a closure's frames, a link's motion, a closure's
# motion, and forces; a frame's orientation is three rows.
PLACE_R, PLACE_P, AXIS, OF_FRAME = 0, 3, 4, 5
A_R, A_P, B_R, B_P, OF_CLOSURE = 0, 3, 4, 7, 8
R, P, Z, W, U, WD, UD, OF_LINK = 0, 3, 4, 5, 6, 7, 8, 9
FORCE, MOMENT, OF_FORCES = 0, 1, 2
# Columns of tables of whole numbers.
PARENT, TURNS, COORDINATE = 0, 1, 2
PASSIVE_OF, DRIVE_OF = 0, 1
LOOP_A, LOOP_B, PATH_START, PATH_END = 0, 1, 2, 3
LOOP, KIND, AXES = 0, 1, 2
JOINT, SIGN = 0, 1
UNIT = 2  # column of `row_reals`
# Of `Data.solution`.
OPEN, DETERMINANT, CONDITION, STEPS = 0, 1, 2, 3


def _vector(k: int) -> Any:
    return np.s_[..., k, :]


def _matrix(k: int) -> Any:
    return np.s_[..., k:k + 3, :]


# Parts of tables by the names under which they are read.
PARTS: dict[str, tuple[str, Any]] = {
    'parent': ('joints', np.s_[..., PARENT]), 'turns': ('joints', np.s_[..., TURNS]),
    'coordinate': ('joints', np.s_[..., COORDINATE]), 'loop_a': ('closures', np.s_[..., LOOP_A]),
    'loop_b': ('closures', np.s_[..., LOOP_B]), 'row_unit': ('row_reals', np.s_[..., UNIT]),
    # Of a joint: orientation and origin in its parent, and axis.
    'place_R': ('frames', _matrix(PLACE_R)), 'place_p': ('frames', _vector(PLACE_P)),
    'axis': ('frames', _vector(AXIS)),
    # Of a closure: frames A and B in their links.
    'a_R': ('closure_frames', _matrix(A_R)), 'a_p': ('closure_frames', _vector(A_P)),
    'b_R': ('closure_frames', _matrix(B_R)), 'b_p': ('closure_frames', _vector(B_P)),
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
        Frame at position 0 in the parent's, and axis in the joint's.
    ratio, offset : (J + 1,) arrays
        A joint's position is ratio q[coordinate] + offset.
    passive, drives : int arrays
        Coordinates that closures determine, and those that are given.
    places : (C, 2) int array
        Place of each coordinate among them, or -1.
    stride : (D,) array
        By which drives move between closings.
    closures : (L, 4) int array
        Joints whose links it connects; where its path begins and ends.
    closure_frames : (L, OF_CLOSURE, 3) array
        Frames A and B there.
    rows : (r, 6) int array
        Closure, kind, and four axes. Translation along the first (axis of A); angle: axis of A,
        axis of B, and a second pair. The first rows, as many as passive coordinates, determine
        these; the others follow from them at home.
    row_reals : (r, 3) array
        Weights of the two pairs; the mechanism's size for lengths, 1 for angles: the unit in which
        conditioning is judged.
    passive_unit : (passive,) array
        The same for coordinates.
    path : (K, 2) int array
        Joints between closures' two links, and 1 on the side of B, -1 on that of A.
    """

    joints: Annotated[Integers, 'joints', 3]
    passive: Annotated[Integers, 'passive']
    drives: Annotated[Integers, 'drives']
    places: Annotated[Integers, 'coordinates', 2]
    closures: Annotated[Integers, 'loops', 4]
    rows: Annotated[Integers, 'rows', 6]
    path: Annotated[Integers, 'path', 2]
    frames: Annotated[Array, 'joints', OF_FRAME, 3]
    ratio: Annotated[Array, 'joints']
    offset: Annotated[Array, 'joints']
    stride: Annotated[Array, 'drives']
    closure_frames: Annotated[Array, 'loops', OF_CLOSURE, 3]
    row_reals: Annotated[Array, 'rows', 3]
    passive_unit: Annotated[Array, 'passive']

    def __getattr__(self, name: str) -> Any:
        return _read(self, name)


class Data(NamedTuple):
    """Motion of joints and links; per sample, vectors in the base's frame.

    Parameters
    ----------
    q, v, a : (C,) arrays
        Of all coordinates.
    links : (J + 1, OF_LINK, 3) array
        Orientation, origin, axis, angular and linear velocity and acceleration of each joint's
        link, at its origin.
    loops : (L, OF_CLOSURE, 3) array
        Frames of the closures.
    drive_to_joint : (C, D) array
        T: rates of all coordinates per rate of each drive.
    inverse : (passive, passive + D) array
        J_p^-1, and J_p^-1 J_a.
    solution : (4,) array
        Largest row before the last step (OPEN); determinant and condition number of J_p; steps of
        Newton in the last stride.
    J, by_drives, residuals : arrays
        Scratch: J_p during its elimination, J_a, and rows.
    """

    q: Annotated[Any, 'coordinates']
    v: Annotated[Any, 'coordinates']
    a: Annotated[Any, 'coordinates']
    links: Annotated[Any, 'joints', OF_LINK, 3]
    loops: Annotated[Any, 'loops', OF_CLOSURE, 3]
    drive_to_joint: Annotated[Any, 'coordinates', 'drives']
    inverse: Annotated[Any, 'passive', 'solved']
    solution: Annotated[Any, 4]
    J: Annotated[Any, 'passive', 'passive']
    by_drives: Annotated[Any, 'passive', 'drives']
    residuals: Annotated[Any, 'passive', 1]

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
    tau, tau_friction : (C,) arrays
        Efforts of the tree's coordinates: of the bodies, and against friction of joints.
    efforts : (D,) array
        Of the drives.
    """

    links: Annotated[Any, 'joints', OF_FORCES, 3]
    loops: Annotated[Any, 'loops', OF_FORCES, 3]
    tau: Annotated[Any, 'coordinates']
    tau_friction: Annotated[Any, 'coordinates']
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


# Rows of the parameters of drives, and of the efforts that follow from them.
ARMATURE, VISCOUS, COULOMB, COEFFICIENT, OFFSET, WIDTH, OF_DRIVE = 0, 1, 2, 3, 4, 5, 6
TOTAL, RIGID, DRIVE_FRICTION, JOINT_EFFORT, TRANSMITTED, EFFORTS = 0, 1, 2, 3, 4, 5


# Names of the numbers of rows of the tables, and of the columns of some.
SIZES = ('joints', 'coordinates', 'drives', 'passive', 'loops', 'rows', 'path', 'solved')


@cache
def _shapes(kind: type) -> dict[str, tuple[str | int, ...]]:
    """Return the shapes that the fields of tables are annotated with, by name."""
    return {name: hint.__metadata__
            for name, hint in get_type_hints(kind, include_extras=True).items()}


def _sizes_of(t: Model) -> Integers:
    """Return the numbers that `SIZES` names, of tables."""
    found = {name: rows for table, shape in _shapes(Model).items()
             for name, rows in zip(shape, getattr(t, table).shape, strict=True)}
    found['solved'] = len(t.passive) + len(t.drives)
    return np.array([found[name] for name in SIZES], dtype=np.int64)


FIRST_OF_REALS = 'frames'  # of the tables: whole numbers come before
N = TypeVar('N', bound=tuple[Any, ...])


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
    """Return what rows (N, K) hold by name, the samples first."""
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
        count = ' * '.join(map(str, shape))
        reshaped = f'.reshape(({", ".join(map(str, shape))}))' if len(shape) > 1 else ''
        lines += [f'    of_{name} = {source}[at:at + {count}]{reshaped}', f'    at += {count}']
    lines.append(f'    return Kind({", ".join(f"of_{name}" for name in _shapes(kind))})')
    namespace: dict[str, Any] = {'Kind': kind, '__name__': __name__}
    exec('\n'.join(lines), namespace)
    read: Callable[..., Any] = namespace['read']
    return read


def elements(named: Any) -> Any:
    """Return a named tuple of arrays whose elements are Python's numbers, which are faster.

    Compiled code takes the arrays unchanged.
    """
    return type(named)(*(array.data for array in named))


def _is_real(name: str) -> bool:
    return Model._fields.index(name) >= Model._fields.index(FIRST_OF_REALS)


read_tables, read_motion, read_loads = (_reader(kind) for kind in (Model, Data, Loads))
