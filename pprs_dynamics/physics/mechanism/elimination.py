# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The order in which the derivatives of closures are eliminated, found once for a mechanism.

A leg's rows know its own joints and those of the platform, so that most of J_p is zero for good.
Rows and passive coordinates are put in an order in which few zeros fill up (H. M. Markowitz,
Management Science 3, 1957, with a threshold for the pivots at home). In motion a pivot is the
largest among rows that are alike, and all rows count from where none of these would do; see
`arithmetic.compiled_solve`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.tree_evaluation import constraint_jacobian
from pprs_dynamics.physics.mechanism.tree_tables import (
    DRIVE_OF,
    JOINT,
    KIND,
    LOOP,
    PASSIVE_OF,
    PATH_END,
    PATH_START,
    TRANSLATION,
    Integers,
    Model,
)

PIVOT = 0.1  # of the largest number in its column: the least that a pivot is at home


class Order(NamedTuple):
    """An order of elimination; rows and columns of the lists are places in it.

    Parameters
    ----------
    rows, columns : (n,) int arrays
    swap, below, right : lists of int lists
        By pivot: rows alike, of which the largest becomes the pivot; rows that it is taken from;
        columns in which it is not zero.
    """

    rows: Integers
    columns: Integers
    swap: list[list[int]]
    below: list[list[int]]
    right: list[list[int]]


def with_elimination_order(t: Model, rows: Integers, passive: Integers, units: Array,
                           q: Array) -> Model:
    """Return tables whose first rows determine passive coordinates, in an order of elimination.

    Parameters
    ----------
    t : Model
    rows, passive : int arrays
        As many independent rows as coordinates.
    units : (C,) array
        The mechanism's size for slides, 1 for turns.
    q : (C,) array
        Home, where the loops close.
    """
    implied = np.setdiff1d(np.arange(len(t.rows)), rows)
    order = Order(rows[:0], rows[:0], [], [], [])
    if len(rows):
        _, J, _ = constraint_jacobian(t, q, passive)
        order = elimination_order(J[rows] / t.row_unit[rows, None] * units[passive],
                                  _may_differ_from_zero(t, len(q))[np.ix_(rows, passive)])
    every, passive = np.concatenate((rows[order.rows], implied)), passive[order.columns]
    places = t.places.copy()
    places[:, PASSIVE_OF] = columns_of(passive, len(q))
    lists = order.swap, order.below, order.right
    swap, below, right = (np.array([place for row in one for place in row], dtype=np.int64)
                          for one in lists)
    return t._replace(
        rows=t.rows[every], row_reals=t.row_reals[every], passive=passive,
        passive_unit=units[passive], places=places, swap=swap, below=below, right=right,
        starts=np.column_stack([np.cumsum([0, *map(len, one)]) for one in lists]))


def with_actuated_coordinates(t: Model, drives: Integers, count: int) -> Model:
    """Return tables of so many coordinates, of which some are given."""
    places = np.full((count, 2), -1)
    places[:, DRIVE_OF] = columns_of(drives, count)
    return t._replace(drives=drives, places=places)


def columns_of(coordinates: Integers, count: int) -> Integers:
    """Return each coordinate's column among some coordinates, or -1."""
    column = np.full(count, -1)
    column[coordinates] = np.arange(len(coordinates))
    return column


def _may_differ_from_zero(t: Model, count: int) -> Array:
    """Return where derivatives of rows by coordinates may not be zero, somewhere, (r, C)."""
    found = np.zeros((len(t.rows), count), dtype=bool)
    for r, k in enumerate(t.rows[:, LOOP]):
        joints = t.path[t.closures[k, PATH_START]:t.closures[k, PATH_END], JOINT]
        felt = joints if t.rows[r, KIND] == TRANSLATION else joints[t.turns[joints] != 0]
        found[r, t.coordinate[felt]] = True
    return found


def elimination_order(A: Array, pattern: Array) -> Order:
    """Return an order in which few zeros of a square matrix fill up.

    Parameters
    ----------
    A, pattern : (n, n) arrays
        The matrix at home, and where it may differ from zero elsewhere.
    """
    A, pattern = A.copy(), pattern.copy()
    count = len(A)
    left = np.ones((2, count), dtype=bool)  # rows and columns
    rows: list[int] = []
    columns: list[int] = []
    swap, below, right = [], [], []
    for _ in range(count):
        size = np.abs(A) * np.outer(*left)
        usable = pattern & (size > 0) & (size >= PIVOT * size.max(axis=0))
        inside = pattern & np.outer(*left)
        fill = np.outer(inside.sum(axis=1) - 1, inside.sum(axis=0) - 1)
        best = usable & (fill == fill[usable].min())
        r, c = np.unravel_index(np.argmax(np.where(best, size, -1.0)), A.shape)
        under = [int(k) for k in np.flatnonzero(inside[:, c]) if k != r]
        swap.append([k for k in under if np.array_equal(inside[k], inside[r])])
        below.append(under)
        right.append([int(k) for k in np.flatnonzero(inside[r]) if k != c])
        for k in under:
            A[k] -= A[k, c] / A[r, c] * A[r]
            pattern[k] |= pattern[r]
        left[0, r] = left[1, c] = False
        rows.append(int(r))
        columns.append(int(c))
    of_row, of_column = np.argsort(rows), np.argsort(columns)

    def places(lists: list[list[int]], of: Integers) -> list[list[int]]:
        return [sorted(of[one].tolist()) for one in lists]

    return Order(np.array(rows), np.array(columns), places(swap, of_row), places(below, of_row),
                 places(right, of_column))
