# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Discrete cosine transform of a drive's samples, and sums over bands of frequency.

The orthonormal DCT of stationary noise has nearly uncorrelated coefficients whose variance is the
noise's power spectrum at the frequency k / (2 T). Whitening is then a division. Within a band the
spectrum is taken as constant, so that all a fit needs of its columns are their products summed
over each band.

References
----------
N. Ahmed, T. Natarajan, K. R. Rao, Discrete cosine transform, IEEE Trans. Computers 23 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.residuals import Residuals, bridged

# The lowest frequencies, where spectra are steep, are bands of their own; above, bands grow.
SINGLE_BANDS, BAND_RATIO = 12, 1.25
# For so few pairs of rows, sums over their products are up to 15 times as fast as a product of
# matrices for every band (measured with 40 bands of 4000 samples).
FEW_PAIRS = 12


@dataclass(frozen=True)
class FrequencyBands:
    """Bands that all drives share; the first holds the constant of every stretch only.

    Parameters
    ----------
    edges : (B + 1,) array
        Ascending, the first below 0 [Hz].
    frequency : (B,) array
        At which the spectrum of a band is taken [Hz].
    """

    edges: Array
    frequency: Array

    @classmethod
    def of(cls, duration: float, period: float) -> FrequencyBands:
        """Return bands from the constant to the Nyquist frequency.

        Parameters
        ----------
        duration : float
            Of the longest stretch [s].
        period : float
            Between samples [s].
        """
        step, highest = 0.5 / duration, 0.5 / period
        single = step * (np.arange(SINGLE_BANDS + 1) + 0.5)
        count = max(int(np.ceil(np.log(highest / single[-1]) / np.log(BAND_RATIO))), 1)
        wide = np.geomspace(single[-1], max(highest, 1.01 * single[-1]), count + 1)[1:]
        edges = np.concatenate(([-step], single, wide))
        edges[-1] = np.inf
        centre = np.concatenate(([0.0], step * np.arange(1, SINGLE_BANDS + 1),
                                 np.sqrt(wide * np.concatenate((single[-1:], wide[:-1])))))
        return cls(edges, centre)

    def __len__(self) -> int:
        return len(self.frequency)

    @classmethod
    def for_residuals(cls, residuals: Residuals) -> FrequencyBands:
        """Return the bands that suit the longest stretch of any drive."""
        longest = max((part.stop - part.start for drive in range(len(residuals.drives))
                       for part in residuals.stretches(drive)), default=1)
        return cls.of(longest * residuals.period, residuals.period)


def _fast(part: slice, known: np.typing.NDArray[np.bool_]) -> slice:
    """Return a stretch less a few samples at its end, which is known as its beginning is.

    A length without large prime factors is transformed ten times as fast.
    """
    count = fft.prev_fast_len(part.stop - part.start, True)
    last = part.start + np.flatnonzero(known[part.start:part.start + count])[-1]
    return slice(part.start, int(last) + 1)


class DriveSeries:
    """One drive's measured samples, stretch by stretch, and their transform.

    Short gaps are bridged by straight lines, in the error and in every column alike.

    Parameters
    ----------
    residuals : Residuals
    drive : int
    bands : FrequencyBands

    Attributes
    ----------
    index : (n,) int array
        Samples of the residuals that belong to a stretch.
    known : (n,) bool array
        Those that were measured.
    stretches : list of slice
        Parts of `index` without a gap.
    frequency : (n,) array
        Of the coefficients, ascending [Hz].
    counts : (B,) array
        Coefficients in each band.
    """

    def __init__(self, residuals: Residuals, drive: int, bands: FrequencyBands) -> None:
        self.residuals, self.drive, self.bands = residuals, drive, bands
        measured = np.isfinite(residuals.measured[:, drive])
        stretches = [_fast(part, measured) for part in residuals.stretches(drive)]
        self.index = np.concatenate([np.arange(part.start, part.stop) for part in stretches]
                                    or [np.zeros(0, dtype=int)])
        self.known = measured[self.index]
        lengths = [part.stop - part.start for part in stretches]
        self.stretches = [slice(a, b) for a, b in pairwise(accumulate(lengths, initial=0))]
        frequency = np.concatenate([np.arange(n) / (2 * n * residuals.period) for n in lengths]
                                   or [np.zeros(0)])
        order = np.argsort(frequency, kind='stable')
        # Copies of hundreds of rows are dear: of one stretch all samples are taken as they are.
        self._order: Any = order if len(lengths) > 1 else slice(None)
        self._taken: Any = self.index if len(stretches) != 1 else stretches[0]
        self.frequency = frequency[order]
        self._cuts = np.searchsorted(self.frequency, bands.edges)
        self._cuts[-1] = len(frequency)
        self.counts = np.diff(self._cuts).astype(float)
        self._single = int(np.argmax(np.append(self.counts, 0) != 1))  # bands of one coefficient

    def __len__(self) -> int:
        return len(self.index)

    @cached_property
    def error(self) -> Array:
        """Measured minus model at `index`, gaps bridged [N]."""
        return bridged(np.nan_to_num(self.residuals.error[self.index, self.drive]), self.known)

    def transform(self, values: Array) -> Array:
        """Return DCT coefficients (..., n) by ascending frequency, of values (..., M or n)."""
        if values.shape[-1] != len(self.index):
            values = values[..., self._taken]
        values = bridged(values, self.known)
        parts = [fft.dct(values[..., part], norm='ortho', axis=-1) for part in self.stretches]
        return parts[0] if len(parts) == 1 else np.concatenate(
            parts, axis=-1)[..., self._order]

    def inverse(self, coefficients: Array) -> Array:
        """Return the values (..., n) of DCT coefficients."""
        unsorted = np.empty_like(coefficients)
        unsorted[..., self._order] = coefficients
        parts = [fft.idct(unsorted[..., part], norm='ortho', axis=-1) for part in self.stretches]
        return np.concatenate(parts, axis=-1)

    def products(self, a: Array, b: Array) -> Array:
        """Return the sums over each band of products of rows (p, n) and (q, n), (B, p, q)."""
        if len(a) * len(b) <= FEW_PAIRS:
            return np.moveaxis(self.sums(a[:, None] * b[None]), -1, 0)
        found = np.zeros((len(self.bands), len(a), len(b)))
        cuts, single = self._cuts, self._single
        np.multiply(a[:, :single].T[:, :, None], b[:, :single].T[:, None, :], out=found[:single])
        for band in range(single, len(self.bands)):
            part = slice(cuts[band], cuts[band + 1])
            if cuts[band] < cuts[band + 1]:
                np.matmul(a[:, part], b[:, part].T, out=found[band])
        return found

    def sums(self, values: Array) -> Array:
        """Return the sums over each band of values (..., n), (..., B)."""
        found = np.zeros((*values.shape[:-1], len(self.bands)))
        full = np.flatnonzero(self.counts)
        if len(full):
            found[..., full] = np.add.reduceat(values, self._cuts[full], axis=-1)
        return found

    def spread(self, by_band: Array) -> Array:
        """Return a value per coefficient (n,) from one per band (B,)."""
        return np.repeat(by_band, self.counts.astype(int))
