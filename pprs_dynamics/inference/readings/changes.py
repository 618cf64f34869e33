# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Efforts without their sign, and units or signs that change in the middle of a recording.

Both are read in no other unit as a whole, and what a search for missing effects makes of them is
a long list of effects that are not there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.readings.findings import OtherReading
from pprs_dynamics.inference.readings.table import (
    ANGLES,
    BOTH_SIGNS,
    CHANGES,
    CLEARLY,
    GOOD_FIT,
    LEAST_PART,
    LENGTHS,
    NEARLY,
    SHARP,
    WEAK,
    named,
)
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of, forces_on
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel


def find_changed_efforts(model: DriveModel, recording: Recording) -> Iterator[OtherReading]:
    """Yield efforts that lack their sign, and units or signs that are others from a time on."""
    excerpt = excerpt_of(recording)
    forces = None if excerpt is None else forces_on(model, excerpt.motion, excerpt.time)
    if excerpt is None or forces is None:
        return
    unsigned = _unsigned(recording, excerpt, forces)
    if unsigned:
        yield OtherReading.of(
            'effort_absolute', model.drives, unsigned,
            f'the effort of {named(model.drives, unsigned)} looks like its absolute value: it is '
            'never below 0, where the model changes sign; it must be recorded with its sign')
    else:
        yield from _changed_efforts(model.units, recording, excerpt, forces)


def _told(effort: Array, forces: Array) -> list[int]:
    """Return the drives of which efforts tell anything."""
    size = np.sqrt(np.nanmean(forces ** 2, axis=0))
    return [d for d in range(effort.shape[1])
            if np.isfinite(effort[:, d]).sum() > 2 / LEAST_PART and size[d] > WEAK * size.max()]


def _unlike(effort: Array, forces: Array) -> float:
    known = np.isfinite(effort)
    a, b = effort[known], forces[known]
    return float(np.sum((a - b) ** 2) / max(np.sum(a ** 2) + np.sum(b ** 2), 1e-300))


def _unsigned(recording: Recording, excerpt: Excerpt, forces: Array) -> tuple[int, ...]:
    """Return the drives whose efforts have no sign."""
    found = []
    for d in _told(excerpt.effort, forces):
        effort, force = excerpt.effort[:, d], forces[:, d]
        below = np.sum(np.minimum(force, 0.0) ** 2) / np.sum(force ** 2)
        known = recording.effort[:, d][np.isfinite(recording.effort[:, d])]
        if (BOTH_SIGNS < below < 1 - BOTH_SIGNS and np.all(known >= 0) and np.any(known)
                and CLEARLY * _unlike(effort, np.abs(force)) < _unlike(effort, force)):
            found.append(d)
    return tuple(found)


def _changed_efforts(units: tuple[DriveUnits, ...], recording: Recording, excerpt: Excerpt,
                     forces: Array) -> Iterator[OtherReading]:
    """Yield the efforts that are in another unit, or negated, in one part of the recording."""
    told = _told(excerpt.effort, forces)
    drives = recording.drives
    groups = [tuple(told), *((d,) for d in told)] if len(told) > 1 else [tuple(told)]
    for group in groups if told else ():
        change = _change(excerpt.effort[:, group], forces[:, group])
        if change is None:
            continue
        factor, at, is_after = change
        first, last = excerpt.time[at - 1], excerpt.time[at]
        edge = f'{last:.4g} s' if last - first < SHARP else (
            f'a time between {first:.4g} and {last:.4g} s')
        span = f'from {edge} on' if is_after else f'until {edge}'
        everyone = tuple(range(len(drives))) if group == tuple(told) else group
        how = CHANGES[factor].format(units[group[0]].effort)
        yield OtherReading.of(
            'effort_unit' if factor > 0 else 'effort_sign', drives, everyone,
            f'the effort of {named(drives, everyone)} looks {how} {span}, unlike in the rest; the '
            'parts must be recordings of their own')
        return


def _change(effort: Array, forces: Array) -> tuple[float, int, bool] | None:
    """Return by which factor efforts (M, d) change, before which sample, and in which part."""
    known = np.isfinite(effort)
    e, f = np.where(known, effort, 0.0), np.where(known, forces, 0.0)
    weight = 1 / np.maximum(np.sum(f ** 2, axis=0), 1e-300)

    def sums(factor: float) -> tuple[Array, Array]:
        """Return running sums of squared differences and of squares, (M + 1,) each."""
        parts = ((e / factor - f) ** 2, (e / factor) ** 2 + f ** 2)
        one, two = (np.concatenate(([0.0], np.cumsum(np.sum(part * weight, axis=1))))
                    for part in parts)
        return one, two

    plain = sums(1.0)
    least = plain[0][-1] / plain[1][-1]
    margin = max(1, int(LEAST_PART * len(e)))
    splits = np.arange(margin, len(e) - margin + 1)
    best = None
    for factor in CHANGES:
        other = sums(factor)
        whole = other[0][-1] / other[1][-1]
        for is_after, (one, two) in ((True, (plain, other)), (False, (other, plain))):
            left = one[0][splits] + two[0][-1] - two[0][splits]
            size = one[1][splits] + two[1][-1] - two[1][splits]
            # A part in which next to nothing is asked for is small in any larger unit: what
            # changed must itself be as the model has it.
            part = [two[k][-1] - two[k][splits] if is_after else one[k][splits] for k in (0, 1)]
            unlike = np.where(part[0] < GOOD_FIT * part[1], left / size, np.inf)
            at = int(np.argmin(unlike))
            if CLEARLY * unlike[at] < min(least, whole) and unlike[at] < GOOD_FIT and (
                    best is None or unlike[at] < best[0]):
                best = float(unlike[at]), factor, int(splits[at]), is_after
    return None if best is None else best[1:]


def find_changed_positions(recording: Recording) -> Iterator[OtherReading]:
    """Yield where the positions of all drives are in another unit from one sample to the next."""
    units = {**LENGTHS, **ANGLES}
    factors = [one for unit in units for one in (unit, 1 / unit)]
    before, after = recording.position[:-1], recording.position[1:]
    usable = (before != 0) & (after != 0)
    with np.errstate(divide='ignore', invalid='ignore'):
        ratio = after / before
    for factor in factors:
        alike = np.abs(ratio / factor - 1) < NEARLY
        at = np.flatnonzero(np.all(alike | ~usable, axis=1) & np.any(usable, axis=1))
        for k in at.tolist():
            # One zero crossing may have any ratio: it is one where sizes stay what they become.
            near = slice(max(k - 9, 0), k + 1), slice(k + 1, k + 11)
            sizes = [np.median(np.abs(recording.position[part]), axis=0) for part in near]
            if np.all(np.abs(sizes[1] / np.maximum(sizes[0], 1e-300) / factor - 1) < 10 * NEARLY):
                unit = units.get(factor) or units[1 / factor]
                part = 'until' if factor in units else 'from'
                when = recording.time[k] if factor in units else recording.time[k + 1]
                yield OtherReading.of(
                    'position_unit', recording.drives, range(len(recording.drives)),
                    f'the positions look like {unit} {part} {when:.4g} s'
                    f'{" on" if part == "from" else ""}, unlike in the rest; the parts must be '
                    'recordings of their own')
                return
