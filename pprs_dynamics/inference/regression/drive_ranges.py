# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Ranges of the drives in recordings: strokes, speeds, delays, temperatures, second encoders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction
from pprs_dynamics.physics.effects.drive_effect import DriveRange, Windup
from pprs_dynamics.physics.effects.laws.elastic_joint import load_by_windup
from pprs_dynamics.physics.model.drive_model import DriveModel

LONGEST_DELAY = 0.3  # [s], that a recording may show at once
# Of the effort's variance; efforts that follow the motion less are as much like it at any delay.
LEAST_ALIKE = 0.5


def drive_range(model: DriveModel, recordings: Sequence[FullRate], drive: int) -> DriveRange:
    """Return positions, speeds and delays of a drive in recordings."""
    position = np.concatenate([recording.position[:, drive] for recording in recordings])
    velocity = np.concatenate([recording.velocity[:, drive] for recording in recordings])
    longest = max(recordings, key=lambda recording: len(recording.time))
    return DriveRange(float(longest.time[-1] - longest.time[0]),
                      float(np.median(np.diff(longest.time))),
                      float(np.ptp(position)), float(np.abs(velocity).max()),
                      model.gear_ratios[drive], _delay(longest, drive),
                      model.units[drive].turns,
                      any(np.any(recording.friction_load[:, drive]) for recording in recordings),
                      _channels(recordings, drive), float(position.min() + position.max()) / 2)


def _channels(recordings: Sequence[FullRate], drive: int) -> dict[str, tuple[float, float]]:
    """Return the ranges of further channels of a drive."""
    found = {}
    for name in {name for recording in recordings for name in recording.channels}:
        values = np.concatenate([recording.channels[name][:, drive] for recording in recordings
                                 if name in recording.channels])
        if np.isfinite(values).any():
            found[name] = float(np.nanmin(values)), float(np.nanmax(values))
    return found


def _delay(recording: FullRate, drive: int) -> float:
    """Return by how much the measured effort is most like the drive's if that is late [s].

    By the multiple correlation with the model's effort and what a model may lack most of (dry and
    viscous friction, inertia), over the longest segment, within `LONGEST_DELAY`: a model that
    explains little is like nothing by itself. Where they explain less than `LEAST_ALIKE` it is 0.
    """
    part = max(recording.segments, key=lambda segment: segment.stop - segment.start)
    time = recording.time[part]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    even = np.arange(time[0], time[-1], step) if step else np.zeros(0)
    most = min(int(LONGEST_DELAY / step), len(even) // 4) if step else 0
    measured = recording.effort_measured[part, drive]
    known = np.isfinite(measured)
    if not most or not np.any(known):
        return 0.0
    seen = np.interp(even, time[known], measured[known])
    columns = np.stack([np.interp(even, time, values[part, drive]) for values in (
        recording.effort, recording.velocity, recording.direction, recording.acceleration)])
    columns -= columns.mean(axis=1, keepdims=True)
    columns /= np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), 1e-300)
    columns = np.vstack((columns, np.full(len(even), len(even) ** -0.5)))
    # The same efforts for every delay, which have a past and a future of all of them.
    inner = seen[most:-most] - seen.mean()
    # Correlations by the FFT; `scipy.signal` has them as well, but takes 0.4 s to import.
    size = fft.next_fast_len(len(even), real=True)
    alike = fft.irfft(fft.rfft(columns, size) * fft.rfft(inner, size).conj(), size)[
        :, :len(even) - len(inner) + 1]
    sums = np.cumsum(columns[:, None] * columns, axis=2)
    sums = np.concatenate((np.zeros((*sums.shape[:2], 1)), sums), axis=2)
    grams = (sums[..., len(inner):] - sums[..., :-len(inner)]).transpose(2, 0, 1)
    explained = np.einsum('kl,lkm,ml->l', alike, np.linalg.pinv(grams, 1e-9, hermitian=True), alike)
    best = int(np.argmax(explained))
    if explained[best] < LEAST_ALIKE * (inner @ inner):
        return 0.0
    return round(float((most - best) * step), 9)  # whatever the clock's origin


@dataclass(frozen=True)
class Clearance:
    """Measurement of a drive by a second encoder that it leads by one of two distances.

    Parameters
    ----------
    size : float
        Between the two [m, rad].
    of : {'motion', 'load'}
        Whose side chooses.
    explained : float
        Share of the variance of the distance that the two explain.
    """

    size: float
    of: str
    explained: float


@dataclass(frozen=True)
class SecondEncoders:
    """Wind-up and clearance of the drives with an encoder behind the gear.

    Parameters
    ----------
    windups : mapping of drive to Windup
        Of drives that wind up under their loads.
    clearances : mapping of drive to Clearance
        Of drives that lead their links by one of two distances.
    """

    windups: Mapping[int, Windup]
    clearances: Mapping[int, Clearance]

    @classmethod
    def of(cls, recordings: Sequence[FullRate], reconstructions: Sequence[Reconstruction],
           ) -> SecondEncoders:
        """Return wind-up and clearance for recordings and their motion as it was read."""
        read = [(run.transmitted, run.direction, found.windup) for run, found in zip(
            recordings, reconstructions, strict=False) if found.windup is not None]
        windups, clearances = {}, {}
        for d in range(read[0][0].shape[1] if read else 0):
            load, direction = (np.concatenate([part[k][:, d] for part in read]) for k in (0, 1))
            lead = np.concatenate([windup[:, :, d] for *_, windup in read], axis=1)
            if not np.any(lead):
                continue
            if np.ptp(load):
                stiffness, damping, windup = load_by_windup(load, lead)
                if stiffness > 0:
                    windups[d] = Windup(1 / stiffness, damping / stiffness,
                                        float(np.var(windup) / np.var(load)))
            clearances[d] = max(
                _clearance(lead[0], direction, 'motion'),
                _clearance(lead[0], np.sign(load), 'load'), key=lambda found: found.explained)
        return cls(windups, clearances)


def _clearance(lead: Array, side: Array, of: str) -> Clearance:
    """Return by how much a drive leads its link on either side, (N,)."""
    lead, side = lead - lead.mean(), side - side.mean()
    size = float(side @ lead / max(float(side @ side), 1e-300))
    left = float(np.var(lead - size * side))
    return Clearance(2 * size, of, 1 - left / max(float(np.var(lead)), 1e-300))
