# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a recording has the units, signs and order of drives that a model file says.

Every reading of `table.py` is compared with the one that the model file says. A likelier reading
is reported with the line that says so. Nothing is ever changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pprs_dynamics.arrays import Array
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
    in_reading,
    read_motion,
)
from pprs_dynamics.inference.readings.findings import (
    OtherReading,
    columns_line,
    find_other_velocities,
    findings_of,
    position_scales,
    velocity_factors,
)
from pprs_dynamics.inference.readings.table import Reading, named, readings
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.defects import SLOW_STEP
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Defect, Indices, Mask
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import CURRENT

PLAIN = 'all is as the model file says'


@dataclass(frozen=True)
class Fit:
    """A reading with its score and residuals.

    Parameters
    ----------
    reading : Reading
    score : float
        [nats].
    left, most_left : float
        Mean residual and the largest of a drive, over the squared effort.
    prior : float
        Largest prior cost of a drive [nats].
    least_left : float
        Smallest residual of a drive.
    is_rigid : bool
        Whether each effort certainly has inertia or weight in it.
    """

    reading: Reading
    score: float = 0.0
    left: float = 1.0
    most_left: float = 1.0
    prior: float = 0.0
    least_left: float = 1.0
    is_rigid: bool = False


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
    """Return the mistakes of a recording's names, units and signs, as findings.

    Parameters
    ----------
    model : DriveModel
    recording : Recording
        Of the model's drives.
    """
    if found := tuple(find_sign_bit(recording)):
        return found
    search = Search(model, recording)
    if wrong := [each for each in find_other_velocities(model, search.excerpts.get(1.0))
                 if each.kind == 'rate']:
        return tuple(wrong)
    likely = search.likely()
    each_of = [findings_of(model, recording, fit.reading) for fit in likely]
    mistakes: list[Defect] = [*each_of[0]] if likely else []
    if len(likely) > 1:
        has_columns = model.recorded.columns is not None
        kinds = {mistake.kind for each in each_of for mistake in each}
        kind = 'drive_order' if kinds == {'drive_order'} else 'ambiguous'
        mistakes = [OtherReading.of(
            kind, model.drives, range(len(model.drives)), ', or '.join(
                ' and '.join(mistake.what for mistake in each) or PLAIN for each in each_of),
            ' or '.join(filter(None, (line for each in each_of for line in (
                columns_line(each, has_columns), *(mistake.line for mistake in each))))))]
    kinds = {mistake.kind for mistake in mistakes}
    if not kinds & {'position_unit', 'drive_order', 'ambiguous'}:
        mistakes += search.far_outside(recording)
    if not kinds & {'position_unit', 'position_sign'}:
        mistakes += find_other_velocities(model, search.excerpts.get(
            likely[0].reading.time_unit if likely else 1.0))
    evidence, excerpt = search.evidence(search.rows[0]), search.excerpts.get(1.0)
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
    evidence = None if excerpt is None else Evidence.of(model, excerpt)
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
    recording : Recording
    efforts : (N, E) array, optional
        Of all columns that may be efforts, in place of those of the recording.
    """

    def __init__(self, model: DriveModel, recording: Recording, efforts: Array | None = None,
                 ) -> None:
        self.model = model
        times = _time_units(recording)
        self.excerpts = {
            unit: excerpt for unit in (1.0, *times) if (excerpt := excerpt_of(
                recording, table.STRETCHES, unit, efforts)) is not None}
        turning = [units.turns for units in model.units]
        self.rows = readings(model.drives, model.units, self._loads(), times,
                             bool(np.all(recording.position[:, turning] % 1 == 0)))
        # Amperes are more likely where no name says that it is an effort.
        names = [] if model.recorded.columns is None else [
            drive.names.get('effort') for drive in model.recorded.columns.drives.values()]
        self.price_of_constants = table.COST['drive_constant'] - table.UNNAMED * (
            efforts is not None or any(isinstance(name, int) for name in names))
        # Of currents without a known gain no force is known: masses and units say nothing.
        self.has_gain = model.effort_kind != CURRENT or model.knows_currents
        self.masses = table.MASSES if self.has_gain else np.inf
        # Recorded velocities over the derivatives of positions.
        self.factors = velocity_factors(self.excerpts[1.0]) if 1.0 in self.excerpts else {}
        self.start = Fit(self.rows[0])
        self.fits: list[Fit] = []
        self._evidence: dict[bytes, Evidence | None] = {}
        self.strokes = self._strokes()

    def _loads(self) -> list[float]:
        """Return loads at the tool that the model may lack [kg].

        A load may multiply the efforts of all drives, as another unit would.
        """
        model = self.model
        if PayloadMass.name in model.values.get('effects.active', ()) or (
                model.kind not in PayloadMass.acts_in):
            return []
        most = model.bound(PayloadMass).linear[0].upper
        return [load for share in table.LOADS if (load := share * model.robot.moved_mass) < most]

    def evidence(self, reading: Reading) -> Evidence | None:
        """Return the evidence of a reading; the plain motion may be followed in pieces."""
        key = reading.of_motion
        if key not in self._evidence:
            excerpt = self.excerpts.get(reading.time_unit)
            self._evidence[key] = None if excerpt is None else Evidence.of(
                in_reading(self.model, reading), excerpt,
                None if key == self.rows[0].of_motion else reading)
        return self._evidence[key]

    def _strokes(self) -> tuple[Array, Array]:
        """Return the ends of the strokes, infinite where a drive turns freely.

        Limits of a turn or more of a motor without weight are invented, as URDF asks for some.
        """
        lower, upper = self.model.limits.strokes
        evidence = self.evidence(self.rows[0])
        if evidence is None:
            return lower, upper
        free = np.array([units.turns for units in self.model.units]) & (
            upper - lower >= 2 * np.pi) & (np.linalg.norm(evidence.roots[:, 0, :, 1], axis=1) == 0)
        return np.where(free, -np.inf, lower), np.where(free, np.inf, upper)

    def best(self, efforts: Indices | None = None) -> Fit:
        """Return the most likely reading; mistakes are added to it until none makes it likelier.

        Parameters
        ----------
        efforts : (D,) int array, optional
            Columns of the drives' efforts.
        """
        first = self.rows[0] if efforts is None else replace(self.rows[0], efforts=efforts)
        # What the mechanism cannot follow is as unlikely as an effort of which nothing is right.
        self.start = start = self.fit(first) or Fit(first)
        self.fits = [start]
        is_inside = 1.0 in self.excerpts and not self._outside(first, self.excerpts[1.0])
        # Without masses a gravity of any size may explain positions in another unit.
        explains = is_inside and start.reading.is_plain and self.has_gain and (
            start.prior < table.PLAUSIBLE)
        if explains and start.most_left < table.CLOSE_FIT:
            return start
        is_explained = explains and start.most_left < table.EXPLAINED
        seed = None
        while self._top() is not seed:
            seed = self._top()
            self.fits += [fit for row in self.rows[1:]
                          if (row.kind == 'drive_order' or not is_explained)
                          and self._may_follow(row, seed.reading)
                          and (fit := self.fit(row.after(seed.reading))) is not None
                          and self._is_credible(row, fit)]
        return self._top()

    def likely(self) -> list[Fit]:
        """Return the best reading where it is more likely than the plain one, and its rivals."""
        best = self.best()
        is_sure = not best.reading.is_plain and best.left <= table.GOOD_FIT and (
            self._is_certain(best))
        # The inertia of a drive without weight may be invented, a unit of its efforts not.
        evidence, scales = self.evidence(best.reading), best.reading.effort_scale
        is_sure &= evidence is not None and (evidence.has_weight or bool(
            np.all(np.isin(scales, table.SCALES))))
        return [best, *self._rivals(best)] if is_sure else []

    def _may_follow(self, row: Reading, before: Reading) -> bool:
        """Return whether a row may be added to a reading."""
        if row.kind in ('position_offset', 'drive_order') and (
                self._top().most_left < table.CLOSE_FIT):
            return False
        if 'drive_order' in {row.kind, *before.kinds}:
            return not before.kinds
        return all(row.kind != part.kind or (row.kind == 'position_offset' and not (
            {*row.drives} & {*part.drives})) for part in before.parts)

    def _is_credible(self, row: Reading, fit: Fit) -> bool:
        if row.kind == 'load':
            return fit.most_left < table.GOOD_FIT and fit.prior < table.PLAUSIBLE
        # Symmetric robots fit nearly as well in another order of their drives.
        return row.kind != 'drive_order' or fit.left < table.BETTER_ORDER * self.start.left

    def _top(self) -> Fit:
        """Return the best reading; of those that fit alike the first, which is the simplest."""
        most = max(fit.score for fit in self.fits)
        return next(fit for fit in self.fits if fit.score > most - 0.5)

    def _rivals(self, best: Fit) -> list[Fit]:
        """Return the next reading, if the recording cannot separate it from the best one.

        Inertia alone cannot separate positions in another unit from efforts in another, and the
        weight of a plane arm cannot separate a zero from the mounting of the base.
        """
        def written(reading: Reading) -> bytes:
            """Return what a line would change but signs, whose convention a sentence mentions."""
            scales = np.abs(reading.effort_scale)
            positive = replace(reading, load=0.0, scale=np.abs(reading.scale),
                               offset=reading.offset * np.sign(reading.scale) + 0.0)
            return positive.of_motion + reading.efforts.tobytes() + (
                scales.tobytes() if np.all(np.isin(scales, table.SCALES)) else b'constants')

        seen, found = {written(best.reading)}, []
        for fit in sorted(self.fits, key=lambda fit: -fit.score):
            if best.score - fit.score < table.SURE and written(fit.reading) not in seen:
                seen.add(written(fit.reading))
                found.append(fit)
        return found[:1]

    def fit(self, reading: Reading) -> Fit | None:
        """Return a reading with its best scales of efforts.

        None where it cannot be.
        """
        excerpt = self.excerpts.get(reading.time_unit)
        if excerpt is None or (reading.kinds and not self._possible(reading, excerpt)):
            return None
        evidence = self.evidence(reading)
        # A mounting without weight explains none.
        if evidence is None or (reading.gravity is not None and not evidence.has_weight):
            return None
        weights = self._weights(reading, excerpt, evidence)
        measured = [d for d in np.flatnonzero(weights > 0).tolist()
                    if evidence.is_measured(d, reading.efforts[d])]
        if not measured:
            return None
        weight, cost = weights[measured], (
            reading.cost + self._outside(reading, excerpt) + self._against_velocities(reading))

        @cache
        def likelihood(d: int, scale: float) -> Likelihood:
            return evidence.likelihood(d, reading.efforts[d], scale, self.masses)

        def fit_of(scales: Array, price: float, share: str = '') -> Fit:
            found = [likelihood(d, float(scales[d])) for d in measured]
            score = float(sum(w * each.score for w, each in zip(weight, found, strict=True)))
            return Fit(replace(reading, effort_scale=scales, share=share), score - cost - price,
                       float(np.exp(np.average(np.log([each.left for each in found]),
                                               weights=weight))),
                       max(each.left for each in found), max(each.prior for each in found),
                       min(each.left for each in found))

        def alone(d: int, scales: Sequence[float]) -> float:
            return max((likelihood(d, scale).score - _cost([scale]) / weights[d], scale)
                       for scale in scales)[1]

        first = fit_of(np.ones(len(weights)), 0.0)
        if not reading.kinds and first.most_left < table.CLOSE_FIT and (
                first.prior < table.PLAUSIBLE):
            return first
        factors = np.array([
            evidence.factor(d, column) if evidence.is_measured(d, column) else np.nan
            for d, column in enumerate(reading.efforts.tolist())])
        fits = [first, *(fit_of(*row) for row in self._effort_rows(
            factors, measured, np.asarray(np.isfinite(excerpt.effort).any(axis=0))[reading.efforts],
            evidence.has_weight, alone))]
        for part in reading.parts:
            if part.kind in ('position_offset', 'position_unit', 'mounting'):
                # Another direction of weight is credible only for efforts that show the weight.
                fits = [fit for fit in fits if min([
                    likelihood(d, float(fit.reading.effort_scale[d])).prior for d in measured
                    if d in part.drives], default=0.0) <= table.PLAUSIBLE]
        return max(fits, key=lambda fit: fit.score, default=None)

    def _effort_rows(self, factors: Array, measured: Sequence[int], recorded: Mask,
                     has_weight: bool, alone: Callable[[int, Sequence[float]], float],
                     ) -> Iterator[tuple[Array, float, str]]:
        """Yield scales of efforts, (D,), their prior cost and the share that they are.

        Parameters
        ----------
        factors : (D,) array
            Of weight and inertia in the efforts, or NaN.
        measured : sequence of int
            Drives whose efforts count.
        recorded : (D,) bool array
            Drives with efforts.
        has_weight : bool
        alone : callable
            Returns the likeliest of some scales of a drive.
        """
        same, every = np.log(table.SAME_MASSES), np.arange(len(factors))
        units = [scale for scale in table.SCALES if self.has_gain or abs(scale) == 1]
        if not all(drive.turns for drive in self.model.units):
            units = [scale for scale in units if abs(scale) != table.KGF_CM]

        def is_near(scale: float, group: Sequence[int]) -> bool:
            off = np.abs(np.log(np.abs(factors[group] / scale)))
            off = off[np.isfinite(off)]
            return abs(scale) == 1 or bool(
                len(off) and off.max() < np.log(table.OFF_IN_UNIT[abs(scale)]))

        scales = np.ones(len(factors))
        for d in measured:
            scales[d] = alone(d, [scale for scale in units if scale in table.OF_ONE
                                  and is_near(scale, [d])])
        kinds = [scales[[*family]] for family in table.families(self.model.drives)]
        yield scales, _cost(scales[measured]) if np.ptp(scales[measured]) == 0 else sum(
            _cost(kind[:1] if np.ptp(kind) == 0 else kind) for kind in kinds), ''
        # Inertia alone may be invented: units that are no prefixes need a weight.
        for scale in (scale for scale in units if has_weight or scale in table.OF_ONE):
            if is_near(scale, measured):
                yield np.where(recorded, scale, 1.0), _cost([scale]), ''
        known = [d for d in measured if np.isfinite(factors[d])]
        signs, sizes = np.sign(factors[known]), np.abs(factors[known])
        if not (known and self.has_gain) or np.ptp(signs) > 0:
            return
        price, limits = _cost(signs[:1]), self.model.limits.efforts
        if has_weight and len(known) > 1 and np.all(np.isfinite(limits[known])):
            for share, name in table.SHARES.items():
                scales = signs[0] / (share * limits)
                # Factors near 1 are errors of masses.
                if np.any(np.abs(np.log(np.abs(scales[known]))) > same) and np.all(
                        np.abs(np.log(factors[known] / scales[known])) < same):
                    yield scales, price + table.COST['effort_unit'] + 1.0, name
        # A load may multiply what one drive of several needs; constants near a unit are that.
        if len(known) >= min(2, len(factors)) and np.all(
                np.abs(np.log(sizes)) > same) and np.all(sizes > table.LARGEST_COMPLIANCE) and (
                not any(is_near(scale, known) for scale in table.OF_ONE if abs(scale) != 1)):
            yield (np.where(np.isin(every, known), factors, 1.0),
                   price + self.price_of_constants, '')

    def _weights(self, reading: Reading, excerpt: Excerpt, evidence: Evidence) -> Array:
        """Return the weight of each drive, (D,): 1 for the strongest, 0 for one at rest."""
        effort = np.sqrt(np.mean(np.nan_to_num(excerpt.effort[:, reading.efforts]) ** 2, axis=0))
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
        reading, evidence = fit.reading, self.evidence(fit.reading)
        if evidence is None or not np.any(reading.effort_scale < 0):
            return evidence is not None
        weights, votes = self._weights(
            reading, self.excerpts[reading.time_unit], evidence), 0.0
        moves = evidence.speed > self.model.reversal.velocity
        for d in np.flatnonzero((reading.effort_scale < 0) & moves).tolist():
            column = int(reading.efforts[d])
            if evidence.is_measured(d, column):
                some = Shares.of(evidence, d, column)
                votes += float(weights[d] * np.sign(some.friction)) * some.has_friction
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
        # What one mistake does not concern may be the next one.
        of_motion = sorted({k for part in reading.parts for k in part.drives}) or slice(None)
        return not np.any(((position < lower - slack) | (position > upper + slack))[:, of_motion])

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

    def _against_velocities(self, reading: Reading) -> float:
        """Return the cost of units of positions that no unit of the recorded velocities suits."""
        def is_one_of(units: Sequence[float], factor: float) -> bool:
            return any(abs(abs(factor / unit) - 1) < table.RATE_OFF for unit in units)

        # Velocities are in the unit of the positions, or in one of their own.
        unlike = [d for d, factor in self.factors.items() if reading.scale[d] != 1 and not (
            is_one_of((1.0,), factor) or is_one_of(
                (1.0, *table.VELOCITY_UNITS), factor / float(reading.scale[d])))]
        return table.UNLIKE_VELOCITY * bool(unlike)

    def far_outside(self, recording: Recording) -> Iterator[OtherReading]:
        """Yield positions far beyond the strokes, which no effort is needed to recognise."""
        ends = np.maximum(-self.strokes[0], self.strokes[1])
        reach, units = np.abs(recording.position).max(axis=0), self.model.units
        for turns in (False, True):
            alike = tuple(k for k, unit in enumerate(units) if unit.turns == turns)
            far = [k for k in alike if reach[k] > table.FAR * ends[k]]
            # Angles that explain the efforts well are in the right unit, whatever limits say.
            if not far or (turns and self.start.left <= table.GOOD_FIT):
                continue
            rows = [row for row in self.rows if row.kind == 'position_unit'
                    and {*far} <= {*row.drives} <= {*alike}
                    and np.all((reach * row.scale <= ends)[[*row.drives]])]
            best = min(rows, key=lambda row: len(row.drives), default=None)
            group = alike if turns else tuple(far) if best is None else best.drives
            farthest = max(far, key=lambda k: reach[k] / ends[k])
            unit = '' if best is None else (
                f', as if they were in {best.what.partition(" like ")[2]}')
            # Efforts that could not confirm it leave it a question.
            yield OtherReading.of(
                'stroke' if turns and np.isfinite(recording.effort).any() else 'position_unit',
                recording.drives, group, f'the positions of {named(recording.drives, group)} '
                f'reach {reach[farthest]:.4g} {units[farthest].position}, far out of the stroke'
                + unit, scales=() if best is None else position_scales(self.model, best, best))


def _cost(scales: Sequence[float] | Array) -> float:
    """Return the prior cost of scales that are mistakes each."""
    return float(sum(table.COST['effort_sign'] * (scale < 0)
                     + table.COST['effort_unit'] * (abs(scale) != 1) for scale in scales))


def _time_units(recording: Recording) -> list[float]:
    """Return units of time in which the steps would be those of a robot's recording [s]."""
    steps = np.concatenate([np.diff(recording.time[part]) for part in recording.segments]
                           or [np.zeros(0)])
    step = float(np.median(steps)) if len(steps) else 0.0
    return [unit for unit in table.TIMES
            if step > SLOW_STEP and table.SHORTEST <= step * unit <= SLOW_STEP]
