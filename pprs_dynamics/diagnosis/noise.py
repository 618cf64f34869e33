"""Noise that is correlated in time: its model, its whitening, and how many samples it is worth.

The model is autoregressive. Its lags are single up to 12 samples and beyond that means over
windows that grow geometrically, so that a few coefficients reach far back: slow and 1/f noise
need that, and a vibration of the structure needs the single ones. Coefficients come from least
squares forward and backward in time, since the Yule-Walker estimate is biased where noise is
slow.

References
----------
S. L. Marple, Digital Spectral Analysis, 1987, chapter 8 (forward-backward least squares).
F. Corsi, A simple approximate long-memory model of realized volatility, J. Financial
Econometrics 7 (2009) 174-196 (windows of growing length as lags).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array

SINGLE_LAGS = 12
LONGEST_LAG = 512
# What one more coefficient must gain in deviance: between Akaike's 2 and ln N. Too few would
# leave slow noise unmodelled, too many let the noise swallow what is to be found.
COEFFICIENT_PENALTY = 4.0
# Orders tried between 0 and all lags; models with 5, 7, 9.. lags seldom differ from these.
ORDERS = (0, 1, 2, 3, 4, 6, 8, 10, 12)
# Least reach of data per lag: with fewer samples a coefficient cannot be estimated.
SAMPLES_PER_REACH = 8
LEAST_FOR_FFT = 12  # coefficients, from which on transforms are faster than sums
ROUNDING = 1e-6  # innovations are at least this share of the noise


@dataclass(frozen=True)
class NoiseModel:
    """y_t = sum_i c_i mean(y_{t-last_i} .. y_{t-first_i}) + innovation, for each nested order.

    At the start of a stretch, where less of the past is known, the smaller nested models
    predict; so whitened values have unit variance from the first sample on.

    Parameters
    ----------
    windows : tuple of (first, last)
        Lags in samples; the model of the k-th order uses the first `orders[k]` windows.
    orders : tuple of int
        Nested orders, ascending; the last is the model's.
    coefficients : tuple of arrays
        c of each nested order.
    deviations : tuple of float
        Standard deviation of each order's innovations [N].
    """

    windows: tuple[tuple[int, int], ...]
    orders: tuple[int, ...]
    coefficients: tuple[Array, ...]
    deviations: tuple[float, ...]

    @property
    def order(self) -> int:
        """Number of coefficients."""
        return self.orders[-1]

    @property
    def innovation(self) -> float:
        """Standard deviation of the innovations: the part that the past does not tell [N]."""
        return self.deviations[-1]

    @cached_property
    def filter(self) -> Array:
        """Prediction error filter 1, -a_1, -a_2, .. ."""
        reach = self.windows[self.order - 1][1] if self.order else 0
        taps = np.zeros(reach + 1)
        taps[0] = 1.0
        for c, (first, last) in zip(self.coefficients[-1], self.windows, strict=False):
            taps[first:last + 1] -= c / (last - first + 1)
        return taps

    def spectrum(self, samples: int) -> Array:
        """Return the two-sided power spectrum at `fft.rfftfreq(samples)`; its mean is var y."""
        response = fft.rfft(self.filter, max(samples, len(self.filter)))
        if len(self.filter) > samples:
            raise ValueError(f'{samples} frequencies do not resolve {len(self.filter)} lags')
        power = np.abs(response) ** 2
        # A root on the unit circle would be a line of infinite power.
        result: Array = self.innovation ** 2 / np.maximum(power, 1e-12)
        return result

    def whiten(self, values: Array, stretches: Sequence[slice]) -> Array:
        """Return innovations over their standard deviation, (..., N); 0 outside the stretches.

        Linear in `values`: applied to the columns of a regression as to its left-hand side.
        """
        white = np.zeros(values.shape, dtype=values.dtype)
        for part in stretches:
            white[..., part] = self._whiten_stretch(values[..., part])
        return white

    def _whiten_stretch(self, y: Array) -> Array:
        white = np.empty(y.shape, dtype=y.dtype)
        n = y.shape[-1]
        reaches = [self.windows[order - 1][1] if order else 0 for order in self.orders]
        total = _running_sum(y) if self.order > SINGLE_LAGS else None
        for k, c in enumerate(self.coefficients):
            start = reaches[k]
            stop = n if k + 1 == len(self.orders) else min(reaches[k + 1], n)
            if start >= stop:
                continue
            if len(c) >= LEAST_FOR_FFT and stop - start > 4 * start:
                white[..., start:] = self._filtered(y)[..., start:]
                continue
            ahead = y[..., start:stop].copy()
            # Python's floats leave single precision single.
            for weight, (first, last) in zip(c.tolist(), self.windows, strict=False):
                ahead -= weight * _window_mean(y, total, start, stop, first, last)
            white[..., start:stop] = ahead / float(self.deviations[k])
        return white

    def _filtered(self, y: Array) -> Array:
        """Return the last model's whitened values by Fourier transforms; for many lags."""
        size = fft.next_fast_len(y.shape[-1] + len(self.filter) - 1, real=True)
        taps = (self.filter / self.innovation).astype(y.dtype)
        response: Any = fft.rfft(taps, size)
        filtered: Array = fft.irfft(fft.rfft(y, size) * response, size)[..., :y.shape[-1]]
        return filtered

    def log_deviation(self, samples: int, stretches: Sequence[slice]) -> Array:
        """Return ln of the innovation's standard deviation at each sample, (N,)."""
        logs = np.zeros(samples)
        for part in stretches:
            one = np.full(part.stop - part.start, np.log(self.innovation))
            for k in range(len(self.orders) - 2, -1, -1):
                one[:self.windows[self.orders[k + 1] - 1][1]] = np.log(self.deviations[k])
            logs[part] = one
        return logs

    def covariance(self, samples: int) -> Array:
        """Return the autocovariance at lags 0 .. samples - 1 [N^2]."""
        size = fft.next_fast_len(4 * max(samples, len(self.filter)), real=True)
        values: Array = fft.irfft(self.spectrum(size), size)[:samples]
        return values

    def surrogate(self, samples: int, rng: np.random.Generator, count: int = 1) -> Array:
        """Return `count` records of Gaussian noise with this spectrum, (count, samples)."""
        size = fft.next_fast_len(4 * max(samples, len(self.filter)), real=True)
        white = fft.rfft(rng.normal(size=(count, size)))
        records: Array = fft.irfft(white * np.sqrt(self.spectrum(size)), size)[:, :samples]
        return records


def fit_noise(
    values: Array, stretches: Sequence[slice], longest_lag: int = LONGEST_LAG, least: float = 0.0,
) -> NoiseModel:
    """Return the noise model of a record, its order chosen.

    Parameters
    ----------
    values : (N,) array
        Noise, finite within the stretches; its mean is not removed: a mean that is not noise is
        for the caller to explain.
    stretches : sequence of slice
        Parts without a gap.
    longest_lag : int
        Bound of the reach [samples].
    least : float
        Innovations have at least this standard deviation [N].
    """
    lengths = np.array([part.stop - part.start for part in stretches])
    windows = lag_windows(_affordable_reach(lengths, longest_lag))
    reach = windows[-1][1] if windows else 0
    used = [part for part in stretches if part.stop - part.start > reach]
    gram = np.zeros((len(windows) + 1, len(windows) + 1))
    count = 0
    for part in used:
        for y in (values[part], values[part][::-1]):
            rows = _regressors(y, windows, reach)
            gram += rows @ rows.T
            count += rows.shape[1]
    orders = [order for order in ORDERS if order <= len(windows)]
    orders += list(range(SINGLE_LAGS + 1, len(windows) + 1))
    coefficients, variances = [], []
    floor = max(gram[0, 0] / max(count, 1) * ROUNDING ** 2, least ** 2, 1e-300)
    for order in orders:
        inner = gram[1:order + 1, 1:order + 1]
        inner = inner + np.eye(order) * 1e-10 * (np.trace(inner) / max(order, 1) + 1e-300)
        c = np.linalg.solve(inner, gram[1:order + 1, 0])
        coefficients.append(c)
        # A coefficient has cost a degree of freedom.
        variances.append(max((gram[0, 0] - c @ gram[1:order + 1, 0])
                             / max(count - 2 * order, 1), floor))
    criterion = [count / 2 * np.log(variance) + COEFFICIENT_PENALTY * order
                 for variance, order in zip(variances, orders, strict=True)]
    best = int(np.argmin(criterion)) + 1
    return NoiseModel(windows, tuple(orders[:best]), tuple(coefficients[:best]),
                      tuple(float(np.sqrt(variance)) for variance in variances[:best]))


def lag_windows(reach: int) -> tuple[tuple[int, int], ...]:
    """Return single lags up to 12, then windows whose ends are 16, 24, 32, 48, 64 ... samples."""
    windows = [(lag, lag) for lag in range(1, min(SINGLE_LAGS, reach) + 1)]
    last, step = SINGLE_LAGS, 4
    while last + step <= reach:
        windows.append((last + 1, last + step))
        last += step
        step = 8 if last == 16 else step if last & (last - 1) else last // 2
    return tuple(windows)


def effective_samples(model: NoiseModel, samples: int) -> float:
    """Return how many independent samples have a mean as uncertain as `samples` of this noise."""
    covariance = model.covariance(samples)
    weight = np.concatenate(([1.0], 2 * (1 - np.arange(1, samples) / samples)))
    return float(np.clip(samples * covariance[0] / max(weight @ covariance, 1e-300), 1, samples))


def find_repetition(positions: Array, tolerance: float = 1e-3) -> int | None:
    """Return after how many samples a motion repeats itself, or None.

    Parameters
    ----------
    positions : (N, D) array
        [m].
    tolerance : float
        Largest squared difference between repetitions over the motion's variance; it must
        repeat at least once within the record.
    """
    n = len(positions)
    centred = positions - positions.mean(axis=0)
    size = fft.next_fast_len(2 * n, real=True)
    power = (np.abs(fft.rfft(centred, size, axis=0)) ** 2).sum(axis=1)
    product = fft.irfft(power, size)[:n // 2 + 1]
    squares = np.concatenate(([0.0], np.cumsum((centred ** 2).sum(axis=1))))
    lag = np.arange(len(product))
    difference = squares[n - lag] + squares[-1] - squares[lag] - 2 * product
    relative = difference / np.maximum(n - lag, 1) / max(2 * squares[-1] / n, 1e-300)
    away = np.flatnonzero(relative > 0.1)
    if not len(away):
        return None
    back = away[0] + np.flatnonzero(relative[away[0]:] < tolerance)
    if not len(back):
        return None
    # The bottom of the first dip, not its edge.
    end = back[0]
    while end + 1 < len(relative) and relative[end + 1] < relative[end]:
        end += 1
    return int(end)


def unrepeated(values: Array, repetition: int) -> float:
    """Return the rms of what differs between repetitions of a motion [N]: its noise.

    Noise slower than the repetition is counted only as far as it changes within one.
    """
    change = values[repetition:] - values[:-repetition]
    return float(np.sqrt(np.nanmean(change ** 2) / 2))


def _affordable_reach(lengths: Array, longest: int) -> int:
    """Return the largest reach that still leaves three quarters of the samples as targets."""
    reach = longest
    while reach > 0:
        targets = np.maximum(lengths - reach, 0).sum()
        if targets >= 0.75 * lengths.sum() and targets >= SAMPLES_PER_REACH * reach:
            return reach
        reach = reach // 2 if reach > SINGLE_LAGS else reach - 1
    return 0


def _regressors(y: Array, windows: tuple[tuple[int, int], ...], reach: int) -> Array:
    rows = np.empty((len(windows) + 1, len(y) - reach))
    rows[0] = y[reach:]
    total = _running_sum(y)
    for row, (first, last) in zip(rows[1:], windows, strict=True):
        row[:] = _window_mean(y, total, reach, len(y), first, last)
    return rows


def _running_sum(y: Array) -> Array:
    zero = np.zeros((*y.shape[:-1], 1))
    return np.concatenate((zero, np.cumsum(y, axis=-1, dtype=float)), axis=-1)


def _window_mean(
    y: Array, total: Array | None, start: int, stop: int, first: int, last: int,
) -> Array:
    """Return the mean of y over lags first .. last, for the samples start .. stop - 1."""
    if first == last or total is None:
        return y[..., start - first:stop - first]
    mean: Array = (total[..., start - first + 1:stop - first + 1]
                   - total[..., start - last:stop - last]) / (last - first + 1)
    return mean
