# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer of the search: sets by cost, the one that is reported, and what stands beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.regression.carried_over import CarriedOver
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.absorbed import Absorbed, without_absorbed
from pprs_dynamics.inference.search.candidates import (
    Candidate,
    CandidateSet,
    Component,
    EffectCandidate,
    PlacedNames,
)
from pprs_dynamics.inference.search.cost_terms import CostTerms
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.fitted_model import linear_residual
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.relinearisation import search_around_fitted
from pprs_dynamics.inference.search.search import Search, patterns_of
from pprs_dynamics.inference.search.unknown import DrivePatterns
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.model.force_model import ForceModel

SAME = 1e-6  # of a column's square may lie outside the span of others that do the same


@dataclass(frozen=True)
class Rival:
    """A set that stands beside the one that was adopted.

    Parameters
    ----------
    fitted : CandidateSet
    missing, instead : tuple of str
        Names of adopted effects that it lacks, and what it has instead; neither is empty. An
        adopted effect on another link or joint is `NAME:PLACE`.
    """

    fitted: CandidateSet
    missing: tuple[str, ...]
    instead: tuple[str, ...]


@dataclass(frozen=True)
class Ranking:
    """All sets that were fitted, and what is to be said of them.

    Parameters
    ----------
    first, last : FittedSets
        Around the model as given, and around the last operating point: for looking closer.
    patterns : tuple of DrivePatterns
        Of no catalogue, around the last.
    of_first, of_last : tuple of CandidateSet
        Their sets, by cost.
    map_set, reported : CandidateSet
        Of the last: that of lowest cost, and without what is within the model error of others.
    absorbed : tuple of Absorbed
        What is.
    without : mapping of Candidate to CandidateSet
        The reported set without each of its candidates.
    order : tuple of EffectCandidate
        Those of the reported set, each the one that lowers most what those before it leave.
    path : tuple of CandidateSet
        From the patterns of the reported set to all of it, an effect more in each in that order.
    exact : mapping of PlacedNames to float
        What the sets of the shortlist cost by the exact forces of their own fitted models.
    """

    first: FittedSets = field(repr=False)
    last: FittedSets = field(repr=False)
    patterns: tuple[DrivePatterns, ...] = field(repr=False)
    of_first: tuple[CandidateSet, ...] = field(repr=False)
    of_last: tuple[CandidateSet, ...] = field(repr=False)
    map_set: CandidateSet
    reported: CandidateSet
    absorbed: tuple[Absorbed, ...]
    without: Mapping[Candidate, CandidateSet] = field(repr=False)
    order: tuple[EffectCandidate, ...] = field(repr=False)
    path: tuple[CandidateSet, ...] = field(repr=False)
    exact: Mapping[PlacedNames, float] = field(
        default_factory=lambda: MappingProxyType({}), repr=False)
    is_less: bool = False  # as held-out data did not confirm some effect

    @classmethod
    def of(cls, first: FittedSets, last: Search, map_set: CandidateSet) -> Ranking:
        """Return the ranking of the sets of two searches, and of what the answer needs beside."""
        map_set, reported, absorbed = without_absorbed(last, map_set)
        return cls._reporting(first, last.fits, last.patterns, map_set, reported, absorbed)

    @classmethod
    def _reporting(cls, first: FittedSets, last: FittedSets, patterns: tuple[DrivePatterns, ...],
                   map_set: CandidateSet, reported: CandidateSet, absorbed: tuple[Absorbed, ...],
                   ) -> Ranking:
        without = {gone: last.evaluate(reported.without(gone)) for gone in reported.candidates}
        order, path = _falling(last, map_set, reported)
        return cls(first, last, patterns, _by_cost(first.sets), _by_cost(last.sets), map_set,
                   reported, absorbed, MappingProxyType(without), order, path)

    def less(self, gone: EffectCandidate) -> Ranking:
        """Return the ranking without one of the reported effects, and what paid only beside it."""
        reported = self.last.pruned(self.without[gone])
        return replace(self._reporting(self.first, self.last, self.patterns, self.map_set, reported,
                                       self.absorbed), exact=self.exact, is_less=True)

    def reporting_nothing(self) -> Ranking:
        """Return the ranking with nothing reported, under the noise that the best set leaves."""
        return self._reporting(self.first, self.last, self.patterns, self.map_set,
                               self.last.evaluate(()), ())

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """Return the part of the error that each effect of `order` takes away.

        Of its root mean square over drives, each as a multiple of its noise, of the model as given.
        """
        given = self.first.design.residuals.error
        errors = [_over_noise(self.last, self.map_set, given), *(
            _over_noise(self.last, self.map_set, linear_residual(self.last, step))
            for step in self.path[1:])]
        return tuple((before - after) / errors[0]
                     for before, after in pairwise(errors)) if errors[0] > 0 else ()

    @cached_property
    def sets(self) -> tuple[CandidateSet, ...]:
        """Sets of both searches, the best first, the others by cost.

        A set belongs to the search around whose point it is linear: those with a
        nonlinear effect to the last, the others to the first.
        """
        found = list(self.of_last)
        if self.first is not self.last:
            found = [fitted for fitted in self.of_last if fitted.is_nonlinear] + [
                fitted for fitted in self.of_first if not fitted.is_nonlinear]
        return (self.map_set, *_by_cost([
            other for other in found if other is not self.map_set and other.is_admissible]))

    def barred(self, margin: float) -> tuple[CandidateSet, ...]:
        """Return the sets that would cost less than a margin more than the best, and may not be."""
        found = [fitted for fitted in (*self.of_last, *(
            self.of_first if self.first is not self.last else ())) if fitted.barred
            and fitted.total < self.map_set.total + margin]
        return tuple(sorted(found, key=lambda fitted: fitted.total))

    @property
    def nothing(self) -> CandidateSet:
        """The empty set around the model as given."""
        return next(fitted for fitted in self.of_first if not fitted.candidates)

    @property
    def alone(self) -> dict[str, CandidateSet]:
        """The best set of each effect that was fitted as the only one, by its name."""
        found: dict[str, CandidateSet] = {}
        for fitted in self.of_first:
            if len(fitted.candidates) == 1 and fitted.effects and fitted.is_admissible:
                found.setdefault(fitted.effects[0].name, fitted)
        return found

    def fits_of(self, fitted: CandidateSet) -> FittedSets:
        """Return the fitted sets that a set is of."""
        return self.last if any(other is fitted for other in self.of_last) else self.first

    def best_with(self, candidate: EffectCandidate) -> CandidateSet:
        """Return the set of lowest cost with an effect of the reported set."""
        return min((self.reported, *(fitted for fitted in self._judged if _has(fitted, candidate))),
                   key=lambda fitted: self.difference(fitted, self.map_set).total)

    def best_without(self, candidate: EffectCandidate) -> CandidateSet:
        """Return the set of lowest cost without an effect of the reported set, whatever is in it.

        An effect on other drives or in another shape is the same one; a body on another link is
        another.
        """
        # Of one choice of effects that was ranked by exact forces, these stand for all its sets.
        others = [fitted for fitted in self._judged if not _has(fitted, candidate)
                  and (fitted.placed_names not in self.exact or fitted in self._exact_costs)]
        return min((self.without[candidate], *others),
                   key=lambda fitted: self.difference(fitted, self.map_set).total)

    def difference(self, fitted: CandidateSet, other: CandidateSet) -> CostTerms:
        """Return the terms of what a set costs more than another, exactly where both are known."""
        terms, exact = fitted.terms - other.terms, self._exact_costs
        if fitted not in exact or other not in exact:
            return terms
        return terms + CostTerms(linearisation=(exact[fitted] - fitted.total)
                                 - (exact[other] - other.total))

    @cached_property
    def _exact_costs(self) -> Mapping[CandidateSet, float]:
        """What the sets of the shortlist cost: of each choice of effects the first."""
        first: dict[PlacedNames, CandidateSet] = {}
        for fitted in self.sets:
            first.setdefault(fitted.placed_names, fitted)
        return {first[names]: cost for names, cost in self.exact.items() if names in first}

    @property
    def _judged(self) -> list[CandidateSet]:
        """Sets without what is within the model error of others, which pays but is not reported."""
        ignored = {absorbed.candidate.name for absorbed in self.absorbed}
        return [fitted for fitted in self.sets
                if not ignored & {candidate.name for candidate in fitted.candidates}]

    def near(self, margin: float) -> tuple[CandidateSet, ...]:
        """Return the sets of the last search within a margin of the best."""
        return tuple(fitted for fitted in self.of_last if fitted.cost < self.map_set.cost + margin)

    def nearly(self, margin: float) -> list[tuple[float, CandidateSet]]:
        """Return other sets of the last search within a margin, and what they cost more.

        What exact forces cost more than linear ones is that of the first set of the same effects,
        and as much as of the reported set where it is not known.
        """
        departs = {fitted.placed_names: cost - fitted.total
                   for fitted, cost in self._exact_costs.items()}
        mine = departs.get(self.reported.placed_names, 0.0)

        def more(fitted: CandidateSet) -> float:
            return fitted.cost - self.reported.cost + departs.get(fitted.placed_names, mine) - mine

        costs = [(more(fitted), fitted) for fitted in self.of_last if fitted is not self.reported]
        least = more(self.map_set) + margin
        return sorted(((cost, fitted) for cost, fitted in costs if cost < least),
                      key=lambda pair: pair[0])

    def rivals(self, margin: float) -> list[Rival]:
        """Return sets with other effects than the reported ones so near the best, the best first.

        To have what is within the model error of others makes no rival.
        """
        mine = {candidate.placed_name: candidate.name for candidate in self.reported.effects}
        ignored = {absorbed.candidate.name for absorbed in self.absorbed}
        rivals = []
        for other in self.sets:
            if other.cost > self.map_set.cost + margin:
                break
            theirs = {candidate.placed_name: candidate.name for candidate in other.effects
                      if candidate.name not in ignored}
            missing = sorted(name for placed_name, name in mine.items()
                             if placed_name not in theirs)
            instead = sorted(placed_name if name in mine.values() else name
                             for placed_name, name in theirs.items()
                             if placed_name not in mine)
            if (missing and instead and not self._is_freer(other, missing, instead)
                    and not self._is_beaten(other, margin)):
                rivals.append(Rival(other, tuple(missing), tuple(instead)))
        return [*rivals, *self._within_each_other(), *self._at_one_load()]

    def _within_each_other(self) -> Iterator[Rival]:
        """Yield what was left out where as well the effect that stayed could have been.

        Each is within the lack of fit of the other, however much more one of them costs.
        """
        names = {effect.name for effect in self.reported.effects}
        for absorbed in self.absorbed:
            for other, found in absorbed.instead:
                if other.name in names and found.is_admissible:
                    yield Rival(found, (other.name,), (absorbed.candidate.name,))

    def _is_beaten(self, other: CandidateSet, margin: float) -> bool:
        """Return whether a set is no rival by the exact forces of its own model."""
        mine, theirs = (self.exact.get(fitted.placed_names) for fitted in (self.map_set, other))
        return mine is not None and theirs is not None and theirs > mine + margin

    def _at_one_load(self) -> Iterator[Rival]:
        """Yield the reported set with friction by load for one that no load changes, or back.

        However exact one of them fits: where the load hardly varies, friction that varies as
        little along its guide does the same.
        """
        design, names = self.last.design, {candidate.name for candidate in self.reported.effects}
        for candidate in self.reported.effects:
            other = catalogue().get(candidate.effect.at_one_load)
            if (other is None or other.name in names or not issubclass(other, DriveEffect)
                    or not candidate.drives
                    or not all(design.acts_on(other, d) for d in candidate.drives)):
                continue
            force = self.last.components.force(self.reported, candidate,
                                               design.residuals.measured.shape)
            for coefficients in sorted(other.variants, key=len):
                instead = [Component.of(other, d, {}, coefficients) for d in candidate.drives]
                if not all(self._does_nearly(component, force) for component in instead):
                    continue
                fitted = self.last.evaluate((*self.reported.without(candidate),
                                             EffectCandidate.of(instead)))
                if fitted.is_admissible:
                    yield Rival(fitted, (candidate.name,), (other.name,))
                    break

    def _does_nearly(self, component: Component, force: Array) -> bool:
        """Return whether an effect on a drive does what a force (M, D) does, while it moves."""
        term, d = self.last.components.term(component), component.drive
        assert d is not None
        moving = self.last.design.moving(d)
        rows = term.rows[d][[term.names.index(name) for name in component.names]][:, moving]
        wanted = force[moving, d]
        left = wanted - np.linalg.lstsq(rows.T, wanted, rcond=None)[0] @ rows
        return root_mean_square(left) <= self.last.decisions.one_load * root_mean_square(wanted)

    def _is_freer(self, other: CandidateSet, missing: Sequence[str], instead: Sequence[str],
                  ) -> bool:
        """Return whether what a set has instead does all that is missing, with more coefficients.

        Viscous friction is asymmetric friction that is the same in both directions: a freer form
        that costs more is no other explanation. Of friction only: what else is one thing in a
        recording (a spring and a mass along one sine) is one thing on no other motion.
        """
        for component in (component for c in self.reported.effects if c.name in missing
                          for component in c.components):
            theirs = [other.blocks[two].rows[component.drive] for c in other.effects
                      if c.name in instead and c.effect.is_friction for two in c.components
                      if component.drive is not None and two.drive == component.drive]
            if component.drive is None or not component.effect.is_friction or not theirs:
                return False
            mine = self.reported.blocks[component].rows[component.drive]
            columns = np.concatenate(theirs)
            if len(columns) <= len(mine):
                return False
            left = mine - np.linalg.lstsq(columns.T, mine.T, rcond=None)[0].T @ columns
            if np.sum(left ** 2) > SAME * np.sum(mine ** 2):
                return False
        return True

    def suspects(self, margin: float) -> list[tuple[EffectCandidate, CandidateSet]]:
        """Return effects that nearly pay beside the best, with their sets: noise would do it."""
        mine = {c.key for c in self.map_set.candidates}
        names = {c.name for c in self.map_set.effects}
        found: dict[str, tuple[EffectCandidate, CandidateSet]] = {}
        for fitted in self.near(margin):
            more = [c for c in fitted.effects if c.key not in mine]
            if (len(more) == 1 and len(fitted.candidates) == len(mine) + 1
                    and fitted.cost > self.map_set.cost and more[0].name not in names):
                found.setdefault(more[0].name, (more[0], fitted))
        return list(found.values())


def select(model: ForceModel, recordings: Sequence[Recording], decisions: Decisions,
           progress: Callable[[float], None] | None = None,
           carry_over: Callable[[Design], CarriedOver] | None = None) -> Ranking:
    """Return all sets of effects that were tried, around the fitted model where that matters.

    `carry_over` says what a reference run knows of the recordings.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    design = Design.of(model, recordings, lambda share: report(0.25 * share))
    design = design.beside(carry_over and carry_over(design))
    first = FittedSets(design, decisions)
    search = Search(first, patterns_of(first), lambda share: report(0.25 + 0.35 * share))
    last, best, exact = search_around_fitted(search, report)
    report(1.0)
    return replace(Ranking.of(first, last, best), exact=MappingProxyType(exact))


def without_search(model: ForceModel, recordings: Sequence[Recording], decisions: Decisions,
                   progress: Callable[[float], None] | None = None) -> Ranking:
    """Return the ranking of the empty set alone: what the model as given leaves, and its noise.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    fits = FittedSets(Design.of(model, recordings, progress), decisions)
    nothing = fits.evaluate(())
    return Ranking._reporting(fits, fits, (), nothing, nothing, ())


def _has(fitted: CandidateSet, candidate: EffectCandidate) -> bool:
    return any(effect.placed_name == candidate.placed_name for effect in fitted.effects)


def _by_cost(sets: Sequence[CandidateSet]) -> tuple[CandidateSet, ...]:
    return tuple(sorted(sets, key=lambda fitted: fitted.cost))


def _falling(fits: FittedSets, map_set: CandidateSet, reported: CandidateSet,
             ) -> tuple[tuple[EffectCandidate, ...], tuple[CandidateSet, ...]]:
    """Return the effects of a set, what lowers the error most first, and the sets on the way.

    As a multiple of each drive's noise, since drives may be of different sizes and units. Without
    the patterns: one over a position takes most of what a weight does there.
    """
    order: list[EffectCandidate] = []
    left = list(reported.effects)
    while left:
        following = left[0] if len(left) == 1 else min(left, key=lambda candidate: _over_noise(
            fits, map_set, linear_residual(fits, fits.evaluate((*order, candidate)))))
        order.append(following)
        left.remove(following)
    path = [fits.evaluate((*order[:count], *reported.unknowns)) for count in range(len(order))]
    return tuple(order), (*path, reported)


def _over_noise(fits: FittedSets, map_set: CandidateSet, left: Array) -> float:
    """Return the root of the mean square of errors (M, D), over the noise of each drive."""
    return root_mean_square([
        root_mean_square(left[:, d]) / max(fits.regression.noise_floor(map_set.fit, d), 1e-12)
        for d in fits.regression.drives])
