"""Two models on the same recordings, block by block, under noise that is correlated in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import BLOCKS, LEAST_SAMPLES
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.diagnosis.search import DriveSearch
from pprs_dynamics.residuals.residuals import Residuals

SAME_PERIOD = 0.05  # relative, for noise of one recording to be that of another


def rms(residuals: Residuals) -> float:
    """Return the root of the mean squared error, over samples and drives [N]."""
    return float(np.sqrt(np.nanmean(residuals.error ** 2)))


def rms_by_drive(residuals: Residuals) -> dict[str, float]:
    """Return the same for every drive that was measured [N]."""
    return {drive: float(np.sqrt(np.nanmean(residuals.error[:, d] ** 2)))
            for d, drive in enumerate(residuals.drives)
            if np.isfinite(residuals.error[:, d]).any()}


def block_gains(before: Residuals, after: Residuals, noises: Mapping[int, NoiseModel],
                period: float) -> Array:
    """Return what a model takes off the whitened squared error of each block, (B,).

    Parameters
    ----------
    before, after : Residuals
        Of two models on the same recordings.
    noises : mapping of drive to NoiseModel
        Fitted at a period [s]; where the recordings have another, it is fitted to `after`.
    period : float
    """
    edges = np.linspace(0, len(before), BLOCKS + 1)
    gains = np.zeros(BLOCKS)
    for d in range(len(before.drives)):
        searches = [DriveSearch(residuals, d) for residuals in (before, after)]
        if any(search.known.sum() < LEAST_SAMPLES for search in searches):
            continue
        same = abs(after.period / period - 1) < SAME_PERIOD and d in noises
        noise = noises[d] if same else searches[1].fit_noise(searches[1].error)
        for sign, search in zip((1, -1), searches, strict=True):
            squares = search.whiten(noise, search.error) ** 2
            block = np.searchsorted(edges, search.index, side='right') - 1
            gains += sign * np.bincount(block, squares, BLOCKS)
    return gains


def certainty(gains: Array) -> float:
    """Return the mean gain of a block in its standard errors."""
    error = float(gains.std(ddof=1)) / len(gains) ** 0.5
    mean = float(gains.mean())
    return mean / error if error > 0 else float(np.sign(mean)) * np.inf
