# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Profiles of the error: means over bins with their uncertainty, and the spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals

BINS = 12
# A bin must hold this share of the samples, else its mean is that of an incident.
LEAST_SHARE = 0.01
# A range that holds more of them is no place: it is all of the recording but an incident.
MOST_SHARE = 0.95


@dataclass(frozen=True)
class Profile:
    """Mean error of a drive over bins of a variable.

    Parameters
    ----------
    edges : (K + 1,) array
        Of the bins, in the variable's SI unit.
    mean, uncertainty : (K,) array
        Mean error and its standard deviation under the correlated noise [N]; NaN where a bin
        holds nothing.
    """

    edges: Array
    mean: Array
    uncertainty: Array


def error_profile(
    residuals: Residuals, drive: int, variable: str, noise: NoiseSpectrum, bins: int = BINS,
) -> Profile | None:
    """Return the mean error over bins of a variable, or None where it is unknown or constant.

    Parameters
    ----------
    noise : NoiseSpectrum
        Of the drive.
    """
    error, values = residuals.error[:, drive], residuals.variable(variable, drive)
    if values is None or np.ptp(values) == 0:
        return None
    edges = bin_edges(values, bins)
    count = len(edges) - 1
    place = bin_of(values, edges)
    known = np.isfinite(error)
    mean, spread = np.full((2, count), np.nan)
    # Variance of the coefficients of noise, of samples that may be means of the noise's.
    power = noise.power(np.arange(len(error)) / (2 * len(error) * residuals.period)) * (
        noise.period / residuals.period)
    for k in range(count):
        held = known & (place == k)
        if held.any():
            mean[k] = error[held].mean()
            spread[k] = np.sqrt(power @ dct(held.astype(float), norm='ortho') ** 2) / held.sum()
    return Profile(edges, mean, spread)


def error_spectrum(residuals: Residuals, drive: int, noise: NoiseSpectrum,
                   ) -> tuple[Array, Array, Array]:
    """Return frequencies [Hz], and the power of the drive's error and of its noise there [N^2/Hz].

    One-sided, averaged over its stretches, with a Hann window.
    """
    from scipy.signal import welch

    stretches = residuals.stretches(drive)
    longest = max(part.stop - part.start for part in stretches)
    size = max(min(longest, 4096), min(longest, 16))
    powers, weights = [], []
    for part in stretches:
        if part.stop - part.start >= size:
            # To look at: over the few samples that a stretch lacks it is a straight line.
            error, at = residuals.error[part, drive], np.arange(part.stop - part.start)
            known = np.isfinite(error)
            frequency, power = welch(np.interp(at, at[known], error[known]), 1 / residuals.period,
                                     nperseg=size, detrend=False)
            powers.append(power)
            weights.append(part.stop - part.start)
    return (frequency, np.average(powers, axis=0, weights=weights),
            2 * noise.period * noise.power(frequency))


def bin_edges(values: Array, bins: int) -> Array:
    """Return edges halfway between equal widths and equal numbers of samples."""
    even = np.linspace(values.min(), values.max(), bins + 1)
    edges = 0.5 * (even + np.quantile(values, np.linspace(0, 1, bins + 1)))
    return populated_edges(values, edges)


def bin_of(values: Array, edges: Array) -> np.typing.NDArray[np.intp]:
    """Return in which bin between edges (B + 1,) each value lies; beyond them in the next."""
    return np.clip(np.searchsorted(edges, values, side='right') - 1, 0, len(edges) - 2)


def populated_edges(values: Array, edges: Array) -> Array:
    """Return edges (B + 1,) without those between which too few values (N,) lie."""
    kept = [edges[0]]
    least = LEAST_SHARE * len(values)
    ordered = np.sort(values)
    rank = np.searchsorted(ordered, edges)
    last = 0
    for edge, position in zip(edges[1:-1], rank[1:-1], strict=True):
        if position - last >= least and len(values) - position >= least:
            kept.append(edge)
            last = position
    return np.array([*kept, edges[-1]])
