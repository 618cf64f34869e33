# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Score tests: the gain of each of many terms, all at once at the noise of a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.regression.joint_fit import Columns, JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block, term_gains

Label = TypeVar('Label')


@dataclass(frozen=True)
class Entry(Generic[Label]):
    """Some of the rows, which are fitted together.

    Parameters
    ----------
    label : Label
    rows : tuple of int
        Their places.
    precision : (k, k) array, optional
        Of the prior; by default the g-prior.
    mean : (k,) array, optional
        Of the prior; by default 0.
    """

    label: Label
    rows: tuple[int, ...]
    precision: Array | None = None
    mean: Array | None = None


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
    mean : (n, k) array
    """

    labels: list[Label]
    rows: Integers
    grams: dict[int, Array]
    precision: Array
    mean: Array


class ScoreTest(Generic[Label]):
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
        self.regression, self._columns = regression, Columns(regression, rows)
        sizes: dict[int, list[Entry[Label]]] = {}
        for entry in entries:
            sizes.setdefault(len(entry.rows), []).append(entry)
        self._groups = [self._group(listed) for listed in sizes.values()]

    @classmethod
    def of_blocks(cls, regression: Regression, labels: Sequence[Label], blocks: Sequence[Block],
                  ) -> ScoreTest[Label]:
        """Return the test of blocks, with their priors."""
        ends = np.cumsum([block.size for block in blocks]).tolist()
        rows = regression.joined(blocks).rows
        return cls(regression, {d: of.astype(np.float32) for d, of in rows.items()}, [
            Entry(label, tuple(range(end - block.size, end)), block.precision, block.mean)
            for label, block, end in zip(labels, blocks, ends, strict=True)])

    @property
    def rows(self) -> Mapping[int, Array]:
        """Rows of the tested columns."""
        return self._columns.rows

    def _group(self, entries: list[Entry[Label]]) -> _Group[Label]:
        places = np.array([entry.rows for entry in entries])
        size = places.shape[1]
        grams = {}
        for d, rows in self._columns.rows.items():
            series = self.regression.series[d]
            gram = np.empty((len(entries), size, size, len(series.bands)))
            for i in range(size):
                for j in range(i, size):
                    gram[:, i, j] = gram[:, j, i] = series.sums(
                        rows[places[:, i]] * rows[places[:, j]])
            grams[d] = gram
        precision = self.regression.g_prior({d: gram.sum(axis=-1) for d, gram in grams.items()})
        for number, entry in enumerate(entries):
            if entry.precision is not None:
                precision[number] = entry.precision
        mean = np.stack([np.zeros(size) if entry.mean is None else entry.mean
                         for entry in entries])
        return _Group([entry.label for entry in entries], places, grams, precision, mean)

    def gains(self, fit: JointFit) -> list[tuple[list[Label], Array]]:
        """Return labels, and by how much the deviance falls with each, by group."""
        if not self._groups:
            return []
        taken, side = self._columns.projected(fit)
        used = np.flatnonzero(taken.any(axis=0))
        taken = taken[:, used]
        spread = taken @ fit.covariance[np.ix_(used, used)]
        found = []
        for group in self._groups:
            S = -spread[group.rows] @ taken[group.rows].transpose(0, 2, 1)
            for d, gram in group.grams.items():
                S += gram @ self.regression.weights(fit, d)
            found.append((group.labels, term_gains(S, side[group.rows], group.precision,
                                                   group.mean)))
        return found
