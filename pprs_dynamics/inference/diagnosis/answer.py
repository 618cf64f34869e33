# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is to be said of a ranking: effects with errors and values, rivals, and the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.cautions import find_cautions
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import (
    FoundEffect,
    RankedEffect,
    RankedSet,
    RivalEffect,
    WithinModelError,
)
from pprs_dynamics.inference.diagnosis.localisation import levels
from pprs_dynamics.inference.diagnosis.quantities import plain
from pprs_dynamics.inference.diagnosis.statements import (
    Statement,
    word_statement,
)
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import rms
from pprs_dynamics.inference.search.absorbed import Absorbed
from pprs_dynamics.inference.search.candidates import (
    DURING,
    SINCE,
    Candidate,
    CandidateSet,
    EffectCandidate,
)
from pprs_dynamics.inference.search.constraints import empty_totals
from pprs_dynamics.inference.search.cost_terms import CostTerms
from pprs_dynamics.inference.search.courses import changing_drives, with_courses
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.estimates import (
    Estimates,
    averaged,
    calibrations,
    estimate,
)
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.inference.search.fitted_model import (
    exact_forces,
    fitted_model,
    linear_error,
    linear_residual,
    model_at,
    parts_of,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.held_out import hold_out, predictive_gain
from pprs_dynamics.inference.search.noise_floors import noise_floors
from pprs_dynamics.inference.search.possible_values import why_impossible
from pprs_dynamics.inference.search.ranking import Ranking
from pprs_dynamics.inference.search.relinearisation import settled
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.force_model import ForceModel

MOST_SETS, MOST_BARRED = 8, 3  # that are told with their costs, and those that may not be
MOST_AVERAGED = 5  # sets that estimates are averaged over


class Answer:
    """What is to be said of a ranking."""

    def __init__(self, ranking: Ranking, validate: Sequence[Recording],
                 decisions: Decisions, try_courses: bool = True) -> None:
        self.ranking, self.validate, self.decisions = ranking, validate, decisions
        self.fits, self.map_set, self.reported = ranking.last, ranking.map_set, ranking.reported
        self.design = self.fits.design
        self.drives = self.design.drives
        self.final = settled(self.fits, self.reported)
        self.remaining = ranking.first.design.residuals.measured - exact_forces(
            self.design, self.final.model) - self.design.carried_forces(
                self.final.fitted.fit.coefficients)
        for d, series in self.fits.regression.series.items():
            self.remaining[:, d] -= series.open_forces(self.remaining[:, d])
        # Before a constant form is believed.
        self.dated_fits, self.dated = self._with_courses() if try_courses else (
            self.fits, self.reported)
        self.is_dated, self.adopted = self.dated is not self.reported, self.final.model
        if self.is_dated:
            self.remaining = linear_residual(self.dated_fits, self.dated)
            self.adopted = self._dated_model()
        self.effects = self._dated_effects() if self.is_dated else self._effects_reported()

    def _with_courses(self) -> tuple[FittedSets, CandidateSet]:
        """Return the best set in which effects may begin, end or grow, with what it is a set of.

        Where what was found bends the columns, around the model as given, too, and without it: what
        is there all the time may imitate what begins, which does not show around its model.
        What held-out data refute is not tried again.
        """
        ranking, reported = self.ranking, self.reported
        alone = [] if ranking.is_less else list(ranking.alone.values())
        # Beside the MAP set: what is within the model error of others is none with a date, either.
        constant = reported if ranking.is_less else self.map_set
        if not changing_drives(self.fits, constant, alone):
            return self.fits, reported
        fits, found = with_courses(self.fits, constant, alone)
        if alone and ranking.first is not self.fits:
            kept = ranking.first.evaluate(tuple(
                candidate for candidate in reported.effects if not candidate.effect.nonlinear))
            given, there = with_courses(ranking.first, kept, alone,
                                        min(found.cost, self.map_set.cost))
            if there is not kept:
                return given, there
        return fits, reported if found is constant else found

    @property
    def raises_the_error(self) -> bool:
        """Whether a model with what is reported is clearly worse than the given one.

        Where the linear forces of a set mean nothing, as of a recording in other units.
        """
        given = root_mean_square(self.ranking.first.design.residuals.error)
        return root_mean_square(self.remaining) > (1 + self.decisions.noise_accuracy) * given

    def diagnosis(self, unconfirmed: tuple[FoundEffect, ...]) -> Diagnosis:
        first, final, effects = self.ranking.first.design, self.final, self.effects
        regression = self.fits.regression
        noise = {self.drives[d]: spectrum
                 for d, spectrum in regression.noise(self.map_set.fit).items()}
        seen = noise_floors(self.fits, best=self.map_set.fit)
        # Where the noise cannot be told it is at most what the best set leaves.
        floors = {self.drives[d]: seen.get(self.drives[d], regression.noise_floor(
            self.map_set.fit, d)) for d in regression.drives}
        rivals = self._rivals()
        if self.is_dated:
            # What imitates a constant form is no rival of one that changes.
            rivals = {}
            noise, floors = self._noise_beside_courses()
        depends = self._depends_on(noise)
        if self.is_dated:
            depends = (*self._passing(), *depends)
        sets = tuple((name, *others) for name, others in rivals.items() if others)
        above = self._above_noise(floors)
        little = little_explained(self.adopted, first.residuals, self.remaining, self.decisions)
        passing = any(effect.course is not None and effect.course.kind != SINCE
                      for effect in effects)
        verdict = ('unknown' if depends or above or little or passing else 'ambiguous' if sets
                   else 'effect' if effects else 'adequate')
        moved = [number for number in calibrations(final.fits, final.fitted, final.widths)
                 if abs(number.after - number.before) > self.decisions.sure * number.std]
        absorbed = () if self.is_dated else self.ranking.absorbed
        return Diagnosis(
            verdict, tuple(effects), sets, unconfirmed, self._candidates(),
            self._suspects(), depends, tuple(map(self._within_model_error, absorbed)),
            self._sets(), self._barred(), tuple(moved),
            find_cautions(self.fits, self.map_set, effects), first.notes,
            first.given, self.adopted, first.residuals, self.remaining, noise, floors,
            root_mean_square(list(floors.values())), above, little,
            tuple(name for name in floors if name not in seen),
            'validation' if self.validate else 'blocks', selection=self.ranking,
            decisions=self.decisions)

    def _effects_reported(self) -> list[FoundEffect]:
        """Return the effects of the reported set, with the errors as one after another joins."""
        order, path = self.ranking.order, self.ranking.path
        if not order:
            return []
        errors = [root_mean_square(self.ranking.first.design.residuals.error),
                  *(linear_error(self.fits, step) for step in path[1:-1]),
                  root_mean_square(self.remaining)]
        held_out = self._errors_held_out(errors[0])
        return [self._effect(candidate, self.ranking.shares[k], errors[k:k + 2], held_out[k:k + 2])
                for k, candidate in enumerate(order)]

    def _errors_held_out(self, given: float) -> list[float]:
        """Return the held-out errors of the given model, and with one effect after the other."""
        path = self.ranking.path
        if not self.validate:
            # Nothing is fitted in the model as given: all of its error is held out.
            return [given, *(hold_out(self.fits, step).error for step in path[1:])]
        models = [self.ranking.first.design.given,
                  *(settled(self.fits, step).model for step in path[1:-1]), self.final.model]
        return [rms(measure_residuals(model, self.validate)[0]) for model in models]

    def _effect(self, candidate: EffectCandidate, share: float, errors: Sequence[float],
                held_out: Sequence[float]) -> FoundEffect:
        """Return an effect of the reported set, with the errors before it and with it."""
        final = self.final
        last = next(c for c in final.fitted.effects if c.effect is candidate.effect)
        estimates = averaged(estimate(final.fits, final.fitted, last), self._nearly(candidate))
        parameters = estimates.parameters
        without = self._told(self.ranking.best_without(candidate),
                             self.ranking.best_with(candidate))
        impossible = why_impossible(candidate.effect, parameters, self.decisions) or (
            self._why_less_than_nothing(candidate))
        return FoundEffect(
            candidate.effect, self.design.named(candidate.drives), parameters,
            final.fits.components.force(final.fitted, last, self.remaining.shape), without.cost,
            errors[0], errors[1], held_out[0], held_out[1], estimates.at_bound, share,
            self._certainty(candidate), impossible, without,
            self._in_model(candidate, parameters), moments=estimates.moments)

    def _why_less_than_nothing(self, candidate: EffectCandidate) -> str:
        """Return where recordings speak for less than no friction or inertia, as a clause."""
        if self.reported.terms.feasibility <= self.decisions.rival_margin:
            return ''
        return next((f'{self.drives[component.drive]} would have less than no {of} with what the '
                     'model has' for component in candidate.components
                     if component.drive is not None
                     for of in empty_totals(self.design, self.reported, component)), '')

    def _dated_effects(self) -> list[FoundEffect]:
        """Return the effects where some begin, end or grow within the recordings."""
        fits, found = self.dated_fits, self.dated
        begun = self.ranking.first.design.reconstructions[0].start
        given = self.ranking.first.design.residuals.error
        steps = [fits.evaluate(found.effects[:k]) for k in range(1, len(found.effects))] + [found]
        errors = [root_mean_square(given), *(linear_error(fits, step) for step in steps)]
        held_out = [errors[0], *(hold_out(fits, step).error for step in steps)]
        effects = []
        for k, candidate in enumerate(found.effects):
            course = candidate.course
            if course is not None and course.kind == DURING:
                continue  # what passes is no property of the machine
            estimates = estimate(fits, found, candidate, are_drives_known=True)
            effects.append(FoundEffect(
                candidate.effect, self.design.named(candidate.drives), estimates.parameters,
                fits.components.force(found, candidate, self.remaining.shape),
                fits.evaluate(found.without(candidate)).total - found.total, errors[k],
                errors[k + 1], held_out[k], held_out[k + 1], estimates.at_bound,
                (errors[k] - errors[k + 1]) / errors[0],
                objection=why_impossible(candidate.effect, estimates.parameters, self.decisions),
                in_model=self._in_model(candidate, estimates.parameters),
                course=None if course is None else replace(
                    course, begin=course.begin - begun, end=course.end - begun),
                moments=estimates.moments))
        return effects

    def _passing(self) -> list[Statement]:
        """Return what was there for a stretch alone, drive by drive."""
        residuals = self.ranking.first.design.residuals
        begun = self.ranking.first.design.reconstructions[0].start
        found, fits = self.dated, self.dated_fits
        statements = []
        for candidate in found.effects:
            course = candidate.course
            if course is None or course.kind != DURING:
                continue
            force = fits.components.force(found, candidate, self.remaining.shape)
            span = (course.begin - begun, course.end - begun)
            inside = (residuals.time >= course.begin) & (residuals.time < course.end)
            evidence = fits.evaluate(found.without(candidate)).total - found.total
            for d in np.flatnonzero(np.any(force, axis=0)):
                squares = np.square(residuals.error[:, d])
                share = float(np.nansum(squares[inside]) / np.nansum(squares))
                size = root_mean_square(force[inside, d])
                statements.append(Statement(
                    self.drives[d], 'time', span, share, float(np.mean(inside)),
                    f'{self.drives[d]}: from {span[0]:.4g} s to {span[1]:.4g} s alone its error is '
                    f'another, {plain(size)} {residuals.units_of(self.drives[d]).effort} rms, as '
                    f'of a contact, a stop or a hand ({candidate.name} would explain it): what '
                    'passes is no property of the machine',
                    evidence, 'range', size, float(np.mean(force[:, d] ** 2))))
        return statements

    def _dated_model(self) -> ForceModel:
        """Return the model with what is there at the end, and stays."""
        base, placed = parts_of(self.dated_fits, self.dated)
        there = [effect for effect, component in zip(placed, self.dated.blocks, strict=True)
                 if component.course is None or component.course.kind == SINCE]
        return model_at(self.design, base, there)

    def _noise_beside_courses(self) -> tuple[dict[str, NoiseSpectrum], dict[str, float]]:
        regression, fit = self.dated_fits.regression, self.dated.fit
        return ({self.drives[d]: spectrum for d, spectrum in regression.noise(fit).items()},
                {self.drives[d]: regression.noise_floor(fit, d) for d in regression.drives})

    def _in_model(self, candidate: EffectCandidate, keys: Iterable[str]) -> dict[str, float]:
        """Return what the given model says of an effect; nothing where it lacks it.

        Of links and joints only those that it is on are told.
        """
        found = {}
        for component in candidate.components:
            values = self.ranking.first.design.present(component.effect, component.drive)
            prefix = '' if component.drive is None else f'{self.drives[component.drive]}.'
            found.update({prefix + name: float(value) for name, value in (values or {}).items()
                          if prefix + name in keys})
        # A body or friction on a link or joint where there is none is new.
        return found if not candidate.effect.is_of_one_place or any(
            component.given[k] for component in candidate.components if component.given
            for k, c in enumerate(component.effect.coefficients)
            if c.name in component.names) else {}

    def _nearly(self, candidate: EffectCandidate) -> list[tuple[float, Estimates]]:
        """Return what sets that are nearly as good say of an effect, and what they cost more."""
        near = self.ranking.nearly(self.decisions.rival_margin)[:MOST_AVERAGED]
        return [(cost, estimate(self.fits, fitted, same)) for cost, fitted in near
                for same in fitted.effects if same.effect is candidate.effect]

    def _certainty(self, candidate: EffectCandidate) -> float:
        """Return by how many standard errors held-out data are predicted better with an effect."""
        without = self.ranking.without[candidate]
        if not self.validate:
            at_noise = self.fits.at_noise_of(self.reported, without.candidates)
            return hold_out(self.fits, at_noise).gain(hold_out(self.fits, self.reported)).certainty
        before, after = (measure_residuals(one, self.validate)[0] for one in (
            settled(self.fits, without).model, self.final.model))
        return predictive_gain(before, after).certainty

    def _above_noise(self, floors: Mapping[str, float]) -> dict[str, float]:
        """Return the drives that keep more than noise and forms leave, as multiples of noise."""
        found = {}
        for d in self.fits.regression.drives:
            floor = max(floors[self.drives[d]], 1e-300)
            # A constant that slow noise would show as well is none of it.
            kept = float(np.nanstd(self.remaining[:, d])) / floor
            allowed = np.hypot(self.decisions.left_ratio, self._lack_of_fit[d] / floor)
            if kept > allowed and self._is_worth_a_word(d):
                found[self.drives[d]] = kept
        return found

    def _is_worth_a_word(self, d: int) -> bool:
        """Return whether what is left on a drive is more than a negligible share of its effort."""
        effort = self.ranking.first.design.residuals.measured[:, d]
        return float(np.nanstd(self.remaining[:, d])) > (
            self.decisions.negligible * float(np.nanstd(effort)))

    def _evidence(self, candidate: Candidate) -> float:
        return self.ranking.without[candidate].total - self.reported.total

    def _rivals(self) -> dict[str, list[str]]:
        """Return, for each adopted effect, what stands for it in sets that are nearly as good."""
        rivals: dict[str, list[str]] = {c.name: [] for c in self.reported.effects}
        for rival in self.ranking.rivals(self.decisions.rival_margin):
            for name in rival.missing:
                rivals[name] += [one for one in rival.instead if one not in rivals[name]]
        return rivals

    def _depends_on(self, noise: dict[str, NoiseSpectrum]) -> tuple[Statement, ...]:
        statements = []
        by_drive = {pattern.d: pattern for pattern in self.ranking.patterns}
        for candidate in self.dated.unknowns:
            evidence = (self.dated_fits.evaluate(self.dated.without(candidate)).total
                        - self.dated.total if self.is_dated else self._evidence(candidate))
            for d, block in candidate.parts.items():
                statements.append(word_statement(
                    by_drive[d], candidate, self.dated.fit.of(block), evidence))
        drifting = levels(self.fits.regression.residuals, dict(noise), self.decisions)
        statements += [statement for name, statement in drifting.items()
                       if statement.amplitude > self._lack_of_fit[self.drives.index(name)]]
        return tuple(sorted(statements, key=lambda one: -one.evidence))

    @cached_property
    def _lack_of_fit(self) -> list[float]:
        """What the forms of the adopted effects may leave, by drive, rms [N].

        A share of their sum: what others nearly cancel is no force of a machine.
        """
        force = np.zeros(self.remaining.shape)
        for candidate in self.dated.effects:
            if candidate.effect.idealised:
                force += self.dated_fits.components.force(self.dated, candidate,
                                                          self.remaining.shape)
        return [self.decisions.form_share * root_mean_square(of_drive) for of_drive in force.T]

    def _candidates(self) -> tuple[RankedEffect, ...]:
        """Return the effects that were fitted as the only one, the best first."""
        none = self.ranking.nothing.cost
        return tuple(self._ranked(self.ranking.first, fitted, fitted.effects[0], none - fitted.cost)
                     for fitted in self.ranking.alone.values())

    def _suspects(self) -> tuple[RankedEffect, ...]:
        """Return effects that nearly pay beside those adopted: slow noise would do as well."""
        return tuple(self._ranked(self.fits, fitted, candidate, self.map_set.cost - fitted.cost)
                     for candidate, fitted in self.ranking.suspects(self.decisions.suspect_margin))

    def _ranked(self, fits: FittedSets, fitted: CandidateSet, candidate: EffectCandidate,
                evidence: float) -> RankedEffect:
        return RankedEffect(candidate.name, self.design.named(candidate.drives), evidence,
                            linear_error(fits, fitted))

    def _sets(self) -> tuple[RankedSet, ...]:
        if self.is_dated:
            # Those of the search are of constant forms.
            return (RankedSet(tuple((c.name, self.design.named(c.drives))
                                    for c in self.dated.candidates), CostTerms()),)
        # Of a linear set the cost is that in the first design. Less than the best, of which the
        # exact one is known, it is where that design means nothing any more.
        best, *others = self._of_each_name(self.ranking.sets, MOST_SETS)
        return (best, *sorted((fitted for fitted in others if fitted.cost >= 0),
                              key=lambda fitted: fitted.cost))

    def _barred(self) -> tuple[RankedSet, ...]:
        """Return the sets that would be rivals, or better, and may not be."""
        return self._of_each_name(self.ranking.barred(self.decisions.rival_margin), MOST_BARRED)

    def _of_each_name(self, sets: Iterable[CandidateSet], most: int) -> tuple[RankedSet, ...]:
        """Return the first set of every choice of names."""
        found: dict[frozenset[str], RankedSet] = {}
        for fitted in sets:
            told = self._told(fitted, self.map_set)
            found.setdefault(frozenset(name for name, _ in told.names), told)
            if len(found) == most:
                break
        return tuple(found.values())

    def _told(self, fitted: CandidateSet, best: CandidateSet) -> RankedSet:
        """Return a set against another one."""
        names = tuple((c.name, self.design.named(c.drives)) for c in fitted.candidates)
        return RankedSet(names, self.ranking.difference(fitted, best), fitted.barred)

    def _within_model_error(self, absorbed: Absorbed) -> WithinModelError:
        force = self.fits.components.force(absorbed.beside, absorbed.candidate,
                                           self.design.residuals.measured.shape)
        return WithinModelError(
            absorbed.candidate.name, self.design.named(absorbed.candidate.drives),
            float(np.sqrt(np.mean(force ** 2, axis=0)).max()), absorbed.of)


def rival_effects(diagnosis: Diagnosis, validate: Sequence[Recording] = (),
                  ) -> tuple[RivalEffect, ...]:
    """Return each rival that a diagnosis names, from the best set that holds it.

    Parameters
    ----------
    diagnosis : Diagnosis
    validate : sequence of Recording, optional
        Those of the diagnosis; without them held-out errors are taken on blocks.
    """
    selection = diagnosis.selection
    if selection is None:
        return ()
    found = []
    adopted = {c.name: c.placed_name for c in selection.reported.effects}
    for of, name in ((names[0], name) for names in diagnosis.indistinguishable
                     for name in names[1:]):
        best = next((fitted for fitted in selection.sets
                     if any(name in (c.name, c.placed_name) for c in fitted.effects)
                     and adopted[of] not in {c.placed_name for c in fitted.effects}), None)
        if best is None:
            continue
        fits = selection.fits_of(best)
        candidate = next(c for c in best.effects if name in (c.name, c.placed_name))
        remaining = linear_residual(fits, best)
        found.append(RivalEffect(
            candidate.effect, fits.design.named(candidate.drives),
            estimate(fits, best, candidate).parameters,
            fits.components.force(best, candidate, remaining.shape), of, linear_error(fits, best),
            _held_out(fits, best, validate), best.cost - selection.map_set.cost, remaining))
    return tuple(found)


def _held_out(fits: FittedSets, fitted: CandidateSet, validate: Sequence[Recording]) -> float:
    if not validate:
        return hold_out(fits, fitted).error
    try:
        return rms(measure_residuals(fitted_model(fits, fitted), validate)[0])
    except PprsError:
        return float('nan')
