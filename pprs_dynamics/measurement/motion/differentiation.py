# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Positions that were measured -> position, velocity and acceleration, without delay.

A polynomial of order 7 is fitted to a window of samples around each sample by least squares; its
value and its first two derivatives in the middle are the three quantities. They come from one
fit, so they belong to one motion, and the window has no phase shift. That is Savitzky and
Golay's filter: a fixed set of weights, which a live node applies as well as a whole recording.

On simulated encoders of 1 um at 500 Hz, with motions up to 3 Hz, the force errors that this alone
causes are 0.4 to 0.8 mN rms. Order 5 has up to 2.8 mN, order 3 hundreds. Spectral filters and
splines with the right cut-off do as well, but they see the whole recording at once, are wrong near
its ends, and cannot be run live.

References
----------
A. Savitzky, M. J. E. Golay, Smoothing and differentiation of data by simplified least squares
procedures, Analytical Chemistry 36 (1964).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square

ORDER = 7
SHORTEST_WINDOW = 2 * ORDER + 3  # samples; shorter ones hardly smooth
LONGEST_WINDOW = 401
WINDOW_RATIO = 1.15  # from one window that is tried to the next
# Distortion grows with the 8th power of the window: one of three quarters has a tenth of it.
REFERENCE_RATIO = 0.75
HOPELESS = 10.0  # times the least error squared
# Looked at for the choice of the window: enough to know an rms to a few per cent.
STRETCHES, STRETCH_SAMPLES = 20, 4000
LONG = 10_000  # samples, from which on FFTs are faster


@dataclass(frozen=True)
class LocalPolynomial:
    """Least-squares polynomials over a moving window, evaluated in its middle.

    Parameters
    ----------
    window : int
        Samples, odd.
    step : float
        Between samples [s].
    """

    window: int
    step: float

    @property
    def half(self) -> int:
        """Samples on either side of the middle: the lag of a live filter, the edge of a file."""
        return self.window // 2

    @property
    def coefficients(self) -> Array:
        """Weights of the samples for value, first and second derivative, (3, window)."""
        return _coefficients(self.window, self.step)

    def fitted(self, offsets: Array, values: Array) -> tuple[Array, float]:
        """Return value and two derivatives in the middle, (3, D), and the sum of squared residuals.

        Parameters
        ----------
        offsets : (n,) array
            Times of the samples less that of the middle [s], at equal steps or not. With fewer
            samples than the polynomial has coefficients its order is lower.
        values : (n, D) array
        """
        order = min(ORDER, len(offsets) - 1)
        basis = np.polynomial.legendre.legvander(offsets / (self.half * self.step), order)
        coefficients = np.linalg.lstsq(basis, values, rcond=None)[0]
        derivatives: Array = _middle(self.window, self.step)[:, :order + 1] @ coefficients
        return derivatives, float(np.sum((values - basis @ coefficients) ** 2))

    @property
    def cut_off(self) -> float:
        """Frequency [Hz] at which the amplitude has fallen to 1/sqrt(2)."""
        frequency = np.linspace(0, 0.5 / self.step, 2000)
        offset = np.arange(-self.half, self.half + 1) * self.step
        gain = np.cos(2 * np.pi * frequency[:, None] * offset) @ self.coefficients[0]
        return float(frequency[np.argmax(gain < np.sqrt(0.5))])

    def filtered(self, values: Array, derivative: int) -> Array:
        """Return a derivative (0, 1, 2) of values (N, D), without the edges: (N - 2 half, D)."""
        middle = values[len(values) // 2]  # large constants would cost digits
        result = filtered(values - middle, self.coefficients[derivative])
        return result + middle if derivative == 0 else result

    def differentiated(self, values: Array) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of positions (N, D), without the edges."""
        return self.filtered(values, 0), self.filtered(values, 1), self.filtered(values, 2)

    def noise_gain(self, derivative: int) -> float:
        """Return by what independent noise of the samples is multiplied, rms to rms."""
        return float(np.linalg.norm(self.coefficients[derivative]))


@dataclass(frozen=True)
class Smoothing:
    """The window that suits a recording, and why.

    Parameters
    ----------
    duration : float
        Of the window [s].
    noise : (D,) array
        Of the positions [m rms].
    velocity_error, acceleration_error : (D,) arrays
        What is expected to remain in velocities [m/s rms] and accelerations [m/s^2 rms]: noise,
        and for accelerations distortion too.
    text : str
        The choice in words.
    """

    duration: float
    noise: Array
    velocity_error: Array
    acceleration_error: Array
    text: str

    def polynomial(self, step: float) -> LocalPolynomial:
        """Return the filter for samples `step` apart [s]."""
        return LocalPolynomial(max(SHORTEST_WINDOW, _odd(self.duration / step)), step)


class Stretch(NamedTuple):
    """Positions (n, D) at equal steps [s], and recorded velocities (n, D) where there are any."""

    position: Array
    step: float
    velocity: Array | None = None


def representative(stretches: Sequence[Stretch]) -> list[Stretch]:
    """Return parts of stretches, evenly spread, of about 80 000 samples together."""
    total = sum(len(stretch.position) for stretch in stretches)
    if total <= STRETCHES * STRETCH_SAMPLES:
        return list(stretches)
    parts = []
    for q, step, v in stretches:
        count = min(max(1, round(STRETCHES * len(q) / total)), len(q) // STRETCH_SAMPLES)
        for start in np.linspace(0, len(q) - STRETCH_SAMPLES, count).astype(int):
            part = slice(start, start + STRETCH_SAMPLES)
            parts.append(Stretch(q[part], step, None if v is None else v[part]))
        if not count:
            parts.append(Stretch(q, step, v))
    return parts


def choose_smoothing(stretches: Sequence[Stretch], unit: str = 'm') -> Smoothing:
    """Return the window with the least error in accelerations.

    For each window w the noise that it lets through is known, from that of the positions and its
    weights. Its distortion shows in the difference from a window of three quarters, which has
    much less, after the noise that this difference must have is taken away. The sum over all
    drives is least at the window chosen: on simulated motions within a step of the best.

    Parameters
    ----------
    stretches : sequence of Stretch
        Long enough for the shortest window.
    unit : str
        Of the positions.

    References
    ----------
    The comparison of neighbouring windows is O. V. Lepskii's, the sum is C. L. Mallows's C_p.
    """
    step = min(stretch.step for stretch in stretches)
    noise = position_noise(stretches)
    longest = max(len(stretch.position) * stretch.step for stretch in stretches) / 3
    windows = _windows(max(SHORTEST_WINDOW, min(LONGEST_WINDOW, int(longest / step))))
    errors: dict[int, Array] = {}
    window, least = windows[0], np.inf
    for tried in windows:
        errors[tried] = _acceleration_error(stretches, tried * step, noise)
        squares = float(np.sum(errors[tried] ** 2))
        if squares <= least:
            window, least = tried, squares
        elif squares > HOPELESS * least:
            break  # distortion only grows
    chosen = LocalPolynomial(window, step)
    is_longest = ', the longest one tried' if window == windows[-1] else ''
    text = (
        f'velocities and accelerations come from polynomials of order {ORDER} through the '
        f'positions over {window * step:.3g} s ({window} samples, cut-off {chosen.cut_off:.3g} '
        f'Hz), for the least sum of noise and distortion{is_longest}: positions have '
        f'{root_mean_square(noise) * 1e6:.2g} u{unit} rms of noise, '
        f'accelerations keep {root_mean_square(errors[window]):.2g} {unit}/s^2 rms of error')
    return Smoothing(window * step, noise, noise * chosen.noise_gain(1), errors[window], text)


def position_noise(stretches: Sequence[Stretch]) -> Array:
    """Return the noise of positions, (D,) [m rms], from the residual of the shortest window."""
    squares, count = 0.0, 0
    for q, step, _ in stretches:
        filter_ = LocalPolynomial(SHORTEST_WINDOW, step)
        left = q[filter_.half:-filter_.half] - filter_.filtered(q, 0)
        squares, count = squares + np.sum(left * left, axis=0), count + len(left)
    share = 1 - filter_.coefficients[0][filter_.half]  # of the noise that is left
    noise: Array = np.sqrt(np.asarray(squares) / max(count, 1) / share)
    return noise


def better_recorded(stretches: Sequence[Stretch], smoothing: Smoothing) -> np.ndarray:
    """Return where recorded velocities are better than differentiated positions, (2, D).

    For velocities and, by their derivatives, for accelerations. The two ways differ by the errors
    of both, and that of the differentiated positions is known. Recorded velocities are better
    where the mean square of the difference is below 1.5 times of it, so that they have less than
    half of it: noise, delay and scale count alike.
    """
    better = np.zeros((2, len(smoothing.noise)), dtype=bool)
    for derivative, known in ((1, smoothing.velocity_error), (2, smoothing.acceleration_error)):
        squares, count = np.zeros(len(known)), 0
        for q, step, v in stretches:
            if v is None:
                return better
            filter_ = smoothing.polynomial(step)
            if len(q) < filter_.window:
                continue
            gap = filter_.filtered(q, derivative) - filter_.filtered(v, derivative - 1)
            squares, count = squares + np.sum(gap * gap, axis=0), count + len(gap)
        better[derivative - 1] = squares < 1.5 * count * known ** 2  # False for NaN
    return better


def _acceleration_error(stretches: Sequence[Stretch], duration: float, noise: Array) -> Array:
    squares, count = np.zeros(len(noise)), 0
    for q, step, _ in stretches:
        wide = LocalPolynomial(max(SHORTEST_WINDOW, _odd(duration / step)), step)
        if len(q) < wide.window:
            continue
        narrow = LocalPolynomial(max(ORDER + 2, _odd(REFERENCE_RATIO * wide.window)), step)
        trim = wide.half - narrow.half
        difference = wide.coefficients[2] - np.pad(narrow.coefficients[2], trim)
        gap = filtered(q - q[len(q) // 2], difference)  # large constants would cost digits
        gain = float(np.sum(difference ** 2))
        distortion = np.maximum(np.mean(gap * gap, axis=0) - gain * noise ** 2, 0.0)
        squares += len(gap) * (distortion + (noise * wide.noise_gain(2)) ** 2)
        count += len(gap)
    return np.sqrt(squares / count) if count else np.full(len(noise), np.inf)


@lru_cache(maxsize=256)
def _coefficients(window: int, step: float) -> Array:
    half = window // 2
    legendre = np.polynomial.legendre
    # Legendre polynomials on [-1, 1] keep the fit well conditioned; powers of k do not.
    fit = np.linalg.pinv(legendre.legvander(np.arange(-half, half + 1) / half, ORDER))
    weights: Array = _middle(window, step) @ fit
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=256)
def _middle(window: int, step: float) -> Array:
    """Return value, first and second derivative of Legendre polynomials in the middle, (3, K)."""
    legendre, half = np.polynomial.legendre, window // 2
    return np.array([[legendre.legval(0.0, legendre.legder(unit, d)) / (half * step) ** d
                      for unit in np.eye(ORDER + 1)] for d in range(3)])


def _windows(longest: int) -> list[int]:
    count = int(np.log(longest / SHORTEST_WINDOW) / np.log(WINDOW_RATIO)) + 1
    return sorted({_odd(SHORTEST_WINDOW * WINDOW_RATIO ** k) for k in range(count)})


def _odd(samples: float) -> int:
    """Return the nearest odd number."""
    return 2 * round((samples - 1) / 2) + 1


def filtered(values: Array, weights: Array) -> Array:
    """Return sums of values (N, D) times weights (n,) around each sample, (N - n + 1, D)."""
    return np.stack([convolve_valid(column, weights[::-1]) for column in values.T], axis=1)


def convolve_valid(values: Array, weights: Array) -> Array:
    """Return the convolution where the weights overlap completely, by FFT where that is faster.

    Blocks are transformed one by one (overlap-save): digits are lost to the largest value of a
    block alone, not of the recording. `scipy.signal.oaconvolve` does the same, but importing it
    takes a second, longer than most commands.

    Parameters
    ----------
    values : (N,) array
    weights : (W,) array, W <= N

    Returns
    -------
    (N - W + 1,) array
    """
    if len(values) <= LONG:
        return np.convolve(values, weights, 'valid')
    size = 1 << (8 * len(weights)).bit_length()
    step, count = size - len(weights) + 1, len(values) - len(weights) + 1
    blocks = -(-count // step)
    padded = np.zeros((blocks - 1) * step + size)
    padded[:len(values)] = values
    windows = np.lib.stride_tricks.sliding_window_view(padded, size)[::step]
    product = np.fft.irfft(np.fft.rfft(windows) * np.fft.rfft(weights, size), size)
    return product[:, len(weights) - 1:].ravel()[:count]
