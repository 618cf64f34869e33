# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer of a table of models: effects with errors and values, rivals, and the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.cautions import find_cautions
from pprs_dynamics.inference.diagnosis.diagnosis import (
    Diagnosis,
    EffectAlone,
    FoundEffect,
    NamedEffect,
    RankedSet,
    RivalEffect,
)
from pprs_dynamics.inference.diagnosis.quantities import listed, plain
from pprs_dynamics.inference.diagnosis.statements import Statement, word_statement
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import rms
from pprs_dynamics.inference.search import fitted_model
from pprs_dynamics.inference.search.candidates import (
    DURING,
    SINCE,
    CandidateSet,
    CostTerms,
    EffectCandidate,
    UnknownCandidate,
)
from pprs_dynamics.inference.search.decisions import Decisions, outside_cost
from pprs_dynamics.inference.search.estimates import Estimates, averaged, calibrations, estimate
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.inference.search.held_out import (
    HeldOut,
    PredictiveGain,
    hold_out,
    predictive_gain,
)
from pprs_dynamics.inference.search.noise_floors import noise_at_most
from pprs_dynamics.inference.search.table import ModelTable, Row
from pprs_dynamics.measurement.files.recording import Recording

MOST_SETS = 8  # rows that are listed
MOST_AVERAGED = 5  # sets that estimates are averaged over


class Answer:
    """Effects, values, errors and verdict of a row of the table of models.

    Parameters
    ----------
    table : ModelTable
    row : Row
        The reported one.
    validate : sequence of Recording
        Held-out recordings; blocks of the fitted ones without any.
    """

    def __init__(self, table: ModelTable, row: Row, validate: Sequence[Recording]) -> None:
        self.table, self.row, self.validate = table, row, validate
        self.decisions = table.first.decisions
        self.fits, self.fitted = row.fits, row.fitted
        self.design, self.given = row.fits.design, table.first.design.residuals
        self.drives = self.design.drives
        self.adopted = fitted_model.fitted_model(row.fits, row.fitted)
        self.remaining = self._remaining()
        # Always that of the best row: the residual of a row that lacks an effect is no noise.
        best = table.best
        self.noise: dict[str, NoiseSpectrum] = {
            self.drives[d]: spectrum
            for d, spectrum in best.fits.regression.noise(best.fitted.fit).items()}
        # The residual of the reported set is an upper bound of the noise.
        most = {self.drives[d]: self.fits.regression.noise_floor(self.fitted.fit, d)
                for d in self.fits.regression.drives}
        known = table.noise_floors
        self.noise_levels = {name: noise_at_most(known.get(name, np.inf), bound)
                             for name, bound in most.items()}
        self.unseen = tuple(name for name in most if name not in known)

    def _remaining(self) -> Array:
        """Return measured minus what the reported model predicts, (M, D) [N]."""
        if self.fitted.is_dated:
            return fitted_model.linear_residual(self.fits, self.fitted)
        remaining = self.given.measured - self.design.exact_forces(
            self.adopted) - self.design.carried_forces(self.fitted.fit.coefficients)
        for d, series in self.fits.regression.series.items():
            remaining[:, d] -= series.open_forces(remaining[:, d])
        return remaining

    def force(self, candidate: EffectCandidate | UnknownCandidate) -> Array:
        """Return the force of a candidate of the row, (M, D) [N]."""
        return self.fits.components.force(self.fitted, candidate, self.remaining.shape)

    def over_noise(self, error: Array) -> float:
        """Return the root of the mean square of errors (M, D), each drive over its noise [1]."""
        return root_mean_square([
            root_mean_square(error[:, d]) / max(self.noise_levels[self.drives[d]], 1e-300)
            for d in self.fits.regression.drives])

    def diagnosis(self, unconfirmed: tuple[FoundEffect, ...] = ()) -> Diagnosis:
        """Return the answer; `unconfirmed`: effects of the table's best row that it lacks."""
        table, effects = self.table, self.effects
        rivals = self._rivals()
        depends = (*self._passing(), *self._depends_on())
        above = self._above_noise()
        known = {drive: level for drive, level in self.noise_levels.items()
                 if drive not in self.unseen}
        little = little_explained(self.adopted, table.first.design.residuals, self.remaining,
                                  self.decisions, known)
        drifts = any(effect.course is not None and effect.course.kind != SINCE
                     for effect in effects)
        verdict = ('unknown' if depends or above or little or drifts
                   else 'ambiguous' if rivals else 'effect' if effects
                   else 'unknown' if unconfirmed else 'adequate')
        moved = [number for number in calibrations(self.fits, self.fitted)
                 if abs(number.after - number.before) > self.decisions.sure * number.std]
        first = table.first.design
        return Diagnosis(
            verdict, effects, rivals, unconfirmed, self._candidates(), self._suspects(), depends,
            tuple(self._ranked(row.fitted, row.terms) for row in table.rows[:MOST_SETS]),
            tuple(moved),
            find_cautions(table.last, table.reported, effects, self.noise_levels),
            first.notes, first.given, self.adopted, self.given, self.remaining, self.noise,
            self.noise_levels, above, little, self.unseen,
            'validation' if self.validate else 'blocks', selection=table)

    # Effects

    @cached_property
    def effects(self) -> tuple[FoundEffect, ...]:
        """Effects of the row, largest error reduction first."""
        return tuple(self.found(candidate) for candidate in sorted(
            Row(self.fits, self.fitted).effects,
            key=lambda candidate: -self.over_noise(self.remaining + self.force(candidate))))

    def found(self, candidate: EffectCandidate) -> FoundEffect:
        """Return an effect of the row with its values and errors."""
        fits, fitted, force = self.fits, self.fitted, self.force(candidate)
        estimates = averaged(estimate(fits, fitted, candidate, fitted.is_dated),
                             self._nearly(candidate), candidate.shared)
        parameters = estimates.parameters
        without = self.table.without(candidate)
        with_force, less = self.over_noise(self.remaining), self.over_noise(self.remaining + force)
        before, after, gain = self._held_out(candidate)
        begun = self.table.first.design.reconstructions[0].start
        course = candidate.course
        return FoundEffect(
            candidate.effect, self.design.named(candidate.drives), parameters, force,
            without.cost - self.table.best.cost, root_mean_square(self.remaining + force),
            root_mean_square(self.remaining), before, after, estimates.at_bound,
            gain, objection(less / max(with_force, 1e-300), gain, self.decisions),
            self._ranked(without.fitted, without.terms), self._in_model(candidate, parameters),
            None if course is None else replace(
                course, begin=course.begin - begun, end=course.end - begun), estimates.moments)

    def _held_out(self, candidate: EffectCandidate) -> tuple[float, float, PredictiveGain | None]:
        """Return held-out errors without and with an effect, and its gain where it is known."""
        fits, fitted = self.fits, self.fitted
        less = fitted.without(candidate)
        if not self.validate:
            without = hold_out(fits, fits.at_noise_of(fitted, less))
            return without.error, self._blocks.error, without.gain(self._blocks)
        try:
            before, after = (measure_residuals(model, self.validate)[0] for model in (
                fitted_model.fitted_model(fits, fits.evaluate(less)), self.adopted))
        except PprsError:
            return float('nan'), float('nan'), None
        return rms(before), rms(after), predictive_gain(before, after)

    @cached_property
    def _blocks(self) -> HeldOut:
        return hold_out(self.fits, self.fitted)

    def _in_model(self, candidate: EffectCandidate, keys: Iterable[str]) -> dict[str, float]:
        """Return the values that the input model has of an effect; none where it lacks it."""
        given, prefix = self.table.first.design.given, f'effects.{candidate.name}.'
        if all(effect.name != candidate.name for effect in given.effects):
            return {}
        return {key: float(given.values[prefix + key]) for key in keys
                if prefix + key in given.values}

    def _nearly(self, candidate: EffectCandidate) -> list[tuple[float, Estimates]]:
        """Return estimates of an effect by sets that cost nearly as little, and what they cost.

        Of a row that lacks refused effects, those of the best row: they may be there all the same.
        """
        table, best = self.table, self.table.best
        near = [(table.last, cost, fitted) for cost, fitted in table.near(
            self.decisions.rival_margin)[:MOST_AVERAGED]] if self.row is best else [
                (best.fits, 0.0, best.fitted)]
        return [(cost, estimate(fits, fitted, same)) for fits, cost, fitted in near
                for same in fitted.effects
                if same.effect is candidate.effect and same.course == candidate.course]

    # Residual

    @outside_cost('a residual above hypot(1.5 noise, form error): `unknown`')
    def _above_noise(self) -> dict[str, float]:
        """Return the drives with more residual than noise and forms explain, over the noise.

        Every fit takes forms of friction as unknown, so that they are part of the explanation.
        The form error is a share of the sum of forces: two that cancel are no force of a machine.
        Its size is that which 99 of 100 form errors do not exceed: half of them exceed a mean.
        """
        found, residual = {}, self.remaining - fitted_model.friction_forms(self.fits, self.fitted)
        forms = sum((self.force(candidate) for candidate in self.fitted.effects
                     if candidate.effect.idealised), np.zeros_like(residual))
        for d in self.fits.regression.drives:
            floor = max(self.noise_levels[self.drives[d]], 1e-300)
            form = self.decisions.most_form_share * root_mean_square(forms[:, d]) / floor
            allowed = float(np.hypot(self.decisions.left_ratio, form))
            # A constant may be slow noise.
            ratio = float(np.nanstd(residual[:, d])) / floor
            effort = float(np.nanstd(self.given.measured[:, d]))
            if ratio > allowed and ratio * floor > self.decisions.negligible * effort:
                found[self.drives[d]] = ratio
        return found

    @outside_cost('an effect that ends is no property of the machine: `unknown`')
    def _passing(self) -> Iterator[Statement]:
        """Yield a statement for each drive on which something is there for a stretch alone."""
        residuals, first = self.given, self.table.first.design.reconstructions[0].start
        passing = [(candidate, candidate.course) for candidate in self.fitted.effects
                   if candidate.course is not None and candidate.course.kind == DURING]
        for candidate, course in passing:
            force, evidence = self.force(candidate), self._evidence(candidate)
            begin, end = course.begin - first, course.end - first
            inside = (residuals.time >= course.begin) & (residuals.time < course.end)
            for d in np.flatnonzero(np.any(force, axis=0)):
                drive, squares = self.drives[d], np.square(residuals.error[:, d])
                size = root_mean_square(force[inside, d])
                yield Statement(
                    drive, 'time', (begin, end),
                    float(np.nansum(squares[inside]) / np.nansum(squares)), float(np.mean(inside)),
                    f'{drive}: its error changes from {begin:.4g} s to {end:.4g} s alone, by '
                    f'{plain(size)} {residuals.units_of(drive).effort} rms, as of a contact, a '
                    f'stop or a hand ({candidate.name} explains it): it is no property of the '
                    'machine', evidence, 'range', float(np.mean(force[:, d] ** 2)))

    def _evidence(self, candidate: EffectCandidate | UnknownCandidate) -> float:
        """Return by how much the set of the row costs more without a candidate."""
        return self.fits.evaluate(self.fitted.without(candidate)).total - self.fitted.total

    def _depends_on(self) -> tuple[Statement, ...]:
        """Return patterns of no catalogue, that of the largest share of its drive's error first."""
        by_drive = {pattern.d: pattern for pattern in self.table.patterns}
        statements = [
            word_statement(by_drive[candidate.drive], candidate,
                           self.fitted.fit.of(candidate.block), self._evidence(candidate))
            for candidate in self.fitted.unknowns]
        return tuple(sorted(statements, key=lambda statement: -statement.share_of_error))

    # Queries on the table

    def _rivals(self) -> tuple[tuple[str, ...], ...]:
        """Return each reported effect that has rivals, with their names."""
        rivals: dict[str, list[str]] = {c.name: [] for c in self.row.effects}
        for rival in self.table.rivals(self.decisions.rival_margin):
            for name in rival.missing:
                if name in rivals:
                    rivals[name] += [other for other in rival.instead if other not in rivals[name]]
        return tuple((name, *others) for name, others in rivals.items() if others)

    def _candidates(self) -> tuple[EffectAlone, ...]:
        """Return the effects that were fitted alone, the best first."""
        first = self.table.first
        none = first.evaluate(()).terms
        return tuple(EffectAlone(candidate.name, self.design.named(candidate.drives),
                                 (none - fitted.terms).total,
                                 fitted_model.linear_error(first, fitted))
                     for fitted in self.table.alone.values() for candidate in fitted.candidates)

    def _suspects(self) -> tuple[EffectAlone, ...]:
        """Return effects nearly worth their prior cost in addition to the reported ones."""
        return tuple(EffectAlone(candidate.name, self.design.named(candidate.drives),
                                 (self.table.best.terms - row.terms).total, np.nan)
                     for candidate, row in self.table.suspects(self.decisions.suspect_margin))

    def _ranked(self, fitted: CandidateSet, terms: CostTerms) -> RankedSet:
        """Return a set with its cost above that of the best row."""
        return RankedSet(tuple(NamedEffect(c.name, self.design.named(c.drives))
                               for c in fitted.candidates), terms - self.table.best.terms)


def objection(ratio: float, gain: PredictiveGain | None, decisions: Decisions) -> str:
    """Return why data refute an effect of the row, as a clause; '' where they do not.

    Parameters
    ----------
    ratio : float
        Of the error without its force and with it.
    gain : PredictiveGain or None
        Of held-out data; None where it is not known.
    decisions : Decisions
    """
    if ratio <= 1:
        return 'the error does not fall with its force'
    if gain is None or not np.isfinite(gain.certainty):
        return 'held-out data cannot confirm it'
    if gain.certainty < -decisions.sure:
        return (f'held-out data are predicted worse with it, by {-gain.certainty:.2g} standard '
                'errors')
    if gain.losing and gain.certainty < decisions.sure:
        return f'held-out data of {listed(gain.losing)} are predicted worse with it'
    return ''


def answer_of(table: ModelTable, validate: Sequence[Recording], row: Row | None = None,
              unconfirmed: tuple[FoundEffect, ...] = ()) -> Diagnosis:
    """Return the answer of a table: that of the row of least cost.

    Where an effect of it is not confirmed, the answer is that of the row without it: what remains
    then decides about the verdict, and with no effect left it is `unknown`.
    """
    answer = Answer(table, row or table.best, validate)
    refuted = unconfirmed_effects(answer)
    if not refuted:
        return answer.diagnosis(unconfirmed)
    names, fits = {effect.name for effect in refuted}, table.best.fits
    rest = fits.evaluate(tuple(c for c in answer.fitted.candidates if c.name not in names))
    known = table.exact.get(rest.row_key)
    less = known or (Row(fits, rest, 0.0) if rest.is_dated else Row.exact(fits, rest))
    return answer_of(table, validate, less, (*unconfirmed, *refuted))


@outside_cost('an effect that raises the error, on the recordings or held out, is not reported; '
              'with no other effect: `unknown`')
def unconfirmed_effects(answer: Answer) -> tuple[FoundEffect, ...]:
    """Return the effects of a row that data do not confirm; all where none lowers the error."""
    effects = answer.effects
    refuted = tuple(effect for effect in effects if effect.objection)
    if refuted or answer.over_noise(answer.remaining) < answer.over_noise(answer.given.error):
        return refuted
    return tuple(replace(effect, objection='with all reported effects the error does not fall')
                 for effect in effects)


def rival_effects(diagnosis: Diagnosis, validate: Sequence[Recording] = (),
                  ) -> tuple[RivalEffect, ...]:
    """Return each rival that a diagnosis names, from the cheapest row that has it.

    Parameters
    ----------
    diagnosis : Diagnosis
    validate : sequence of Recording, optional
        Those of the diagnosis; without them held-out errors are taken on blocks.
    """
    table, found = diagnosis.selection, dict[str, RivalEffect]()
    named = {name for _, *names in diagnosis.indistinguishable for name in names}
    for rival in table.rivals(table.first.decisions.rival_margin) if table else ():
        new = [c for c in rival.row.effects if c.placed_name not in found
               and {c.name, c.placed_name} & named.intersection(rival.instead)]
        if table and new:
            answer = Answer(table, rival.row, validate)
            found.update({c.placed_name: RivalEffect(
                answer.found(c), rival.missing[0], rival.row.cost - table.best.cost,
                answer.remaining) for c in new})
    return tuple(found.values())
