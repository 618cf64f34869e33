# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What each of many terms would gain beside a fit, all at once at its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block, term_gains

MOST_CROSSES = 60  # products with blocks that are kept: those of a search's best sets

Label = TypeVar('Label')


@dataclass(frozen=True)
class Entry(Generic[Label]):
    """Some of a scan's rows, which are fitted together.

    Parameters
    ----------
    label : Label
    rows : tuple of int
        Their places.
    is_fixed : bool
        True where the only row has the coefficient 1.
    precision : (k, k) array, optional
        Of the prior; by default the g-prior.
    """

    label: Label
    rows: tuple[int, ...]
    is_fixed: bool = False
    precision: Array | None = None


@dataclass(frozen=True)
class _Group(Generic[Label]):
    """Entries with equally many rows.

    Parameters
    ----------
    labels : list of n Label
    rows : (n, k) int array
    grams : mapping of drive to (n, k, k, B) array
        Band sums.
    precision : (n, k, k) array
    is_fixed : bool
    """

    labels: list[Label]
    rows: np.typing.NDArray[np.int_]
    grams: dict[int, Array]
    precision: Array
    is_fixed: bool


class Scan(Generic[Label]):
    """Entries on some drives.

    Parameters
    ----------
    regression : Regression
    rows : mapping of drive to (R, n) array
        Transformed, in single precision: it proposes, and a fit decides.
    entries : sequence of Entry
    """

    def __init__(self, regression: Regression, rows: Mapping[int, Array],
                 entries: Sequence[Entry[Label]]) -> None:
        self.regression, self._rows = regression, rows
        self._crosses: dict[tuple[int, Block], Array] = {}
        kinds: dict[tuple[int, bool], list[Entry[Label]]] = {}
        for entry in entries:
            kinds.setdefault((len(entry.rows), entry.is_fixed), []).append(entry)
        self._groups = [self._group(listed, is_fixed)
                        for (_, is_fixed), listed in kinds.items()]

    def _group(self, entries: list[Entry[Label]], is_fixed: bool) -> _Group[Label]:
        places = np.array([entry.rows for entry in entries])
        size = places.shape[1]
        grams = {}
        for d, rows in self._rows.items():
            series = self.regression.series[d]
            gram = np.empty((len(entries), size, size, len(series.bands)))
            for i in range(size):
                for j in range(i, size):
                    gram[:, i, j] = gram[:, j, i] = series.sums(
                        rows[places[:, i]] * rows[places[:, j]])
            grams[d] = gram
        precision = np.stack([
            self.regression.g_prior({d: gram[number].sum(axis=-1) for d, gram in grams.items()})
            if entry.precision is None else entry.precision
            for number, entry in enumerate(entries)])
        return _Group([entry.label for entry in entries], places, grams, precision, is_fixed)

    def _cross(self, d: int, block: Block | None) -> Array:
        """Return band sums of all rows with a block's, or with base and error, (B, R, k)."""
        key = (d, block or _BASE)
        if key not in self._crosses:
            if len(self._crosses) > MOST_CROSSES * len(self._rows):
                self._crosses = {one: cross for one, cross in self._crosses.items()
                                 if one[1] is _BASE}
            other = self.regression.base[d] if block is None else block.rows[d]
            self._crosses[key] = self.regression.series[d].products(
                self._rows[d], other.astype(np.float32)).astype(np.float32)
        return self._crosses[key]

    def gains(self, fit: JointFit) -> list[tuple[list[Label], Array]]:
        """Return labels, and by how much the deviance falls with each, by group."""
        if not self._groups:
            return []
        count = len(next(iter(self._rows.values())))
        taken = np.zeros((count, len(fit.coefficients)))
        side = np.zeros(count)
        weights = {d: self.regression.weights(fit, d) for d in self._rows}
        for d in self._rows:
            index, felt = self.regression.local(fit, d)

            def weighted(block: Block | None, d: int = d) -> Array:
                cross = self._cross(d, block)
                narrow = weights[d].astype(np.float32)
                return (narrow @ cross.reshape(len(narrow), -1)).reshape(
                    cross.shape[1:]).astype(float)

            with_base = weighted(None)
            known = np.concatenate([with_base[:, :-1], *(weighted(one) for one in felt)], axis=1)
            side += with_base[:, -1] - known @ fit.coefficients[index]
            for block in fit.blocks:
                if block.is_fixed and d in block.rows:
                    side -= weighted(block)[:, 0]
            taken[:, index] += known
        felt_any = np.flatnonzero(taken.any(axis=0))
        taken = taken[:, felt_any]
        spread = taken @ fit.covariance[np.ix_(felt_any, felt_any)]
        found = []
        for group in self._groups:
            S = -spread[group.rows] @ taken[group.rows].transpose(0, 2, 1)
            for d, gram in group.grams.items():
                S += gram @ weights[d]
            found.append((group.labels, term_gains(S, side[group.rows], group.precision,
                                                   group.is_fixed)))
        return found


_BASE = Block({}, np.zeros((0, 0)))
