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
descriptions, each weighted by its likelihood and its prior. Drives of a robot are alike: the prior
joins fixed odds and the posteriors of the other drives, each by itself. A drive that is clearly
white stays white next to any that drift. No constant has less noise than the lowest frequency.

The amplitudes maximise Whittle's restricted likelihood: with squares r^2 and leverage h of a
regression, by Fisher scoring, each step of which is a least squares problem with amplitudes that
are not negative. The constant (k = 0) takes no part: whether it is noise is for the criterion to
judge.

References
----------
P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953) 423-434.
D. A. Harville, Maximum likelihood approaches to variance component estimation, J. Am. Stat.
Assoc. 72 (1977) 320-338 (restricted likelihood, scoring).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.bands import FrequencyBands
from pprs_dynamics.physics.mechanism.evaluation import run

# Scoring ends once a full step promises to lower -2 ln of the likelihood by less; a step is halved
# until it brings a share of what it promises (Armijo), or is shorter than the least.
CONVERGED, MOST_STEPS, SUFFICIENT, LEAST_STEP = 1e-4, 30, 1e-4, 1e-4
# Changes of which amplitudes are at their least in a step, fall of -2 ln of the likelihood for one,
# and share of a pivot that is rounding.
MOST_CHANGES, LEAST_FALL, ROUNDING = 100, 1e-12, 1e-13
OCTAVES_BELOW = 1  # that corners go on below the lowest frequency of the record: 1/f noise does
# Exponents s of noise that goes on below the record, the prior odds of each against one corner, and
# how far down S of a constant is taken. Share of constants beyond three standard deviations where
# nothing is, of 400 draws of a single drive: white noise 0.0 %, AR(1) noise 0.8 to 1.5 %, 1/f noise
# 0.0 % if it goes on for 16 records and 1.3 % for 50, random walks 0.8 %. A constant under white
# noise counts 12 % less than it would if the noise were known. With equal odds, one under AR(1)
# noise of 0.5 s beside white noise would count half.
EXPONENTS, ODDS, CONTINUED_OCTAVES = np.array([0.5, 1.0, 1.5, 2.0]), math.exp(-3.0), 2
# Drives that the odds count as, in addition to the others' posteriors. A constant of 4 deviations
# counts as 3.2 where five of six drives are random walks, with 1 as 3.1, with 10 as 3.3; of six
# drives of noise of eleven kinds 0.44 % of the constants are beyond three deviations (0.42, 0.45).
PRIOR_DRIVES = 4
# Steps of scoring to a description, whose two amplitudes change by 1 % after them; the best of the
# last few counts.
DESCRIBED, COMPARED = 6, 2
NO_WEIGHT = 1e15  # noise of a constant over that of the shapes, with which no constant counts
SLOW_SHARE = 0.1  # of the highest corner, below which noise counts as slow
LEAST_SHARE = 1e-7  # of the mean square, that every amplitude keeps: no spectrum is 0
# [N^2], of a rounding of 1e-12 N, which nothing resolves: squares of it are no zeros yet.
LEAST_POWER = 1e-24


class NoiseShapes:
    """The shapes phi_j that a spectrum is made of, at the bands' frequencies, (J + 1, B).

    Parameters
    ----------
    bands : FrequencyBands

    Attributes
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

    def __init__(self, bands: FrequencyBands) -> None:
        lowest, highest = bands.frequency[1] / 2 ** OCTAVES_BELOW, bands.frequency[-1]
        count = max(int(np.floor(np.log2(highest / lowest))), 1)
        self.corners = lowest * 2.0 ** np.arange(count)
        self.at_bands = _shapes(self.corners, bands.frequency)
        numbers = bands.frequency[1:] / bands.frequency[1]
        falling = np.column_stack([2.0 ** (CONTINUED_OCTAVES * EXPONENTS),
                                   numbers ** -EXPONENTS[:, None]])
        self.described = np.concatenate((self.at_bands[1:], falling))
        self.counts = np.diff(np.minimum(bands.edges, highest)) / bands.frequency[1]

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
        power[:, 0] = self._of_constant(power[:, 1:])
        return power

    def without_constants(self, amplitudes: Array) -> Array:
        """Return S as `spectra`, so large in the first band that a constant has no weight."""
        power: Array = amplitudes @ self.at_bands
        power[:, 0] *= NO_WEIGHT
        return power

    def _of_constant(self, power: Array) -> Array:
        """Return the noise of a constant, (D,), of the other bands' spectra (D, B - 1) [N^2]."""
        found, deviance = np.empty((2, len(power), len(self.described)))
        run(extrapolate, np.ascontiguousarray(power), self.counts[1:],
            np.ascontiguousarray(self.described[:, 1:]), self.described[:, 0].copy(), found,
            deviance)
        odds = np.where(np.arange(found.shape[1]) < len(self.corners), 1.0, ODDS)
        likelihood = np.exp((deviance.min(axis=1)[:, None] - deviance) / 2)
        alone = odds * likelihood
        alone /= alone.sum(axis=1)[:, None]
        weight = (PRIOR_DRIVES * odds / odds.sum() + alone.sum(axis=0) - alone) * likelihood
        mean: Array = (weight * found).sum(axis=1) / weight.sum(axis=1)
        return np.maximum(mean, power[:, 0])  # a description fits the slowest least

    def start(self, squares: Array, counts: Array) -> Array:
        """Return amplitudes to start from, (..., J + 1): a share of the mean square for each."""
        mean = squares[..., 1:].sum(axis=-1) / np.maximum(counts[..., 1:].sum(axis=-1), 1)
        count = len(self.at_bands)
        return np.repeat(np.maximum(mean, LEAST_POWER)[..., None] / count, count, axis=-1)

    def fitted(self, amplitudes: Array, squares: Array, counts: Array, leverage: Array) -> Array:
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
        """
        squares, free = squares[:, 1:].copy(), np.maximum(
            counts[:, 1:] - leverage[:, 1:], 0.02 * counts[:, 1:])
        least = LEAST_SHARE * squares.sum(axis=1) / np.maximum(free.sum(axis=1), 1) + LEAST_POWER
        found: Array = np.maximum(amplitudes, least[:, None])
        size, bands = self.at_bands.shape
        run(maximise_likelihood, found, squares, free, least, self.at_bands[:, 1:].copy(),
            np.empty((3, bands)), np.empty((4, size)), np.empty((2, size, size)))
        return found


def extrapolate(power: Array, counts: Array, slow: Array, of_constant: Array, found: Array,
                deviance: Array) -> None:
    """Write the noise of a constant that descriptions of spectra have: a loop over drives.

    Parameters
    ----------
    power : (D, B) array
        Spectra [N^2].
    counts : (B,) array
        Coefficients in the bands.
    slow : (K, B) array
        Spectra of slow noise that describe a whole spectrum together with white noise.
    of_constant : (K,) array
        What a constant has of them.
    found : (D, K) array
        Written to: the noise of a constant [N^2].
    deviance : (D, K) array
        Written to: -2 ln of the likelihood of a description.
    """
    bands = power.shape[1]
    for d in range(power.shape[0]):
        least = LEAST_POWER
        for b in range(bands):
            least += LEAST_SHARE * power[d, b] / bands
        for k in range(slow.shape[0]):
            # Of white noise and of slow noise: best fit of Whittle's likelihood.
            white = power[d, bands - 1]
            grown = max(power[d, 0] - white, least)
            found[d, k], deviance[d, k] = white, math.inf
            for step in range(DESCRIBED):
                after = a = b2 = c = x = y = 0.0
                for b in range(bands):
                    spectrum = white + grown * slow[k, b]
                    inverse = 1 / spectrum
                    if step >= DESCRIBED - COMPARED:
                        after += counts[b] * (math.log(spectrum) + power[d, b] * inverse)
                    weight = counts[b] * inverse * inverse
                    sloped = weight * slow[k, b]
                    a += weight
                    b2 += sloped
                    c += sloped * slow[k, b]
                    x += weight * power[d, b]
                    y += sloped * power[d, b]
                if step >= DESCRIBED - COMPARED and after < deviance[d, k]:
                    deviance[d, k], found[d, k] = after, white + grown * of_constant[k]
                white = max((c * x - b2 * y) / max(a * c - b2 * b2, 1e-9 * a * c), least)
                grown = max((y - b2 * white) / c, least)
                white = max((x - b2 * grown) / a, least)


def maximise_likelihood(found: Array, squares: Array, free: Array, least: Array, phi: Array,
                        bands: Array, sizes: Array, grams: Array) -> None:
    """Move amplitudes to where their likelihood is highest: a loop over drives.

    Scoring is a regression of the bands' mean squares on the shapes, whose weights follow from the
    last spectrum, with amplitudes that are not below the least.

    Parameters
    ----------
    found : (D, J) array
        Amplitudes to start from, written to [N^2].
    squares, free : (D, B) array
        Sums of squares of the residual, and degrees of freedom, in the bands.
    least : (D,) array
        That every amplitude keeps [N^2].
    phi : (J, B) array
    bands : (3, B) array
    sizes : (4, J) array
    grams : (2, J, J) array
        Work space.
    """
    power, root, change = bands[0], bands[1], bands[2]
    side, above, free_of, solved = sizes[0], sizes[1], sizes[2], sizes[3]
    gram, factor = grams[0], grams[1]
    for d in range(found.shape[0]):
        before = 0.0
        for b in range(phi.shape[1]):
            power[b] = 0.0
            for j in range(phi.shape[0]):
                power[b] += found[d, j] * phi[j, b]
            before += free[d, b] * math.log(power[b]) + squares[d, b] / power[b]
        for _ in range(MOST_STEPS):
            for b in range(phi.shape[1]):
                root[b] = free[d, b] / (power[b] * power[b])
                change[b] = squares[d, b] / max(free[d, b], 1e-300)
                for j in range(phi.shape[0]):
                    change[b] -= least[d] * phi[j, b]
            for i in range(phi.shape[0]):
                side[i] = 0.0
                for b in range(phi.shape[1]):
                    side[i] += root[b] * phi[i, b] * change[b]
                for j in range(i + 1):
                    total = 0.0
                    for b in range(phi.shape[1]):
                        total += root[b] * phi[i, b] * phi[j, b]
                    gram[i, j] = gram[j, i] = total
            for j in range(phi.shape[0]):
                above[j] = max(found[d, j] - least[d], 0.0)
            solve_non_negative(gram, side, above, free_of, solved, factor)
            promised = 0.0
            for b in range(phi.shape[1]):
                change[b] = 0.0
                for j in range(phi.shape[0]):
                    change[b] += (least[d] + above[j] - found[d, j]) * phi[j, b]
                promised += change[b] * (squares[d, b] / power[b] - free[d, b]) / power[b]
            share = 0.0 if promised < CONVERGED else 1.0
            after = before
            while share > 0.0:
                after = 0.0
                for b in range(phi.shape[1]):
                    trial = power[b] + share * change[b]
                    after += free[d, b] * math.log(trial) + squares[d, b] / trial
                if after <= before - SUFFICIENT * share * promised:
                    break
                share = share / 2 if share > LEAST_STEP else 0.0
            if share == 0.0:
                break
            before = after
            for j in range(phi.shape[0]):
                found[d, j] += share * (least[d] + above[j] - found[d, j])
            for b in range(phi.shape[1]):
                power[b] += share * change[b]


def solve_non_negative(gram: Array, side: Array, found: Array, free: Array, solved: Array,
                       factor: Array) -> None:
    """Move x to where x' G x - 2 x' s is least with x >= 0, by an active set.

    Parameters
    ----------
    gram : (J, J) array
        G
    side : (J,) array
        s
    found : (J,) array
        x to start from, written to.
    free, solved : (J,) array
    factor : (J, J) array
        Work space.
    """
    for i in range(len(side)):
        free[i] = 1.0 if found[i] > 0 else 0.0
    for _ in range(MOST_CHANGES):
        solve_free(gram, side, free, solved, factor)
        share, changed = 1.0, -1
        for i in range(len(side)):
            if solved[i] < 0 and found[i] <= share * (found[i] - solved[i]):
                share, changed = found[i] / (found[i] - solved[i]), i
        for i in range(len(side)):
            found[i] += share * (solved[i] - found[i])
        if changed >= 0:
            found[changed] = free[changed] = 0.0
            continue
        fall = LEAST_FALL
        for i in range(len(side)):
            slope = side[i]
            for j in range(len(side)):
                slope -= gram[i, j] * found[j]
            if free[i] == 0 and slope > 0 and slope * slope > fall * gram[i, i]:
                fall, changed = slope * slope / gram[i, i], i
        if changed < 0:
            return
        free[changed] = 1.0


def solve_free(gram: Array, side: Array, free: Array, solved: Array, factor: Array) -> None:
    """Write the solution of G x = s for free unknowns, by Cholesky's factor; others are 0."""
    for i in range(len(side)):
        total = side[i]
        for j in range(i + 1):
            inner = gram[i, j]
            for k in range(j):
                inner -= factor[i, k] * factor[j, k]
            if i == j:
                factor[i, i] = math.sqrt(max(inner, ROUNDING * gram[i, i]))
            else:
                factor[i, j] = free[i] * free[j] * inner / factor[j, j]
                total -= factor[i, j] * solved[j]
        solved[i] = free[i] * total / factor[i, i]
    for i in range(len(side) - 1, -1, -1):
        total = solved[i]
        for j in range(i + 1, len(side)):
            total -= factor[j, i] * solved[j]
        solved[i] = total / factor[i, i]


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


def _shapes(corners: Array, frequency: Array) -> Array:
    slow = 1 / (1 + (frequency / corners[:, None]) ** 2)
    return np.concatenate((np.ones((1, len(frequency))), slow))
