# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a recording has the units, signs and order of drives that a model file says.

Every reading of `table.py` is compared with the one that the model file says. A likelier reading
is reported with the line that says so. Nothing is ever changed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MisreadError
from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import (
    Evidence,
    Likelihood,
    in_reading,
    mountings_in,
    read_motion,
)
from pprs_dynamics.inference.readings.findings import (
    Mistake,
    OtherReading,
    find_amperes,
    find_motion,
    find_no_measurements,
    find_other_velocities,
    find_shares,
    find_sign_bit,
    findings_of,
    knows_forces,
    lines_of,
    near,
)
from pprs_dynamics.inference.readings.links import velocity_links
from pprs_dynamics.inference.readings.table import Reading, readings
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.defects import SLOW_STEP
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.model.drive_model import DriveModel

PLAIN = 'all is as the model file says'


@dataclass(frozen=True)
class Fit:
    """A reading with its score and residuals.

    Parameters
    ----------
    reading : Reading
    score : float
        [nats].
    residuals, priors : sequence of float
        Of each drive whose efforts count: residual over the squared effort, and prior cost [nats].
    """

    reading: Reading
    score: float = 0.0
    residuals: Sequence[float] = (1.0,)
    priors: Sequence[float] = (0.0,)

    @property
    def residual(self) -> float:
        """Geometric mean of the residuals."""
        return float(np.exp(np.mean(np.log(self.residuals))))


def with_mistakes(model: DriveModel, recording: Recording, refuse: bool = False) -> Recording:
    """Return a recording with its mistakes among its findings.

    Raises
    ------
    MisreadError
        With `refuse`, where its units, signs or order look different from what the model file says.
    """
    mistakes = find_mistakes(model, recording)
    others = [mistake for mistake in mistakes if isinstance(mistake, OtherReading)]
    if refuse and others:
        raise MisreadError(recording.name, [other.what for other in others],
                           lines_of(others, model.recorded.columns is not None))
    return replace(recording, findings=(*recording.findings, *mistakes), checked_for=model)


def find_mistakes(model: DriveModel, recording: Recording, is_first: bool = False,
                  ) -> tuple[Mistake, ...]:
    """Return the mistakes of a recording's names, units and signs, as findings.

    Parameters
    ----------
    model : DriveModel
    recording : Recording
        Of the model's drives.
    is_first : bool
        Whether nobody has checked the unit of its efforts yet.
    """
    if found := tuple(find_sign_bit(recording)):
        return found
    excerpt = excerpt_of(recording, table.STRETCHES)
    if excerpt is None:
        return tuple(find_shares(model))
    search = Search(model, recording, excerpt, is_first)
    likely = search.likely() or [Fit(search.rows[0])]
    if not search.explains and (found := tuple(find_motion(model, excerpt))):
        return found
    by_reading: list[list[Mistake]] = []
    for fit in likely:
        said: list[Mistake] = [*findings_of(model, recording, fit.reading)]
        if {'position_unit', 'position_title', 'position_sign'}.isdisjoint(fit.reading.kinds):
            said += find_other_velocities(model, search.factors, fit.reading.time_unit)
        by_reading.append(said)
    # What all of them say is no question.
    mistakes: list[Mistake] = [mistake for mistake in by_reading[0] if all(
        mistake in said for said in by_reading)]
    by_reading = [[mistake for mistake in said if mistake not in mistakes] for said in by_reading]
    if kinds := {mistake.kind for said in by_reading for mistake in said}:
        has_columns = model.recorded.columns is not None
        kind = next((kind for kind in kinds if kind == 'rate' or len(kinds) == 1), 'ambiguous')
        mistakes.append(OtherReading.of(
            kind, model.drives, range(len(model.drives)), ', or '.join(
                ' and '.join(mistake.what for mistake in said) or PLAIN for said in by_reading),
            ' or '.join(line for said in by_reading for line in lines_of(said, has_columns))))
    shares = tuple(find_shares(model))
    mistakes += shares
    evidence = search.evidence(search.rows[0])
    if not (search.has_gain or shares):
        factors = search.effort_factors(likely[0].reading)
        # Without weight the inertia may be a guess: only a first model is asked about.
        if is_first or (evidence is not None and evidence.has_weight and np.any(
                np.abs(np.log(np.abs(factors))) > np.log(table.OTHER_UNIT))):
            mistakes.append(find_amperes(model, factors))
    if mistakes or evidence is None:
        return tuple(mistakes)
    return tuple(find_no_measurements(model, recording, evidence))


def looks_like(model: DriveModel, recordings: Sequence[Recording]) -> dict[str, Mistake]:
    """Return what recordings look like instead of what the model file says, by drive."""
    return {drive: finding for recording in recordings
            for finding in (recording.findings if recording.checked_for is model
                            else find_mistakes(model, recording))
            if isinstance(finding, Mistake) for drive in finding.drives}


def shows_weight(model: DriveModel, recording: Recording) -> bool:
    """Return whether the drives of a recording bear a weight, which fixes units of motion."""
    excerpt = excerpt_of(recording, table.STRETCHES)
    evidence = None if excerpt is None else Evidence.of(
        model, excerpt, Reading.plain(len(model.drives)))
    return evidence is not None and evidence.has_weight


class Search:
    """The search for a reading that is more likely than the plain one.

    Parameters
    ----------
    model : DriveModel
    recording : Recording
    excerpt : Excerpt
        Of the recording.
    is_first : bool
        Whether nobody has checked the unit of the efforts yet.
    rate : float, optional
        Samples per second where no times are recorded; without, that of the model file.
    """

    def __init__(self, model: DriveModel, recording: Recording, excerpt: Excerpt, is_first: bool,
                 rate: float | None = None) -> None:
        self.model = model
        # Gaps are other ones in milliseconds.
        self._step = _step(recording)
        self._excerpts = {1.0: excerpt, **{
            unit: other for unit in table.TIMES if self._step > SLOW_STEP
            and table.SHORTEST <= self._step * unit <= SLOW_STEP
            and (other := excerpt_of(recording, table.STRETCHES, unit)) is not None}}
        columns = model.recorded.columns
        self.rate = columns.rate if rate is None and columns is not None else rate
        # Recorded velocities over the derivatives of positions, each with its relative doubt.
        self.factors = {d: (factor, table.RATE_OFF + 1 - alike ** 2) for d, (alike, factor) in (
            enumerate(() if recording.velocity is None else velocity_links(
                zip(recording.position.T, recording.velocity.T, strict=True), recording.time)))
            if abs(alike) >= table.ALIKE}
        self.velocity_scales = [model.recorded.columns_of(drive).velocity_scale
                                for drive in model.drives]
        turning = [units.turns for units in model.units]
        # Degrees are not in degrees again.
        self.rows = readings(model.drives, model.units, self._loads(), [*self._excerpts][1:],
                             bool(np.all(recording.position[:, turning] % 1 == 0)),
                             not np.any(recording.effort < 0),
                             {d: scale for d, scale in enumerate(
                                 model.recorded.columns_of(drive).position_scale
                                 for drive in model.drives)
                              if abs(scale) in table.POSITION_UNITS})
        # A gain that someone has checked may be wrong by a factor, a unit that nobody has checked
        # may be any.
        self.cost_of_constants = table.COST['drive_constant'] - table.UNCHECKED * is_first
        self.is_first = is_first
        self.same_masses = np.log(table.OTHER_UNIT if self.is_first else table.SAME_MASSES)
        # Without a gain masses and units are no evidence.
        self.has_gain = knows_forces(model, recording)
        self.masses = table.MASSES if self.has_gain else np.inf
        self.start, self.explains = Fit(self.rows[0]), False
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

    def excerpt(self, reading: Reading) -> Excerpt:
        """Return the excerpt in the unit of time of a reading."""
        unit = reading.time_unit
        return self._excerpts.get(unit) or self._excerpts[1.0].slower(unit)

    def motion(self, reading: Reading) -> DriveMotion:
        """Return the motion in a reading."""
        return read_motion(self.excerpt(reading).motion, reading)

    def evidence(self, reading: Reading) -> Evidence | None:
        """Return the evidence of a reading; None where its motion is impossible."""
        key = reading.of_motion
        if key not in self._evidence:
            self._evidence[key] = Evidence.of(
                in_reading(self.model, reading), self.excerpt(reading), reading)
        return self._evidence[key]

    def _strokes(self) -> tuple[Array, Array]:
        """Return the ends of the strokes, infinite where a drive turns freely.

        Limits of a turn or more of a motor without weight are invented, as URDF asks for some.
        """
        lower, upper = self.model.limits.lower, self.model.limits.upper
        evidence = self.evidence(self.rows[0])
        if evidence is None:
            return lower, upper
        free = np.array([units.turns for units in self.model.units]) & (
            upper - lower >= 2 * np.pi) & (np.linalg.norm(evidence.roots[:, 0, :, 1], axis=1) == 0)
        return np.where(free, -np.inf, lower), np.where(free, np.inf, upper)

    def best(self) -> Fit:
        """Return the most likely reading; mistakes are added to it until none makes it likelier."""
        first = self.rows[0]
        # What the mechanism cannot follow is as unlikely as an effort of which nothing is right.
        self.fits = self.fits_of(first) or [Fit(first)]
        if self._against_velocities(first):
            self.fits += [fit for row in self._rates(first)
                          for fit in self.fits_of(row.after(first))]
        self.start = start = self._top()
        # Without masses a gravity of any size may explain positions in another unit.
        explains = not start.reading.kinds - {'rate'} and not self._slow(start.reading) and np.all(
            start.reading.effort_scale == 1) and self.has_gain and (
                max(start.priors) < table.PLAUSIBLE)
        if explains and max(start.residuals) < table.CLOSE_FIT:
            self.explains = True  # hardly anything may be explained better
            return start
        # Efforts that are explained may still be amperes of motion in turns, nearly 2 pi less.
        self.explains = bool(explains and max(start.residuals) < table.EXPLAINED)
        tried = {'position_unit', 'drive_order'} if self.explains else {*table.COST} - (
            set() if self.has_gain else {'mounting', *table.LACKING})
        # Of two zeros, or units, that are wrong each explains little alone: an arm that stands
        # upright at the zeros of one file lies at those of another.
        alone = [row for row in self.rows if row.kind in ('time_unit', 'position_offset')
                 or self._is_unit_of_all(row)]
        pairs = [replace(second.after(first.after(self.rows[0])),
                         drives=first.drives + second.drives)
                 for first, second in combinations(alone, 2)
                 if (first.kind, first.drives) != (second.kind, second.drives)]
        seed = None
        while self._top() is not seed:
            seed = self._top()
            mountings = mountings_in(self.model, self.excerpt(seed.reading), seed.reading)
            self._extend(seed, (*self.rows[1:], *mountings, *self._rates(seed.reading)), tried)
            if seed is start and not any(
                    max(fit.residuals) < table.EXPLAINED for fit in self.fits if np.all(
                        fit.reading.effort_scale == 1)):
                self._extend(seed, pairs, tried)
        return self._top()

    def _extend(self, seed: Fit, rows: Sequence[Reading], tried: Collection[str]) -> None:
        """Add the fits of a reading with each row of some kinds, where they may become the best."""
        least = self._top().score - table.SURE
        self.fits += [fit for row in rows
                      if row.kind in tried and self._may_follow(row, seed.reading)
                      for reading in self._after(row, seed.reading)
                      for fit in self.fits_of(reading, least) if self._is_credible(row, fit)]

    def likely(self) -> list[Fit]:
        """Return the best reading where it is more likely than the plain one, and its rivals."""
        best = self.best()
        is_good = best.residual <= table.GOOD_FIT or best.reading.is_no_measurement
        # Angles that explain the efforts are in the right unit, whatever limits say.
        is_right = is_good and not self._against_velocities(best.reading)
        far = (self.reach(self.start.reading) > (table.FAR if is_good else table.BEYOND)) & [
            not (is_right and units.turns) for units in self.model.units]
        if np.any(far) and (best.reading.is_plain or not is_good) and (units := [
                unit for row in self.rows if row.kind == 'position_unit'
                for unit in self._after(row, self.rows[0])]):
            return [Fit(units[0]), self.start]
        # The inertia of a drive without weight may be invented, a unit of its efforts not.
        evidence, scales = self.evidence(best.reading), best.reading.effort_scale
        if not is_good or evidence is None or not (
                self.is_first or evidence.has_weight or np.all(np.isin(scales, table.SCALES))
                or best.reading.is_no_measurement):
            return []
        rivals = self._rivals(best)
        # Where inertia and weight show no sign, friction alone is not sure of one.
        negated = [evidence.factor(d, best.reading.efforts[d])
                   for d in np.flatnonzero(scales < 0).tolist()]
        if negated and not np.any(np.isfinite(negated)):
            rivals = rivals or self.fits[:1]
        return [best, *rivals] if not best.reading.is_plain or (self.is_first and rivals) else []

    def _rates(self, before: Reading) -> Iterator[Reading]:
        """Yield rows with times of which the recorded velocities are the derivatives.

        Without times the velocities may be in any unit.
        """
        if self.rate and not self.factors and self.model.recorded.columns:
            for unit in table.RATES:
                yield replace(self.rows[0], kind='rate', cost=table.COST['rate'], time_unit=unit,
                              what=f'there look to be {self.rate / unit:g} samples per second, '
                              f'not {self.rate:g}')
        factors = [factor * before.time_unit / float(before.scale[d])
                   for d, (factor, _) in self.factors.items()]
        common = float(np.median(factors or [0.0]))
        if common <= 0 or not all(near(common, (factor,)) for factor in factors) or (
                self.rate is None and not self._against_velocities(before)):
            return
        # Velocities may be in the unit of the positions, as they are read, or in one of their own.
        scale = float(np.median([self.velocity_scales[d] for d in self.factors]))
        units = {1.0: 0.0} if self.rate is None else {unit * scale: table.COST['velocity_unit'] * (
            unit != 1) for unit in (1.0, *table.VELOCITY_UNITS) if unit > 0} | {1.0: 0.0}
        for unit, cost in units.items():
            if not near(unit / common, self._excerpts):
                what = 'the times were in another unit' if self.rate is None else (
                    f'there were {float(f"{self.rate * common / unit:.3g}"):g} samples per second, '
                    f'not {self.rate:g}')
                yield replace(
                    self.rows[0], kind='rate', cost=table.COST['rate'] + cost,
                    time_unit=unit / common,
                    what=f'the recorded velocities are {factors[0]:.4g} times the derivatives of '
                    f'the positions, as if {what}')

    def _may_follow(self, row: Reading, before: Reading) -> bool:
        """Return whether a row may be added to a reading."""
        if {'drive_order', *table.LACKING} & {row.kind, *before.kinds}:
            return not before.kinds
        return all(row.kind != part.kind or (row.kind == 'position_offset' and not (
            {*row.drives} & {*part.drives}) and len(row.drives) == 1) for part in before.parts)

    def _after(self, row: Reading, before: Reading) -> list[Reading]:
        """Return the possible readings that add a row to another one.

        In another unit the zeros of positions may be off as well.
        """
        reading = row.after(before)
        zeros = [zero.after(reading) for zero in self.rows if zero.kind == 'position_offset'] if (
            row.kind == 'position_unit' and not (self.fits_of(reading) if self._is_unit_of_all(row)
                                                 else self._possible(reading))) else []
        return [found for found in (reading, *zeros) if self._possible(found)]

    def _is_unit_of_all(self, row: Reading) -> bool:
        """Return whether the angles of all drives that turn are in another unit."""
        return row.kind == 'position_unit' and len(row.drives) == sum(
            units.turns for units in self.model.units)

    def _is_credible(self, row: Reading, fit: Fit) -> bool:
        # Symmetric robots fit nearly as well in another order of their drives.
        if row.kind == 'drive_order':
            return fit.residual < table.BETTER_ORDER * self.start.residual
        # Masses that inertia contradicts are guesses, and so is their weight.
        if row.kind == table.WITHOUT_GRAVITY and max(fit.priors) > table.PLAUSIBLE:
            return False
        evidence = self.evidence(fit.reading)
        # Without weight, masses that are off look like another rate.
        if row.kind == 'rate' and not self.factors:
            return evidence is not None and evidence.has_weight
        # What nothing explains, with any sign, may be external.
        return row.kind not in table.LACKING or fit.residual < table.GOOD_FIT or (
            evidence is not None and fit.residual < evidence.unexplained * (
                table.NO_WORSE.get(row.kind, 0.0)))

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
            """Return what a line would change; all positions negated are all efforts negated."""
            sign = -1.0 if np.all(reading.scale < 0) else 1.0
            scales = sign * reading.effort_scale
            same = replace(reading, load=0.0, scale=sign * reading.scale,
                           offset=sign * reading.offset + 0.0)
            return same.of_motion + reading.efforts.tobytes() + (
                scales.tobytes() if np.all(np.isin(scales, table.SCALES)) else b'constants')

        seen, found = {written(best.reading)}, []
        for fit in sorted(self.fits, key=lambda fit: -fit.score):
            if best.score - fit.score < table.SURE and written(fit.reading) not in seen and (
                    fit.reading.is_plain or fit.residual <= table.GOOD_FIT) and not (
                        best.reading.is_no_measurement and fit.reading.is_no_measurement):
                seen.add(written(fit.reading))
                found.append(fit)
        return found[:1]

    def fits_of(self, reading: Reading, least: float = -np.inf) -> list[Fit]:
        """Return a reading with each scale that its efforts may have.

        None where it cannot be, or no coefficients give it a score of at least `least`.
        """
        excerpt = self.excerpt(reading)
        if reading.kinds and not self._possible(reading):
            return []
        cost = (reading.cost + self._outside(reading) + self._against_velocities(reading)
                + self._slow(reading))
        if not np.isfinite(excerpt.effort).any():
            return [Fit(reading, -cost, (table.GOOD_FIT,))]
        evidence = self.evidence(reading)
        # A mounting without weight explains none, and an external torque lacks more than inertia.
        if evidence is None or ((reading.gravity is not None or reading.contains == table.LACKING[
                table.EXTERNAL][0]) and not evidence.has_weight):
            return []
        measured = self._measured(reading, excerpt, evidence)
        if not measured or least > sum(
                evidence.most(d, reading.efforts[d]) for d in measured) - cost:
            return []

        @cache
        def likelihood(d: int, scale: float) -> Likelihood:
            return evidence.likelihood(d, reading.efforts[d], scale, self.masses,
                                       reading.contains)

        def fit_of(scales: Array, price: float) -> Fit:
            found = [likelihood(d, float(scales[d])) for d in measured]
            score, prior, residual = np.array(found).T
            # A guess of one mass is a guess of all.
            return Fit(replace(reading, effort_scale=scales),
                       float(np.sum(score + prior) - prior.max()) - cost - price,
                       residual.tolist(), prior.tolist())

        negated = [d for d in measured if likelihood(d, -1.0).score - likelihood(d, 1.0).score > (
            table.COST['effort_sign'])]
        signs = np.where(np.isin(np.arange(len(self.model.drives)), negated), -1.0, 1.0)
        fits = [fit_of(np.ones(len(self.model.drives)), 0.0)]
        if 0 in reading.contains:
            return fits
        fits += [fit_of(*row) for row in self._effort_rows(reading, evidence, measured, signs)]
        if {'position_offset', 'position_unit', 'mounting', 'load'} & {
                part.kind for part in reading.parts}:
            # Another weight is credible only for efforts that show weight or inertia.
            fits = [fit for fit in fits if np.mean(fit.priors) <= table.PLAUSIBLE]
        return fits

    def effort_factors(self, reading: Reading) -> Array:
        """Return the factors of inertia and gravity in efforts, (D,); NaN where none is certain."""
        evidence, columns = self.evidence(reading), reading.efforts.tolist()
        return np.array([np.nan if evidence is None else evidence.factor(d, column)
                         for d, column in enumerate(columns)])

    def _effort_rows(self, reading: Reading, evidence: Evidence, measured: Sequence[int],
                     negated: Array) -> Iterator[tuple[Array, float]]:
        """Yield scales of efforts, (D,), and their prior cost.

        Parameters
        ----------
        reading : Reading
        evidence : Evidence
        measured : sequence of int
            Drives whose efforts count.
        negated : (D,) array
            The likelier sign of each drive's efforts.
        """
        kinds = [negated[[*family]] for family in table.families(self.model.drives)]
        yield negated, _cost(negated[measured]) if np.ptp(negated[measured]) == 0 else sum(
            _cost(kind[:1] if np.ptp(kind) == 0 else kind) for kind in kinds)
        factors = self.effort_factors(reading)
        known = [d for d in measured if np.isfinite(factors[d])]
        drives, recorded = np.arange(len(factors)), evidence.total[
            np.arange(len(factors)), reading.efforts] > 0
        signs, sizes = np.sign(factors[known]), np.abs(factors[known])
        off = {unit: np.exp(np.abs(np.log(sizes / unit)).max(initial=0.0))
               for unit in table.OFF_IN_UNIT if known and self.has_gain and not (
                   {unit} & {*table.OF_LENGTHS} if all(drive.turns for drive in self.model.units)
                   else {unit} & {*table.OF_TURNS})}
        for scale in table.SCALES:
            unit = abs(scale)
            if unit == 1 or (unit in off and off[unit] < table.OFF_IN_UNIT[unit][1]):
                yield np.where(recorded, scale, 1.0), _cost([scale])
        if not off or np.ptp(signs) > 0:
            return
        # A load may multiply what one drive of several needs, and factors of each drive explain
        # it as well; constants that are nearly a unit are that.
        others = np.abs(np.log(sizes)) > self.same_masses
        is_other = not reading.load and np.any(others) if self.is_first else (
            np.all(others) and len(known) >= min(2, len(factors)))
        if is_other and not any(off[unit] < table.OFF_IN_UNIT[unit][0] for unit in off):
            # Others bear a weight that hardly changes, or have a factor among the others.
            of_means, doubtful = (np.array([factor(d, column, *errors) for d, column in enumerate(
                reading.efforts.tolist())]) for factor, *errors in (
                    (evidence.factor_of_means,), (evidence.factor, 0.0)))
            is_weight = (np.sign(of_means) == signs[0]) & (not reading.kinds)
            among = np.clip(np.where(np.isnan(doubtful), np.median(factors[known]), doubtful),
                            factors[known].min(), factors[known].max())
            yield (np.where(np.isin(drives, known), factors, np.where(is_weight, of_means, among)),
                   _cost(signs[:1]) + (table.COST[table.POSITION_ERROR] if np.all(
                       sizes < table.LARGEST_COMPLIANCE) else self.cost_of_constants))

    def _measured(self, reading: Reading, excerpt: Excerpt, evidence: Evidence) -> list[int]:
        """Return the drives that move, if some do, and whose efforts are no zeros among others."""
        effort = np.sqrt(np.mean(np.nan_to_num(excerpt.effort[:, reading.efforts]) ** 2, axis=0))
        # As recorded: in a larger unit a drive at rest would move, and count for that unit.
        recorded = self.evidence(self.rows[0]) or evidence
        moves, size = recorded.moves(self.model)[reading.positions], recorded.size
        found = (effort > 0) & (np.maximum(effort / max(effort.max(), 1e-300), size / max(
            size.max(), 1e-300)) > table.LEAST_FORCE)
        found &= moves | (not np.any(moves & found))
        return [d for d in np.flatnonzero(found).tolist()
                if evidence.is_measured(d, reading.efforts[d])]

    def _possible(self, reading: Reading) -> bool:
        """Return whether a reading brings positions into the strokes."""
        lower, upper = self.strokes
        slack = table.STROKE_SLACK * (upper - lower)
        position = self.motion(reading).position
        # Drives may report angles from 0 to a turn.
        turns = np.array([units.turns for units in self.model.units]) & np.isfinite(upper - lower)
        middle = np.mean(np.where(turns, (lower, upper), 0.0), axis=0)
        position = np.where(turns, position - 2 * np.pi * np.round(
            (position - middle) / (2 * np.pi)), position)
        # What one mistake does not concern may be the next one.
        of_motion = sorted({k for part in reading.parts for k in part.drives}) or slice(None)
        return not np.any(((position < lower - slack) | (position > upper + slack))[:, of_motion])

    def reach(self, reading: Reading) -> Array:
        """Return the largest positions over the ends of the strokes, (D,)."""
        reach = np.abs(self.motion(reading).position).max(axis=0)
        return np.asarray(reach / np.maximum(*np.abs(self.strokes)))

    def _outside(self, reading: Reading) -> float:
        """Return the cost of positions and speeds beyond their limits, and of tiny motions."""
        motion = self.motion(reading)
        speed = np.abs(motion.velocity).max(axis=0) / np.where(
            np.isfinite(self.strokes[0]), self.model.robot.structure.speed, np.inf)
        most = float(np.max(np.maximum(self.reach(reading), speed)))
        used = np.ptp(motion.position, axis=0) / (self.strokes[1] - self.strokes[0])
        used = used[np.isfinite(used) & (used > 0)]
        tiny = float(np.mean(np.maximum(np.log(table.USED / used), 0.0))) if len(used) else 0.0
        return tiny + (table.FAR_OUTSIDE if most > table.FAR
                       else table.OUTSIDE if most > table.BEYOND else 0.0)

    def _slow(self, reading: Reading) -> float:
        """Return the cost of steps that cannot follow a robot, where another unit has others."""
        return table.SLOW * (len(self._excerpts) > 1 and (
            self._step * reading.time_unit >= table.OTHER_TIME))

    def _against_velocities(self, reading: Reading) -> float:
        """Return the cost of times and positions that no unit of the recorded velocities suits."""
        # Velocities are in the unit of the positions, or in one of their own.
        return table.UNLIKE_VELOCITY * (not all(
            near(abs(factor * reading.time_unit), (1.0,), doubt) or near(
                factor * reading.time_unit / reading.scale[d] / self.velocity_scales[d],
                (1.0, *table.VELOCITY_UNITS), doubt)
            for d, (factor, doubt) in self.factors.items()))


def _cost(scales: Sequence[float] | Array) -> float:
    """Return the prior cost of scales that are mistakes each."""
    return float(sum(table.COST['effort_sign'] * (scale < 0)
                     + table.COST['effort_unit'] * (abs(scale) != 1) for scale in scales))


def _step(recording: Recording) -> float:
    """Return the median step of time between samples of a motion [s]; 0 of poses that are held."""
    steps = [np.diff(recording.time[part]) for part in recording.segments
             if part.stop - part.start > 1 and not recording.are_poses]
    return float(np.median(np.concatenate(steps))) if steps else 0.0
