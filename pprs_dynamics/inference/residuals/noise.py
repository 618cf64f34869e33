# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Power spectrum of the noise of each drive: smooth and falling.

.. math:: S(f) = a_0 + \sum_j \frac{a_j}{1 + (f / f_j)^2}, \qquad a_j \ge 0,

with corners f_j one octave apart, from 1 / (4 T) to half the Nyquist frequency: wide enough for
white noise, AR(1) noise of any correlation and nearly 1/f noise. No resonance is possible: a
vibration is no noise.

The noise of a constant (k = 0) lies below all frequencies of a record, and is extrapolated. Each
drive's own spectrum is described by white noise plus AR(1) noise, flat below its corner, and by
white noise plus 1 / f^s, which goes on below. The noise of a constant is the mean over these
descriptions, each weighted by its likelihood and its prior. Of three drives or more it is at least
the drive's own level along the median slope.

The amplitudes maximise Whittle's restricted likelihood: with squares r^2 and leverage h of a
regression, by Fisher scoring, each step of which is a least squares problem with amplitudes that
are not negative. The constant (k = 0) takes no part: whether it is noise is for the criterion to
judge.

References
----------
P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953) 423-434.
D. A. Harville, Maximum likelihood approaches to variance component estimation, J. Am. Stat.
Assoc. 72 (1977) 320-338 (restricted likelihood, scoring).
C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, Prentice-Hall (1974) (active set).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.bands import SINGLE_BANDS, FrequencyBands

# Scoring ends once a full step promises to lower -2 ln of the likelihood by less; a step is halved
# until it brings a share of what it promises (Armijo), or is shorter than the least.
CONVERGED, MOST_STEPS, SUFFICIENT, LEAST_STEP = 1e-4, 30, 1e-4, 1e-4
MOST_ACTIVE = 1000  # changes of the active set in a step
OCTAVES_BELOW = 1  # that corners go on below the lowest frequency of the record: 1/f noise does
# Exponents s of noise that goes on below the record, the prior odds of each against one corner, and
# how far down S of a constant is taken. Share of constants beyond three standard deviations where
# nothing is, of 400 draws of a single drive: white noise 0.0 %, AR(1) noise 0.8 to 1.5 %, 1/f noise
# 0.0 % if it goes on for 16 records and 1.3 % for 50, random walks 0.8 %. A constant under white
# noise counts 12 % less than it would if the noise were known. With equal odds, one under AR(1)
# noise of 0.5 s beside white noise would count half.
EXPONENTS, ODDS, CONTINUED_OCTAVES = np.array([0.5, 1.0, 1.5, 2.0]), np.exp(-3.0), 2
SLOPE_OCTAVES, LEAST_PEERS = 3, 3  # lowest ones, and drives, of which the median slope is taken
DESCRIBED = 6  # steps of scoring to a description: its two amplitudes change by 1 % after them
SLOW_SHARE = 0.1  # of the highest corner, below which noise counts as slow
LEAST_SHARE = 1e-7  # of the mean square, that every amplitude keeps: no spectrum is 0
# [N^2], of a rounding of 1e-12 N, which nothing resolves: squares of it are no zeros yet.
LEAST_POWER = 1e-24


@dataclass(frozen=True)
class NoiseShapes:
    """The shapes phi_j that a spectrum is made of, at the bands' frequencies, (J + 1, B).

    Parameters
    ----------
    corners : (J,) array
        f_j [Hz].
    at_bands : (J + 1, B) array
        1 and 1 / (1 + (f / f_j)^2).
    described : (K, B) array
        Spectra of slow noise that describe a whole spectrum together with white noise; in the
        first band what a constant has of them.
    counts : (B,) array
        Coefficients of one record in the bands.
    """

    corners: Array
    at_bands: Array
    described: Array
    counts: Array

    @classmethod
    def of(cls, bands: FrequencyBands) -> NoiseShapes:
        """Return the shapes for some bands."""
        lowest, highest = bands.frequency[1] / 2 ** OCTAVES_BELOW, bands.frequency[-1]
        count = max(int(np.floor(np.log2(highest / lowest))), 1)
        corners = lowest * 2.0 ** np.arange(count)
        shapes = _shapes(corners, bands.frequency)
        numbers = bands.frequency[1:] / bands.frequency[1]
        falling = np.column_stack([2.0 ** (CONTINUED_OCTAVES * EXPONENTS),
                                   numbers ** -EXPONENTS[:, None]])
        counts = np.diff(np.minimum(bands.edges, highest)) / bands.frequency[1]
        return cls(corners, shapes, np.concatenate((shapes[1:], falling)), counts)

    @property
    def is_slow(self) -> np.typing.NDArray[np.bool_]:
        """True for the corners that count as slow noise, (J,)."""
        slow: np.typing.NDArray[np.bool_] = self.corners < SLOW_SHARE * self.corners[-1]
        return slow

    def spectra(self, amplitudes: Array) -> Array:
        """Return S at the bands of all drives, (D, B), of their amplitudes (D, J + 1) [N^2].

        That of the constant, in the first band, is extrapolated.
        """
        power: Array = amplitudes @ self.at_bands
        power[:, 0] = np.maximum(self._of_constant(power[:, 1:]), _along_median(power))
        return power

    def _of_constant(self, power: Array) -> Array:
        """Return the noise of a constant, (D,), of the other bands' spectra (D, B - 1) [N^2]."""
        counts, slow, of_constant = self.counts[1:], self.described[:, 1:], self.described[:, 0]
        least = LEAST_SHARE * power.mean(axis=1)[:, None] + LEAST_POWER
        seen = power[:, None]
        # Of white noise and of slow noise, (D, K): best fit of Whittle's likelihood.
        white = np.repeat(power[:, -1:], len(slow), axis=1)
        grown = np.maximum(power[:, :1] - white, least)
        found, deviance = white, np.full(white.shape, np.inf)
        for _ in range(DESCRIBED):
            spectrum = white[..., None] + grown[..., None] * slow
            after = (np.log(spectrum) + seen / spectrum) @ counts
            is_better = after < deviance
            deviance = np.where(is_better, after, deviance)
            found = np.where(is_better, white + grown * of_constant, found)
            weight = counts / spectrum ** 2
            sloped = weight * slow
            a, b, c = (rows.sum(axis=-1) for rows in (weight, sloped, sloped * slow))
            x, y = ((rows * seen).sum(axis=-1) for rows in (weight, sloped))
            white = np.maximum((c * x - b * y) / np.maximum(a * c - b ** 2, 1e-9 * a * c), least)
            grown = np.maximum((y - b * white) / c, least)
            white = np.maximum((x - b * grown) / a, least)
        odds = np.where(np.arange(len(slow)) < len(self.corners), 1.0, ODDS)
        weight = odds * np.exp((deviance.min(axis=1)[:, None] - deviance) / 2)
        mean: Array = (weight * found).sum(axis=1) / weight.sum(axis=1)
        return mean

    def start(self, squares: Array, counts: Array) -> Array:
        """Return amplitudes to start from, (..., J + 1): a share of the mean square for each."""
        mean = squares[..., 1:].sum(axis=-1) / np.maximum(counts[..., 1:].sum(axis=-1), 1)
        count = len(self.at_bands)
        return np.repeat(np.maximum(mean, LEAST_POWER)[..., None] / count, count, axis=-1)

    def fitted(self, amplitudes: Array, squares: Array, counts: Array, leverage: Array,
               steps: int = MOST_STEPS) -> Array:
        """Return the amplitudes that maximise the likelihood, (D, J + 1).

        Parameters
        ----------
        amplitudes : (D, J + 1) array
            To start from [N^2].
        squares : (D, B) array
            Sums of squares of the residual in the bands [N^2].
        counts : (D, B) array
            Coefficients in the bands.
        leverage : (D, B) array
            Degrees of freedom that the regression spends there.
        steps : int
            At most: a regression that is fitted anew does not need the end of the way.
        """
        phi = self.at_bands[:, 1:]
        squares, free = squares[:, 1:], np.maximum(
            counts[:, 1:] - leverage[:, 1:], 0.02 * counts[:, 1:])
        least = LEAST_SHARE * squares.sum(axis=1) / np.maximum(free.sum(axis=1), 1) + LEAST_POWER
        return _scored(amplitudes, squares, free, least[:, None], phi, steps)


def _scored(amplitudes: Array, squares: Array, free: Array, least: Array, phi: Array,
            steps: int) -> Array:
    """Return the amplitudes of all drives that maximise the likelihood, (D, J + 1)."""
    from scipy.optimize import nnls  # here: commands that fit no noise start without it

    found = np.maximum(amplitudes, least)
    going = np.arange(len(found))  # drives that have not converged
    before = _deviance(found @ phi, squares, free)
    for _ in range(steps):
        a, r2, f, low = found[going], squares[going], free[going], least[going]
        power = a @ phi
        # Scoring is a regression of the bands' mean squares on the shapes, whose weights follow
        # from the last spectrum; that amplitudes are not negative is exact.
        root = np.sqrt(f) / power
        design = root[:, None] * phi
        scale = np.sqrt(np.sum(design ** 2, axis=2))
        wanted = root * (r2 / np.maximum(f, 1e-300) - low * phi.sum(axis=0))
        above = np.stack([nnls(rows.T, target, maxiter=MOST_ACTIVE)[0]
                          for rows, target in zip(design / scale[:, :, None], wanted, strict=True)])
        step = low + above / scale - a
        promised = np.sum((step @ phi) * (r2 / power ** 2 - f / power), axis=1)
        share = np.where(promised < CONVERGED, 0.0, 1.0)
        while True:
            after = _deviance((a + share[:, None] * step) @ phi, r2, f)
            short = after > before[going] - SUFFICIENT * share * promised
            if not np.any(short & (share > 0)):
                break
            share = np.where(short, np.where(share > LEAST_STEP, share / 2, 0.0), share)
        found[going], before[going] = a + share[:, None] * step, after
        going = going[share > 0]
        if not len(going):
            break
    return found


def _deviance(power: Array, squares: Array, free: Array) -> Array:
    """Return -2 ln of the likelihood of spectra (D, B), (D,)."""
    deviance: Array = np.sum(free * np.log(power) + squares / power, axis=1)
    return deviance


@dataclass(frozen=True)
class NoiseSpectrum:
    """The noise of one drive.

    Parameters
    ----------
    corners : (J,) array
        [Hz]
    amplitudes : (J + 1,) array
        a_0, a_1 .. [N^2].
    period : float
        Between the samples whose variance the spectrum's mean is [s].
    constant : float, optional
        S of a constant [N^2]; by default as the shapes have it at frequency 0.
    """

    corners: Array
    amplitudes: Array
    period: float
    constant: float | None = None

    def power(self, frequency: Array) -> Array:
        """Return S at frequencies [Hz]: the variance of a DCT coefficient [N^2]."""
        frequency = np.asarray(frequency, dtype=float)
        power: Array = self.amplitudes @ _shapes(self.corners, frequency)
        return power if self.constant is None else np.where(frequency == 0, self.constant, power)

    @property
    def rms(self) -> float:
        """Root of the mean square of the samples [N]."""
        # The mean of 1 / (1 + (f / f_j)^2) up to the Nyquist frequency is an arc tangent.
        ratio = 0.5 / (self.period * self.corners)
        means = np.concatenate(([1.0], np.arctan(ratio) / ratio))
        return float(np.sqrt(self.amplitudes @ means))

    def effective_samples(self, samples: int) -> float:
        """Return how many independent samples have a mean as uncertain as `samples` of these.

        With what the shapes have at frequency 0, not with what may lie below the recording's.
        """
        return float(np.clip(samples * self.rms ** 2 / self.amplitudes.sum(), 1, samples))


def _along_median(power: Array) -> Array:
    """Return each drive's level, (D,), extrapolated along the median slope of all; 0 for two.

    A dozen coefficients determine the slope of a drive to 0.4, and drives of a robot are alike. Of
    two, a drive that drifts would hide the offset of the other.
    """
    single = power[:, 1:SINGLE_BANDS + 1]
    numbers = np.arange(1, single.shape[1] + 1)
    last = min(2 ** SLOPE_OCTAVES, len(numbers))
    if len(single) < LEAST_PEERS or last == 1:
        return np.zeros(len(single))
    slopes = np.sort(np.log(single[:, 0] / single[:, last - 1])) / np.log(last)
    slope = (slopes[len(slopes) // 2] + slopes[(len(slopes) - 1) // 2]) / 2  # the median
    found: Array = single.mean(axis=1) / np.mean(
        numbers ** -slope) * 2.0 ** (CONTINUED_OCTAVES * slope)
    return found


def _shapes(corners: Array, frequency: Array) -> Array:
    slow = 1 / (1 + (frequency / corners[:, None]) ** 2)
    return np.concatenate((np.ones((1, len(frequency))), slow))
