# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A recording of the robot: what its drives did and what they needed, whatever file it is in."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array, as_numbers
from pprs_dynamics.drives import CHANNELS, DRIVES, RecordedDrives
from pprs_dynamics.errors import MotionError, UnreadableFileError
from pprs_dynamics.measurement.files.bag_files import read_bag, write_bag
from pprs_dynamics.measurement.files.bag_storage import is_bag
from pprs_dynamics.measurement.files.csv_files import write_csv
from pprs_dynamics.measurement.files.defects import Judgement
from pprs_dynamics.measurement.files.samples import Defect, Indices, Progress, Samples
from pprs_dynamics.measurement.files.table_files import read_table
from pprs_dynamics.system.files import readable
from pprs_dynamics.system.plain_text import counted, displayed

# Of files that are written, and looked for in folders.
ENDINGS = ('.csv', '.mcap', '.db3')
# Share of a turn that a step has at least where an angle begins again.
MOST_OF_TURN, TURN_ROUNDING = 0.75, 1e-3


@dataclass(frozen=True, kw_only=True)
class Recording(Samples):
    """Measured motion and effort of D drives: samples that were judged.

    Times, (N,), strictly increase within each segment, positions are finite, efforts are in N or
    N m, and `findings` has every defect, and what was done about it.

    Parameters
    ----------
    name : str
        For people: the file's name, as `displayed`.
    segments : tuple of slice
        Stretches to be treated each for itself. Samples outside of them are not to be used.
    gain : (D,) array or None
        By which recorded currents were multiplied [N m/A, N/A]; NaN for drives whose efforts were
        recorded, None where all were.
    are_poses : bool
        Whether each segment is a pose that is held.
    checked_for : object, optional
        The model for which its units, signs and order were checked: mistakes are in its findings.
    drives, time, position, velocity, effort, epoch, source, findings, units
    effort_limits, channels
        As of `Samples`.

    Raises
    ------
    MotionError
        For arrays whose shapes do not fit together.
    """

    name: str
    segments: tuple[slice, ...] = ()
    gain: Array | None = None
    are_poses: bool = False
    checked_for: object = None

    def __post_init__(self) -> None:
        if self.time.ndim != 1:
            raise MotionError('time', f'its shape is {self.time.shape}', 'be (N,)', 'shape')
        shape = (len(self.time), len(self.drives))
        for quantity, values in (*self.measured.items(), *self.channels.items()):
            if values.shape != shape:
                raise MotionError(quantity, f'its shape is {values.shape}', f'be {shape}', 'shape')

    @classmethod
    def from_arrays(
        cls, name: str, time: ArrayLike, position: ArrayLike, velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None, drives: tuple[str, ...] = DRIVES,
        channels: Mapping[str, ArrayLike] = MappingProxyType({}),
    ) -> Recording:
        """Return a recording of arrays, checked as the content of a file.

        Parameters
        ----------
        name : str
        time : (N,) array
            [s], or dates.
        position, velocity, effort : (N, D) arrays
            Copied; the last two may be absent, and what is missing may be NaN, None or NA.
        drives : tuple of D str
        channels : mapping of str to (N, D) array
            Of `CHANNELS`, by name.

        Raises
        ------
        MotionError
            For what are no numbers, arrays whose shapes do not fit together, or without a single
            finite sample.
        """
        given = {'time': time, 'position': position, 'velocity': velocity, 'effort': effort}
        numbers = {quantity: _numbers(quantity, values) for quantity, values in given.items()
                   if values is not None}
        beside = {name: _numbers(name, values) for name, values in channels.items()}
        time, position = numbers['time'], numbers['position']
        efforts = numbers.get('effort', np.full(position.shape, np.nan))
        velocities = numbers.get('velocity')
        # Checks the shapes before anything computes with them.
        cls(drives, time, position, velocities, efforts, name=name, channels=beside)
        recording = _judged(name, Samples(drives, time, position, velocities, efforts,
                                          channels=beside))
        if not len(recording.time):
            raise MotionError('position', 'no sample is finite', 'be finite', 'finite')
        return recording


@dataclass(frozen=True)
class DriveSummary:
    """Range of positions, speeds and efforts of one drive.

    Parameters
    ----------
    position : (lowest, highest)
        Range [m, rad].
    velocity, effort : (lowest, highest) or None
        Range as recorded [m/s, rad/s], [N, N m]; None where it was never measured.
    measured : float
        Share of the samples with an effort, 0 to 1.
    channels : mapping of str to (lowest, highest)
        Ranges of further quantities, by name.
    """

    position: tuple[float, float]
    velocity: tuple[float, float] | None
    effort: tuple[float, float] | None
    measured: float
    channels: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class SegmentSummary:
    """One segment: its times [s], samples, and rate [Hz] from the median step."""

    start: float
    end: float
    samples: int
    rate: float


@dataclass(frozen=True)
class Summary:
    """Summary of a recording.

    Parameters
    ----------
    name, source : str
        Name of the file, and its format.
    samples : int
        Samples without the discarded ones.
    used : int
        Samples in segments.
    epoch : int
        Unix time from which the other times are counted [s].
    start, end : float
        First and last time [s].
    duration : float
        Duration of all segments together [s].
    rate : float
        Samples per second in the segments, from the median step; NaN without segments.
    segments : tuple of SegmentSummary
        Parts without a gap.
    drives : dict of DriveSummary
        Range of each drive's quantities.
    findings : tuple of Defect
        What looks wrong.
    """

    name: str
    source: str
    samples: int
    used: int
    epoch: int
    start: float
    end: float
    duration: float
    rate: float
    segments: tuple[SegmentSummary, ...]
    drives: dict[str, DriveSummary]
    findings: tuple[Defect, ...]


def read_recording(
    path: str | PathLike[str], drives: Sequence[str] | RecordedDrives = DRIVES,
    topic: str | None = None, progress: Progress | None = None,
) -> Recording:
    """Read a rosbag2 directory, a bare .mcap or .db3 file, or a CSV: the content decides.

    Parameters
    ----------
    path : path
    drives : RecordedDrives or sequence of str
        Taken by name, in any order, among any others; `model.recorded` of a model, ('axis',) for
        a single axis.
    topic : str, optional
        Of sensor_msgs/JointState, or prefix of CSV columns; needed where there are several.
    progress : callable, optional
        Called with (done, total) now and then.

    Raises
    ------
    UnreadableFileError
        Where the file is missing, damaged, of another kind, or lacks a drive; and for currents
        without a gain.
    MissingLibraryError
        For a bag, where rosbags is not installed.
    """
    if not os.fspath(path):  # which would be the present folder
        raise UnreadableFileError("''", 'the name of a recording must not be empty')
    path = Path(path)
    if not isinstance(drives, RecordedDrives):
        drives = RecordedDrives(tuple(drives))
    with readable(path):
        read = (read_bag if is_bag(path) and not drives.layout.files else read_table)
        samples = read(path, drives, topic, progress)
    samples, applied = _as_efforts(path, _scaled(samples, drives), drives)
    recording = replace(_judged(displayed(path.name), replace(
        samples, units=drives.units, effort_limits=drives.effort_limits)),
        gain=applied, drives=drives.names)
    if not len(recording.time):
        raise UnreadableFileError(
            path, f'none of its {counted(len(samples.time), "sample")} has a finite time and '
            'finite positions of all drives')
    return recording


def _scaled(samples: Samples, drives: RecordedDrives) -> Samples:
    """Return samples in SI units, as the columns of a model file say."""
    of_drives = [drives.columns_of(drive) for drive in drives.names]
    velocity, effort = samples.velocity, samples.effort.copy()
    scale, offset, speed, force = np.array([
        (names.position_scale, names.position_offset, names.velocity_scale, names.effort_scale)
        for names in of_drives]).T
    for d, names in enumerate(of_drives):
        if names.effort_sign_bit is not None:
            effort[:, d] = signed(effort[:, d], names.effort_sign_bit)
    position, wraps = unwrapped(samples.position * scale, [
        2 * np.pi if units.turns else np.inf for units in drives.units] or [np.inf] * len(scale))
    wrapped = [drive for drive, count in zip(drives.names, wraps.tolist(), strict=True) if count]
    told = Defect('wrapped_position', int(wraps.sum()), 'the position jumps by a turn of '
                  + ', '.join(wrapped), drives=tuple(wrapped))
    return replace(
        samples, position=position + offset, findings=(*samples.findings, *[told][:len(wrapped)]),
        velocity=None if velocity is None else velocity * speed,
        effort=effort * force * drives.effort_factor,
        channels={name: values * scale + offset if CHANNELS[name] == 'm' else values
                  for name, values in samples.channels.items()})


def unwrapped(values: Array, periods: Sequence[float]) -> tuple[Array, Indices]:
    """Return angles, (N, D), that run on where they began again, and how often, (D,).

    Angles of which each lies within one period begin again where they jump by nearly all of it.
    """
    found, counts = values.copy(), np.zeros(len(periods), dtype=np.int64)
    for d, period in enumerate(periods):
        known = np.flatnonzero(np.isfinite(values[:, d]))
        angles = values[known, d]
        jumps = np.abs(np.diff(angles)) > MOST_OF_TURN * period
        if np.any(jumps) and np.ptp(angles) <= period * (1 + TURN_ROUNDING):
            found[known, d] = np.unwrap(angles, MOST_OF_TURN * period, period=period)
            counts[d] = jumps.sum()
    return found, counts


def signed(magnitude: Array, bit: int) -> Array:
    """Return numbers, (N,), whose sign is a bit above their magnitude."""
    size = 2.0 ** bit
    return np.where(magnitude >= size, size - magnitude, magnitude)


def _as_efforts(path: Path, samples: Samples, drives: RecordedDrives,
                ) -> tuple[Samples, Array | None]:
    """Return samples with currents times the gain, and the gain where it was applied."""
    gain = drives.gain
    currents = np.array(samples.in_amperes or [False] * len(samples.drives)) | drives.in_amperes
    names = ', '.join(np.array(samples.drives)[currents])
    is_known = gain is not None and any(factor != 1 for factor in gain)
    if not np.any(currents):
        unused = Defect('gain_unused', int(np.isfinite(samples.effort).sum()),
                        'the model has a gain, but these efforts are no columns of currents '
                        '(where they are currents write effort_unit: A)')
        told = (unused,) if is_known and unused.count else ()
        return replace(samples, findings=(*samples.findings, *told)), None
    if gain is None:
        raise UnreadableFileError(path, f'there are currents of {names}, but only the model of an '
                                  'arm has a gain, by which they become efforts')
    if not is_known:
        samples = replace(samples, findings=(*samples.findings, Defect(
            'no_gain', int(np.sum(currents)), f'the efforts of {names} are currents, and the gain '
            'of the model is 1 (write gain, the effort per ampere of each drive)',
            drives=tuple(np.array(drives.names)[currents].tolist()))))
    applied: Array = np.where(currents, np.asarray(gain), np.nan)
    efforts = np.where(currents, samples.effort * np.asarray(gain), samples.effort)
    return replace(samples, effort=efforts, in_amperes=()), applied


def write_recording(path: str | PathLike[str], recording: Recording) -> None:
    """Write a recording as .csv, bare .mcap, bare .db3, or, any other name, as a bag directory.

    CSV keeps every digit, but not `epoch`; bags keep stamps to 1 ns. Files are replaced,
    directories are not.

    Raises
    ------
    UnreadableFileError
        Where it cannot be written.
    MissingLibraryError
        For a bag, where rosbags is not installed.
    """
    path = Path(path)
    if path.suffix == '.csv':
        write_csv(path, recording)
    else:
        write_bag(path, {'/joint_states': recording})


def describe(recording: Recording) -> Summary:
    """Return a summary of a recording: rates, duration, ranges, findings."""
    time = recording.time
    parts = (slice(0, len(time)),) if recording.are_poses else recording.segments
    steps = [np.diff(time[part]) for part in parts]
    segments = tuple(
        SegmentSummary(float(time[part.start]), float(time[part.stop - 1]), len(own) + 1,
                       float(1 / np.median(own)))
        for part, own in zip(parts, steps, strict=True))
    ranges = {}
    for k, drive in enumerate(recording.drives):
        position, effort = _range(recording.position[:, k]), recording.effort[:, k]
        assert position is not None
        ranges[drive] = DriveSummary(
            position, None if recording.velocity is None else _range(recording.velocity[:, k]),
            _range(effort), float(np.mean(np.isfinite(effort))),
            {name: covered for name, values in recording.channels.items()
             if (covered := _range(values[:, k])) is not None})
    return Summary(
        recording.name, recording.source, len(time), sum(part.samples for part in segments),
        recording.epoch, float(time.min()), float(time.max()),
        sum(part.end - part.start for part in segments),
        float(1 / np.median(np.concatenate(steps))) if steps else float('nan'),
        segments, ranges, recording.findings)


def _numbers(quantity: str, values: ArrayLike) -> Array:
    """Return a caller's argument as an array, or raise MotionError naming the quantity."""
    try:
        return as_numbers(values)
    except (TypeError, ValueError) as error:
        raise MotionError(quantity, f'it contains what is no number ({error})', 'be numbers',
                          'shape') from None


def _judged(name: str, samples: Samples) -> Recording:
    judged = Judgement(samples)
    return Recording(**{**vars(judged.samples), 'findings': tuple(judged.findings)}, name=name,
                     segments=judged.segments, are_poses=judged.are_poses)


def _range(values: Array) -> tuple[float, float] | None:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else None
