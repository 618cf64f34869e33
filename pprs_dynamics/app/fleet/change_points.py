# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Change points in a series of values over time: steps, and slopes with a beginning.

A change is told only where a constant is refuted by an F test, corrected for every place at which
it might have been found (Bonferroni) and for noise that is correlated from one value to the next.
The scatter is that of the series itself: what a fit says of its own uncertainty holds what does
not change from day to day, such as tolerances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import comb
from typing import Any

import numpy as np
from scipy.special import fdtrc

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MissingLibraryError

LEAST_VALUES = 8  # in a series in which changes are looked for
LEAST_SEGMENT = 3  # values before and after a change: fewer may be a bad day
CLIPPED = 3.5  # standard deviations from its neighbours beyond which a value is drawn in
NEIGHBOURS = 5
NORMAL = 1.4826  # standard deviation over median absolute deviation of Gaussian noise
MOST_STEPS = 4
# Of Schwarz's criterion, for one more change: its size, its place, and that changes are rare. Of
# series of 30 values with one step, 1 % got a second one at a price of 4.
PRICE = 5.0
DRAWS = 4000  # of slopes, for the time at which a limit is reached
# Of the values' size: a smaller scatter is rounding, of a number that recordings tell nothing of.
ROUNDING = 1e-6


@dataclass(frozen=True)
class ChangePoint:
    """A step, or a slope from some day on.

    Parameters
    ----------
    kind : {'step', 'slope'}
    time, time_std : float
        First day of the new value, or begin of the slope [days since 1970].
    size, size_std : float
        Of the step [unit]; or of the slope [unit per day].
    level : float
        Before [unit].
    """

    kind: str
    time: float
    time_std: float
    size: float
    size_std: float
    level: float


@dataclass(frozen=True)
class ChangePoints:
    """What became of a series.

    Parameters
    ----------
    found : tuple of ChangePoint
        None, one slope, or steps in order.
    probability : float
        Of so clear a change by chance, if nothing changed; at all places together.
    statistic : float
        F, for the order among changes.
    scatter : float
        Standard deviation from value to value [unit].
    fitted : (N,) array
        Curve through the values [unit].
    draws : (K, 3) array
        Begins [days], slopes [unit per day] and levels [unit] that the values allow, for a slope.
    """

    found: tuple[ChangePoint, ...]
    probability: float
    statistic: float
    scatter: float
    fitted: Array
    draws: Array


def find_change_points(time: Array, value: Array, threshold: float) -> ChangePoints:
    """Return the changes of a series.

    Parameters
    ----------
    time : (N,) array
        [days], ascending.
    value : (N,) array
    threshold : float
        Probability below which a change is told.
    """
    series = _Series(time, value)
    constant = ChangePoints((), 1.0, 0.0, series.scatter, np.full(len(time), np.median(value)),
                            np.zeros((0, 3)))
    # Without times, e.g. where stamps begin at 0, there is no order to look for changes in.
    if len(time) < LEAST_VALUES or time[0] == time[-1] or (
            series.scatter <= ROUNDING * float(np.abs(value).max())):
        return constant
    slope, steps = series.slope(), series.steps()
    best = min((slope, *steps), key=lambda one: one.information)
    probability, statistic = series.chance(best)
    if probability > threshold:
        return replace(constant, probability=probability, statistic=statistic)
    rest = float(np.sqrt(best.squares / max(len(time) - best.count - 1, 1)))
    found, draws = (series.told_slope() if best is slope
                    else (series.told_steps(best), constant.draws))
    return ChangePoints(found, probability, statistic, rest, best.fitted, draws)


@dataclass(frozen=True)
class _Fit:
    """A curve with `count` changes: sum of squares left, Schwarz's criterion, and places."""

    count: int
    squares: float
    information: float
    fitted: Array
    places: tuple[int, ...]


class _Series:
    def __init__(self, time: Array, value: Array) -> None:
        self.time = np.asarray(time, dtype=float)
        self.value = _drawn_in(np.asarray(value, dtype=float))
        self.n = len(self.value)

    @cached_property
    def scatter(self) -> float:
        return _scatter(self.value)

    def _fit(self, fitted: Array, count: int, places: tuple[int, ...]) -> _Fit:
        squares = float(np.sum((self.value - fitted) ** 2))
        least = self.n * (1e-6 * self.scatter) ** 2
        information = self.n * np.log(max(squares, least)) + PRICE * count * np.log(self.n)
        return _Fit(count, squares, float(information), fitted, places)

    @cached_property
    def _hinges(self) -> tuple[Array, Array, Array, Array]:
        """Return places (H,) at which a slope may begin, and fits of level and slope there.

        Coefficients (H, 2), sums of squares (H,) and covariances but for the noise (H, 2, 2).
        """
        places = np.unique(self.time[:self.n - LEAST_SEGMENT])
        places = places[places < self.time[-1]]  # recordings may have one time
        ramps = np.maximum(self.time - places[:, None], 0.0)
        columns = np.stack([np.ones_like(ramps), ramps], axis=2)
        spreads = np.linalg.inv(columns.transpose(0, 2, 1) @ columns)
        c = (spreads @ (columns.transpose(0, 2, 1) @ self.value)[:, :, None])[:, :, 0]
        rest = self.value - (columns @ c[:, :, None])[:, :, 0]
        return places, c, np.sum(rest ** 2, axis=1), spreads

    def slope(self) -> _Fit:
        """Return the best constant that turns into a line."""
        places, c, squares, _ = self._hinges
        k = int(np.argmin(squares))
        return self._fit(c[k, 0] + c[k, 1] * np.maximum(self.time - places[k], 0.0), 1, ())

    def steps(self) -> list[_Fit]:
        """Return the best fits with one step, two, ..."""
        try:
            from ruptures import KernelCPD
        except ImportError:
            raise MissingLibraryError('ruptures', 'finding changes', 'fleet') from None
        search: Any = KernelCPD(kernel='linear', min_size=LEAST_SEGMENT).fit(
            self.value[:, None] / self.scatter)
        found = []
        for count in range(1, min(MOST_STEPS, self.n // LEAST_SEGMENT - 1) + 1):
            places = tuple(search.predict(n_bkps=count)[:-1])
            fitted = np.concatenate([np.full(len(part), part.mean())
                                     for part in np.split(self.value, places)])
            found.append(self._fit(fitted, count, places))
        return found

    def chance(self, fit: _Fit) -> tuple[float, float]:
        """Return the probability of such a fit if nothing changed, and its F."""
        constant = float(np.sum((self.value - self.value.mean()) ** 2))
        freedom = self.n - 1 - fit.count
        rest = self.value - fit.fitted
        # Values that follow their predecessors are fewer than they look.
        follows = max(float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300), 0.0)
        inflation = (1 + follows) / (1 - min(follows, 0.95))
        noise = max(fit.squares, self.n * (1e-3 * self.scatter) ** 2) / freedom
        F = (constant - fit.squares) / fit.count / noise / inflation
        places = comb(self.n, fit.count)
        return float(min(places * fdtrc(fit.count, freedom, max(F, 0.0)), 1.0)), float(F)

    def told_slope(self) -> tuple[tuple[ChangePoint, ...], Array]:
        """Return the slope, averaged over the days at which it may have begun."""
        places, c, squares, spreads = self._hinges
        noise = squares.min() / max(self.n - 3, 1)
        # The noise is not known either: Student's t, for places as for coefficients.
        freedom = max(self.n - 3, 1)
        weights = (squares / max(squares.min(), 1e-300)) ** (-freedom / 2)
        weights /= weights.sum()
        rng = np.random.default_rng(0)
        chosen = rng.choice(len(places), DRAWS, p=weights)
        roots = np.linalg.cholesky(noise * spreads)
        wider = np.sqrt(freedom / rng.chisquare(freedom, (DRAWS, 1, 1)))
        drawn = c[chosen] + (roots[chosen] @ (wider * rng.standard_normal((DRAWS, 2, 1))))[:, :, 0]
        draws = np.column_stack([places[chosen], drawn[:, 1], drawn[:, 0]])
        day, size, level = draws.mean(axis=0)
        between = float(np.median(np.diff(places))) / 12 ** 0.5 if len(places) > 1 else 0.0
        day_std = float(np.hypot(draws[:, 0].std(), between))
        return (ChangePoint('slope', float(day), day_std, float(size), float(draws[:, 1].std()),
                            float(level)),), draws

    def told_steps(self, fit: _Fit) -> tuple[ChangePoint, ...]:
        """Return the steps of a fit."""
        noise = fit.squares / max(self.n - fit.count - 1, 1)
        bounds = (0, *fit.places, self.n)
        found = []
        for before, place, after in zip(bounds, fit.places, bounds[2:], strict=False):
            left, right = self.value[before:place], self.value[place:after]
            std = float(np.sqrt(noise * (1 / len(left) + 1 / len(right))))
            found.append(ChangePoint('step', float(self.time[place]),
                                     self._day_std(before, place, after, noise),
                                     float(right.mean() - left.mean()), std, float(left.mean())))
        return tuple(found)

    def _day_std(self, first: int, place: int, last: int, noise: float) -> float:
        """Return the uncertainty of a step's day, from how well the days around it would do."""
        places = np.arange(first + 1, last)
        squares = np.array([sum(float(np.sum((part - part.mean()) ** 2)) for part in (
            self.value[first:k], self.value[k:last])) for k in places])
        weights = np.exp(-0.5 * (squares - squares.min()) / max(noise, 1e-300))
        weights /= weights.sum()
        spread = float(np.sqrt(weights @ (self.time[places] - self.time[place]) ** 2))
        gap = float(self.time[place] - self.time[place - 1])
        return float(np.hypot(spread, gap / 12 ** 0.5))


def _scatter(value: Array) -> float:
    """Return the standard deviation from value to value, whatever the trend."""
    if len(value) < 2:
        return 0.0
    steps = np.diff(value) / 2 ** 0.5
    robust = NORMAL * float(np.median(np.abs(steps - np.median(steps))))
    return robust or float(np.std(steps))


def _drawn_in(value: Array) -> Array:
    """Return values with single bad days drawn in towards their neighbours."""
    if len(value) < NEIGHBOURS:
        return value
    padded = np.concatenate([value[NEIGHBOURS // 2:0:-1], value, value[-2:-2 - NEIGHBOURS // 2:-1]])
    middle: Array = np.median(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS), axis=1)
    most = CLIPPED * _scatter(value)
    return middle + np.clip(value - middle, -most, most)
