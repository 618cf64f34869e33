# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Samples of a file before they are judged, and findings about them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import CHANNELS, Column, DriveUnits

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Progress = Callable[[int, int], None]

QUANTITIES = ('position', 'velocity', 'effort')
CURRENT = 'current'  # that a table may hold instead of an effort

# Stamps beyond this [s] count from an epoch: as floats they would lose more than 0.1 ns.
EPOCH_STAMP = 1e6
# A finding names at most this many places; its count is always complete.
MOST_SPANS = 100
# Beyond this, in SI units, nothing that a drive does or applies can lie: a mistake of a sensor or
# a file. Squares and sums of what is left are finite.
LARGEST_MEASURED = 1e12
# From this share of its limit on an effort is at the limit, noise of the sensor aside; a drive
# that goes beyond it by this factor is not held by that limit.
AT_LIMIT, BEYOND_LIMIT = 0.99, 1.05

# Everything that can be found, and what is done about it. Nothing else is ever changed.
POLICY = {
    'no_metadata': 'its only storage file is read',
    'ignored_columns': 'name those to use in columns of the model file',
    'ignored_joints': 'they are ignored',
    'incomplete_messages': 'those messages are ignored',
    'merged': 'samples are those of the first drive, the others lie between their neighbours',
    'commanded_efforts': 'they are used as efforts',
    'receive_times': 'the times at which the messages were recorded are used',
    'epoch_unit': 'they are read so',
    'gain_unused': 'they are taken as N m or N',
    'no_gain': 'they stay amperes',
    'non_finite_time': 'those samples are dropped',
    'non_finite_position': 'those samples are dropped',
    'clock_reset': 'the recording is split there',
    'unordered_stamps': 'they are sorted in',
    'duplicate_stamps': 'the first sample of each stamp is kept',
    'position_spike': 'those samples are dropped',
    'wrapped_position': 'it runs on there',
    'position_jump': 'the recording is split there',
    'gap': 'the recording is split there',
    'lost_samples': 'they stay within one segment, to be interpolated',
    'irregular_steps': 'the stamps are taken as true',
    'slow_rate': 'the stamps are taken as seconds',
    'impossible_position': 'those samples are dropped',
    'impossible_velocity': 'they count as not measured',
    'impossible_effort': 'they count as not measured',
    'held_position': 'each is used once',
    'held_poses': 'each counts by the mean of its effort; they show gravity and offsets',
    'held_effort': 'each is used once',
    'unmeasured_effort': 'it counts as not measured',
    'effort_zero': 'they count as not measured',
    'saturated_effort': 'they are left out of every comparison and fit',
    'mostly_saturated': 'too few efforts remain to judge this drive, and none of it is used',
    'no_effort': 'compare, diagnose, fit and adopt need them and will refuse it',
    'effort_not_measured': 'the motion is kept and these efforts count as not measured',
    'missing_velocity': 'they are computed from the positions',
    'constant_position': 'it is kept',
    'constant_velocity': 'it is kept',
    'constant_effort': 'it is kept',
    'frozen_samples': 'they are kept',
    'short_segment': 'those segments are not used',
    'too_short': 'it is kept',
    'too_long': 'the rest is left out of fits',
}


@dataclass(frozen=True)
class Defect:
    """Something about a recording that its user should know.

    Parameters
    ----------
    kind : str
        Kind of the defect, a key of `POLICY`.
    count : int
        Number of samples, places or columns that it concerns.
    what : str
        The defect, as a clause.
    spans : tuple of (start, end)
        The first 100 places, in the recording's time [s]; empty where it has no place.
    drives : tuple of str
        The drives concerned; empty where it concerns all.
    """

    kind: str
    count: int
    what: str
    spans: tuple[tuple[float, float], ...] = ()
    drives: tuple[str, ...] = ()

    @property
    def action(self) -> str:
        """Action that was taken, as a clause."""
        return POLICY[self.kind]

    @property
    def text(self) -> str:
        """The finding as one sentence."""
        return f'{self.what}; {self.action}'


@dataclass(frozen=True)
class Samples:
    """Joint states in the order of their file, with all its defects.

    Parameters
    ----------
    drives : tuple of str
        Names of the D drives.
    time : (N,) array
        [s], after `epoch`.
    position : (N, D) array
        [m].
    velocity : (N, D) array or None
        [m/s], NaN where there is none.
    effort : (N, D) array
        [N], NaN where there is none.
    epoch : int
        Whole seconds that `time` counts from.
    source : str
        Format and topic, for people.
    findings : tuple of Defect
        Remarks of the reader of the file.
    in_amperes : tuple of D bool
        Drives whose `effort` is a current [A]; () for none.
    units : tuple of D DriveUnits
        () where all drives push.
    effort_limits : tuple of D float
        Largest absolute efforts that the drives can apply; () where they are not known.
    channels : mapping of str to (N, D) array
        Of `CHANNELS` those that the file has, NaN where they were not measured: a thermometer is
        slower than an encoder, and not in every drive.
    """

    drives: tuple[str, ...]
    time: Array
    position: Array
    velocity: Array | None
    effort: Array
    epoch: int = 0
    source: str = ''
    findings: tuple[Defect, ...] = field(default=())
    in_amperes: tuple[bool, ...] = ()
    units: tuple[DriveUnits, ...] = ()
    effort_limits: tuple[float, ...] = ()
    channels: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of_columns(
        cls, drives: tuple[str, ...], time: Array, columns: Mapping[tuple[str, str], Array],
        source: str, findings: tuple[Defect, ...] = (), epoch: int = 0,
    ) -> Samples:
        """Return the samples of a table.

        Parameters
        ----------
        drives : tuple of D str
        time : (N,) array
            Stamps [s].
        columns : dict of (N,) arrays
            By drive and quantity: one of `QUANTITIES` or `CHANNELS`, or `CURRENT`.
        source, findings, epoch
            As of the class; `time` counts from the last.
        """
        none = np.full(len(time), np.nan)

        def of(quantity: str) -> Array:
            return np.column_stack([columns.get((drive, quantity), none) for drive in drives])

        whole, velocity = whole_epoch(time), of('velocity')
        in_amperes = tuple((drive, CURRENT) in columns for drive in drives)
        return cls(drives, time - whole, of('position'),
                   None if np.all(np.isnan(velocity)) else velocity,
                   np.where(in_amperes, of(CURRENT), of('effort')), epoch + whole, source, findings,
                   in_amperes, channels={name: of(name) for name in CHANNELS if any(
                       np.isfinite(columns.get((drive, name), none)).any() for drive in drives)})

    @property
    def measured(self) -> dict[str, Array]:
        """Return position, velocity where there is any, and effort by name, (N, D)."""
        return {name: values for name in QUANTITIES if (values := getattr(self, name)) is not None}

    def taken(self, index: Indices | Mask) -> Self:
        """Return the samples of an index or a mask."""
        arrays: Any = {name: values[index] for name, values in self.measured.items()}
        return replace(self, time=self.time[index], **arrays, channels={
            name: values[index] for name, values in self.channels.items()})

    def unit_of(self, drive: int, unit: str) -> str:
        """Return the unit of a drive's quantity; see `DriveUnits.of`."""
        return self.units[drive].of(unit) if self.units else unit


@dataclass(frozen=True)
class Series:
    """One column of a table, or one element of messages that are arrays.

    Parameters
    ----------
    column : str or int
        As a model file names it.
    title : str
        What it is called, for people; empty where it has no name.
    values : (n,) array
        Its first numbers.
    """

    column: Column
    title: str
    values: Array


def whole_epoch(seconds: Array) -> int:
    """Return the whole seconds that stamps, (N,) [s], are best counted from.

    0 for a clock that starts near 0. The median decides, so that single stamps of another clock
    (0 before it was set) do not.
    """
    finite = seconds[np.isfinite(seconds)]
    if not len(finite) or abs(middle := float(np.median(finite))) < EPOCH_STAMP:
        return 0
    near = finite[np.abs(finite - middle) < EPOCH_STAMP]
    # Stamps that lie farther from each other count in no seconds: they are told as they are.
    return int(np.floor(near.min())) if 2 * len(near) > len(finite) else 0


def when(spans: tuple[tuple[float, float], ...]) -> str:
    """Return 'at 1.5 s' or 'between 1.5 s and 2 s'."""
    first, last = min(span[0] for span in spans), max(span[1] for span in spans)
    if first == last:
        return f'at {first:.6g} s'
    return f'between {first:.6g} s and {last:.6g} s'
