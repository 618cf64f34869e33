# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Closures as rows: independent rows, and mobility.

Rows and passive coordinates are chosen by QR decomposition with pivoting at home. Lengths count
in units of the mechanism's size there, so that metres and radians compare.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.tree_equations import (
    ANGLE,
    AXES,
    KIND,
    LOOP,
    PASSIVE_OF,
    TRANSLATION,
    Integers,
    Model,
)
from pprs_dynamics.physics.mechanism.tree_evaluation import constraint_jacobian

X, Y, Z = range(3)
Row = tuple[int, tuple[int, int, int, int], tuple[float, float]]


def _along(axis: int) -> Row:
    return TRANSLATION, (axis, 0, 0, 0), (1.0, 0.0)


def _square(a: int, b: int) -> Row:
    return ANGLE, (a, b, 0, 0), (1.0, 0.0)


def _turn(axis: int) -> Row:
    """Return the rotation about an axis: half of two products, zero only where frames agree."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    return ANGLE, (j, k, k, j), (0.5, -0.5)


POINT = (_along(X), _along(Y), _along(Z))
ROWS: dict[str, tuple[Row, ...]] = {
    'spherical': POINT,
    'revolute': (*POINT, _square(X, Z), _square(Y, Z)),
    'universal': (*POINT, _square(X, Y)),
    'cylindrical': (_along(X), _along(Y), _square(X, Z), _square(Y, Z)),
    'prismatic': (_along(X), _along(Y), _turn(X), _turn(Y), _turn(Z)),
    'fixed': (*POINT, _turn(X), _turn(Y), _turn(Z)),
}
# Files round angles such as pi / 2 to four digits; poorer conditions make no robot.
RANK = 1e-4  # of the largest singular value
OPEN = 1e-4  # of the size: by which a loop may be open at home, in rows that others imply
TRIES = 60  # Newton steps to home
LONGEST_STEP = 0.2  # of the size, or rad, in one of them
CLOSED_HOME = 1e-12  # of the size


@dataclass(frozen=True)
class Mobility:
    """What closures leave free at home.

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
    slides : (C,) bool array
        Coordinates in metres.
    names : list of str
        Of the coordinates.
    loops : list of str
    size : float
        Of the mechanism [m].
    """

    def __init__(self, t: Model, slides: Array, names: list[str], loops: list[str], size: float,
                 ) -> None:
        self.t, self.names, self.loops = t, names, loops
        self.columns = np.where(slides, size, 1.0)
        self.rows = np.where(t.rows[:, KIND] == TRANSLATION, 1 / size, 1.0)

    def derivatives(self, q: Array) -> tuple[Array, Array]:
        """Return rows (r,) and their derivatives by all coordinates (r, C), in units of size."""
        residuals, J, _ = constraint_jacobian(self.t, q, np.arange(len(q)))
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
        residuals, _, m = constraint_jacobian(t, q, np.arange(len(q)))
        worst = np.abs(residuals * self.rows)
        if np.max(worst, initial=0.0) > OPEN:
            row = int(np.argmax(worst))
            name, kind = self.loops[t.rows[row, LOOP]], t.rows[row, KIND]
            amount = (f'{1e3 * abs(residuals[row]):.3g} mm' if kind == TRANSLATION
                      else f'{np.degrees(abs(residuals[row])):.3g} degrees')
            raise ModelError('robot.loops', name, f'close at home: it is open by {amount}, and '
                             'no position of the passive joints nearby closes it (check frames, '
                             'lengths, and robot.home)')
        for k, name in enumerate(self.loops):
            kinds = {tuple(row[AXES:]) for row in t.rows if row[LOOP] == k and row[KIND] == ANGLE}
            along = np.einsum('ij,ij->j', m.A[0, k], m.B[0, k])
            if (X, Z, 0, 0) in kinds and along[Z] < 0:
                raise ModelError('robot.loops', name, 'have both axes z the same way: they are '
                                 'opposite at home, turn one frame by pi about x')
            if (Y, Z, Z, Y) in kinds and np.min(along) < 0:
                raise ModelError('robot.loops', name, 'have both frames the same way round: one '
                                 'is half a turn off at home')

    def are_redundant(self, q: Array, free: Array) -> bool:
        """Return whether the coordinates that are not free depend on each other."""
        _, J = self.derivatives(q)
        return _rank(J) > _rank(J[:, free])

    def mobility(self, q: Array, drives: Integers, moves: Array) -> Mobility:
        """Return what is free at a closed home.

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
        # Here and not above: robots without loops need it not, and it takes long to import.
        from scipy.linalg import null_space, qr

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
        free = null_space(J_p, rcond=RANK) if len(J_p) else np.eye(len(passive))
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
            rows = np.sort(qr(J_p.T, pivoting=True, mode='r')[1][:rank])
            chosen = np.sort(qr(J_p[rows], pivoting=True, mode='r')[1][:rank])
            determined = passive[chosen]
            condition = float(np.linalg.cond(J_p[np.ix_(rows, chosen)]))
        held = np.setdiff1d(passive, determined)
        return Mobility(rows, determined, held, q, freedoms, condition)


def _rank(J: Array) -> int:
    if not J.size:
        return 0
    values = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(values > RANK * values[0])) if values[0] > 0 else 0


def with_determined_coordinates(t: Model, rows: Integers, passive: Integers, units: Array,
                                q: Array) -> Model:
    """Return tables whose first rows determine passive coordinates.

    Coordinates that few rows depend on come first: fewer zeros then fill up in the elimination.

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
    _, J, _ = constraint_jacobian(t, q, passive)
    passive = passive[np.argsort(np.count_nonzero(J[rows], axis=0), kind='stable')]
    every = np.concatenate((rows, np.setdiff1d(np.arange(len(t.rows)), rows)))
    places = t.places.copy()
    places[:, PASSIVE_OF] = columns_of(passive, len(q))
    return t._replace(rows=t.rows[every], row_reals=t.row_reals[every], passive=passive,
                      passive_unit=units[passive], places=places)


def columns_of(coordinates: Integers, count: int) -> Integers:
    """Return each coordinate's column among some coordinates, or -1."""
    column = np.full(count, -1)
    column[coordinates] = np.arange(len(coordinates))
    return column
