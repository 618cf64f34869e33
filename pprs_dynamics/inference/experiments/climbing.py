# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Local optimisation of a motion within limits: sequential quadratic programming (SLSQP).

The criterion is dear and, since drives turn over in a millimetre per second, rough: slopes are
differences over wide steps, and each round stays near where they were taken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError

ROUNDS, ITERATIONS = 2, 2
TRUST = 0.3  # of the largest parameter, that a round may move each
STEP = 0.02  # of differences, relative to the largest parameter
FAILURE = 10.0  # below the start: the value where the mechanism cannot follow
OUTSIDE = -1.0  # room there

Evaluation = Callable[[Array], tuple[Array, Array]]
"""Rows of parameters (M, p) -> values (M,) and room to each limit (M, L), 0 at the limit."""


class _Evaluated:
    """Values and slopes of an evaluation, each computed once."""

    def __init__(self, evaluated: Evaluation, start: Array) -> None:
        self._evaluated = evaluated
        self._step = STEP * float(np.abs(start).max())
        self._known: dict[bytes, tuple[float, Array]] = {}
        self._slopes: dict[bytes, tuple[Array, Array]] = {}
        values, rooms = evaluated(start[None])
        self._worst, self._limits = float(values[0]) - FAILURE, rooms.shape[1]
        self._known[start.tobytes()] = float(values[0]), rooms[0]

    def at(self, z: Array) -> tuple[float, Array]:
        """Return value and room."""
        key = z.tobytes()
        if key not in self._known:
            try:
                values, rooms = self._evaluated(z[None])
                self._known[key] = float(values[0]), rooms[0]
            except PprsError:
                self._known[key] = self._worst, np.full(self._limits, OUTSIDE)
        return self._known[key]

    def slopes(self, z: Array) -> tuple[Array, Array]:
        """Return the slopes of value (p,) and room (L, p)."""
        key = z.tobytes()
        if key not in self._slopes:
            value, room = self.at(z)
            try:
                values, rooms = self._evaluated(z + self._step * np.eye(len(z)))
                self._slopes[key] = ((values - value) / self._step,
                                     ((rooms - room) / self._step).T)
            except PprsError:
                self._slopes[key] = np.zeros(len(z)), np.zeros((self._limits, len(z)))
        return self._slopes[key]


def climb(start: Array, evaluated: Evaluation, put_back: Callable[[Array], Array]) -> Array:
    """Return parameters with a larger value than the start, or the start.

    Parameters
    ----------
    start : (p,) array
        Within the limits.
    evaluated : callable
        See `Evaluation`; raises PprsError where there is no value.
    put_back : callable
        Returns parameters moved onto the limits: these hold to first order only.
    """
    from scipy.optimize import Bounds, minimize  # here: commands start without it

    known = _Evaluated(evaluated, start)
    best, trust = start, TRUST
    for _ in range(ROUNDS):
        room = trust * np.abs(best).max()
        result = minimize(  # type: ignore[call-overload]
            lambda z: -known.at(z)[0], best, jac=lambda z: -known.slopes(z)[0], method='SLSQP',
            bounds=Bounds(best - room, best + room),
            constraints={'type': 'ineq', 'fun': lambda z: known.at(z)[1],
                         'jac': lambda z: known.slopes(z)[1]},
            options={'maxiter': ITERATIONS, 'ftol': 1e-3})
        moved = put_back(result.x)
        if known.at(moved)[0] > known.at(best)[0]:
            best = moved
        else:
            trust /= 2
    return best
