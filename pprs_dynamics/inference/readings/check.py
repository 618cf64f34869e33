# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a recording has the units, signs and order of drives that a model file says.

The recording is read in every way of `table.py`, and what is more likely than the plain reading
is reported with the line that says so. Nothing is ever changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import MisreadError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.efforts import (
    constants_reading,
    find_changed_efforts,
    find_no_measurements,
    find_scales,
    find_sign_bit,
    unit_reading,
)
from pprs_dynamics.inference.readings.evidence import (
    Parts,
    Shares,
    effort_contents,
    likelihood,
    parts_of,
    read_motion,
    rigid_factor,
)
from pprs_dynamics.inference.readings.findings import OtherReading, Scales, columns_line
from pprs_dynamics.inference.readings.table import Reading, named, plain, quarter_turn, readings
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.defects import SLOW_STEP
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import CURRENT
from pprs_dynamics.system.plain_yaml import scalar


@dataclass(frozen=True)
class Fit:
    """A reading with its score, the scale of each drive's efforts and the mean residual."""

    reading: Reading
    time_unit: float
    score: float
    scales: Array
    left: float

    @property
    def is_plain(self) -> bool:
        """Whether it is the reading by names and units."""
        return not self.reading.kind and self.time_unit == 1 and bool(np.all(self.scales == 1))

    @property
    def is_other_unit(self) -> bool:
        """Whether only efforts differ, those of all drives by one unit or by drive constants."""
        sizes = np.abs(self.scales)
        return not self.reading.kind and self.time_unit == 1 and (self.has_constants or bool(
            np.all(sizes == sizes[0]) and sizes[0] != 1))

    @property
    def has_constants(self) -> bool:
        """Whether efforts are multiplied by constants of the drives."""
        return not np.all(np.isin(self.scales, table.SCALES))


def with_mistakes(model: DriveModel, recording: Recording, refuse: bool = False) -> Recording:
    """Return a recording with its mistakes among its findings.

    Raises
    ------
    MisreadError
        With `refuse`, where its units, signs or order look otherwise than it says.
    """
    mistakes = find_mistakes(model, recording)
    others = [mistake for mistake in mistakes if isinstance(mistake, OtherReading)]
    if refuse and others:
        raise MisreadError(recording.name, [other.what for other in others], [
            columns_line(others, model.recorded.columns is not None),
            *(other.line for other in others)])
    return replace(recording, findings=(*mistakes, *recording.findings))


def find_mistakes(model: DriveModel, recording: Recording) -> tuple[Defect, ...]:
    """Return where a recording is read better otherwise than its names and units say.

    Parameters
    ----------
    model : DriveModel
    recording : Recording
        Of the model's drives.
    """
    if found := tuple(find_sign_bit(recording)):
        return found
    excerpts = {unit: excerpt for unit in (1.0, *_time_units(recording))
                if (excerpt := excerpt_of(recording, table.STRETCHES, unit)) is not None}
    if wrong := [*_of_rate(model, recording, excerpts.get(1.0))]:
        return tuple(wrong)
    search = Search(model, excerpts, bool(np.all(recording.position % 1 == 0)))
    best = search.best()
    rival = None if best is None else search.rival(best)
    if best is not None and best.is_other_unit and rival is None:
        best = None  # `find_scales` compares the factors themselves
    contents = effort_contents(model, recording, excerpts.get(1.0))
    has_columns = model.recorded.columns is not None
    mistakes: list[Defect] = [] if best is None else list(_of_fit(model, recording, best))
    if best is not None and rival is not None:
        both = [[*_of_fit(model, recording, fit)] for fit in (best, rival)]
        mistakes = [OtherReading.of(
            'ambiguous', model.drives, range(len(model.drives)), ', or '.join(
                ' and '.join(mistake.what for mistake in each) for each in both),
            ' or '.join(columns_line(each, has_columns) for each in both))]
    kinds = {mistake.kind for mistake in mistakes}
    if not mistakes:
        mistakes += find_scales(model, contents)
    if not kinds & {'position_unit', 'drive_order', 'ambiguous'}:
        # Angles that explain the efforts well are in the right unit, whatever limits say.
        mistakes += _of_strokes(model, recording, search.strokes,
                                search.plain_left > table.GOOD_FIT)
    if not kinds & {'position_unit', 'position_sign'}:
        mistakes += _of_velocities(model, recording, excerpts.get(
            1.0 if best is None else best.time_unit))
    for last in (find_changed_efforts(model, recording, excerpts.get(1.0)),
                 find_no_measurements(model, contents)):
        if not any(isinstance(mistake, OtherReading) for mistake in mistakes):
            mistakes += last
    return tuple(mistakes)


class Search:
    """The search for a reading that is more likely than the plain one.

    Parameters
    ----------
    model : DriveModel
    excerpts : dict of float to Excerpt
        Of the recording, by the unit of its times [s].
    are_counts : bool
        Whether all its positions are whole numbers.
    """

    def __init__(self, model: DriveModel, excerpts: dict[float, Excerpt],
                 are_counts: bool = False) -> None:
        self.model, self.excerpts, self.are_counts = model, excerpts, are_counts
        # Of currents without a known gain no force is known: masses say nothing.
        self.masses = np.inf if model.effort_kind == CURRENT and not model.knows_currents else (
            table.MASSES)
        self.plain_left = 1.0  # residual of the plain reading
        self.fits: list[Fit] = []
        self._parts: dict[tuple[float, bytes, bytes], Parts | None] = {}
        self.strokes = self._strokes()

    def _strokes(self) -> tuple[Array, Array]:
        """Return the ends of the strokes, infinite where a drive turns freely.

        Limits of a turn or more of a motor without weight are invented, as URDF asks for some.
        """
        lower, upper = self.model.limits.strokes
        excerpt = self.excerpts.get(1.0)
        parts = None if excerpt is None else parts_of(
            self.model, excerpt, plain(len(lower)), in_pieces=True)
        if parts is None:
            return lower, upper
        free = np.array([units.turns for units in self.model.units]) & (
            upper - lower >= 2 * np.pi) & (np.nanmax(np.abs(parts.gravity), axis=0) == 0)
        return np.where(free, -np.inf, lower), np.where(free, np.inf, upper)

    def best(self) -> Fit | None:
        """Return the best reading where it is more likely than the plain one."""
        drives = self.model.drives
        first = plain(len(drives))
        # What the mechanism cannot follow is as unlikely as an effort of which nothing is right.
        start = self.fit(first, 1.0, in_pieces=True) or Fit(
            first, 1.0, 0.0, np.ones(len(drives)), 1.0)
        self.plain_left = start.left
        if 1.0 in self.excerpts and start.left < 1.5 * table.CLOSEST and start.is_plain and not (
                self._outside(first, self.excerpts[1.0])):
            return None
        self.fits = [start]
        for reading in (first, *readings(drives, self.model.units, self.are_counts)):
            if reading.kind == 'drive_order' and self._top().left < table.CLOSE_FIT:
                break
            for unit in self.excerpts:
                fit = None if reading is first and unit == 1 else self.fit(reading, unit)
                # Symmetric robots fit nearly as well in another order of their drives.
                if fit is not None and (reading.kind != 'drive_order'
                                        or fit.left < table.BETTER_ORDER * start.left):
                    self.fits.append(fit)
        for seed in (start, self._top()):
            self.fits += self._turned(seed)
        best = self._top()
        is_sure = not best.is_plain and best.left <= table.GOOD_FIT and self._is_certain(best)
        return best if is_sure else None

    def _top(self) -> Fit:
        """Return the best reading; of those that fit alike the first, which is the simplest."""
        most = max(fit.score for fit in self.fits)
        return next(fit for fit in self.fits if fit.score > most - 0.5)

    def rival(self, best: Fit) -> Fit | None:
        """Return another reading of positions that is nearly as likely as the best one.

        Inertia alone cannot separate positions in another unit from efforts in another.
        """
        others = [fit for fit in self.fits if fit.reading.kind == 'position_unit'
                  and best.score - fit.score < table.SURE
                  and fit.time_unit == best.time_unit == 1
                  and best.reading.kind in ('', 'position_unit')
                  and not np.allclose(fit.reading.position, best.reading.position)]
        return max(others, key=lambda fit: fit.score, default=None)

    def _turned(self, seed: Fit) -> Iterator[Fit]:
        """Yield readings with zeros that are quarter turns off, one drive after another."""
        if seed.left < table.CLOSE_FIT or seed.reading.kind not in ('', 'position_unit'):
            return
        for _ in self.model.drives:
            fits = [fit for d, units in enumerate(self.model.units) if units.turns
                    for turn in table.QUARTERS
                    if (fit := self.fit(quarter_turn(self.model.drives, d, turn, seed.reading),
                                        seed.time_unit)) is not None]
            best = max(fits, key=lambda fit: fit.score, default=seed)
            if best.score <= seed.score:
                return
            seed = best
            yield seed

    def fit(self, reading: Reading, unit: float, in_pieces: bool = False) -> Fit | None:
        """Return a reading with its best scales of efforts; None where it cannot be."""
        excerpt = self.excerpts.get(unit)
        if excerpt is None or (reading.kind and not self._possible(reading, excerpt)):
            return None
        offset = np.asarray(reading.offset, float)
        key = unit, reading.position.tobytes(), offset.tobytes()
        if key not in self._parts:
            self._parts[key] = parts_of(self.model, excerpt, reading, in_pieces)
        parts = self._parts[key]
        if parts is None:
            return None
        effort, weights = reading.effort_of(excerpt.effort), self._weights(excerpt, parts)
        weights = np.abs(reading.effort) @ weights
        found = {(d, scale): one for d in np.flatnonzero(weights > 0).tolist()
                 for scale in table.SCALES if (one := likelihood(
                     effort[:, d], parts, d, scale, self.masses)) is not None}
        measured = sorted({d for d, _ in found})
        if not measured:
            return None
        cost = (reading.cost + (table.COST['time_unit'] if unit != 1 else 0.0)
                + self._outside(reading, excerpt))

        def fit_of(scales: Array) -> Fit:
            ones = [found[d, scales[d]] for d in measured]
            weight = weights[measured]
            return Fit(reading, unit, float(
                sum(w * one.score for w, one in zip(weight, ones, strict=True)))
                - cost - self._cost(scales, measured), scales,
                float(np.exp(np.average(np.log([one.left for one in ones]), weights=weight))))

        alone = np.ones(effort.shape[1])
        for d in measured:
            alone[d] = max(table.OF_ONE, key=lambda scale: found[d, scale].score
                           - _mistakes(scale) / weights[d])
        choices = [alone]
        # Inertia alone may be invented: units that are no prefixes need a weight.
        has_weight = bool(np.nanmax(np.abs(parts.gravity)) > 0)
        for scale in table.SCALES if has_weight else table.OF_ONE:
            common = np.ones(effort.shape[1])
            common[np.isfinite(effort).any(axis=0)] = scale
            choices.append(common)
        own = np.ones(effort.shape[1])
        for d in measured if has_weight else ():
            factor = rigid_factor(effort[:, d], parts, d)
            if factor and abs(np.log(abs(factor))) > np.log(table.SAME_MASSES) and (
                    one := likelihood(effort[:, d], parts, d, factor, self.masses)) is not None:
                own[d], found[d, factor] = factor, one
        if np.all(own[measured] != 1) and np.ptp(np.sign(own[measured])) == 0:
            choices.append(own)
        return max((fit_of(scales) for scales in choices), key=lambda one: one.score)

    def _cost(self, scales: Array, measured: list[int]) -> float:
        """Return the prior cost of scales: kinds of drives may share a mistake."""
        told = scales[measured]
        if not np.all(np.isin(told, table.SCALES)):
            return table.COST['drive_constant'] + (
                table.COST['effort_sign'] if told[0] < 0 else 0.0)
        if np.all(told == told[0]):
            return _mistakes(float(told[0]))
        kinds = [scales[[*family]] for family in table.families(self.model.drives)]
        return sum(_mistakes(float(kind[0])) if np.all(kind == kind[0])
                   else sum(map(_mistakes, kind.tolist())) for kind in kinds)

    def _weights(self, excerpt: Excerpt, parts: Parts) -> Array:
        """Return what each drive counts, (D,): the strongest 1, one at rest among others 0."""
        effort = np.sqrt(np.nanmean(np.nan_to_num(excerpt.effort) ** 2, axis=0))
        speed = np.sqrt(np.mean(parts.velocity ** 2, axis=0))
        moves = speed > self.model.reversal.velocity
        force = np.sqrt(np.nanmean((parts.inertia + parts.gravity + parts.others) ** 2, axis=0))
        sizes = np.maximum(effort / max(effort.max(), 1e-300), force / max(force.max(), 1e-300))
        found = np.where((sizes > table.WEAK) & (effort > 0), np.sqrt(sizes), 0.0)
        weights: Array = found * (moves if np.any(moves & (found > 0)) else 1.0)
        return weights

    def _is_certain(self, fit: Fit) -> bool:
        """Whether friction says the same as weight of efforts that are negated.

        Weight and inertia of a wrong model may be negative, friction may not.
        """
        if not np.any(fit.scales < 0):
            return True
        excerpt = self.excerpts[fit.time_unit]
        parts = parts_of(self.model, excerpt, fit.reading, in_pieces=False)
        if parts is None:
            return False
        effort, votes = fit.reading.effort_of(excerpt.effort), 0.0
        width = np.broadcast_to(self.model.reversal.velocity, fit.scales.shape)
        weights = self._weights(excerpt, parts)
        for d in np.flatnonzero(fit.scales < 0).tolist():
            known = np.isfinite(effort[:, d])
            if np.ptp(effort[known, d]) > 0 and root_mean_square(parts.velocity[:, d]) > width[d]:
                some = Shares.of(effort[known, d], parts.rows(known), d)
                if abs(some.friction) > table.CERTAIN * some.friction_by_chance:
                    votes += float(weights[d] * np.sign(some.friction))
        return votes <= 0

    def _possible(self, reading: Reading, excerpt: Excerpt) -> bool:
        """Return whether a reading brings positions into the strokes."""
        lower, upper = self.strokes
        with np.errstate(invalid='ignore'):
            slack = table.STROKE_SLACK * (upper - lower)
        position = excerpt.motion.position @ reading.position.T + reading.offset
        slack = np.where(np.isfinite(slack), slack, 0.0)
        return not np.any((position < lower - slack) | (position > upper + slack))

    def _outside(self, reading: Reading, excerpt: Excerpt) -> float:
        """Return the cost of positions and speeds that are beyond their limits."""
        lower, upper = self.strokes
        motion = read_motion(excerpt.motion, reading)
        reach = np.abs(motion.position).max(axis=0) / np.maximum(np.abs(lower), np.abs(upper))
        speed = np.abs(motion.velocity).max(axis=0) / np.where(
            np.isfinite(lower), self.model.speed_limits, np.inf)
        most = float(np.max(np.maximum(reach, speed)))
        return (table.FAR_OUTSIDE if most > table.FAR
                else table.OUTSIDE if most > table.BEYOND else 0.0)


def _mistakes(scale: float) -> float:
    return (table.COST['effort_sign'] if scale < 0 else 0.0) + (
        table.COST['effort_unit'] if abs(scale) != 1 else 0.0)


def _time_units(recording: Recording) -> list[float]:
    """Return units of time in which the steps would be those of a robot's recording [s]."""
    steps = np.concatenate([np.diff(recording.time[part]) for part in recording.segments]
                           or [np.zeros(0)])
    step = float(np.median(steps)) if len(steps) else 0.0
    return [unit for unit in table.TIMES
            if step > SLOW_STEP and table.SHORTEST <= step * unit <= SLOW_STEP]


# --------------------------------------------------------------------------------- sentences


def _of_fit(model: DriveModel, recording: Recording, fit: Fit) -> Iterator[OtherReading]:
    """Yield the mistakes of times, of positions and order, and of efforts."""
    drives = model.drives
    if fit.time_unit != 1.0:
        yield OtherReading('time_unit', 1, f'the times look like {table.TIMES[fit.time_unit]}: as '
                           f'seconds they make the motion {1 / fit.time_unit:.0f} times too slow '
                           'for its efforts', scales=(('', 'time_scale', fit.time_unit),))
    if fit.reading.kind == 'drive_order':
        scales, line = _order_scales(model, recording, fit.reading)
        yield OtherReading.of('drive_order', drives, fit.reading.drives, fit.reading.what, line,
                              scales=scales)
    elif fit.reading.kind:
        yield OtherReading.of(fit.reading.kind, drives, fit.reading.drives, fit.reading.what,
                              scales=position_scales(model, fit.reading))
    if fit.has_constants:
        yield constants_reading(model, dict(enumerate(fit.scales.tolist())))
        return
    for scale in dict.fromkeys(fit.scales[fit.scales != 1].tolist()):
        yield unit_reading(model, np.flatnonzero(fit.scales == scale).tolist(), scale)


def position_scales(model: DriveModel, reading: Reading) -> Scales:
    """Return the factors and offsets below `columns` with which positions are read so."""
    found = []
    offset = np.zeros(len(model.drives)) + reading.offset
    for k, drive in enumerate(model.drives):
        columns = model.recorded.columns
        before = None if columns is None else columns.drives[drive]
        scale, start = (1.0, 0.0) if before is None else (
            before.position_scale, before.position_offset)
        factor = float(reading.position[k, k])
        if k in reading.drives and factor not in (0.0, 1.0):
            found.append((drive, 'position_scale', factor * scale))
        if k in reading.drives and (total := factor * start + float(offset[k])) != start:
            found.append((drive, 'position_offset', total))
    return tuple(found)


def _order_scales(model: DriveModel, recording: Recording, reading: Reading) -> tuple[Scales, str]:
    """Return the columns with which drives are read in another order, or a line of joints."""
    drives, joints = model.drives, model.recorded.joints or model.drives
    moved = [(keys, matrix.argmax(axis=1)) for keys, matrix in (
        (('position', 'velocity'), reading.position), (('effort', 'current'), reading.effort))
        if np.any(matrix != np.eye(len(drives)))]
    columns = {} if model.recorded.columns is None else model.recorded.columns.drives
    names = {drive: columns[drive].names for drive in columns}
    if not any(names.values()):
        if len(moved) > 1:
            return (), 'joint_map: {' + ', '.join(
                f'{scalar(drives[k])}: {scalar(joints[moved[0][1][k]])}'
                for k in reading.drives) + '}'
        if ', ' in recording.source:  # of a topic: its columns cannot be named
            return (), ''
        known = ('position', 'effort', *(['velocity'] if recording.velocity is not None else []))
        names = {drive: {key: f'{joint}/{key}' for key in known}
                 for drive, joint in zip(drives, joints, strict=True)}
    return tuple((drives[k], key, names[drives[order[k]]][key]) for keys, order in moved
                 for k in reading.drives for key in keys if key in names[drives[order[k]]]), ''


def _of_strokes(model: DriveModel, recording: Recording, strokes: tuple[Array, Array],
                with_angles: bool) -> Iterator[Defect]:
    """Yield positions far beyond the strokes, which no effort is needed to recognise."""
    lower, upper = strokes
    drives, ends = recording.drives, np.maximum(-lower, upper)
    reach = np.abs(recording.position).max(axis=0)
    for turns, names in ((False, table.LENGTHS), (True, table.ANGLES)):
        alike = [k for k, units in enumerate(model.units) if units.turns == turns]
        far = tuple(k for k in alike if reach[k] > table.FAR * ends[k])
        if not far or (turns and not with_angles):
            continue
        # Encoders of a robot's turning joints count alike; its rails may not.
        group = tuple(alike) if turns else far
        unit = next((unit for unit in names if unit < 1 and np.all(
            reach[list(group)] * unit <= ends[list(group)])), 1.0)
        farthest = max(far, key=lambda k: reach[k] / ends[k])
        scale = Reading('position_unit', '', group, np.diag(
            [unit if k in group else 1.0 for k in range(len(drives))]), np.eye(len(drives)), 0.0)
        yield OtherReading.of(
            'position_unit', drives, group, f'the positions of {named(drives, group)} reach '
            f'{reach[farthest]:.4g} {model.units[farthest].position}, far out of the stroke'
            + (f', as if they were in {names[unit]}' if unit != 1.0 else ''),
            scales=() if unit == 1.0 else position_scales(model, scale))


def _factors(excerpt: Excerpt | None) -> dict[int, float]:
    """Return recorded velocities over the derivatives of positions, of drives where they agree."""
    found: dict[int, float] = {}
    if excerpt is None or excerpt.velocity is None:
        return found
    for drive in range(excerpt.velocity.shape[1]):
        known = np.isfinite(excerpt.velocity[:, drive])
        recorded, true = (values[known, drive] for values in (
            excerpt.velocity, excerpt.motion.velocity))
        size = float(true @ true) * float(recorded @ recorded)
        if size > 0 and abs(float(recorded @ true)) >= table.ALIKE * np.sqrt(size):
            found[drive] = float(recorded @ true) / float(true @ true)
    return found


def _of_rate(model: DriveModel, recording: Recording, excerpt: Excerpt | None) -> Iterator[Defect]:
    """Yield a rate of the model file that all recorded velocities contradict alike."""
    columns, factors = model.recorded.columns, np.array([*_factors(excerpt).values()])
    rate = None if columns is None else columns.rate
    factor = float(np.median(factors)) if len(factors) else 0.0
    if rate is None or factor <= 0 or np.any(np.abs(factors / factor - 1) > table.RATE_OFF) or any(
            abs(factor / unit - 1) < table.RATE_OFF for unit in (1.0, *table.VELOCITY_UNITS)):
        return
    true_rate = float(f'{rate * factor:.3g}')
    yield OtherReading('rate', len(recording.time), f'the recorded velocities are {factor:.4g} '
                       f'times the derivatives of the positions at {rate:g} samples per second, '
                       f'as if there were {true_rate:g}', scales=(('', 'rate', true_rate),))


def _of_velocities(model: DriveModel, recording: Recording, excerpt: Excerpt | None,
                   ) -> Iterator[Defect]:
    """Yield recorded velocities in other units or signs than positions."""
    columns, groups = model.recorded.columns, dict[float, list[int]]()
    for drive, factor in _factors(excerpt).items():
        for wrong in table.VELOCITY_UNITS:
            if abs(factor / wrong - 1) <= table.NEAR_ONE:
                groups.setdefault(wrong, []).append(drive)
    for factor, group in groups.items():
        times = 'minus' if factor == -1.0 else f'{factor:.4g} times'
        yield OtherReading.of(
            'velocity', recording.drives, group, 'the recorded velocity of '
            f'{named(recording.drives, tuple(group))} is {times} the derivative of the position',
            scales=tuple((drive, 'velocity_scale', (
                1.0 if columns is None else columns.drives[drive].velocity_scale) / factor)
                for drive in (recording.drives[k] for k in group)))
