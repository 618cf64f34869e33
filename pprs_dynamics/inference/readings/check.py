# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a recording has the units, signs and order of drives that a model file says.

The recording is read in the ways of `table.py`, and a way that is more likely than the plain
reading is reported with the line that says so. Nothing is ever changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveColumns, RecordedColumns
from pprs_dynamics.errors import MisreadError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.efforts import (
    find_no_measurements,
    find_sign_bit,
    find_unsigned,
)
from pprs_dynamics.inference.readings.evidence import (
    Evidence,
    Likelihood,
    Shares,
    effort_contents,
    read_motion,
)
from pprs_dynamics.inference.readings.findings import OtherReading, Scales, columns_line
from pprs_dynamics.inference.readings.table import Reading, named, plain, quarter_turn, readings
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.defects import SLOW_STEP
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import CURRENT
from pprs_dynamics.system.plain_yaml import scalar


@dataclass(frozen=True)
class Fit:
    """A reading with its score, the scale of each drive's efforts and its residuals.

    Parameters
    ----------
    reading : Reading
    time_unit : float
        [s].
    score : float
        [nats].
    scales : (D,) array
        Of the efforts, as multiples of those in SI units.
    what : str
        What the scales are, where they are of no single unit.
    left, most_left : float
        Mean residual and the largest of a drive, over the squared effort.
    prior : float
        Largest prior cost of a drive [nats].
    """

    reading: Reading
    time_unit: float
    score: float
    scales: Array
    what: str = ''
    left: float = 1.0
    most_left: float = 1.0
    prior: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether it is the reading by names and units."""
        return not self.reading.kind and self.time_unit == 1 and bool(np.all(self.scales == 1))


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
    excerpt = excerpts.get(1.0)
    if wrong := [*_of_rate(model, recording, excerpt)]:
        return tuple(wrong)
    search = Search(model, excerpts, bool(np.all(recording.position % 1 == 0)))
    best = search.best()
    likely = [] if best is None else [best, *search.rivals(best)]
    has_columns = model.recorded.columns is not None
    mistakes: list[Defect] = [] if best is None else list(_of_fit(model, recording, best))
    if len(likely) > 1:
        each_of = [[*_of_fit(model, recording, fit)] for fit in likely]
        mistakes = [OtherReading.of(
            'ambiguous', model.drives, range(len(model.drives)), ', or '.join(
                ' and '.join(mistake.what for mistake in each) for each in each_of),
            ' or '.join(filter(None, (line for each in each_of for line in (
                columns_line(each, has_columns), *(mistake.line for mistake in each))))))]
    kinds = {mistake.kind for mistake in mistakes}
    if not kinds & {'position_unit', 'drive_order', 'ambiguous'}:
        # Angles that explain the efforts well are in the right unit, whatever limits say.
        mistakes += _of_strokes(model, recording, search.strokes,
                                search.plain_left > table.GOOD_FIT)
    if not kinds & {'position_unit', 'position_sign'}:
        mistakes += _of_velocities(model, recording, excerpts.get(
            1.0 if best is None else best.time_unit))
    evidence = search.evidence(plain(len(model.drives)), 1.0)
    if evidence is None or excerpt is None or any(
            isinstance(mistake, OtherReading) for mistake in mistakes):
        return tuple(mistakes)
    mistakes += find_unsigned(model, recording, excerpt, evidence)
    if not mistakes:
        mistakes += find_no_measurements(model, effort_contents(model, recording, evidence))
    return tuple(mistakes)


def unlike_masses(model: DriveModel, recording: Recording) -> dict[str, float]:
    """Return the factors of drives whose efforts are certainly another multiple of the masses'."""
    excerpt = excerpt_of(recording, table.STRETCHES)
    evidence = None if excerpt is None else Evidence.of(model, excerpt, plain(len(model.drives)))
    factors = {} if evidence is None else {
        drive: evidence.factor(d, d) for d, drive in enumerate(model.drives)
        if evidence.is_measured(d, d)}
    return {drive: factor for drive, factor in factors.items()
            if abs(np.log(abs(factor))) > np.log(table.OTHER_UNIT)}


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
        # Of currents without a known gain no force is known: masses and units say nothing.
        self.has_gain = model.effort_kind != CURRENT or model.knows_currents
        self.masses = table.MASSES if self.has_gain else np.inf
        self.plain_left = 1.0  # residual of the plain reading
        self.fits: list[Fit] = []
        self._evidence: dict[tuple[float, bytes], Evidence | None] = {}
        self.strokes = self._strokes()

    def evidence(self, reading: Reading, unit: float) -> Evidence | None:
        """Return the evidence of a reading; the plain motion may be followed in pieces."""
        is_plain = not reading.kind and unit == 1
        key = unit, np.concatenate([reading.scale, reading.offset, reading.positions, (
            [] if reading.gravity is None else reading.gravity), [reading.load]]).tobytes()
        if key not in self._evidence:
            excerpt = self.excerpts.get(unit)
            self._evidence[key] = None if excerpt is None else Evidence.of(
                in_reading(self.model, reading), excerpt, reading, in_pieces=is_plain)
        return self._evidence[key]

    def _strokes(self) -> tuple[Array, Array]:
        """Return the ends of the strokes, infinite where a drive turns freely.

        Limits of a turn or more of a motor without weight are invented, as URDF asks for some.
        """
        lower, upper = self.model.limits.strokes
        evidence = self.evidence(plain(len(lower)), 1.0)
        if evidence is None:
            return lower, upper
        free = np.array([units.turns for units in self.model.units]) & (
            upper - lower >= 2 * np.pi) & (np.linalg.norm(evidence.roots[:, 0, :, 1], axis=1) == 0)
        return np.where(free, -np.inf, lower), np.where(free, np.inf, upper)

    def best(self) -> Fit | None:
        """Return the best reading where it is more likely than the plain one."""
        drives = self.model.drives
        first = plain(len(drives))
        # What the mechanism cannot follow is as unlikely as an effort of which nothing is right.
        start = self.fit(first, 1.0) or Fit(first, 1.0, 0.0, np.ones(len(drives)))
        self.plain_left, self.fits = start.left, [start]
        is_inside = 1.0 in self.excerpts and not self._outside(first, self.excerpts[1.0])
        # Without masses a gravity of any size may explain positions in another unit.
        explains = is_inside and start.is_plain and self.has_gain and (
            start.prior < table.PLAUSIBLE)
        if explains and start.most_left < table.CLOSE_FIT:
            return None
        if not (explains and start.most_left < table.EXPLAINED):
            self.fits += self._loaded(first, 1.0)
        for reading in readings(drives, self.model.units, self.are_counts):
            is_order = reading.kind == 'drive_order'
            if not is_order and explains and start.most_left < table.EXPLAINED:
                continue
            if is_order and self._top().left < table.CLOSE_FIT:
                break
            for unit in self.excerpts:
                fit = self.fit(reading, unit)
                # Symmetric robots fit nearly as well in another order of their drives.
                if fit is not None and (
                        not is_order or fit.left < table.BETTER_ORDER * start.left):
                    self.fits.append(fit)
        for unit in self.excerpts:
            if unit != 1 and (fit := self.fit(first, unit)) is not None:
                self.fits.append(fit)
        if not (explains and start.most_left < table.EXPLAINED):
            top = self._top()
            if top.reading.kind == 'position_unit':
                self.fits += self._loaded(top.reading, top.time_unit)
            for seed in (start, self._top()):
                self.fits += self._turned(seed)
        best = self._top()
        is_sure = not best.is_plain and best.left <= table.GOOD_FIT and self._is_certain(best)
        return best if is_sure else None

    def _loaded(self, reading: Reading, unit: float) -> list[Fit]:
        """Return a reading with loads at the tool, where these explain the efforts.

        A load may multiply the efforts of all drives, as another unit would.
        """
        model = self.model
        if PayloadMass.name in model.values.get('effects.active', ()) or (
                model.kind not in PayloadMass.acts_in):
            return []
        mass, most = model.robot.moved_mass, model.bound(PayloadMass).linear[0].upper
        return [fit for share in table.LOADS if share * mass < most and (fit := self.fit(
            replace(reading, load=share * mass, cost=reading.cost + table.COST['load']), unit))
            is not None and fit.most_left < table.GOOD_FIT]

    def _top(self) -> Fit:
        """Return the best reading; of those that fit alike the first, which is the simplest."""
        most = max(fit.score for fit in self.fits)
        return next(fit for fit in self.fits if fit.score > most - 0.5)

    def rivals(self, best: Fit) -> list[Fit]:
        """Return other readings that the recording cannot separate from the best one.

        Inertia alone cannot separate positions in another unit from efforts in another, and the
        weight of a plane arm cannot separate a zero from the mounting of the base.
        """
        found: dict[str, Fit] = {}
        for fit in sorted(self.fits, key=lambda fit: -fit.score):
            pair = {best.reading.kind, fit.reading.kind}
            same_motion = pair <= {'position_offset', 'mounting'} and len(pair) > 1
            other_unit = pair <= {'', 'position_unit'} and fit.reading.kind and not np.allclose(
                fit.reading.scale, best.reading.scale)
            if fit.time_unit == best.time_unit == 1 and (same_motion or other_unit) and (
                    best.score - fit.score < table.SURE):
                found.setdefault(fit.reading.kind, fit)
        return [*found.values()]

    def _turned(self, seed: Fit) -> Iterator[Fit]:
        """Yield readings with zeros that are quarter turns off, one drive after another."""
        if seed.left < table.CLOSE_FIT or seed.reading.kind not in ('', 'position_unit'):
            return
        drives = self.model.drives
        turning = [d for d, units in enumerate(self.model.units) if units.turns]
        for _ in drives:
            turned = [quarter_turn(drives, d, turn, seed.reading)
                      for d in turning for turn in table.QUARTERS]
            if len(turning) <= table.MOST_TURNED:  # two may be off together
                turned += [quarter_turn(drives, d, turn, one) for one in turned for d in turning
                           for turn in table.QUARTERS if d > max(one.drives, default=len(drives))]
            fits = [fit for reading in turned
                    if (fit := self.fit(reading, seed.time_unit, seed.score)) is not None]
            best = max(fits, key=lambda fit: fit.score, default=seed)
            if best.score <= seed.score:
                return
            seed = best
            yield seed

    def fit(self, reading: Reading, unit: float, least: float = -np.inf) -> Fit | None:
        """Return a reading with its best scales of efforts.

        None where it cannot be, or its score cannot reach the best one or `least`.
        """
        excerpt = self.excerpts.get(unit)
        if excerpt is None or (reading.kind and not self._possible(reading, excerpt)):
            return None
        evidence = self.evidence(reading, unit)
        # A mounting without weight explains none.
        if evidence is None or (reading.gravity is not None and not evidence.has_weight):
            return None
        weights = self._weights(excerpt, evidence)[reading.efforts]
        measured = [d for d in np.flatnonzero(weights > 0).tolist()
                    if evidence.is_measured(d, reading.efforts[d])]
        if not measured:
            return None
        cost = (reading.cost + (table.COST['time_unit'] if unit != 1 else 0.0)
                + self._outside(reading, excerpt))
        most = sum(weights[d] * evidence.most(d, reading.efforts[d]) for d in measured) - cost
        if most < max([least, *(fit.score for fit in self.fits)]) - table.SURE:
            return None
        known: dict[tuple[int, float], Likelihood] = {}

        def likelihood(d: int, scale: float) -> Likelihood:
            if (d, scale) not in known:
                known[d, scale] = evidence.likelihood(d, reading.efforts[d], scale, self.masses)
            return known[d, scale]

        def fit_of(scales: Array, price: float, what: str = '') -> Fit:
            found = [likelihood(d, float(scales[d])) for d in measured]
            weight = weights[measured]
            score = float(sum(w * each.score for w, each in zip(weight, found, strict=True)))
            return Fit(reading, unit, score - cost - price, scales, what, float(np.exp(np.average(
                np.log([each.left for each in found]), weights=weight))),
                max(each.left for each in found), max(each.prior for each in found))

        count = len(weights)
        fits = [fit_of(np.ones(count), 0.0)]
        if not reading.kind and fits[0].most_left < table.CLOSE_FIT and (
                fits[0].prior < table.PLAUSIBLE):
            return fits[0]
        alone, has_weight = np.ones(count), evidence.has_weight
        factors = self._factors(evidence, reading)

        def distance(scale: float, group: Sequence[int]) -> float:
            """Return by which logarithm factors of masses are off those of a unit."""
            off = np.abs(np.log(np.abs(factors[group] / scale)))
            return 0.0 if abs(scale) == 1 else float(np.max(
                off, initial=0.0, where=np.isfinite(off))) if np.isfinite(off).any() else np.inf

        units = table.SCALES if self.has_gain else (1.0, -1.0)
        same = float(np.log(table.SAME_MASSES))
        for d in measured:
            alone[d] = max((likelihood(d, scale).score - _mistakes(scale) / weights[d], scale)
                           for scale in units if scale in table.OF_ONE
                           and distance(scale, [d]) < same)[1]
        fits.append(fit_of(alone, self._cost(alone, measured)))
        # Inertia alone may be invented: units that are no prefixes need a weight.
        for scale in (scale for scale in units if has_weight or scale in table.OF_ONE):
            common = np.ones(count)
            common[np.isfinite(excerpt.effort[:, reading.efforts]).any(axis=0)] = scale
            if distance(scale, measured) < (table.NEAR_UNIT if abs(scale) == table.KGF_CM
                                            else same):
                fits.append(fit_of(common, _mistakes(scale)))
        if has_weight and self.has_gain:
            fits += [fit_of(scales, price, what) for scales, price, what in self._by_drive(
                factors, measured)]
        if reading.kind in ('position_offset', 'position_unit', 'mounting'):
            # Another direction of weight is credible only for efforts that show the weight.
            fits = [fit for fit in fits if min([
                likelihood(d, float(fit.scales[d])).prior for d in measured
                if d in reading.drives], default=0.0) <= table.PLAUSIBLE]
        return max(fits, key=lambda fit: fit.score, default=None)

    def _factors(self, evidence: Evidence, reading: Reading) -> Array:
        """Return the factor of weight and inertia in the efforts of each drive, (D,), or NaN."""
        return np.array([evidence.factor(d, column) if evidence.is_measured(d, column) else np.nan
                         for d, column in enumerate(reading.efforts.tolist())])

    def _by_drive(self, factors: Array, measured: Sequence[int],
                  ) -> Iterator[tuple[Array, float, str]]:
        """Yield scales that differ from drive to drive, their prior cost and what they are."""
        measured = [d for d in measured if np.isfinite(factors[d])]
        signs = np.sign(factors[measured])
        if not measured or np.ptp(signs) > 0:
            return
        price = table.COST['effort_sign'] if signs[0] < 0 else 0.0
        sizes, same = np.abs(factors[measured]), np.log(table.SAME_MASSES)
        limits = self.model.limits.efforts
        if len(measured) > 1 and np.all(np.isfinite(limits[measured])):
            for share, name in table.SHARES.items():
                scales = 1 / (share * limits)
                # Factors near 1 are errors of masses.
                if np.any(np.abs(np.log(scales[measured])) > same) and np.all(
                        np.abs(np.log(sizes / scales[measured])) < same):
                    yield signs[0] * scales, price + table.COST['effort_unit'] + 1.0, name
        # A load may multiply what one drive of several needs.
        if len(measured) >= min(2, len(factors)) and np.all(
                np.abs(np.log(sizes)) > same) and np.all(sizes > table.LARGEST_COMPLIANCE):
            yield (np.where(np.isin(np.arange(len(factors)), measured), factors, 1.0),
                   price + table.COST['drive_constant'], '')

    def _cost(self, scales: Array, measured: list[int]) -> float:
        """Return the prior cost of scales: kinds of drives may share a mistake."""
        if np.ptp(scales[measured]) == 0:
            return _mistakes(float(scales[measured[0]]))
        kinds = [scales[[*family]] for family in table.families(self.model.drives)]
        return sum(_mistakes(float(kind[0])) if np.all(kind == kind[0])
                   else sum(map(_mistakes, kind.tolist())) for kind in kinds)

    def _weights(self, excerpt: Excerpt, evidence: Evidence) -> Array:
        """Return what each drive counts, (D,): the strongest 1, one at rest among others 0."""
        effort = np.sqrt(np.nanmean(np.nan_to_num(excerpt.effort) ** 2, axis=0))
        moves = evidence.speed > self.model.reversal.velocity
        sizes = np.maximum(effort / max(effort.max(), 1e-300),
                           evidence.size / max(evidence.size.max(), 1e-300))
        found = np.where((sizes > table.WEAK) & (effort > 0), np.sqrt(sizes), 0.0)
        weights: Array = found * (moves if np.any(moves & (found > 0)) else 1.0)
        return weights

    def _is_certain(self, fit: Fit) -> bool:
        """Whether friction says the same as weight of efforts that are negated.

        Weight and inertia of a wrong model may be negative, friction may not.
        """
        evidence = self.evidence(fit.reading, fit.time_unit)
        if evidence is None or not np.any(fit.scales < 0):
            return evidence is not None
        weights, votes = self._weights(self.excerpts[fit.time_unit], evidence), 0.0
        width = np.broadcast_to(self.model.reversal.velocity, fit.scales.shape)
        for d in np.flatnonzero((fit.scales < 0) & (evidence.speed > width)).tolist():
            column = int(fit.reading.efforts[d])
            if evidence.is_measured(d, column):
                some = Shares.of(evidence, d, column)
                if some.has_friction:
                    votes += float(weights[d] * np.sign(some.friction))
        return votes <= 0

    def _possible(self, reading: Reading, excerpt: Excerpt) -> bool:
        """Return whether a reading brings positions into the strokes."""
        lower, upper = self.strokes
        with np.errstate(invalid='ignore'):
            slack = table.STROKE_SLACK * (upper - lower)
        position = read_motion(excerpt.motion, reading).position
        # Drives may report angles from 0 to a turn.
        turns = np.array([units.turns for units in self.model.units]) & np.isfinite(upper - lower)
        middle = np.mean(np.where(turns, (lower, upper), 0.0), axis=0)
        position = np.where(turns, position - 2 * np.pi * np.round(
            (position - middle) / (2 * np.pi)), position)
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
    drives, reading = model.drives, fit.reading
    if fit.time_unit != 1.0:
        yield OtherReading('time_unit', 1, f'the times look like {table.TIMES[fit.time_unit]}: as '
                           f'seconds they make the motion {1 / fit.time_unit:.0f} times too slow '
                           'for its efforts', scales=(('', 'time_scale', fit.time_unit),))
    if reading.kind == 'drive_order':
        scales, line = _order_scales(model, recording, reading)
        yield OtherReading.of('drive_order', drives, reading.drives, reading.what, line,
                              scales=scales)
    elif reading.gravity is not None:
        vector = ', '.join(f'{value:g}' for value in mounted_gravity(model, reading.gravity))
        key = 'under robot' if 'robot.gravity' in model.values else 'in the model file'
        yield OtherReading.of('mounting', drives, reading.drives, reading.what,
                              f'gravity: [{vector}] {key}')
    elif reading.kind:
        yield OtherReading.of(reading.kind, drives, reading.drives, reading.what,
                              scales=_position_scales(model, reading))
    if fit.what in table.SHARES.values():
        yield OtherReading.of(
            'effort_share', drives, range(len(drives)), f'the effort of '
            f"{named(drives, tuple(range(len(drives))))} looks like {fit.what} of the drives' "
            'largest', scales=_effort_scales(model, range(len(drives)), fit.scales))
    elif not np.all(np.isin(fit.scales, table.SCALES)):
        yield _constants(model, fit.scales)
    else:
        for scale in dict.fromkeys(fit.scales[fit.scales != 1].tolist()):
            yield _unit(model, np.flatnonzero(fit.scales == scale).tolist(), fit.scales)


def _constants(model: DriveModel, factors: Array) -> OtherReading:
    """Return the finding that efforts are multiples of the model's, by drive: currents."""
    every = tuple(range(len(model.drives)))
    listed = ', '.join(f'{factor:.3g} ({drive})' for drive, factor in zip(
        model.drives, factors, strict=True) if factor != 1)
    gains = ', '.join('1.0' if factor == 1 else f'{1 / factor:.3g}' for factor in factors)
    return OtherReading.of(
        'drive_constant', model.drives, every, f'the effort of {named(model.drives, every)} is '
        f'another multiple of what the masses need: {listed}: it looks like currents in amperes, '
        'percent of a torque, or another unit',
        f'effort_kind: current, and beside urdf or mjcf  gain: [{gains}]')


def _unit(model: DriveModel, group: Sequence[int], scales: Array) -> OtherReading:
    """Return the finding that efforts of some drives are the model's in another unit or sign."""
    drives, scale = model.drives, float(scales[group[0]])
    times = 'minus' if scale == -1.0 else f'{scale:.4g} times'
    what = f'the effort of {named(drives, tuple(group))} looks like {times} what the model says'
    if abs(scale) != 1:
        units = dict.fromkeys(table.EFFORTS[abs(scale)].format(model.units[k].effort)
                              for k in group)
        what += f', as if it were in {" or ".join(units)}'
    if scale < 0 and len(group) == len(drives):
        what += f' (or {"its position is" if len(drives) == 1 else "positions are"} negated)'
    return OtherReading.of('effort_sign' if abs(scale) == 1 else 'effort_unit', drives, group,
                           what, scales=_effort_scales(model, group, scales))


def _as_read(model: DriveModel, drive: str) -> DriveColumns:
    """Return the columns and scales with which a model file reads a drive."""
    return (model.recorded.columns or RecordedColumns()).drives.get(drive, DriveColumns())


def _effort_scales(model: DriveModel, group: Sequence[int], scales: Array) -> Scales:
    """Return the factors below `columns` by which efforts are divided by others, (D,)."""
    return tuple((model.drives[k], 'effort_scale', _as_read(
        model, model.drives[k]).effort_scale / float(scales[k])) for k in group)


def mounted_gravity(model: DriveModel, direction: Array) -> Array:
    """Return gravity as large as a model's in another direction of the base [m/s^2]."""
    given = model.values.get('robot.gravity', model.values.get('gravity'))
    return np.linalg.norm(given) * direction + 0.0


def in_reading(model: DriveModel, reading: Reading) -> DriveModel:
    """Return a model under the gravity, and with the load, of a reading."""
    changes: dict[str, Any] = {}
    if reading.gravity is not None:
        key = 'robot.gravity' if 'robot.gravity' in model.values else 'gravity'
        changes[key] = tuple(mounted_gravity(model, reading.gravity).tolist())
    if reading.load:
        changes['effects.active'] = [*model.values.get('effects.active', ()), PayloadMass.name]
        changes[f'effects.{PayloadMass.name}.mass'] = reading.load
    return DriveModel.from_parameters({**model.values, **changes}, model.source) if (
        changes) else model


def _position_scales(model: DriveModel, reading: Reading) -> Scales:
    """Return the factors and offsets below `columns` with which positions are read so."""
    found = []
    for k in reading.drives:
        drive, factor = model.drives[k], float(reading.scale[k])
        before = _as_read(model, drive)
        if factor != 1:
            found.append((drive, 'position_scale', factor * before.position_scale))
        total = factor * before.position_offset + float(reading.offset[k])
        if total != before.position_offset:
            found.append((drive, 'position_offset', total))
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
        scale = plain(len(drives)).changed('position_unit', '', group, 0.0, scale=np.array(
            [unit if k in group else 1.0 for k in range(len(drives))]))
        # Efforts that could not confirm it leave it a question.
        yield OtherReading.of(
            'stroke' if turns and np.isfinite(recording.effort).any() else 'position_unit',
            drives, group, f'the positions of {named(drives, group)} reach '
            f'{reach[farthest]:.4g} {model.units[farthest].position}, far out of the stroke'
            + (f', as if they were in {names[unit]}' if unit != 1.0 else ''),
            scales=() if unit == 1.0 else _position_scales(model, scale))


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
    """Yield a rate or a unit of times that all recorded velocities contradict alike."""
    columns, factors = model.recorded.columns, np.array([*_factors(excerpt).values()])
    factor = float(np.median(factors)) if len(factors) else 0.0
    if columns is None or factor <= 0 or np.any(np.abs(factors / factor - 1) > table.RATE_OFF):
        return
    turns = all(units.turns for units in model.units)
    times = [unit for each in table.TIMES for unit in (each, 1 / each)
             if abs(factor / unit - 1) < table.RATE_OFF and columns.rate is None and turns]
    for unit in times:  # no velocity of an angle is in thousandths
        yield OtherReading(
            'rate', len(recording.time), f'the recorded velocities are {unit:g} times the '
            'derivatives of the positions, as if the times were in another unit',
            scales=(('', 'time_scale', (columns.time_scale or 1.0) / unit),))
    if columns.rate is None or any(abs(factor / unit - 1) < table.RATE_OFF
                                   for unit in (1.0, *table.VELOCITY_UNITS)):
        return
    rate, true_rate = columns.rate, float(f'{columns.rate * factor:.3g}')
    yield OtherReading('rate', len(recording.time), f'the recorded velocities are {factor:.4g} '
                       f'times the derivatives of the positions at {rate:g} samples per second, '
                       f'as if there were {true_rate:g}', scales=(('', 'rate', true_rate),))


def _of_velocities(model: DriveModel, recording: Recording, excerpt: Excerpt | None,
                   ) -> Iterator[Defect]:
    """Yield recorded velocities in other units or signs than positions."""
    groups: dict[float, list[int]] = {}
    for drive, factor in _factors(excerpt).items():
        for wrong in table.VELOCITY_UNITS:
            if abs(factor / wrong - 1) <= table.NEAR_ONE:
                groups.setdefault(wrong, []).append(drive)
    for factor, group in groups.items():
        times = 'minus' if factor == -1.0 else f'{factor:.4g} times'
        yield OtherReading.of(
            'velocity', recording.drives, group, 'the recorded velocity of '
            f'{named(recording.drives, tuple(group))} is {times} the derivative of the position',
            scales=tuple((drive, 'velocity_scale', _as_read(model, drive).velocity_scale / factor)
                         for drive in (recording.drives[k] for k in group)))
