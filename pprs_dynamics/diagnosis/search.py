"""The search for patterns in one drive's error, under noise that is fitted with each of them.

Whether an error is a pattern or slow noise is decided by likelihood: the noise is fitted once
with the pattern taken out and once with it left in, and the two deviances are compared. Noise
fitted to the error as it is swallows part of the pattern, noise fitted to what a rich
regression leaves is too optimistic where noise is slow; so the second only proposes patterns and
the comparison decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.noise import COEFFICIENT_PENALTY, NoiseModel, fit_noise
from pprs_dynamics.diagnosis.regression import (
    one_degree,
    orthonormal,
    pattern_gains,
    slow_noise,
    solve,
    trial_limits,
)
from pprs_dynamics.residuals.residuals import Residuals, bridged, find_stretches
from pprs_dynamics.selection.patterns import LEAST_SHARE, Family, Pattern, build_families

# Samples per column below which the rich regression would explain the noise itself.
SAMPLES_PER_COLUMN = 8
FIT_ITERATIONS = 2
# What a simulation without noise leaves can be explained to rounding, and no measurement can:
# innovations are at least this share of the error.
LEAST_INNOVATION = 1e-4
# Limits move by up to a bin, then by shares of it: a step in time has to be met to the sample.
REFINEMENT_PRICE = 3.0  # for the best of limits that the threshold's draws do not try
COARSE, FINE = (1.0, 0.2), (0.04, 0.008)
MOST_KEPT = 8000  # samples of which whitened columns are kept: some 20 MB per drive
LOWEST_LINE = 3  # periods within the record, below which a line is a drift
BACKGROUND_WIDTH = 41  # frequencies over which a line's background is taken


@dataclass(frozen=True)
class Fit:
    """A pattern with the noise beside it.

    Parameters
    ----------
    deviance : float
        -2 log-likelihood plus the noise model's penalty.
    coefficients : array
    noise : NoiseModel
    """

    deviance: float
    coefficients: Array
    noise: NoiseModel


@dataclass(frozen=True)
class Candidate:
    """A pattern of a family, with the columns that carry it and what it gains.

    Parameters
    ----------
    family : Family
    pattern : Pattern
    columns : (1 or 2, N) array
    proposal : float
        Gain under the noise of the rich regression, less the penalty.
    score : float
        Gain in deviance with the noise refitted on either side, less the penalty.
    fit : Fit, optional
    price : float
        Beside the family's penalty, for limits that were moved.
    """

    family: Family
    pattern: Pattern
    columns: Array
    proposal: float
    score: float = -np.inf
    fit: Fit | None = None
    price: float = 0.0


class DriveSearch:
    """One drive's error as a series without holes, and the regressions on it.

    Parameters
    ----------
    residuals : Residuals
    drive : int
    """

    def __init__(self, residuals: Residuals, drive: int) -> None:
        error = residuals.error[:, drive]
        stretches = find_stretches(error, residuals.segment)
        self.index = np.concatenate([np.arange(part.start, part.stop) for part in stretches]
                                    or [np.zeros(0, dtype=int)])
        self.known = np.isfinite(error[self.index])
        lengths = [part.stop - part.start for part in stretches]
        ends = np.cumsum(lengths)
        self.stretches = [slice(int(end - length), int(end))
                          for end, length in zip(ends, lengths, strict=True)]
        self.error = bridged(np.nan_to_num(error[self.index]), self.known)
        self.residuals = Residuals(
            residuals.drives, residuals.time[self.index], residuals.segment[self.index],
            residuals.measured[self.index], residuals.model[self.index], {},
            {name: values[self.index] for name, values in residuals.variables.items()},
            residuals.period)
        self.drive = drive
        self._kept: dict[int, tuple[Array, Array]] = {}

    @cached_property
    def families(self) -> list[Family]:
        """All families of the drive."""
        return build_families(self.residuals, self.drive)

    def whiten(self, noise: NoiseModel, values: Array) -> Array:
        """Return whitened values, 0 where nothing was measured."""
        if not self.known.all():
            values = bridged(values, self.known)
        white = noise.whiten(values, self.stretches)
        if not self.known.all():
            white[..., ~self.known] = 0.0
        return white

    def fit_noise(self, rest: Array) -> NoiseModel:
        """Return the noise model of what a regression leaves."""
        least = LEAST_INNOVATION * float(np.sqrt(np.mean(self.error ** 2)))
        return fit_noise(rest, self.stretches, least=least)

    @cached_property
    def rich_noise(self) -> NoiseModel:
        """Noise of what a regression on all own variables leaves."""
        columns = [family.columns for family in self.families
                   if family.rivals == 1 and not family.paired]
        # The offset and the direction come first, and always.
        budget = len(self.error) / SAMPLES_PER_COLUMN
        chosen: list[Array] = []
        for block in columns:
            if sum(map(len, chosen)) + len(block) <= budget:
                chosen.append(block)
        stacked = np.concatenate(chosen) if chosen else np.zeros((0, len(self.error)))
        rest = self.error - solve(stacked, self.error) @ stacked
        noise = self.fit_noise(rest)
        white = self.whiten(noise, stacked)
        rest = self.error - solve(white, self.whiten(noise, self.error)) @ stacked
        return self.fit_noise(rest)

    def fit(self, columns: Array, error: Array | None = None) -> Fit:
        """Fit columns (C, N) and noise together by generalised least squares."""
        y = self.error if error is None else error
        if not len(columns):
            noise = self.fit_noise(y)
            return Fit(self._deviance(noise, y), np.zeros(0), noise)
        noise = self.rich_noise
        best: Fit | None = None
        for _ in range(FIT_ITERATIONS):
            c = solve(self.whiten(noise, columns), self.whiten(noise, y))
            rest = y - c @ columns
            noise = self.fit_noise(rest)
            deviance = self._deviance(noise, rest)
            if best is None or deviance < best.deviance:
                best = Fit(deviance, c, noise)
        assert best is not None
        return best

    def _deviance(self, noise: NoiseModel, rest: Array) -> float:
        white = self.whiten(noise, rest)
        logs = noise.log_deviation(len(rest), self.stretches)
        return float(white @ white + 2 * logs[self.known].sum()
                     + COEFFICIENT_PENALTY * noise.order)

    def propose(self, noise: NoiseModel, adopted: Array, draws: Array | None = None,
                ) -> tuple[list[Candidate], Array]:
        """Return the best pattern of every family, best first, and the null's largest gains.

        Parameters
        ----------
        noise : NoiseModel
            To whiten with.
        adopted : (C, N) array
            Columns that are explained already.
        draws : (N, R) array, optional
            White noise; the largest gain over all patterns is returned for each.
        """
        white = self.whiten(noise, self.error)
        basis = orthonormal(self.whiten(noise, adopted))
        sides = np.stack((white, *(draws.T if draws is not None else ()))).T
        sides[~self.known] = 0.0
        sides = (sides - basis.T @ (basis @ sides)).astype(np.float32)
        narrow = basis.astype(np.float32)
        largest = np.full(sides.shape[1] - 1, -np.inf)
        candidates = []
        for number, family in enumerate(self.families):
            if family.variable == 'time' and len(family.columns) == 1 and len(adopted) and np.ptp(
                    adopted, axis=1).min() == 0:
                continue
            x, gram = self._scanned(noise, number)
            cross = x @ narrow.T
            gains = pattern_gains(family, x @ sides, gram - cross @ cross.T, gram.diagonal())
            largest = np.maximum(largest, gains[:, 1:].max(axis=0) - family.penalty)
            best = int(np.argmax(gains[:, 0]))
            candidates.append(Candidate(family, family.patterns[best],
                                        family.pattern_columns(best),
                                        float(gains[best, 0]) - family.penalty))
        line = self.line(sides[:, 0].astype(float))
        if line is not None:
            candidates.append(line)
            power = np.abs(np.fft.rfft(sides[:, 1:], axis=0)) ** 2
            highest = 2 * power[LOWEST_LINE:-1].max(axis=0) / max(int(self.known.sum()), 1)
            largest = np.maximum(largest, one_degree(highest) - line.family.penalty)
        candidates.sort(key=lambda candidate: -candidate.proposal)
        return candidates, largest

    def _scanned(self, noise: NoiseModel, number: int) -> tuple[Array, Array]:
        """Return a family's whitened columns and their Gram matrix, in single precision."""
        # Those under the rich noise are asked for again and again.
        keep = noise is self.rich_noise and len(self.error) <= MOST_KEPT
        if keep and number in self._kept:
            return self._kept[number]
        x = self.whiten(noise, self.families[number].columns.astype(np.float32))
        found = x, x @ x.T
        return self._kept.setdefault(number, found) if keep else found

    def line(self, series: Array) -> Candidate | None:
        """Return the strongest spectral line of a series above its neighbourhood."""
        n = len(series)
        if n < 4 * BACKGROUND_WIDTH:
            return None
        power = np.abs(np.fft.rfft(series)) ** 2
        # The median of an exponential variate is ln 2 of its mean.
        background = median_filter(power, BACKGROUND_WIDTH, mode='nearest') / np.log(2)
        usable = slice(LOWEST_LINE, len(power) - 1)
        gain = 2 * power[usable] / np.maximum(background[usable], 1e-300)
        frequency = (int(np.argmax(gain)) + LOWEST_LINE) / (n * self.residuals.period)
        frequency = self._refined(frequency, series)
        phase = 2 * np.pi * frequency * self.residuals.time
        columns = np.stack((np.cos(phase), np.sin(phase)))
        pattern = Pattern('line', scale=frequency)
        family = Family('frequency', columns, np.zeros((0, 0)), (pattern,), rivals=len(gain),
                        paired=True)
        return Candidate(family, pattern, columns,
                         float(one_degree(np.asarray(gain.max()))) - family.penalty)

    def _refined(self, frequency: float, white: Array) -> float:
        """Return the frequency of the largest power within one resolution of the given one.

        To a thousandth of the resolution: where noise is small at that frequency, what a wrong
        one leaves is still a line.
        """
        t = self.residuals.time
        step = 1 / (len(self.error) * self.residuals.period)
        for _ in range(3):
            trial = frequency + step * np.linspace(-1, 1, 21)
            power = np.abs(np.exp(-2j * np.pi * trial[:, None] * t) @ white)
            frequency = float(trial[int(np.argmax(power))])
            step /= 10
        return frequency

    def refine(
        self, candidate: Candidate, noise: NoiseModel, adopted: Array,
        widths: tuple[float, ...] = COARSE,
    ) -> Candidate:
        """Return the candidate with the limits of its range moved to where it gains most."""
        pattern, family = candidate.pattern, candidate.family
        if pattern.kind not in ('range', 'directed_range') or pattern.limits is None:
            return candidate
        speed = family.variable.startswith('velocity') and pattern.kind == 'directed_range'
        values = self.values(family.variable)
        values = np.abs(values) if speed else values
        sign = self.values('direction') if pattern.kind == 'directed_range' else 1.0
        white = self.whiten(noise, np.concatenate((self.error[None], adopted)))
        basis = orthonormal(white[1:])
        limits = list(pattern.limits)
        best, column = -np.inf, candidate.columns[0]
        tries = np.ones(2)
        outer = (float(values.min()), float(values.max()))
        for end, width in ((end, width) for width in widths for end in (0, 1)):
            if limits[end] == outer[end]:
                continue
            trials = trial_limits(limits[end], outer, family.edges, width)
            low = np.where(end == 0, trials, limits[0])
            high = np.where(end == 1, trials, limits[1])
            columns = np.asarray(
                ((values >= low[:, None]) & (values <= high[:, None])) * sign, dtype=float)
            x = self.whiten(noise, np.concatenate((columns, column[None])))
            x = x - (x @ basis.T) @ basis
            size = np.maximum(np.einsum('ij,ij->i', x, x), 1e-300)
            # Whitened by slow noise a range is little but spikes at its limits: each shift is
            # then a try of its own, while under white noise hardly anything changes.
            same = (x[:-1] @ x[-1]) ** 2 / (size[:-1] * size[-1])
            tries[end] += float(np.sum(1 - same))
            x, size = x[:-1], size[:-1]
            gains = (x @ white[0]) ** 2 / size
            # A handful of samples is an incident, not a range.
            held = np.abs(columns).sum(axis=1) >= LEAST_SHARE * len(values)
            gains[~held] = -np.inf
            top = int(np.argmax(gains))
            if gains[top] > best:
                best, column, limits[end] = float(gains[top]), columns[top], float(trials[top])
        if not np.isfinite(best):
            return candidate
        price = max(candidate.price, REFINEMENT_PRICE) + 2 * float(np.log(tries).sum())
        return replace(candidate, pattern=replace(pattern, limits=(limits[0], limits[1])),
                       columns=column[None], proposal=best - family.penalty - price, price=price)

    def values(self, variable: str) -> Array:
        """Return a variable by its name in the interface, also one of another drive, (N,)."""
        name, _, other = variable.partition(' of ')
        drive = self.residuals.drives.index(other) if other else self.drive
        values = self.residuals.variable(name, drive)
        assert values is not None
        return values

    def compare(self, candidates: Sequence[Candidate], adopted: Array) -> list[Candidate]:
        """Return candidates with their score, the noise refitted with and without each."""
        without = self.fit(adopted)
        scored = []
        for candidate in candidates:
            columns = np.concatenate((adopted, candidate.columns))
            fit = self.fit(columns)
            gain = min(without.deviance - fit.deviance,
                       self._guarded_gain(fit.noise, candidate.columns, adopted))
            if candidate.family.paired:
                gain = float(one_degree(np.asarray(gain)))
            score = gain - candidate.family.penalty - candidate.price
            scored.append(replace(candidate, score=score, fit=fit))
        return sorted(scored, key=lambda candidate: -candidate.score)

    def _guarded_gain(self, noise: NoiseModel, columns: Array, adopted: Array) -> float:
        """Return the gain if noise went on growing towards low frequencies, see `slow_noise`."""
        cosines = slow_noise(noise, len(self.error))
        white = self.whiten(noise, np.concatenate((self.error[None], columns, adopted, cosines)))
        y, x = white[0], white[1:1 + len(columns)]
        basis = orthonormal(white[1 + len(columns):1 + len(columns) + len(adopted)])
        slow = white[1 + len(columns) + len(adopted):]
        y, x, slow = (rows - (rows @ basis.T) @ basis for rows in (y, x, slow))
        inner = slow @ slow.T + np.eye(len(slow))
        xs, ys = x @ slow.T, slow @ y
        cross = x @ y - xs @ np.linalg.solve(inner, ys)
        gram = x @ x.T - xs @ np.linalg.solve(inner, xs.T)
        return float(cross @ np.linalg.solve(gram + 1e-12 * np.trace(gram) * np.eye(len(gram)),
                                             cross))
