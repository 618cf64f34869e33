# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Findings about a recording: units, signs or order other than its names say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from pprs_dynamics.drives import DriveColumns, RecordedColumns
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import gravity_in
from pprs_dynamics.inference.readings.table import Reading, named
from pprs_dynamics.inference.residuals.excerpt import Excerpt
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_yaml import scalar

Scales = tuple[tuple[str, str, float | str | int], ...]


@dataclass(frozen=True)
class Mistake(Defect):
    """A finding about units, signs, order or kind of a recording's numbers.

    Parameters
    ----------
    kind, count, what, spans, drives
        See `Defect`.
    line : str
        What to write into the model file, so that it is read as it looks; '' where no line does.
    """

    line: str = ''

    @classmethod
    def of(cls, kind: str, drives: Sequence[str], group: Sequence[int], what: str,
           line: str = '', **more: Any) -> Self:
        """Return a mistake of some of the drives."""
        return cls(kind, len(group), what, (), tuple(drives[k] for k in group), line, **more)

    @property
    def action(self) -> str:
        """What was done about it, as a clause."""
        return 'nothing is changed'


class NoMeasurement(Mistake):
    """A finding that efforts are not what drives were measured to apply."""

    @property
    def action(self) -> str:
        """What follows, as a clause."""
        return 'no effect is claimed'


def effort_looks_like(findings: Iterable[Iterable[Defect]]) -> dict[str, str] | None:
    """Return the kind of each drive's effort that findings call no measurement; None for none."""
    return {drive: finding.kind for finding in no_measurements(findings)
            for drive in finding.drives} or None


def no_measurements(findings: Iterable[Iterable[Defect]]) -> list[NoMeasurement]:
    """Return the findings that efforts are no measurement."""
    return [finding for each in findings for finding in each if isinstance(finding, NoMeasurement)]


@dataclass(frozen=True)
class OtherReading(Mistake):
    """A finding that a recording is in other units, signs or another order than it says.

    Parameters
    ----------
    kind, count, what, spans, drives, line
        See `Mistake`.
    scales : tuple of (drive, key, value)
        Of `columns` in the model file, so that it is read as it looks; '' for keys of no drive.
    """

    scales: Scales = ()


def columns_line(findings: Iterable[OtherReading], has_columns: bool = False) -> str:
    """Return the line of a model file with which a recording is read as it looks; '' for none.

    Where the file has `columns` already, what is to be added to the columns of each drive.
    """
    blocks: dict[str, dict[str, None]] = {}
    for drive, key, value in (scale for finding in findings for scale in finding.scales):
        blocks.setdefault(drive, {})[
            f'{key}: {scalar(value) if isinstance(value, str | int) else f"{value:.7g}"}'] = None
    entries = [entry if not drive else f'{drive}: {{{entry}}}' for drive, entry in (
        (drive, ', '.join(keys)) for drive, keys in blocks.items())]
    if has_columns and entries:
        return f'under columns, beside what stands there: {", ".join(entries)}'
    return f'columns: {{{", ".join(entries)}}}' if entries else ''


# -------------------------------------------------------------------------- of other readings


def findings_of(model: DriveModel, recording: Recording, reading: Reading) -> list[OtherReading]:
    """Return the mistakes of times, of positions and order, and of efforts."""
    drives, scales, every = model.drives, reading.effort_scale, tuple(range(len(model.drives)))
    found = []
    for part in reading.parts:
        line, changes = '', position_scales(model, part, reading)
        if part.kind == 'time_unit':
            changes = (('', 'time_scale', part.time_unit),)
        if part.kind == 'drive_order':
            changes, line = _order_scales(model, recording, reading)
        if part.gravity is not None:
            key, vector = gravity_in(model, part.gravity)
            line = (f'gravity: [{", ".join(f"{value:g}" for value in vector)}] '
                    + ('under robot' if key.startswith('robot') else 'in the model file'))
            changes = ()
        if part.what:
            found.append(OtherReading.of(part.kind, drives, part.drives, part.what, line,
                                         scales=changes))

    def of(kind: str, group: Sequence[int], what: str, line: str = '') -> None:
        changes = tuple((drives[k], 'effort_scale', _as_read(
            model, drives[k]).effort_scale / float(scales[k])) for k in group)
        noun = f'the effort of {named(drives, tuple(group))}'
        found.append(OtherReading.of(kind, drives, group, f'{noun} {what}', line,
                                     scales=() if line else changes))

    if reading.share:
        of('effort_share', every, f"looks like {reading.share} of the drives' largest")
    elif not np.all(np.isin(scales, table.SCALES)):
        listed = ', '.join(f'{scale:.3g} ({drive})' for drive, scale in zip(
            drives, scales, strict=True) if scale != 1)
        # Drives without weight and inertia show none of their own: another's is nearer than 1.
        other = np.median(scales[scales != 1])
        gains = ', '.join(f'{1 / (other if scale == 1 else scale):.3g}' for scale in scales)
        of('drive_constant', every, f'is another multiple of what the masses need: {listed}: it '
           'looks like currents in amperes, percent of a torque, or another unit',
           f'effort_kind: current, and beside urdf or mjcf  gain: [{gains}]')
    else:
        for scale in dict.fromkeys(scales[scales != 1].tolist()):
            group = np.flatnonzero(scales == scale).tolist()
            units = dict.fromkeys(table.EFFORTS[abs(scale)].format(model.units[k].effort)
                                  for k in group if abs(scale) != 1)
            of('effort_unit' if units else 'effort_sign', group,
               f'looks like {"minus" if scale == -1 else f"{scale:.4g} times"} what the model says'
               + (f', as if it were in {" or ".join(units)}' if units else '')
               + (f' (or {"its position is" if len(drives) == 1 else "positions are"} negated)'
                  if scale < 0 and len(group) == len(drives) else ''))
    return found


def find_other_velocities(model: DriveModel, excerpt: Excerpt | None) -> Iterator[OtherReading]:
    """Yield recorded velocities that are a multiple of the derivatives of positions.

    All alike they contradict the unit or rate of times; else their own unit or sign is another.
    """
    factors = {} if excerpt is None else velocity_factors(excerpt)
    common = float(np.median([*factors.values()])) if factors else 0.0
    drives, columns, off = model.drives, model.recorded.columns, table.RATE_OFF
    if columns is not None and common > 0 and all(
            abs(factor / common - 1) <= off for factor in factors.values()):
        if columns.rate is not None and all(
                abs(common / unit - 1) >= off for unit in (1.0, *table.VELOCITY_UNITS)):
            rate = float(f'{columns.rate * common:.3g}')
            yield OtherReading('rate', 1, f'the recorded velocities are {common:.4g} times the '
                               f'derivatives of the positions at {columns.rate:g} samples per '
                               f'second, as if there were {rate:g}', scales=(('', 'rate', rate),))
            return
        if columns.rate is None and all(units.turns for units in model.units):
            # No velocity of an angle is in thousandths.
            unit = next((unit for each in table.TIMES for unit in (each, 1 / each)
                         if abs(common / unit - 1) < off), None)
            if unit is not None:
                yield OtherReading('rate', 1, f'the recorded velocities are {unit:g} times the '
                                   'derivatives of the positions, as if the times were in another '
                                   'unit', scales=(('', 'time_scale', (
                                       columns.time_scale or 1.0) / unit),))
                return
    groups: dict[float, list[int]] = {}
    for drive, factor in factors.items():
        for wrong in table.VELOCITY_UNITS:
            if abs(factor / wrong - 1) <= table.NEAR_ONE:
                groups.setdefault(wrong, []).append(drive)
    for factor, group in groups.items():
        times = 'minus' if factor == -1.0 else f'{factor:.4g} times'
        yield OtherReading.of(
            'velocity', drives, group, f'the recorded velocity of {named(drives, tuple(group))} '
            f'is {times} the derivative of the position', scales=tuple(
                (drives[k], 'velocity_scale', _as_read(model, drives[k]).velocity_scale / factor)
                for k in group))


def velocity_factors(excerpt: Excerpt) -> dict[int, float]:
    """Return recorded velocities over the derivatives of positions, of drives where they agree."""
    found: dict[int, float] = {}
    for drive, (recorded, true) in enumerate(() if excerpt.velocity is None else zip(
            excerpt.velocity.T, excerpt.motion.velocity.T, strict=True)):
        pair = np.column_stack([recorded, true])[np.isfinite(recorded)]
        (size, both), (_, other) = pair.T @ pair
        if size * other > 0 and abs(both) >= table.ALIKE * np.sqrt(size * other):
            found[drive] = float(both / other)
    return found


def _as_read(model: DriveModel, drive: str) -> DriveColumns:
    """Return the columns and scales with which a model file reads a drive."""
    return (model.recorded.columns or RecordedColumns()).drives.get(drive, DriveColumns())


def position_scales(model: DriveModel, part: Reading, whole: Reading) -> Scales:
    """Return the factors and offsets below `columns` that a part of a reading changes."""
    found: list[tuple[str, str, float]] = []
    for k in part.drives:
        before, factor = _as_read(model, model.drives[k]), float(whole.scale[k])
        if part.scale[k] != 1:
            found.append((model.drives[k], 'position_scale', factor * before.position_scale))
        if part.offset[k] or (part.scale[k] != 1 and before.position_offset):
            found.append((model.drives[k], 'position_offset',
                          factor * before.position_offset + float(whole.offset[k])))
    return tuple(found)


def _order_scales(model: DriveModel, recording: Recording, reading: Reading) -> tuple[Scales, str]:
    """Return the columns with which drives are read in another order, or a line of joints."""
    drives, joints = model.drives, model.recorded.joints or model.drives
    moved = [(keys, places) for keys, places in (
        (('position', 'velocity'), reading.positions), (('effort', 'current'), reading.efforts))
        if np.any(places != np.arange(len(drives)))]
    names = {drive: _as_read(model, drive).names for drive in drives}
    if not any(names.values()):
        if len(moved) > 1:
            return (), 'joint_map: {' + ', '.join(
                f'{scalar(drives[k])}: {scalar(joints[moved[0][1][k]])}'
                for k in reading.drives) + '}'
        known = ('position', 'effort', *(['velocity'] if recording.velocity is not None else []))
        names = {drive: {key: f'{joint}/{key}' for key in known}
                 for drive, joint in zip(drives, joints, strict=True)}
    return tuple((drives[k], key, names[drives[order[k]]][key]) for keys, order in moved
                 for k in reading.drives for key in keys if key in names[drives[order[k]]]), ''
