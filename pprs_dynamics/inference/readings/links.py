# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are derivatives of which, and which are the same motion, earlier or later."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.readings import table
from pprs_dynamics.measurement.files.recording import MOST_OF_TURN, TURN_ROUNDING, unwrapped


def links_of(values: Array, time: Array) -> tuple[Array, Array]:
    """Return which of M columns, (N, M), are derivatives of which, (M, M) each.

    Correlation, and ratio, of column j with the derivative of column i; NaN where one of them does
    not move. Changes of every column are compared with the integral of every other one, over
    steps of several lengths: integrals forgive quantisation and noise, which differences multiply.
    """
    known = np.isfinite(values).all(axis=1) & np.isfinite(time)
    known[known] = np.concatenate([[True], np.diff(time[known]) > 0])
    values, steps = values[known], np.diff(time[known])[:, None]
    area = np.cumsum(np.vstack([0 * values[:1], 0.5 * (values[1:] + values[:-1]) * steps]), axis=0)
    correlation, slope = np.full((2, values.shape[1], values.shape[1]), np.nan)
    for length in (step for step in table.LENGTHS_OF_STEPS if (
            step < len(values) // 4 and len(values) >= table.LEAST_ROWS)):
        change, covered = (part[length:] - part[:-length] for part in (values, area))
        change, covered = change - change.mean(axis=0), covered - covered.mean(axis=0)
        sizes, areas = (np.sum(part ** 2, axis=0) for part in (change, covered))
        product = np.where(both := np.outer(sizes, areas), change.T @ covered, np.nan)
        alike = product / np.sqrt(np.where(both, both, 1.0))
        better = ~(np.abs(alike) <= np.abs(correlation)) & np.isfinite(alike)
        with np.errstate(divide='ignore'):
            slope = np.where(better, areas / product, slope)
        correlation = np.where(better, alike, correlation)
    return correlation, slope


def velocity_links(drives: Iterable[Sequence[Array]], time: Array) -> list[tuple[float, float]]:
    """Return the correlation of velocities with derivatives of positions, and their ratio.

    Of each drive, from its positions and velocities, (N,) each, in the middle of a recording. Both
    are NaN where a drive does not move or is not known.
    """
    middle = slice(max(len(time) // 2 - table.HALF, 0), len(time) // 2 + table.HALF)
    found = [links_of(np.column_stack(pair)[middle], time[middle]) for pair in drives]
    return [(float(correlation[0, 1]), float(slope[0, 1])) for correlation, slope in found]


def turn_of(values: Array) -> float:
    """Return after how much the angles of a column, (N,), begin again; infinite if they do not."""
    known = values[np.isfinite(values)]
    span, step = np.ptp(known), np.abs(np.diff(known)).max(initial=0.0)
    return next((turn for unit in (1.0, *table.ANGLES, *table.COUNTS)
                 if table.NEARLY < span / (turn := 2 * np.pi / unit) <= 1 + TURN_ROUNDING
                 and step > MOST_OF_TURN * turn), np.inf)


def running_on(values: Array) -> Array:
    """Return columns, (N, M), of which angles run on that begin again after a turn."""
    return unwrapped(values, [turn_of(column) for column in values.T])[0]


@dataclass(frozen=True)
class Layout:
    """A hypothesis: columns are blocks of one quantity each.

    Parameters
    ----------
    blocks : dict of str to list of int
        Places of columns by quantity: positions, perhaps velocities and efforts.
    rate : float
        Velocities over the derivatives of positions; 0 without velocities.
    evidence : float
        That the other columns follow from the positions [nats].
    """

    blocks: dict[str, list[int]]
    rate: float
    evidence: float


def layouts(values: Array, time: Array, count: int) -> list[Layout]:
    """Return layouts of columns, (N, M), in blocks or in every so many, others before or after.

    Those with the most evidence come first, of equal ones those with the smoothest positions.
    """
    links, width = links_of(values, time), values.shape[1]
    number = width // count
    found: dict[str, Layout] = {}
    for first in range(width - number * count + 1) if number else ():
        places = np.arange(first, first + number * count)
        for blocks in (places.reshape(number, count), places.reshape(count, number).T):
            for layout in _layouts_of(*links, values, blocks.tolist()):
                found.setdefault(str(layout.blocks), layout)
    return sorted(found.values(), key=lambda layout: (
        -layout.evidence, roughness(values[:, layout.blocks[table.POSITION]])))


def _layouts_of(correlation: Array, slope: Array, values: Array, blocks: list[list[int]],
                ) -> Iterator[Layout]:
    """Yield which block may be the positions, and which other one, or none, the efforts."""
    numbers, moves = range(len(blocks)), np.any(np.diff(values, axis=0), axis=0)
    moving = [in_motion(values, block) for block in blocks]
    # A block that is the derivative of another, or the same earlier or later.
    rates = np.array([[_nats(correlation[i, j][first & second]) for j, second in zip(
        blocks, moving, strict=True)] for i, first in zip(blocks, moving, strict=True)])
    alike = np.array([[lag_of(values, i, j) is not None for j in blocks] for i in blocks])
    follows = np.where(alike, len(blocks[0]) * _nats(np.array([table.COPY])), rates)

    def best_of(block: int, known: Sequence[int]) -> int:
        """Return the measured one of those that move as a block does."""
        group = sorted({block, *(k for k in known if alike[block, k])})
        return group[measured(values, [blocks[k] for k in group])]

    for q in numbers:
        for effort in (None, *numbers) if (
                np.any(moving[q]) and best_of(q, numbers) == q) else ():
            if effort == q:
                continue
            # The tree of the likeliest links from the positions to all that follows from them.
            known, rest, evidence = [q], {*numbers} - {q, effort}, 0.0
            while rest and (best := max((follows[i, k], k) for i in known for k in rest))[0] > 0:
                known.append(best[1])
                rest.remove(best[1])
                evidence += best[0]
            found = {table.POSITION: blocks[q]}
            if rates[q, known].any():
                found[table.VELOCITY] = blocks[best_of(
                    max(known, key=lambda k: float(rates[q, k])), known)]
            if effort is not None:
                found[table.EFFORT] = blocks[effort]
            explained = [*blocks[q], *(blocks[effort] if effort is not None else ()), *(
                place for k in known for place in np.asarray(blocks[k])[moving[k] & moving[q]])]
            evidence -= table.MASSES_MOST * float(np.sum(np.delete(moves, explained)))
            slopes = slope[found[table.POSITION], found.get(table.VELOCITY, blocks[q])][
                moving[q]]
            yield Layout(found, float(np.nanmedian(slopes)) if table.VELOCITY in found else 0.0,
                         evidence)


def _nats(correlation: Array) -> float:
    """Return the evidence for a link of the columns of all joints; 0 for none."""
    moving = correlation[np.isfinite(correlation)]
    if not len(moving) or np.median(moving) <= table.ALIKE:
        return 0.0
    return float(-0.5 * table.SAMPLES * np.sum(np.log(np.maximum(
        1 - np.maximum(moving, 0.0) ** 2, table.CLOSEST))))


def in_motion(values: Array, block: Sequence[int]) -> NDArray[np.bool_]:
    """Return which columns of a block, of one unit, move by more than the noise of a still one."""
    spans = np.ptp(np.nan_to_num(values[:, block]), axis=0)
    return np.asarray(spans > table.WEAK * spans.max())


def lag_of(values: Array, block: Sequence[int], other: Sequence[int]) -> float | None:
    """Return by how many samples another block comes later; None if they do not move alike."""
    first, second = in_motion(values, block), in_motion(values, other)
    if not np.any(first & second):
        return None if np.any(first | second) else 0.0
    lags = [lag(values[:, block[k]], values[:, other[k]])
            for k in np.flatnonzero(first & second).tolist()]
    known = [found for found in lags if found is not None]
    return float(np.median(known)) if len(known) == len(lags) else None


def lag(values: Array, other: Array) -> int | None:
    """Return by how many samples other values come later; None where they do not move alike."""
    # Over many samples an encoder's counts do not matter.
    step = max(1, len(values) // table.LEAST_ROWS)
    first, second = (np.nan_to_num(part[step:] - part[:-step]) for part in (values, other))
    count = len(first) - table.LONGEST_LAG
    if count < table.LEAST_ROWS or not (np.any(first) and np.any(second)):
        return None
    found = {sign * k: float(np.corrcoef(early[:count], late[k:count + k])[0, 1])
             for sign, early, late in ((-1, second, first), (1, first, second))
             for k in range(table.LONGEST_LAG)}
    best = max(found, key=lambda lag: found[lag])
    return best if found[best] > table.COPY else None


def measured(values: Array, blocks: Sequence[Sequence[int]]) -> int:
    """Return the place of the block that is measured, of those that move as the first one does.

    That is the last one, or the one with noise: commands have none.
    """
    lags = [lag_of(values, blocks[0], block) for block in blocks]
    rough = [roughness(values[:, block]) for block in blocks]
    alike = [k for k, found in enumerate(lags) if k == 0 or found is not None]
    least = table.ROUGHER * min(rough[k] for k in alike)
    return max(alike, key=lambda k: (lags[k] or 0.0, rough[k] > least))


def roughness(values: Array) -> float:
    """Return the third differences of columns over their first ones: small for a motion.

    The median does not see single jumps.
    """
    moved = np.maximum(np.std(np.diff(values, axis=0), axis=0), 1e-300)
    return float(np.median(np.abs(np.diff(values, 3, axis=0)) / moved))
