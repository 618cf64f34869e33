# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Patterns of one drive's error that are in no catalogue: ranges, growths, lines, coupling.

They compete with the effects of the catalogue in the same search and by the same criterion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import Columns, JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block, term_gains
from pprs_dynamics.inference.residuals.profiles import LEAST_SHARE, MOST_SHARE
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import CostTerms, PriorCosts, UnknownCandidate
from pprs_dynamics.inference.search.patterns import (
    Family,
    Pattern,
    build_families,
    trial_limits,
)

OVERSAMPLING = 4  # of the frequencies at which lines are looked for
# Limits of a range are moved by up to a bin, then by shares of it: a step in time is to be met to
# the sample.
LIMIT_STEPS = (1.0, 0.2, 0.04, 0.008)


@dataclass(frozen=True, eq=False)
class _Transformed:
    """A family with its columns transformed.

    Parameters
    ----------
    family : Family
    rows : (C, n) array
        In single precision.
    gram : (B, C, C) array
        Band sums.
    """

    family: Family
    rows: Array
    gram: Array

    def of_patterns(self, S: Array) -> Array:
        """Return products (C, C) of the columns for the patterns, (P, k, k)."""
        if self.family.paired:
            pairs = np.arange(len(S)).reshape(-1, 2)
            found: Array = S[pairs[:, :, None], pairs[:, None, :]]
            return found
        weights = self.family.weights
        positive: Array = np.maximum(np.sum(weights @ S * weights, axis=1), 0.0)[:, None, None]
        return positive

    def gains(self, columns: Columns, fit: JointFit, weights: Array, scale: float) -> Array:
        """Return by how much the deviance of a fit falls with each pattern, (P,).

        Parameters
        ----------
        columns : Columns
            The rows, against what is in a fit.
        fit : JointFit
        weights : (B,) array
            Of its noise.
        scale : float
            Of the g-priors of the patterns.
        """
        taken, side = columns.projected(fit)
        S = np.tensordot(weights, self.gram, 1) - taken @ fit.covariance @ taken.T
        b = side.reshape(-1, 2) if self.family.paired else (self.family.weights @ side)[:, None]
        precision = self.of_patterns(self.gram.sum(axis=0)) / scale
        # A pattern that no sample shows has no scale, and gains nothing.
        shown = np.einsum('pkk->p', precision) > 0
        found = np.full(len(b), -np.inf)
        found[shown] = term_gains(self.of_patterns(S)[shown], b[shown], precision[shown],
                                  np.zeros_like(b[shown]))
        return found


class DrivePatterns:
    """Patterns of the error of one drive, and their columns.

    Parameters
    ----------
    regression : Regression
    prior_costs : PriorCosts
    d : int
    with_plain_forms : bool
        Also what effects of the catalogue are exactly: a constant, friction, a ripple.
    """

    def __init__(self, regression: Regression, prior_costs: PriorCosts, d: int,
                 with_plain_forms: bool = False) -> None:
        self.regression, self.prior_costs, self.d = regression, prior_costs, d
        self.series = regression.series[d]
        self.with_plain_forms = with_plain_forms
        residuals = regression.residuals
        index = self.series.index
        self.residuals = Residuals(
            residuals.drives, residuals.time[index], residuals.segment[index],
            residuals.measured[index], residuals.model[index], {},
            {name: values[index] for name, values in residuals.variables.items()},
            residuals.period, residuals.units)

    @cached_property
    def _transformed(self) -> list[_Transformed]:
        def transformed(family: Family) -> _Transformed:
            rows = self.series.transform(family.columns.astype(np.float32, copy=False))
            return _Transformed(family, rows, self.series.products(rows, rows))

        return [transformed(family) for family in build_families(self.residuals, self.d)
                if self.with_plain_forms or not (family.paired or family.is_plain)]

    @cached_property
    def _columns(self) -> list[Columns]:
        return [Columns(self.regression, {self.d: transformed.rows})
                for transformed in self._transformed]

    @property
    def families(self) -> list[Family]:
        """All families that are searched."""
        return [transformed.family for transformed in self._transformed]

    def family_block(self, family: Family) -> Block:
        """Return all columns of a family as one block: any curve along its variable."""
        return self.regression.transformed_block(
            {self.d: self.series.transform(family.columns.astype(float))})

    def prior_cost(self, family: Family) -> CostTerms:
        """Return the prior cost of a pattern of a family: that it is unknown, where, and which."""
        return self.prior_costs.of_pattern(max(len(self._transformed), 1) * family.alike,
                                           max(len(family.patterns), 1))

    def candidate(self, family: Family, pattern: Pattern, rows: Array) -> UnknownCandidate:
        """Return a pattern with its columns (1 or 2, M at the series' samples)."""
        full = np.zeros((len(rows), len(self.regression.residuals)))
        full[:, self.series.index] = rows
        block = self.regression.transformed_block({self.d: self.series.transform(rows)})
        return UnknownCandidate(family, pattern, self.d, full, block, self.prior_cost(family))

    def proposals(self, fit: JointFit, count: int) -> list[tuple[UnknownCandidate, float]]:
        """Return the best patterns of different variables with their gains less their prior costs.

        Parameters
        ----------
        fit : JointFit
            At whose noise.
        count : int
        """
        weights = self.regression.weights(fit, self.d)
        scale = len(self.series) * max(self.regression.error_scale[self.d], 1e-12) ** 2
        scored: list[tuple[float, Family, int]] = []
        for transformed, columns in zip(self._transformed, self._columns, strict=True):
            gains = transformed.gains(columns, fit, weights, scale)
            best = int(np.argmax(gains))
            net = float(gains[best]) - self.prior_cost(transformed.family).total
            scored.append((net, transformed.family, best))
        scored.sort(key=lambda scored: -scored[0])
        found = [(self.candidate(family, family.patterns[best], family.pattern_columns(best)),
                  score)
                 for score, family, best in scored[:count]]
        line = self.line(fit)
        if line is not None:
            found.append((line, self.regression.gain(fit, line.block) - line.terms.total))
        return sorted(found, key=lambda scored: -scored[1])

    def line(self, fit: JointFit) -> UnknownCandidate | None:
        """Return the strongest spectral line of the residual of a fit."""
        longest = max(self.series.stretches, key=lambda part: part.stop - part.start)
        white = self.regression.in_time(
            fit, self.d, self.regression.remaining(fit, self.d))[longest]
        at = self.series.index[longest] - self.series.index[longest.start]
        n, period = int(at[-1]) + 1, self.residuals.period
        lowest = self.prior_costs.decisions.line_periods
        if n < 16 * lowest:
            return None
        even = np.zeros(n)
        even[at] = white
        power = np.abs(np.asarray(fft.rfft(even, OVERSAMPLING * n))) ** 2
        first = int(np.ceil(lowest * OVERSAMPLING))
        frequency = (first + int(np.argmax(power[first:-1]))) / (OVERSAMPLING * n * period)
        time = self.residuals.time[longest]
        step = 1 / (OVERSAMPLING * n * period)
        for _ in range(4):
            trial = frequency + step * np.linspace(-1, 1, 11)
            heights = np.abs(np.exp(-2j * np.pi * trial[:, None] * time) @ white)
            frequency = float(trial[int(np.argmax(heights))])
            step /= 5
        pattern, rows = Pattern('line', scale=frequency), _wave(frequency, self.residuals.time)
        # As many frequencies as the stretch resolves were tried.
        family = Family('frequency', rows, np.zeros((0, 0)), (pattern,), alike=n // 2,
                        paired=True)
        return self.candidate(family, pattern, rows)

    def refined(self, candidate: UnknownCandidate, fit: JointFit) -> UnknownCandidate:
        """Return a range with its limits moved to where they gain most at the noise of a fit.

        Parameters
        ----------
        candidate : UnknownCandidate
        fit : JointFit
            Without the candidate.
        """
        pattern, family = candidate.pattern, candidate.family
        if pattern.kind not in ('range', 'directed_range') or pattern.limits is None:
            return candidate
        speed = family.variable.startswith('velocity') and pattern.kind == 'directed_range'
        values = self.values(family.variable)
        values = np.abs(values) if speed else values
        sign = self.values('direction') if pattern.kind == 'directed_range' else 1.0
        weights = self.series.spread(self.regression.weights(fit, self.d))
        limits = list(pattern.limits)
        outer = (float(values.min()), float(values.max()))
        best = -np.inf
        for end, width in ((end, width) for width in LIMIT_STEPS for end in (0, 1)):
            if limits[end] == outer[end]:
                continue
            trials = trial_limits(limits[end], outer, family.edges, width)
            low = np.where(end == 0, trials, limits[0])
            high = np.where(end == 1, trials, limits[1])
            rows = np.asarray(((values >= low[:, None]) & (values <= high[:, None])) * sign,
                              dtype=float)
            # A handful of samples is an incident, not a range; so is what all but them leave.
            share = np.abs(rows).mean(axis=1)
            held = (share >= LEAST_SHARE) & (share <= MOST_SHARE)
            x = self.series.transform(rows)
            taken, side = Columns(self.regression, {self.d: x}).projected(fit)
            information = x ** 2 @ weights - np.einsum('ip,pq,iq->i', taken, fit.covariance, taken)
            gains = np.where(held, side ** 2 / np.maximum(information, 1e-9), -np.inf)
            top = int(np.argmax(gains))
            if gains[top] > best:
                best, limits[end] = float(gains[top]), float(trials[top])
        moved = pattern._replace(limits=(limits[0], limits[1]))
        rows = np.asarray((values >= limits[0]) & (values <= limits[1]), dtype=float) * sign
        return self.candidate(family, moved, rows[None])

    def values(self, variable: str) -> Array:
        """Return a variable by its name in the interface, also one of another drive, (n,)."""
        values = self.residuals.variable(variable, self.d)
        assert values is not None
        return values


def _wave(frequency: float, time: Array) -> Array:
    """Return cosine and sine of a frequency [Hz], (2, n)."""
    phase = 2 * np.pi * frequency * time
    return np.stack((np.cos(phase), np.sin(phase)))


def best_patterns(libraries: Sequence[DrivePatterns], fit: JointFit, count: int,
                  least: float = 0.0) -> list[UnknownCandidate]:
    """Return the best patterns of any drive at the noise of a fit, their limits refined.

    Of those whose gain less their prior cost is more than the least.
    """
    found = [(candidate, gain, components) for components in libraries
             for candidate, gain in components.proposals(fit, count)]
    found.sort(key=lambda scored: -scored[1])
    return [components.refined(candidate, fit)
            for candidate, gain, components in found[:count] if gain > least]
