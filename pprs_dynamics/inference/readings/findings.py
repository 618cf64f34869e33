# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Findings about a recording: units, signs or order that differ from its names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import (
    Evidence,
    fast_noise,
    gravity_key,
)
from pprs_dynamics.inference.readings.names import is_share
from pprs_dynamics.inference.readings.table import Reading, named
from pprs_dynamics.inference.residuals.excerpt import Excerpt
from pprs_dynamics.measurement.files.recording import Recording, signed
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model import recorded_names
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import EFFORT_KIND
from pprs_dynamics.system.plain_yaml import as_yaml

KINDS = {recorded_names.COMMANDED: table.COMMAND, recorded_names.EXTERNAL: table.EXTERNAL}
Scale = tuple[str, str, float | str | int]  # drive, key below `columns`, value
Scales = tuple[Scale, ...]


@dataclass(frozen=True)
class Mistake(Defect):
    """A finding about units, signs, order or kind of a recording's numbers.

    Parameters
    ----------
    kind, count, what, spans, drives
        See `Defect`.
    line : str
        What to write into the model file, so that it is read as it looks; '' where no line does.
    scales : tuple of (drive, key, value)
        The same below `columns`; '' for keys of no drive.
    """

    line: str = ''
    scales: Scales = ()

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
    return [finding for some in findings for finding in some if isinstance(finding, NoMeasurement)]


class OtherReading(Mistake):
    """A finding that a recording is in other units, signs or another order than it says."""


def columns_line(scales: Iterable[Scale], has_columns: bool = False) -> str:
    """Return the line of a model file with which a recording is read as it looks; '' for none.

    Where the file has `columns` already, what is to be added or changed there.
    """
    blocks: dict[str, dict[str, None]] = {}
    for drive, key, value in scales:
        blocks.setdefault(drive, {})[
            f'{key}: {as_yaml(value) if isinstance(value, str | int) else f"{value:.7g}"}'] = None
    entries = [entry if not drive else f'{as_yaml(drive)}: {{{entry}}}' for drive, entry in (
        (drive, ', '.join(keys)) for drive, keys in blocks.items())]
    if has_columns and entries:
        return f'under columns, add or change only these keys: {", ".join(entries)}'
    return f'columns: {{{", ".join(entries)}}}' if entries else ''


def lines_of(findings: Iterable[Defect], has_columns: bool = False) -> list[str]:
    """Return the lines of a model file with which a recording is read as findings say."""
    mistakes = [finding for finding in findings if isinstance(finding, Mistake)]
    first = columns_line([scale for mistake in mistakes for scale in mistake.scales], has_columns)
    return [*filter(None, (first, *(mistake.line for mistake in mistakes)))]


def _numbers(values: Array, digits: int = 3) -> str:
    """Return a list of a model file, in which every number is a float."""
    return as_yaml([float(f'{value:.{digits}g}') for value in values])


def gravity_line(model: DriveModel, gravity: Array) -> str:
    """Return the line of a model file with gravity in the base, (3,) [m/s^2]."""
    line = f'gravity: {_numbers(gravity + 0.0, 6)}'
    return f'under robot, {line}' if gravity_key(model).startswith('robot') else line


# -------------------------------------------------------------------------- of other readings


def findings_of(model: DriveModel, recording: Recording, reading: Reading) -> list[Mistake]:
    """Return the mistakes of times, of positions and order, and of efforts."""
    drives, scales, every = model.drives, reading.effort_scale, tuple(range(len(model.drives)))
    found: list[Mistake] = []
    for part in reading.parts:
        line, changes = '', position_scales(model, part, reading)
        if part.time_unit != 1:
            changes = (_time_scale(model, part.time_unit),)
        if part.kind == 'drive_order':
            changes = _order_scales(model, recording, reading)
        if part.gravity is not None:
            line, changes = gravity_line(model, part.gravity), ()
        if part.kind in table.LACKING:
            columns = model.recorded.columns
            what = part.what if part.kind != table.COMMAND or not (columns and columns.rate) else (
                f'{part.what}; or there are fewer samples per second than {columns.rate:g}')
            found.append(NoMeasurement.of(part.kind, drives, every, what,
                                          f'{EFFORT_KIND}: {table.LACKING[part.kind][1]}'))
        elif part.what:
            found.append(OtherReading.of(part.kind, drives, part.drives, part.what, line,
                                         scales=changes))

    def of(kind: str, group: Sequence[int], what: str) -> None:
        changes = tuple((drives[k], 'effort_scale', model.recorded.columns_of(
            drives[k]).effort_scale / float(scales[k])) for k in group)
        noun = f'the effort of {named(drives, tuple(group))}'
        found.append(OtherReading.of(kind, drives, group, f'{noun} {what}', scales=changes))

    if reading.is_no_measurement and np.any(scales != 1):
        found.append(NoMeasurement.of(
            table.POSITION_ERROR, drives, every, f'the effort of {named(drives, every)} is '
            f'{scales[0]:.2g} times what the model says: it looks like an error of position under '
            'the effort, or is in another unit', f'{EFFORT_KIND}: {recorded_names.COMMANDED}'))
    elif not np.all(np.isin(scales, table.SCALES)):
        listed = ', '.join(f'{scale:.3g} ({drive})' for drive, scale in zip(
            drives, scales, strict=True) if scale != 1)
        gains = '' if model.gain is None else (  # the paper's robot has none
            ' (then write effort_kind: current, and under robot  gain: '
            f'{_numbers(1 / scales)})')
        of('drive_constant', np.flatnonzero(scales != 1).tolist(),
           f'is another multiple of what the masses need: {listed}: it looks like currents in '
           f'amperes{gains}, percent of a torque, or another unit')
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


def find_other_velocities(model: DriveModel, factors: Mapping[int, tuple[float, float]],
                          time_unit: float) -> Iterator[OtherReading]:
    """Yield recorded velocities that are a multiple of the derivatives of positions."""
    groups: dict[float, list[int]] = {}
    drives, known = model.drives, (*table.VELOCITY_UNITS, *(
        1 / unit for unit in table.VELOCITY_UNITS))
    for drive, (once, doubt) in factors.items():
        factor = once * time_unit
        if not near(factor, (1.0,), max(doubt, table.NEAR_ONE)):
            unit = near(factor, (*known, *groups), doubt) or float(f'{factor:.4g}')
            groups.setdefault(unit, []).append(drive)
    for factor, group in groups.items():
        times = 'minus' if factor == -1.0 else f'{factor:.4g} times'
        yield OtherReading.of(
            'velocity', drives, group, f'the recorded velocity of {named(drives, tuple(group))} '
            f'is {times} the derivative of the position', scales=tuple(
                (drives[k], 'velocity_scale', model.recorded.columns_of(
                    drives[k]).velocity_scale / factor) for k in group))


def near(factor: float, units: Iterable[float], doubt: float = table.RATE_OFF) -> float:
    """Return the unit to which a factor of velocities is near; 0 for none."""
    return next((unit for unit in units if abs(factor / unit - 1) <= doubt), 0.0)


def find_motion(model: DriveModel, excerpt: Excerpt) -> Iterator[OtherReading]:
    """Yield efforts that are the recorded motion itself."""
    effort = excerpt.effort
    group = np.flatnonzero(np.any(np.nan_to_num(effort), axis=0)).tolist()
    for quantity in ('position', 'velocity', 'acceleration') if group else ():
        true = getattr(excerpt.motion, quantity)
        apart, size = (np.linalg.norm(np.nan_to_num(values)[:, group], axis=0)
                       for values in (effort - true, true))
        if np.all(apart < table.SAME_MOTION * size) and model.effort_kind not in KINDS:
            yield OtherReading.of(
                'effort_motion', model.drives, group,
                f'the effort of {named(model.drives, tuple(group))} is the recorded {quantity}, '
                'and must be a force or torque: name its column under columns. Or no effort was '
                'measured', f'{EFFORT_KIND}: {recorded_names.COMMANDED}')


def _time_scale(model: DriveModel, unit: float) -> Scale:
    """Return the key with which recorded times are in another unit [s]."""
    columns = model.recorded.columns
    if columns is not None and columns.rate is not None:
        return '', 'rate', float(f'{columns.rate / unit:.3g}')
    return '', 'time_scale', unit * ((columns and columns.time_scale) or 1.0)


def position_scales(model: DriveModel, part: Reading, whole: Reading) -> Scales:
    """Return the factors and offsets below `columns` that a part of a reading changes."""
    found: list[tuple[str, str, float]] = []
    for k in part.drives:
        before, factor = model.recorded.columns_of(model.drives[k]), float(whole.scale[k])
        if part.scale[k] != 1:
            found.append((model.drives[k], 'position_scale', factor * before.position_scale))
        if part.offset[k] or (part.scale[k] != 1 and before.position_offset):
            found.append((model.drives[k], 'position_offset',
                          factor * before.position_offset + float(whole.offset[k])))
    return tuple(found)


def _order_scales(model: DriveModel, recording: Recording, reading: Reading) -> Scales:
    """Return the columns with which drives are read in another order."""
    drives = model.drives
    known = ('position', 'effort', *(['velocity'] if recording.velocity is not None else []))
    names = {drive: model.recorded.columns_of(drive).names or {
        key: f'{joint}/{key}' for key in known}
        for drive, joint in zip(drives, model.recorded.joints, strict=True)}
    return tuple((drives[k], key, names[drives[order[k]]][key]) for keys, order in (
        (('position', 'velocity'), reading.positions), (('effort', 'current'), reading.efforts))
        for k in reading.drives if order[k] != k for key in keys if key in names[drives[order[k]]])


# ------------------------------------------------------------------ efforts and what they are


def find_sign_bit(recording: Recording) -> Iterator[OtherReading]:
    """Yield efforts that are magnitudes with a bit for their sign, as servos report loads."""
    efforts = {d: column[np.isfinite(column)] for d, column in enumerate(recording.effort.T)}
    counts = {d: effort for d, effort in efforts.items()
              if len(effort) > 1 and np.all(effort >= 0) and np.all(effort % 1 == 0)}
    for bit in table.SIGN_BITS:
        # Servos of one robot report alike: what one shows is true of all.
        group = [d for d, effort in counts.items() if effort.max() < 2.0 ** (bit + 1)]
        if any(_has_sign(counts[d], bit) for d in group):
            yield OtherReading.of(
                'effort_sign_bit', recording.drives, group,
                f'the effort of {named(recording.drives, tuple(group))} looks like a magnitude '
                f'whose sign is bit {bit} ({2 ** bit})',
                scales=tuple((recording.drives[d], 'effort_sign_bit', bit) for d in group))
            return


def _has_sign(effort: Array, bit: int) -> bool:
    """Return whether efforts hardly change where a bit does, if it is their sign."""
    above = effort >= 2.0 ** bit
    at = np.flatnonzero(np.diff(above))
    steps, raw = (np.abs(np.diff(values)[at]).sum() for values in (signed(effort, bit), effort))
    return bool(0.02 < np.mean(above) < 0.98 and steps < table.CALMER * raw)


# ------------------------------------------------------------------------------- measurements


def knows_forces(model: DriveModel, recording: Recording) -> bool:
    """Return whether efforts are forces: currents without a gain and shares are none."""
    are_currents = model.effort_kind == recorded_names.CURRENT or recording.gain is not None
    return (model.knows_currents or not are_currents) and not any(find_shares(model))


def find_amperes(model: DriveModel, factors: Array) -> OtherReading:
    """Return that efforts are currents, with the gain by the masses.

    Parameters
    ----------
    model : DriveModel
    factors : (D,) array
        Of the model's inertia and weight in the efforts; NaN where they do not show.
    """
    unseen = tuple(np.flatnonzero(np.isnan(factors)).tolist())
    gain = f'gain: {_numbers(1 / np.abs(np.where(np.isnan(factors), 1.0, factors)))}'
    return OtherReading.of(
        'drive_constant', model.drives, range(len(factors)), 'the efforts are currents, and what '
        f'an ampere gives is not known: by the masses {gain}' + (
            f', but they do not show that of {named(model.drives, unseen)}' if unseen else ''),
        f'under robot, {gain}')


def find_shares(model: DriveModel) -> Iterator[OtherReading]:
    """Yield efforts that are a share of an unknown torque or force."""
    columns = [model.recorded.columns_of(drive) for drive in model.drives]
    group = [d for d, of_drive in enumerate(columns) if is_share(of_drive)]
    if group:
        named_so = ', '.join(str(columns[d].names['effort']) for d in group)
        yield OtherReading.of(
            'effort_share', model.drives, group,
            f'{named_so}: a share of a torque or force that the file does not name',
            f'effort_scale: 0.01 times that (of per mille 0.001 times), as in columns: '
            f'{{{as_yaml(model.drives[group[0]])}: {{effort_scale: 0.3}}}}')


def find_no_measurements(model: DriveModel, recording: Recording, evidence: Evidence,
                         ) -> Iterator[NoMeasurement]:
    """Yield that efforts are no measurement, as the model file or their lack of noise says."""
    if model.effort_kind in KINDS:
        yield NoMeasurement.of(
            KINDS[model.effort_kind], model.drives, range(len(model.drives)),
            f'the efforts are {model.effort_kind}, as the model file says with {EFFORT_KIND}')
        return
    group = [d for d in range(len(model.drives)) if evidence.moves(model)[d]
             and evidence.count[d, d] >= table.LEAST_MEANS and fast_noise(recording, d) < (
                 table.LEAST_NOISE * np.sqrt(evidence.swing[d, d] / evidence.count[d, d]))]
    if group:
        yield NoMeasurement.of(
            table.NOISE_FREE, model.drives, group,
            f'the effort of {named(model.drives, tuple(group))} contains no noise: it looks '
            'computed, not measured')
