# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Check samples: every defect is reported and treated by the policy in `samples.POLICY`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.measurement.files import signals, stamps
from pprs_dynamics.measurement.files.poses import held_poses
from pprs_dynamics.measurement.files.samples import (
    AT_LIMIT,
    BEYOND_LIMIT,
    LARGEST_MEASURED,
    MOST_SPANS,
    Defect,
    Indices,
    Mask,
    Samples,
    when,
)
from pprs_dynamics.system.plain_text import counted

# What a differentiating filter needs at least; shorter segments are nothing but edges.
SHORTEST_SEGMENT = 20
# Below these a recording is told to be short: too few samples for statistics of a model's error.
FEW_SAMPLES = 100
SHORT_TIME = 1.0
# Share of a drive's efforts at a limit, from which on the others are not used either: they are
# chosen by their size, so that no fit to them is one of the drive.
MOSTLY_SATURATED = 0.9
# Median steps beyond this [s] cannot follow a robot.
SLOW_STEP = 0.1
UNITS = {'position': 'm', 'velocity': 'm/s', 'effort': 'N'}  # of drives that push


class Judgement:
    """Checks samples: drops some, splits the rest into segments, and lists all defects.

    Parameters
    ----------
    samples : Samples
        As read.

    Attributes
    ----------
    samples : Samples
        The remaining samples.
    segments : tuple of slice
        Stretches without reset, jump or gap, of at least 20 samples.
    are_poses : bool
        Whether each stretch is a pose that is held, of any length.
    findings : list of Defect
    """

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        self.findings = list(samples.findings)
        self.segments: tuple[slice, ...] = ()
        self.are_poses = False
        self._stretch: Indices = np.zeros(len(samples.time), dtype=np.int64)  # numbers of them
        self._drop_non_finite()
        if not len(self.samples.time):
            return
        self._order()
        poses = held_poses(*(getattr(self.samples, name) for name in (
            'position', 'time', 'velocity')))
        self.are_poses = len(poses) > 0
        if self.are_poses:
            self._split(poses[1:])
            self._tell('held_poses', len(poses), f'{len(poses)} poses are held, and no motion')
        else:
            self._keep(self._first_of_held('position', self.samples.position))
            self._judge_positions()
            self._judge_spacing()
        self._judge_efforts_and_velocities()
        self._judge_constant_values()
        self._cut_segments()

    def _tell(self, kind: str, count: int, what: str, places: Iterable[tuple[int, int]] = (),
              drives: Iterable[str] = ()) -> None:
        """Add a finding with places as (first, last) samples, if there are any."""
        if not count:
            return
        time = self.samples.time
        spans = tuple((float(time[first]), float(time[last])) for first, last in places)
        where = f' {when(spans)}' if spans else ''
        self.findings.append(Defect(kind, count, what + where, spans[:MOST_SPANS], tuple(drives)))

    def _tell_samples(self, kind: str, mask: Mask, what: str, drives: Iterable[str] = (),
                      noun: str = 'sample') -> None:
        """Add a finding about the samples of a mask, whose count begins the clause."""
        count = int(mask.sum())
        self._tell(kind, count, f'{counted(count, noun)} {what}',
                   stamps.runs(mask & np.isfinite(self.samples.time)), drives)

    def _tell_values(self, kind: str, mask: Mask, what: str) -> None:
        """Add a finding about the values of a mask (N, D); {} in the clause is for their drives."""
        drives = self._named(np.any(mask, axis=0))
        self._tell_samples(kind, np.any(mask, axis=1), what.format(', '.join(drives)), drives)

    def _keep(self, mask: Mask) -> None:
        """Drop the other samples."""
        if not np.all(mask):
            self.samples, self._stretch = self.samples.taken(mask), self._stretch[mask]

    def _split(self, firsts: Indices) -> None:
        """Let stretches begin at samples."""
        self._stretch += np.searchsorted(firsts, np.arange(len(self._stretch)), side='right')

    def _mark_impossible(self, quantity: str) -> Mask:
        """Replace damaged numbers by NaN, and return where: beyond all measurement, or far off."""
        samples, values = self.samples, self.samples.measured[quantity]
        bad = np.isfinite(values) & (np.abs(values) > LARGEST_MEASURED)
        rest = np.where(bad, np.nan, values)
        bad |= np.column_stack([signals.far_from_the_rest(column, SHORTEST_SEGMENT)
                                for column in rest.T])
        if np.any(bad):
            largest = float(np.abs(values[bad]).max())
            values[bad] = np.nan
            article = 'an' if quantity == 'effort' else 'a'
            unit = samples.unit_of(int(np.argmax(np.any(bad, axis=0))), UNITS[quantity])
            self._tell_values(f'impossible_{quantity}', bad, f'with {article} {quantity} of {{}} '
                              f'up to {largest:.3g} {unit}, far from all others,')
        return bad

    def _drop_non_finite(self) -> None:
        bad_time = ~np.isfinite(self.samples.time)
        self._tell_samples('non_finite_time', bad_time, 'without a finite time')
        self._keep(~bad_time)
        bad = ~np.isfinite(self.samples.position)
        self._tell_values('non_finite_position', bad, 'without a finite position of {}')
        bad |= self._mark_impossible('position')
        self._keep(~np.any(bad, axis=1))

    def _order(self) -> None:
        time = self.samples.time
        resets = stamps.clock_resets(time)
        if len(resets):
            first = int(resets[0])
            self._tell('clock_reset', len(resets),
                       f'the clock is set back {counted(len(resets), "time")}, first from '
                       f'{time[first - 1]:.6g} s to {time[first]:.6g} s,',
                       [(int(k), int(k)) for k in resets])
        self._split(resets)
        late = stamps.late_samples(time, self._stretch)
        self._tell_samples('unordered_stamps', late, 'out of order', noun='stamp')
        if np.any(late):
            self.samples = self.samples.taken(np.lexsort((time, self._stretch)))
        same = np.diff(self.samples.time, prepend=-np.inf) == 0
        self._tell_samples('duplicate_stamps', same, 'with the stamp of another')
        self._keep(~same)

    def _first_of_held(self, quantity: str, values: NDArray[np.float64]) -> Mask:
        """Return where values that a slower source wrote into a faster table are new."""
        count = signals.held_for(values)
        if count == 1:
            return np.ones(len(values), dtype=bool)
        rate = 1 / float(np.median(np.diff(self.samples.time)))
        first = signals.first_of_held(values, count)
        self._tell(f'held_{quantity}', int(np.sum(~first)),
                   f'the {quantity}s are held: {rate / count:.3g} new ones a second in '
                   f'{rate:.4g} samples a second')
        return first

    def _judge_positions(self) -> None:
        spikes, found = signals.find_jumps(self.samples)
        for drive, name in enumerate(self.samples.drives):
            jumps = [(first, size) for first, k, size in found if k == drive]
            size = max((size for _, size in jumps), key=abs, default=0.0)
            self._tell('position_jump', len(jumps),
                       f'the position of {name} jumps {counted(len(jumps), "time")}, by up to '
                       f'{size:.4g} {self.samples.unit_of(drive, "m")},',
                       [(first, first) for first, _ in jumps], [name])
        self._split(np.array([first for first, _, _ in found], dtype=np.int64))
        self._tell_values('position_spike', spikes, 'with a spike in the position of {}')
        self._keep(~np.any(spikes, axis=1))

    def _judge_spacing(self) -> None:
        time = self.samples.time
        gaps, losses, counts = zip(*(stamps.gaps(time, part) for part in stamps.stretches(
            self._stretch)), strict=True)
        gap, lost, lost_count = np.concatenate(gaps), np.concatenate(losses), sum(counts)
        missing = sum(time[gap] - time[gap - 1])
        self._tell('gap', len(gap), f'{counted(len(gap), "gap")} of {missing:.4g} s in all',
                   [(k - 1, k) for k in gap])
        self._tell('lost_samples', lost_count, f'{counted(lost_count, "sample")} lost',
                   [(k - 1, k) for k in lost])
        self._split(gap)
        self._judge_regularity()

    def _judge_regularity(self) -> None:
        time = self.samples.time
        spreads = [((part.start, part.stop - 1), *np.quantile(
            np.diff(time[part]), (0.05, 0.5, 0.95)).tolist())
                   for part in stamps.stretches(self._stretch)
                   if part.stop - part.start >= SHORTEST_SEGMENT]
        irregular = [(place, low, high) for place, low, step, high in spreads
                     if high - low > stamps.IRREGULAR_SPREAD * step]
        if irregular:
            low, high = min(low for _, low, _ in irregular), max(high for _, _, high in irregular)
            self._tell('irregular_steps', len(irregular),
                       f'steps between stamps vary from {1e3 * low:.3g} to {1e3 * high:.3g} ms',
                       [place for place, _, _ in irregular])
        slow = [(place, step) for place, _, step, _ in spreads if step > SLOW_STEP]
        if slow:
            self._tell('slow_rate', len(slow),
                       f'there is only one sample in {max(step for _, step in slow):.4g} s',
                       [place for place, _ in slow])

    def _judge_efforts_and_velocities(self) -> None:
        effort = self.samples.effort
        effort[np.isinf(effort)] = np.nan
        if np.isnan(effort).all():
            self._tell('no_effort', len(effort), 'there is no effort of any drive')
        else:
            self._tell_missing('effort_not_measured', effort, 'effort')
            self._mark_impossible('effort')
            self._leave_out_unmeasured()
            effort[~self._first_of_held('effort', effort)] = np.nan
            self._leave_out_zeros()
            self._leave_out_saturated()
        velocity = self.samples.velocity
        if velocity is None:
            self._tell('missing_velocity', len(effort), 'no velocities are recorded')
            return
        velocity[np.isinf(velocity)] = np.nan
        self._tell_missing('missing_velocity', velocity, 'velocity')
        self._mark_impossible('velocity')

    def _leave_out_unmeasured(self) -> None:
        """Take out efforts that are 0 throughout a motion: no sensor measures them."""
        position, effort = self.samples.position, self.samples.effort
        for drive, name in enumerate(self.samples.drives):
            if signals.is_constant(effort[:, drive]) and not np.nanmax(
                    np.abs(effort[:, drive])) and not signals.is_constant(position[:, drive]):
                self._tell('unmeasured_effort', 1,
                           f'the effort of {name} is 0 throughout, while it moves', drives=[name])
                effort[:, drive] = np.nan

    def _leave_out_zeros(self) -> None:
        """Take out single zeros amid other efforts: an answer that did not come."""
        effort, samples = self.samples.effort, self.samples
        zeros, usual = zip(*(signals.lost_to_zero(effort[:, drive])
                             for drive in range(len(samples.drives))), strict=True)
        lost = np.column_stack(zeros)
        # What is 0 at the same moment was lost with it.
        lost |= np.any(lost, axis=1)[:, None] & (np.abs(effort) <= np.array(usual))
        self._tell_values('effort_zero', lost, 'in which the effort of {} is 0 and far from it '
                          'before and after')
        effort[lost] = np.nan

    def _leave_out_saturated(self) -> None:
        """Take out efforts at a limit, which say only that they are there."""
        effort, samples = self.samples.effort, self.samples
        limits = samples.effort_limits or (np.inf,) * len(samples.drives)
        for drive, (limit, name) in enumerate(zip(limits, samples.drives, strict=True)):
            size = np.abs(effort[:, drive])
            largest = np.nanmax(size, initial=0.0)
            at_limit = size >= (AT_LIMIT * limit if largest <= BEYOND_LIMIT * limit else np.inf)
            if not np.any(at_limit):
                at_limit = signals.cut_off(effort[:, drive], samples.position[:, drive])
            if not np.any(at_limit):
                continue
            levels = sorted({f'{value:.4g}' for value in size[at_limit]}, key=float)
            level = f'its limit of {limit:.6g}' if largest >= AT_LIMIT * limit else (
                ' and '.join(levels))
            share = at_limit.sum() / np.isfinite(effort[:, drive]).sum()
            is_lost = share > MOSTLY_SATURATED
            self._tell('mostly_saturated' if is_lost else 'saturated_effort', int(at_limit.sum()),
                       f'the effort of {name} is cut off at {level} '
                       f'{samples.unit_of(drive, "N")} in {100 * share:.3g} % of the samples',
                       stamps.runs(at_limit), [name])
            effort[at_limit | is_lost, drive] = np.nan

    def _tell_missing(self, kind: str, values: NDArray[np.float64], quantity: str) -> None:
        missing = np.isnan(values)
        counts = missing.sum(axis=0)
        drives = self._named(counts > 0)
        share = [f'{name} ({100 * count / len(values):.3g} % of the samples)'
                 for name, count in zip(self.samples.drives, counts, strict=True) if count]
        self._tell(kind, int(counts.sum()), f'no {quantity} of {", ".join(share)}',
                   stamps.runs(np.any(missing, axis=1)), drives)

    def _judge_constant_values(self) -> None:
        samples = self.samples
        runs = signals.frozen_runs(samples)
        count = sum(last - first for first, last in runs)
        self._tell('frozen_samples', count,
                   f'{counted(count, "sample")} repeating every value of the one before', runs)
        for drive, name in enumerate(samples.drives):
            moves = not signals.is_constant(samples.position[:, drive])
            for quantity, values in samples.measured.items():
                known = values[np.isfinite(values[:, drive]), drive]
                if signals.is_constant(known) and (moves or quantity != 'velocity'):
                    self._tell(f'constant_{quantity}', 1,
                               f'the {quantity} of {name} is {known[0]:.6g} '
                               f'{samples.unit_of(drive, UNITS[quantity])} throughout'
                               + (', while it moves' if quantity == 'velocity' else ''),
                               drives=[name])
            if not signals.is_constant(samples.effort[:, drive]):
                runs = signals.stuck_efforts(samples, drive)
                self._tell('constant_effort', len(runs),
                           f'the effort of {name} does not change while it moves', runs, [name])

    def _cut_segments(self) -> None:
        time = self.samples.time
        parts = stamps.stretches(self._stretch)
        if self.are_poses:
            self.segments = tuple(parts)
            return
        short = [part for part in parts if part.stop - part.start < SHORTEST_SEGMENT]
        self.segments = tuple(part for part in parts if part.stop - part.start >= SHORTEST_SEGMENT)
        count = sum(part.stop - part.start for part in short)
        self._tell('short_segment', len(short),
                   f'{counted(len(short), "segment")} of fewer than {SHORTEST_SEGMENT} samples, '
                   f'{counted(count, "sample")} in all,',
                   [(part.start, part.stop - 1) for part in short])
        used = sum(part.stop - part.start for part in self.segments)
        duration = float(sum(time[part.stop - 1] - time[part.start] for part in self.segments))
        if used < FEW_SAMPLES or duration < SHORT_TIME:
            self._tell('too_short', 1, f'the usable segments have only {counted(used, "sample")} '
                                       f'in {duration:.3g} s')

    def _named(self, mask: Mask) -> list[str]:
        return [name for name, true in zip(self.samples.drives, mask, strict=True) if true]
