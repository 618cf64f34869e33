# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What all entrants by regression share: whitened equations of a problem, and groups of columns.

No entrant sees the truth, and none has more than the protocol's files. A group is one effect at
one place in one shape; an entrant chooses groups, and `answered` makes an answer of its choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from benchmarks.naming.problems import Answer, Column, Named, Problem
from pprs_dynamics.arrays import Array

HIGHEST_ORDER = 24  # of autoregressive noise
RIDGE = 1e-9  # relative, against columns that are nearly alike


@dataclass(frozen=True)
class Group:
    """Columns that are taken or left together."""

    effect: str
    drive: str | None
    columns: tuple[int, ...]


class Equations:
    """A problem as weighted least squares, drives one after the other.

    Parameters
    ----------
    problem : Problem
    whiten : bool
        Whether noise of each drive is taken as autoregressive, its order by BIC; else as white.
    found : sequence of Group
        Groups of an earlier choice, with which the noise is estimated.

    Attributes
    ----------
    y : (n,) array
        The error in units of its noise, what the model's own numbers explain taken out.
    X : (n, P) array
        The columns, likewise, each scaled to length sqrt(n).
    blocks : (n,) array of int
        Ten stretches of time, for cross-validation.
    """

    def __init__(self, problem: Problem, whiten: bool = False, found: Sequence[Group] = ()) -> None:
        self.problem = problem
        groups: dict[tuple[str, str | None, tuple[tuple[str, float], ...]], list[int]] = {}
        for k, column in enumerate(problem.columns):
            groups.setdefault(column.group, []).append(k)
        self.groups = [Group(effect, drive, tuple(columns))
                       for (effect, drive, _), columns in groups.items()]
        y, X, base = [], [], []
        for d in range(len(problem.drives)):
            own, of_base = problem.error[:, d], problem.base[:, :, d]
            known = np.isfinite(own)
            stacked = np.vstack((own[known], of_base[:, known], problem.rows[:, known, d]))
            there = [1 + len(of_base) + k for group in found for k in group.columns]
            rest = _residual(stacked[0], stacked[[*range(1, 1 + len(of_base)), *there]])
            filtered = lfilter(_predictor(rest) if whiten else [1.0 / max(rest.std(), 1e-12)], 1.0,
                               stacked)
            skip = HIGHEST_ORDER if whiten else 0
            filtered = filtered[:, skip:]
            y.append(filtered[0])
            base.append(filtered[1:1 + len(of_base)])
            X.append(filtered[1 + len(of_base):])
        self.y, wide, of_model = (np.concatenate(y), np.concatenate(X, axis=1).T,
                                  np.concatenate(base, axis=1).T)
        self.blocks = np.concatenate([np.arange(len(e)) * 10 // max(len(e), 1) for e in y])
        self.drive = np.repeat(np.arange(len(y)), [len(e) for e in y])
        # The model's numbers are as uncertain as their priors: unit precision beside the columns.
        gram = of_model.T @ of_model + np.eye(of_model.shape[1])
        self.y = self.y - of_model @ np.linalg.solve(gram, of_model.T @ self.y)
        wide -= of_model @ np.linalg.solve(gram, of_model.T @ wide)
        length = np.sqrt(np.mean(np.square(wide), axis=0))
        self.scale = np.where(length > 1e-9, length, np.inf)
        self.X: Array = wide / self.scale
        self.gram = self.X.T @ self.X
        self.right = self.X.T @ self.y
        self.total = float(self.y @ self.y)

    def fit(self, columns: Sequence[int]) -> tuple[Array, Array, float]:
        """Return coefficients of the scaled columns, their covariance at unit noise, and the rest.

        The rest is the sum of squares that is left.
        """
        at = np.asarray(columns, dtype=int)
        if not len(at):
            return np.zeros(0), np.zeros((0, 0)), self.total
        gram = self.gram[np.ix_(at, at)]
        inverse = np.linalg.inv(gram + RIDGE * np.trace(gram) * np.eye(len(at)))
        found = inverse @ self.right[at]
        return found, inverse, float(self.total - self.right[at] @ found)

    def compressed(self, without: Array | None = None) -> tuple[Array, Array]:
        """Return as many rows as there are columns that say the same as all samples but some.

        X' X and X' y are those of the samples; a library gets through these in a fraction of the
        time.
        """
        gram, right = self.gram, self.right
        if without is not None:
            gram = gram - self.X[without].T @ self.X[without]
            right = right - self.X[without].T @ self.y[without]
        values, vectors = np.linalg.eigh(gram)
        kept = values > 1e-9 * values.max()
        root = np.sqrt(values[kept])
        return (np.asfortranarray(root[:, None] * vectors[:, kept].T),
                (vectors[:, kept].T @ right) / root)

    def gains(self, chosen: Sequence[int], groups: Sequence[Group]) -> Array:
        """Return by how much each group lowers the rest in addition to chosen columns."""
        at = np.asarray(chosen, dtype=int)
        inverse = (np.linalg.inv(self.gram[np.ix_(at, at)] + RIDGE * len(self.y) * np.eye(len(at)))
                   if len(at) else np.zeros((0, 0)))
        found = inverse @ self.right[at]
        gains = np.zeros(len(groups))
        for k, group in enumerate(groups):
            own = np.asarray(group.columns)
            cross = self.gram[np.ix_(at, own)]
            right = self.right[own] - cross.T @ found
            part = (self.gram[np.ix_(own, own)] - cross.T @ inverse @ cross
                    + 1e-6 * len(self.y) * np.eye(len(own)))
            gains[k] = right @ np.linalg.solve(part, right)
        return gains

    def answered(self, chosen: Sequence[Group]) -> Answer:
        """Return an answer that names groups, the one that explains most first."""
        columns = [k for group in chosen for k in group.columns]
        if not columns:
            return Answer('none')
        found, inverse, rest = self.fit(columns)
        noise = rest / max(len(self.y) - len(columns), 1)
        deviation = np.sqrt(np.maximum(noise * np.diag(inverse), 0.0))
        by_effect: dict[str, list[tuple[Group, float]]] = {}
        at = 0
        values: dict[str, dict[str, tuple[float, float | None]]] = {}
        for group in chosen:
            part = slice(at, at + len(group.columns))
            without = [k for k in columns if k not in group.columns]
            power = self.fit(without)[2] - rest
            by_effect.setdefault(group.effect, []).append((group, power))
            for k, value, std in zip(group.columns, found[part], deviation[part], strict=True):
                column: Column = self.problem.columns[k]
                key = (f'{group.drive}.' if group.drive else '') + column.coefficient
                values.setdefault(group.effect, {})[key] = (
                    float(value / self.scale[k]), float(std / self.scale[k]))
            at = part.stop
        order = sorted(by_effect, key=lambda name: -sum(power for _, power in by_effect[name]))
        return Answer.of([Named(
            name, None if by_effect[name][0][0].drive is None else tuple(
                drive for drive in self.problem.drives
                if any(group.drive == drive for group, _ in by_effect[name])),
            values[name]) for name in order])

    def best_single(self) -> list[int]:
        """Return the columns of each effect at each place in the shape that fits best alone."""
        gains = self.gains([], self.groups)
        best: dict[tuple[str, str | None], tuple[float, Group]] = {}
        for gain, group in zip(gains, self.groups, strict=True):
            key = group.effect, group.drive
            if gain > best.get(key, (-1.0, group))[0]:
                best[key] = float(gain), group
        return [k for _, group in best.values() for k in group.columns]

    def forward(self, most: int = 12) -> list[Group]:
        """Return groups in the order in which a greedy search takes them; one shape of each."""
        chosen: list[Group] = []
        free = list(self.groups)
        while len(chosen) < most and free:
            gains = self.gains([k for group in chosen for k in group.columns], free)
            best = free[int(np.argmax(gains))]
            chosen.append(best)
            free = [g for g in free if (g.effect, g.drive) != (best.effect, best.drive)]
        return chosen


def _residual(y: Array, base: Array) -> Array:
    if not len(base):
        return y
    # Of one size: numbers of which little is known are a million times as large as others.
    even = base / np.maximum(np.sqrt(np.mean(np.square(base), axis=1)), 1e-12)[:, None]
    gram = even @ even.T
    return y - even.T @ np.linalg.solve(gram + RIDGE * len(y) * np.eye(len(even)), even @ y)


def _predictor(noise: Array) -> Array:
    """Return the filter of the prediction error of autoregressive noise, to unit variance."""
    n = len(noise)
    full = np.correlate(noise, noise, 'full')[n - 1:n + HIGHEST_ORDER] / n
    best, chosen = np.inf, np.array([1.0 / np.sqrt(max(full[0], 1e-24))])
    first = full * (1 + 1e-9 * (np.arange(len(full)) == 0))
    for order in range(1, HIGHEST_ORDER + 1):
        past = solve_toeplitz(first[:order], full[1:order + 1])
        variance = max(float(full[0] - past @ full[1:order + 1]), 1e-24)
        cost = n * np.log(variance) + order * np.log(n)
        if cost < best:
            best, chosen = cost, np.concatenate(([1.0], -past)) / np.sqrt(variance)
    return np.asarray(chosen)
