# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Named tuples of arrays as rows of numbers: compiled code takes few arrays faster than many.

Shapes are stated once, by names of sizes. Space for a motion is a row per sample, or one row that
every sample uses in turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.tree_tables import (
    OF_FORCES,
    OF_LINK,
    Data,
    Integers,
    Loads,
    Model,
)


class Sizes(NamedTuple):
    """Numbers of rows of the tables, and of the columns of some."""

    frames: int
    joints: int
    coordinates: int
    drives: int
    passive: int
    loops: int
    closure_frames: int
    rows: int
    path: int
    starts: int
    swap: int
    below: int
    right: int
    links: int
    forces: int
    loop_forces: int
    solved: int

    @classmethod
    def of(cls, t: Model) -> Sizes:
        """Return those of tables."""
        joints, loops = len(t.joints), len(t.closures)
        return cls(len(t.frames), joints, len(t.places), len(t.drives), len(t.passive), loops,
                   len(t.closure_frames), len(t.rows), len(t.path), len(t.starts), len(t.swap),
                   len(t.below), len(t.right), OF_LINK * joints, OF_FORCES * joints,
                   OF_FORCES * loops, len(t.passive) + len(t.drives))


SHAPES: dict[type, dict[str, tuple[str | int, ...]]] = {
    Model: {
        'joints': ('joints', 3), 'passive': ('passive',), 'drives': ('drives',),
        'places': ('coordinates', 2), 'closures': ('loops', 4), 'rows': ('rows', 6),
        'path': ('path', 2), 'starts': ('starts', 3), 'swap': ('swap',), 'below': ('below',),
        'right': ('right',), 'frames': ('frames', 3), 'ratio': ('joints',),
        'offset': ('joints',), 'stride': ('drives',), 'closure_frames': ('closure_frames', 3),
        'row_reals': ('rows', 3), 'passive_unit': ('passive',)},
    Data: {
        'q': ('coordinates',), 'v': ('coordinates',), 'a': ('coordinates',), 'links': ('links', 3),
        'loops': ('closure_frames', 3), 'drive_to_joint': ('coordinates', 'drives'),
        'inverse': ('passive', 'solved'), 'solution': (4,), 'J': ('passive', 'passive'),
        'by_drives': ('passive', 'drives'), 'residuals': ('passive', 1)},
    Loads: {
        'links': ('forces', 3), 'loops': ('loop_forces', 3), 'tau': ('coordinates',),
        'tau_friction': ('coordinates',), 'efforts': ('drives',)}}
FIRST_OF_REALS = 'frames'  # of the tables: whole numbers come before
N = TypeVar('N', bound=tuple[Any, ...])


class PackedTables(NamedTuple):
    """Tables as rows of numbers: their sizes, whole numbers, and others."""

    sizes: Integers
    integers: Integers
    reals: Array


def packed_tables(t: Model) -> PackedTables:
    """Return tables as rows of numbers."""
    sizes = np.array(Sizes.of(t), dtype=np.int64)
    first = Model._fields.index(FIRST_OF_REALS)
    return PackedTables(sizes, np.concatenate([np.ravel(values) for values in t[:first]]),
                        np.concatenate([np.ravel(values) for values in t[first:]]))


def length_of(kind: type, sizes: Integers) -> int:
    """Return how many numbers a row of a named tuple has."""
    by_name = dict(zip(Sizes._fields, sizes.tolist(), strict=True))
    return sum(math.prod(by_name[n] if isinstance(n, str) else n for n in shape)
               for shape in SHAPES[kind].values())


def views(kind: Callable[..., N], sizes: Integers, table: Array) -> N:
    """Return what rows (N, K) hold by name, the samples first."""
    return kind(*(table[:, start:end].reshape(len(table), *shape) for start, end, shape in _places(
        kind, tuple(sizes.tolist()))))


@cache
def _places(kind: type, sizes: tuple[int, ...]) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
    by_name = dict(zip(Sizes._fields, sizes, strict=True))
    found, start = [], 0
    for shape in SHAPES[kind].values():
        numbers = tuple(by_name[n] if isinstance(n, str) else n for n in shape)
        found.append((start, start + math.prod(numbers), numbers))
        start += math.prod(numbers)
    return tuple(found)


def _reader(kind: type) -> Callable[..., Any]:
    """Return a function that makes a named tuple of views of a row, for compiled code.

    Its source is written out: Numba makes named tuples only where all their elements are.
    """
    lines = ['def read(sizes, row, more):', '    at = 0', *(
        f'    {name} = sizes[{k}]' for k, name in enumerate(Sizes._fields))]
    for name, shape in SHAPES[kind].items():
        if name == FIRST_OF_REALS:
            lines.append('    at = 0')
        source = 'more' if kind is Model and _is_real(name) else 'row'
        count = ' * '.join(map(str, shape))
        reshaped = f'.reshape(({", ".join(map(str, shape))}))' if len(shape) > 1 else ''
        lines += [f'    of_{name} = {source}[at:at + {count}]{reshaped}', f'    at += {count}']
    lines.append(f'    return Kind({", ".join(f"of_{name}" for name in SHAPES[kind])})')
    namespace: dict[str, Any] = {'Kind': kind, '__name__': __name__}
    exec('\n'.join(lines), namespace)
    read: Callable[..., Any] = namespace['read']
    return read


def _is_real(name: str) -> bool:
    return Model._fields.index(name) >= Model._fields.index(FIRST_OF_REALS)


read_tables, read_motion, read_loads = (_reader(kind) for kind in (Model, Data, Loads))
