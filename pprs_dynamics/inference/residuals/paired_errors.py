# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Two models on the same recordings, block by block, under noise that is correlated in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.residuals.bands import DriveSeries, FrequencyBands
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals

BLOCKS = 10
LEAST_SAMPLES = 100  # measured on a drive, below which it takes no part


def rms(residuals: Residuals) -> float:
    """Return the root of the mean squared error, over samples and drives [N]."""
    return root_mean_square(residuals.error)


def rms_by_drive(residuals: Residuals) -> dict[str, float]:
    """Return the root of the mean squared error of every drive that was measured [N]."""
    return {drive: root_mean_square(residuals.error[:, d])
            for d, drive in enumerate(residuals.drives)
            if np.isfinite(residuals.error[:, d]).any()}


def sample_gains(
    before: Residuals, after: Residuals, noises: Mapping[str, NoiseSpectrum],
) -> Array:
    """Return what a model takes off the whitened squared error of each sample, (M,).

    Parameters
    ----------
    before, after : Residuals
        Of two models on the same recordings.
    noises : mapping of str to NoiseSpectrum
        By drive.
    """
    bands = FrequencyBands.for_residuals(before)
    gains = np.zeros(len(before))
    for d, name in enumerate(before.drives):
        for sign, residuals in ((1, before), (-1, after)):
            series = DriveSeries(residuals, d, bands)
            if name not in noises or len(series) < LEAST_SAMPLES:
                continue
            root = np.sqrt(noises[name].power(series.frequency))
            gains[series.index] += sign * series.inverse(
                series.transform(series.error) / root) ** 2
    return gains


def block_gains(before: Residuals, after: Residuals, noises: Mapping[str, NoiseSpectrum]) -> Array:
    """Return the gains of `sample_gains` summed over blocks of equal length, (B,)."""
    gains = sample_gains(before, after, noises)
    edges = np.linspace(0, len(before), BLOCKS + 1)
    block = np.searchsorted(edges, np.arange(len(before)), side='right') - 1
    return np.bincount(block, gains, BLOCKS).astype(float)


def certainty(gains: Array) -> float:
    """Return the mean gain of a block in its standard errors."""
    error = float(gains.std(ddof=1)) / len(gains) ** 0.5
    mean = float(gains.mean())
    return mean / error if error > 0 else float(np.sign(mean)) * np.inf
