# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which columns are derivatives of which, and which are the same motion, earlier or later."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.readings import table
from pprs_dynamics.measurement.files.recording import MOST_OF_TURN, TURN_ROUNDING, unwrapped


@dataclass(frozen=True)
class Links:
    """Which columns are derivatives of which, from M columns of N samples.

    Parameters
    ----------
    correlation, slope : (M, M) arrays
        Of column j with the derivative of column i, over steps of several lengths; NaN where one
        of them does not move.
    """

    correlation: Array
    slope: Array

    @classmethod
    def of(cls, values: Array, time: Array) -> Links:
        """Compare changes of every column, (N, M), with the integral of every other one.

        Integrals forgive quantisation and noise, which differences multiply.
        """
        known = np.isfinite(values).all(axis=1) & np.isfinite(time)
        known[known] = np.concatenate([[True], np.diff(time[known]) > 0])
        values, time = running_on(values[known]), time[known]
        count = values.shape[1]
        best = [np.full((count, count), np.nan) for _ in range(2)]
        if len(time) < table.LEAST_ROWS:
            return cls(*best)
        steps = np.diff(time)[:, None]
        area = np.vstack([np.zeros(count), np.cumsum(
            0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
        for length in (step for step in table.LENGTHS_OF_STEPS if step < len(time) // 4):
            change, covered = (each[length:] - each[:-length] for each in (values, area))
            change, covered = change - change.mean(axis=0), covered - covered.mean(axis=0)
            with np.errstate(divide='ignore', invalid='ignore'):
                sizes, areas = (np.sqrt(np.sum(each ** 2, axis=0)) for each in (change, covered))
                product = change.T @ covered
                found = product / np.outer(sizes, areas)
            better = ~(np.abs(found) <= np.abs(best[0])) & np.isfinite(found)
            slope = (np.sum(covered ** 2, axis=0)[None, :]
                     / np.where(product == 0, np.nan, product))
            best = [np.where(better, new, old) for new, old in zip(
                (found, slope), best, strict=True)]
        return cls(*best)


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
    """A way in which columns are blocks of one quantity each.

    Parameters
    ----------
    positions, velocities : list of int
        Places of columns; of the latter there may be none.
    efforts : list of list of int
        Blocks that may be efforts: neither of the motion nor of what it was asked to be.
    rate : float
        Velocities over the derivatives of positions; NaN without velocities.
    """

    positions: list[int]
    velocities: list[int]
    efforts: list[list[int]]
    rate: float


def layouts(values: Array, time: Array, turns: Sequence[bool]) -> list[Layout]:
    """Return layouts of columns, (N, M), in blocks or in every so many, others before or after.

    The smoothest positions with velocities come first. Of D drives some turn, the others slide.
    """
    links, width, count = Links.of(values, time), values.shape[1], len(turns)
    number = width // count
    if not number:
        return []
    found: dict[tuple[int, ...], Layout] = {}
    for first in range(width - number * count + 1):
        places = np.arange(first, first + number * count)
        for blocks in (places.reshape(number, count), places.reshape(count, number).T):
            for layout in _layouts_of(links, values, blocks.tolist(), turns):
                found.setdefault((*layout.positions, *layout.velocities), layout)
    return sorted(found.values(), key=lambda layout: (
        not layout.velocities, roughness(values[:, layout.positions])))


def _layouts_of(links: Links, values: Array, blocks: list[list[int]], turns: Sequence[bool],
                ) -> Iterator[Layout]:
    numbers = range(len(blocks))

    def in_one_unit(block: Sequence[int], other: Sequence[int]) -> bool:
        """Return whether slopes of drives that turn are the same, and of those that slide."""
        slopes = np.log(np.maximum(links.slope[block, other], 1e-300))
        return all(np.ptp(group) < table.NEAR_ONE for kind in {*turns} if len(
            group := slopes[np.isfinite(slopes) & (np.array(turns) == kind)]))

    # A block has the derivatives of another where most joints that move have them.
    rates = np.array([[_median(links.correlation[block, other]) for other in blocks]
                      for block in blocks]).reshape(len(blocks), len(blocks))
    np.fill_diagonal(rates, 0.0)
    # What has a velocity is followed by it best: an effort may resemble a position.
    is_rate = (rates > table.ALIKE) & (rates > rates.max(axis=0, initial=0.0) - table.AS_WELL)
    is_rate &= np.array([[in_one_unit(block, other) for other in blocks] for block in blocks])
    alike = np.array([[move_alike(values, block, other) for other in blocks] for block in blocks])
    still = [k for k in numbers if not is_rate[:, k].any()]
    for b in [k for k in still if is_rate[k].any()] or still:
        # What is asked for moves as what is measured.
        group = [k for k in still if alike[b, k]]
        q = group[measured(values, [blocks[k] for k in group])]
        # An effort may follow what was asked for as a velocity does, but less than one does.
        best = max(np.flatnonzero(is_rate[group].any(axis=0)).tolist(),
                   key=lambda k: float(rates[group, k].max()), default=None)
        speeds = [] if best is None else [k for k in numbers if alike[best, k]]
        v = speeds[measured(values, [blocks[k] for k in speeds])] if speeds else None
        used = {*group, *speeds}
        slope = np.nan if v is None else _median(links.slope[blocks[q], blocks[v]])
        # Of what was asked for the derivatives are known, too.
        for _ in range(2):
            used |= {k for k in numbers for j in used if alike[j, k] or (
                rates[j, k] > table.COPY and abs(_median(
                    links.slope[blocks[j], blocks[k]]) / slope - 1) < table.SAME_UNIT)}
        rest = [blocks[k] for k in numbers if k not in used]
        if v is None or rest or rates[q, v] > table.COPY:
            yield Layout(blocks[q], [] if v is None else blocks[v], rest, slope)
        else:  # an effort may resemble a velocity, where friction is most of it
            yield Layout(blocks[q], [], [blocks[k] for k in speeds], np.nan)


def _median(values: Array) -> float:
    """Return the median over joints that move."""
    moving = values[np.isfinite(values)]
    return float(np.median(moving)) if len(moving) else 0.0


def move_alike(values: Array, block: Sequence[int], other: Sequence[int]) -> bool:
    """Return whether some columns move as others do, perhaps earlier or later."""
    return all(lag(values[:, first], values[:, second]) is not None or not (
        np.any(np.diff(values[:, first])) or np.any(np.diff(values[:, second])))
        for first, second in zip(block, other, strict=True))


def lag(values: Array, other: Array) -> int | None:
    """Return by how many samples other values come later; None where they do not move alike."""
    values, other = np.nan_to_num(values), np.nan_to_num(other)
    step = max(_step(values), _step(other))
    first, second = (each[step:] - each[:-step] for each in (values, other))
    count = len(first) - table.LONGEST_LAG
    if count < table.LEAST_ROWS or not (np.any(first) and np.any(second)):
        return None
    found = {sign * k: float(np.corrcoef(early[:count], late[k:count + k])[0, 1])
             for sign, early, late in ((-1, second, first), (1, first, second))
             for k in range(table.LONGEST_LAG)}
    best = max(found, key=lambda lag: found[lag])
    return best if found[best] > table.COPY else None


def _step(values: Array) -> int:
    """Return the samples in which a column changes by many of the counts that it has."""
    moved = np.abs(np.diff(values))
    count = np.min(moved, where=moved > 0, initial=np.inf)
    return next((step for step in table.LENGTHS_OF_STEPS[:4] if np.std(
        values[step:] - values[:-step]) > table.COARSE * count), 1)


def measured(values: Array, blocks: Sequence[Sequence[int]]) -> int:
    """Return the place of the block that is measured, of those that move as the first one does.

    That is the last one, or the one with noise: commands have none.
    """
    lags = [[lag(values[:, first], values[:, other]) for first, other in zip(
        blocks[0], block, strict=True)] for block in blocks]
    alike = [k for k, each in enumerate(lags) if k == 0 or None not in each]
    rough = [roughness(values[:, block]) for block in blocks]
    least = table.ROUGHER * min(rough[k] for k in alike)
    return max(alike, key=lambda k: (float(np.median([lag or 0 for lag in lags[k]])),
                                     rough[k] > least))


def roughness(values: Array) -> float:
    """Return the size of third differences over that of the first ones: small for a motion."""
    moved = np.std(np.diff(values, axis=0), axis=0)
    return float(np.median(np.std(np.diff(values, 3, axis=0), axis=0) / np.maximum(moved, 1e-300)))
