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

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.residuals.residuals import Residuals

# The lowest frequencies, where spectra are steep, are bands of their own; above, bands grow.
SINGLE_BANDS, BAND_RATIO = 12, 1.25
MOST_STRETCHES = 256  # whose means are rotated at once: a record of more is taken in parts
# For so few pairs of rows, sums over their products are up to 15 times as fast as a product of
# matrices for every band (measured with 40 bands of 4000 samples).
FEW_PAIRS = 12
LEAST_OPEN = 0.05  # variance of open forces over the noise's, below which a direction is known


class FrequencyBands:
    """Bands from the constant to the Nyquist frequency, that all drives share.

    The first holds the constant of every record only.

    Parameters
    ----------
    duration : float
        Of the longest record [s].
    period : float
        Between samples [s].

    Attributes
    ----------
    edges : (B + 1,) array
        Ascending, the first below 0 [Hz].
    frequency : (B,) array
        At which the spectrum of a band is taken [Hz].
    """

    def __init__(self, duration: float, period: float) -> None:
        step, highest = 0.5 / duration, 0.5 / period
        single = step * (np.arange(SINGLE_BANDS + 1) + 0.5)
        count = max(int(np.ceil(np.log(highest / single[-1]) / np.log(BAND_RATIO))), 1)
        wide = np.geomspace(single[-1], max(highest, 1.01 * single[-1]), count + 1)[1:]
        self.edges = np.concatenate(([-step], single, wide))
        self.edges[-1] = np.inf
        self.frequency = np.concatenate(([0.0], step * np.arange(1, SINGLE_BANDS + 1),
                                         np.sqrt(wide * np.concatenate((single[-1:], wide[:-1])))))

    def __len__(self) -> int:
        return len(self.frequency)

    @classmethod
    def for_residuals(cls, residuals: Residuals) -> FrequencyBands:
        """Return the bands that suit the longest record of any drive, its gaps included."""
        longest = max((residuals.time[record[-1].stop - 1] - residuals.time[record[0].start]
                       for drive in range(len(residuals.drives))
                       for record in _records(residuals, drive)), default=0.0)
        return cls(float(longest) + residuals.period, residuals.period)


def _records(residuals: Residuals, drive: int) -> list[list[slice]]:
    """Return the stretches of a drive, those through which noise goes on together."""
    records: list[list[slice]] = []
    for part in residuals.stretches(drive):
        same = records and residuals.record[records[-1][-1].start] == residuals.record[part.start]
        if same and len(records[-1]) < MOST_STRETCHES:
            records[-1].append(part)
        else:
            records.append([part])
    return records


@dataclass(frozen=True)
class OpenForces:
    """Unknown forces on a drive in addition to its noise: Gaussian, of few directions.

    Parameters
    ----------
    rows : (K, M) array
        Their sum, with independent factors of unit variance, is what the forces may be [N].
    power : (B,) array
        Spectrum of the noise at the bands [N^2].
    """

    rows: Array
    power: Array


class DriveSeries:
    """One drive's measured samples, stretch by stretch, and their transform.

    Over a stretch the k-th coefficient of the DCT has the frequency k / (2 T) of its length T, and
    the one of k = 0 is its mean. In a record of several stretches, through the gaps between which
    slow noise goes on, the R means are no constants: they show what is slower than a stretch.
    They are rotated by an orthonormal basis, made of cos(k pi t / T) at the stretches for
    k = 0 .. R - 1 with the length T of the record; the k-th has the frequency k / (2 T), and only
    that of k = 0 is the constant.

    Only what was measured counts. Within a stretch samples follow each other as if the few that
    are missing were not: the transform stays orthonormal, so that white noise is white.

    Where forces are open, with covariance Z^T Z in addition to the noise S, coefficients are
    multiplied by S^1/2 (1 + S^-1/2 Z^T Z S^-1/2)^-1/2 S^-1/2: noise and open forces together are
    then as the noise alone is without. What lies along open forces counts the less, the larger they
    may be.

    Parameters
    ----------
    residuals : Residuals
    drive : int
    bands : FrequencyBands
    open_forces : OpenForces, optional

    Attributes
    ----------
    index : (n,) int array
        Samples of the residuals that were measured and take part.
    stretches : list of slice
        Parts of `index` without a long gap.
    frequency : (n,) array
        Of the coefficients, ascending [Hz].
    counts : (B,) array
        Coefficients in each band.
    """

    def __init__(self, residuals: Residuals, drive: int, bands: FrequencyBands,
                 open_forces: OpenForces | None = None) -> None:
        self.residuals, self.drive, self.bands = residuals, drive, bands
        measured = np.isfinite(residuals.measured[:, drive])
        records = [[_fast(part.start + np.flatnonzero(measured[part])) for part in record]
                   for record in _records(residuals, drive)]
        known = [part for record in records for part in record]
        self.index = np.concatenate([*known, np.zeros(0, dtype=int)])
        self.stretches = [slice(a, b) for a, b in pairwise(accumulate(
            map(len, known), initial=0))]
        first = np.array([part.start for part in self.stretches])
        frequency = np.concatenate([*(
            np.arange(len(part)) / (2 * residuals.period * (part[-1] - part[0] + 1))
            for part in known), np.zeros(0)])
        self._rotations: list[tuple[Integers, Array]] = []
        at = 0
        for record in records:
            means = first[at:at + len(record)]
            at += len(record)
            if len(record) > 1:
                basis, slow = _slow_basis([residuals.time[part] for part in record],
                                          residuals.period)
                self._rotations.append((means, basis))
                frequency[means] = slow
        order = np.argsort(frequency, kind='stable')
        # Copies of hundreds of rows are dear: of one stretch all samples are taken as they are.
        is_one = len(known) == 1
        self._order: Any = slice(None) if is_one else order
        whole = is_one and known[0][-1] - known[0][0] + 1 == len(known[0])
        self._taken: Any = slice(int(known[0][0]), int(known[0][-1]) + 1) if whole else self.index
        self.frequency = frequency[order]
        self._cuts = np.searchsorted(self.frequency, bands.edges)
        self._cuts[-1] = len(frequency)
        self.counts = np.diff(self._cuts).astype(float)
        self._single = int(np.argmax(np.append(self.counts, 0) != 1))  # bands of one coefficient
        self._open = None if open_forces is None or not len(self) else _Narrowing(
            open_forces.rows, self.cosines(open_forces.rows),
            np.sqrt(self.spread(open_forces.power)))

    def __len__(self) -> int:
        return len(self.index)

    @cached_property
    def error(self) -> Array:
        """Measured minus model at `index` [N]."""
        error: Array = self.residuals.error[self.index, self.drive]
        return error

    def transform(self, values: Array) -> Array:
        """Return coefficients (..., n) by ascending frequency, of values (..., M or n).

        Along open forces they are as much smaller as these make the noise larger.
        """
        found = self.cosines(values)
        return found if self._open is None else self._open.narrowed(found)

    def open_forces(self, values: Array) -> Array:
        """Return the most likely open forces, (M,), given the residual (M,) of a fit [N]."""
        return np.zeros_like(values) if self._open is None else self._open.expected(
            self.cosines(values))

    def cosines(self, values: Array) -> Array:
        """Return the coefficients of the plain transform."""
        if values.shape[-1] != len(self.index):
            values = values[..., self._taken]
        parts = [fft.dct(values[..., part], norm='ortho', axis=-1) for part in self.stretches]
        if len(parts) == 1:
            return parts[0]
        coefficients: Array = np.concatenate(parts, axis=-1)
        for means, basis in self._rotations:
            coefficients[..., means] = coefficients[..., means] @ basis
        return coefficients[..., self._order]

    def inverse(self, coefficients: Array) -> Array:
        """Return the values (..., n) of coefficients of the plain transform."""
        unsorted = np.empty_like(coefficients)
        unsorted[..., self._order] = coefficients
        for means, basis in self._rotations:
            unsorted[..., means] = unsorted[..., means] @ basis.T
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


class _Narrowing:
    """Open forces along their principal directions, in units of the noise.

    Parameters
    ----------
    rows : (K, M) array
    cosines : (K, n) array
        Their plain coefficients.
    root : (n,) array
        Of the noise's spectrum.

    Attributes
    ----------
    axes : (K, R) array
        Directions among the rows.
    values : (R,) array
        Whitened squares along them.
    across, along : (R, n) array
        Directions over and times the root of the noise's spectrum.
    """

    def __init__(self, rows: Array, cosines: Array, root: Array) -> None:
        white = cosines / root
        values, axes = np.linalg.eigh(white @ white.T)
        kept = values > LEAST_OPEN
        self.rows, self.values, self.axes = rows, values[kept], axes[:, kept]
        directions = self.axes.T @ white / np.sqrt(self.values)[:, None]
        self.across, self.along = directions / root, directions * root

    def narrowed(self, coefficients: Array) -> Array:
        """Return coefficients (..., n) with what lies along open forces made smaller."""
        less = (1 - 1 / np.sqrt(1 + self.values)).astype(coefficients.dtype)
        along = coefficients @ self.across.T.astype(coefficients.dtype)
        narrowed: Array = coefficients - (along * less) @ self.along.astype(coefficients.dtype)
        return narrowed

    def expected(self, coefficients: Array) -> Array:
        """Return the mean of open forces given plain coefficients (n,) of an error, (M,)."""
        share = np.sqrt(self.values) / (1 + self.values)
        expected: Array = (self.axes @ (share * (self.across @ coefficients))) @ self.rows
        return expected


def _fast(samples: Integers) -> Integers:
    """Return the samples of a stretch less a few at its end.

    A count without large prime factors is transformed ten times as fast.
    """
    return samples[:fft.prev_fast_len(len(samples), True)]


def _slow_basis(times: list[Array], period: float) -> tuple[Array, Array]:
    """Return an orthonormal basis of the means of R stretches, (R, R), and its frequencies, (R,).

    By QR of the means of cos(k pi t / T), each as much as the root of its samples is worth.
    """
    start = times[0][0] - period / 2
    length = times[-1][-1] + period / 2 - start
    wave = np.pi * np.arange(len(times)) / length
    means = np.stack([np.sqrt(len(time)) * np.cos(np.outer(time - start, wave)).mean(axis=0)
                      for time in times])
    return np.linalg.qr(means)[0], wave / (2 * np.pi)
