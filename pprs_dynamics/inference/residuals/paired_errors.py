# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Two models on the same recordings, block by block, under noise that is correlated in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

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


@dataclass(frozen=True)
class PairedGain:
    """What a model takes off the squared error of another one, in units of the noise.

    Parameters
    ----------
    gains : (B,) array
        Of whitened squared error, block by block.
    sizes : (B,) array
        Whitened squares of what the two predict otherwise.
    """

    gains: Array
    sizes: Array

    @property
    def certainty(self) -> float:
        """The gain over all blocks in its standard errors.

        Of blocks in which a model changes nothing nothing is expected: the gain is a ratio
        estimate, its error what gains differ by from their share by size (W. G. Cochran, Sampling
        Techniques, 3rd ed., 1977, 6.4), and no less than noise makes, with 4 |a - b|^2 the
        variance of |noise - a|^2 - |noise - b|^2.
        """
        total, size, count = float(self.gains.sum()), float(self.sizes.sum()), len(self.gains)
        if size <= 0:
            return 0.0
        spread = count / (count - 1) * float(np.sum(
            (self.gains - total / size * self.sizes) ** 2))
        return total / float(np.sqrt(max(4 * size, spread)))


def sample_gains(
    before: Residuals, after: Residuals, noises: Mapping[str, NoiseSpectrum],
) -> tuple[Array, Array]:
    """Return `gains` and `sizes` of a `PairedGain` sample by sample, (M,) each.

    Parameters
    ----------
    before, after : Residuals
        Of two models on the same recordings.
    noises : mapping of str to NoiseSpectrum
        By drive.
    """
    bands = FrequencyBands.for_residuals(before)
    gains, sizes = np.zeros(len(before)), np.zeros(len(before))
    for d, name in enumerate(before.drives):
        series = DriveSeries(before, d, bands)
        if name not in noises or len(series) < LEAST_SAMPLES:
            continue
        root = np.sqrt(noises[name].power(series.frequency))
        one, other = (series.inverse(series.transform(error[:, d]) / root)
                      for error in (before.error, after.error))
        gains[series.index] += one ** 2 - other ** 2
        sizes[series.index] += (one - other) ** 2
    return gains, sizes


def paired_gain(before: Residuals, after: Residuals, noises: Mapping[str, NoiseSpectrum],
                ) -> PairedGain:
    """Return the gains of `sample_gains` summed over blocks of equal length."""
    edges = np.linspace(0, len(before), BLOCKS + 1)
    block = np.searchsorted(edges, np.arange(len(before)), side='right') - 1
    return PairedGain(*(np.bincount(block, one, BLOCKS).astype(float)
                        for one in sample_gains(before, after, noises)))
