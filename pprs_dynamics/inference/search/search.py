# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Search for the set of effects with the lowest cost.

The cost of a set is its penalised deviance (`regression.joint_fit`) plus the prior costs of what
was chosen (`PriorCosts`). From the best set, effects are added, placed on other drives, dropped,
replaced and merged, until no neighbour is better. A scan at the noise of a fit proposes, a fit
with its own noise decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from pprs_dynamics.inference.search.candidates import (
    Candidate,
    Candidates,
    CandidateSet,
    Component,
    EffectCandidate,
    UnknownCandidate,
    joined,
)
from pprs_dynamics.inference.search.components import placed
from pprs_dynamics.inference.search.fitted_model import is_shown
from pprs_dynamics.inference.search.fitted_sets import LEAST_IMPROVEMENT, FittedSets
from pprs_dynamics.inference.search.scan import Scan, with_fast_noise
from pprs_dynamics.inference.search.unknown import DrivePatterns, best_patterns
from pprs_dynamics.physics.effects.catalogue import catalogue

# In a set: bounds of the effort. With four patterns, other effects stood for the same pattern on
# the last two of six drives.
MOST_EFFECTS, MOST_UNKNOWN = 6, 6
BEAM, PROPOSALS = 3, 6  # sets from which effects are added, and candidates of a scan for the best
REPLACEMENTS = 3  # candidates tried in the place of one or of two
INADMISSIBLE = 2  # sets of which parts are tried: often they differ by little
REFINED, FIRST_REFINED = 3, 6  # of the sets fitted in a round, and of those of one effect
USUAL_STEPS = 50  # sets fitted and drives scanned, after which a bar stands at half
# How much worse than the best a replacement may look at the best one's noise (its own noise may
# favour it by about as much), and how much of what is lost without it it has to make good there.
REPLACED, RECOVERED = 15.0, 0.9


class Search:
    """A search over the candidates of one design.

    Parameters
    ----------
    fits : FittedSets
    patterns : sequence of DrivePatterns, optional
        Patterns of no catalogue that take part, see `patterns_of`; by default none do.
    progress : callable, optional
        Called with the share of the work that is done.
    """

    def __init__(self, fits: FittedSets, patterns: Sequence[DrivePatterns] = (),
                 progress: Callable[[float], None] | None = None) -> None:
        self.fits, self.patterns = fits, tuple(patterns)
        self.scan = Scan(fits)
        self._report, self._steps, self.is_ended = progress or (lambda share: None), 0, False

    @property
    def best(self) -> CandidateSet:
        """The set of lowest cost so far."""
        return self.fits.best

    def run(self, start: Candidates = ()) -> CandidateSet:
        """Return the best set that the search reaches, by effects alone at first.

        Patterns of no catalogue are added after effects. Where the exact forces of the best set are
        no longer those of the columns the search ends before its end: what would come next might
        only make good the difference.
        """
        self.fits.stepped, self.is_ended = self._stepped, False
        try:
            self.fits.evaluate(())
            if start:
                self.fits.refined(self.fits.evaluate(start))
            self.is_ended = self._descend(False) and (
                not self.patterns or self._descend(True))
            return self.best
        finally:
            # The fits hold hundreds of megabytes, and are let go of where nothing names them.
            self.fits.stepped = lambda: None
            self._report(1.0)

    def _stepped(self) -> None:
        """Report progress that always rises: the amount of work is not known."""
        self._steps += 1
        self._report(self._steps / (self._steps + USUAL_STEPS))

    def _descend(self, with_patterns: bool) -> bool:
        """Move from the best set to better neighbours; return whether until there is none."""
        while True:
            before = self.best.cost
            self._fit(self._additions(with_patterns))
            if not self.best.cost < before - LEAST_IMPROVEMENT:
                # What one effect stood for may be superfluous beside what replaced another.
                near = [fitted for fitted in self._fit(self._replacements(self.best))
                        if fitted.cost < self.best.cost + self.fits.decisions.rival_margin]
                for fitted in sorted(near, key=lambda fitted: fitted.cost)[:REFINED]:
                    simplified(self.fits, fitted)
            for fitted in self._inadmissible():
                self._fit(self._with_others(fitted))
                self._fit(reduced(fitted, component) for component in fitted.blocks)
            simplified(self.fits, self.best)
            self._fit(self._with_same_form())
            if not self.best.cost < before - LEAST_IMPROVEMENT:
                return True
            if not is_shown(self.fits, self.best):
                return False

    def _with_same_form(self) -> Iterator[Candidates]:
        """Yield sets with the form error that lowers the cost of the best set.

        What it is made of without one of its effects, and others that cost as little without it.
        """
        best, known, form = self.best, self.best.with_form, self.best.form
        if known is None:
            return
        yield from map(known.without, known.candidates)
        names = {c.name for c in form}
        most = best.plain + self.fits.decisions.rival_margin
        for fitted in self.fits.sets:
            if fitted.is_admissible and fitted.plain < most and names.isdisjoint(
                    c.name for c in fitted.candidates):
                yield (*fitted.candidates, *form)

    def _inadmissible(self) -> list[CandidateSet]:
        """Return inadmissible sets that would be the best: a part of one may be the best."""
        found = [fitted for fitted in self.fits.sets
                 if fitted.barred and fitted.total < self.best.cost + LEAST_IMPROVEMENT]
        return sorted(found, key=lambda fitted: fitted.total)[:INADMISSIBLE]

    # Moves

    def _fit(self, sets: Iterable[Candidates]) -> list[CandidateSet]:
        """Return new sets, fitted; bring those that may be the best to where they cost least."""
        new = [self.fits.evaluate(candidates) for candidates in sets
               if not self.fits.has(candidates) and self._is_bounded(candidates)]
        # A pattern of no catalogue is at its best from the start, an effect once its shape is.
        shaped = [fitted for fitted in new if any(component.effect.shape or component.centre
                                                  for component in fitted.blocks)]
        # The first effect decides which way the search goes.
        for number, fitted in enumerate(sorted(shaped, key=lambda shaped: shaped.total)):
            if number < (FIRST_REFINED if len(fitted.candidates) == 1 else REFINED):
                self.fits.refined(fitted)
        # A scan puts it where each drive pays by itself: with others that is seldom right.
        for fitted in new:
            if len(fitted.candidates) == len(fitted.effects) == 1:
                simplified(self.fits, fitted)
        return new

    @staticmethod
    def _is_bounded(candidates: Candidates) -> bool:
        unknown = sum(isinstance(candidate, UnknownCandidate) for candidate in candidates)
        return unknown <= MOST_UNKNOWN and len(candidates) - unknown <= MOST_EFFECTS

    def _additions(self, with_patterns: bool) -> list[Candidates]:
        """Return sets with one candidate more, or on more drives, from the best few sets."""
        found: list[Candidates] = []
        ranked = sorted(self.fits.sets, key=lambda fitted: fitted.cost)
        if with_patterns:
            # Beside an effect that imitates them patterns may be within its form error.
            base = next(fitted for fitted in ranked if not fitted.effects)
            found += [(*base.candidates, pattern)
                      for pattern in best_patterns(self.patterns, base.fit, REPLACEMENTS)]
        for rank, base in enumerate(ranked[:BEAM]):
            count = PROPOSALS if rank == 0 else 2
            found += self.scan.proposals(base, count)
            if base.with_form is not None:
                found += self.scan.proposals(base.with_form, count)
            if rank == 0:
                fast = replace(base, fit=with_fast_noise(self.fits.regression, base.fit))
                found += self.scan.proposals(fast, REPLACEMENTS)
                for near in (base, fast) if with_patterns else ():
                    patterns = best_patterns(self.patterns, near.fit, REPLACEMENTS)
                    found += [(*base.candidates, pattern) for pattern in patterns]
        return found

    def _replacements(self, best: CandidateSet) -> Iterator[Candidates]:
        """Yield sets in which something else replaces candidates.

        Under the noise of the set, so that a replacement that explains as much is seen to.
        """
        yield from self._with_others(best)
        for candidate in best.effects:
            for component in candidate.components if candidate.effect.shape else ():
                yield from self._reshaped(best, candidate, component)

    def _with_others(self, best: CandidateSet) -> Iterator[Candidates]:
        """Yield sets in which another effect replaces one or two candidates."""
        for candidate in best.candidates:
            # Whatever stands for one effect as well is a rival: all of them are fitted.
            yield from self._instead(best, best.without(candidate), None)
        for candidate in best.effects:
            # Friction that differs by direction contains other effects, another on each drive: an
            # offset beside friction that is the same both ways.
            if candidate.effect.symmetric:
                yield from self._instead(
                    best, _same_both_ways(self.fits, best, candidate), REPLACEMENTS)
                for component in candidate.components if len(candidate.components) > 1 else ():
                    yield from self._instead(best, reduced(best, component), REPLACEMENTS)
        for pair in combinations(best.candidates, 2):
            if any(isinstance(candidate, EffectCandidate) for candidate in pair):
                yield from self._instead(best, best.without(*pair), REPLACEMENTS)

    def _reshaped(self, best: CandidateSet, candidate: EffectCandidate, component: Component,
                  ) -> Iterator[Candidates]:
        """Yield a set with an effect on one drive in the shapes that a scan has there."""
        if component.drive is not None and component.course is None:
            base = self.fits.at_noise_of(best, reduced(best, component))
            for other in self.fits.components.local[component.drive].best_shapes(
                    base.fit, component, REPLACEMENTS):
                yield exchanged(best, candidate, with_instead(candidate, component, other))

    def _instead(self, best: CandidateSet, rest: Candidates, count: int | None,
                 ) -> list[Candidates]:
        """Return a part of a set with an effect that makes good most of what it lacks."""
        base = self.fits.at_noise_of(best, rest)
        return self.scan.proposals(base, count, RECOVERED * (base.total - best.total) - REPLACED)


def patterns_of(fits: FittedSets) -> list[DrivePatterns]:
    """Return the patterns of no catalogue of all drives."""
    return [DrivePatterns(fits.regression, fits.prior_costs, d) for d in fits.regression.drives]


def with_instead(candidate: EffectCandidate, gone: Component, instead: Component,
                 ) -> EffectCandidate:
    """Return the candidate with another component for one of its own."""
    return EffectCandidate.of([*(component for component in candidate.components
                                 if component is not gone), instead])


def reduced(fitted: CandidateSet, gone: Component) -> Candidates:
    """Return the candidates of a set without a component."""
    kept = (tuple(component for component in c.components if component != gone)
            if isinstance(c, EffectCandidate) else () for c in fitted.candidates)
    return tuple(EffectCandidate.of(components) if components else c
                 for c, components in zip(fitted.candidates, kept, strict=True)
                 if components or not c.components)


def exchanged(fitted: CandidateSet, old: Candidate, new: Candidate) -> Candidates:
    """Return the candidates of a set with another one for one of them."""
    return tuple(new if c is old else c for c in fitted.candidates)


def simplified(fits: FittedSets, fitted: CandidateSet) -> CandidateSet:
    """Return a set with less, and in variants, as long as that costs less.

    Without candidates and drives, or with friction that is the same in both directions.
    """
    return _descended(fits, fitted,
                      lambda fitted: [*_with_fewer(fits, fitted), *_otherwise(fits, fitted)])


def of_same_names(fits: FittedSets, fitted: CandidateSet) -> CandidateSet:
    """Return the set of least cost of the same effects: on other drives, in other variants.

    Where it is barred, also without its patterns of no catalogue: around their own model its
    effects may explain what these stood for. A pattern that may be there is not dropped here,
    where no other may join for it: a bump came out as ripple at one scale of a robot and as none
    at another.
    """
    return _descended(fits, fitted, lambda fitted: [
        *_otherwise(fits, fitted), *_on_more_drives(fits, fitted),
        *[fitted.effects] * bool(fitted.barred and fitted.unknowns)])


def _descended(fits: FittedSets, fitted: CandidateSet,
               neighbours: Callable[[CandidateSet], Iterable[Candidates]]) -> CandidateSet:
    while True:
        best = min(map(fits.evaluate, neighbours(fitted)), key=lambda fitted: fitted.cost,
                   default=fitted)
        if not best.cost < fitted.cost - LEAST_IMPROVEMENT:  # both may be inadmissible: inf
            return fitted
        fitted = fits.refined(best)


def _may_share(fits: FittedSets, candidate: EffectCandidate) -> bool:
    """Return whether shapes of an effect on several drives may be one: what they measure is."""
    parts = candidate.components
    return bool(candidate.effect.shape and len(parts) > 1 and not candidate.shared
                and len({fits.design.given.units[d].turns for d in candidate.drives or ()}) == 1)


def _same_both_ways(fits: FittedSets, fitted: CandidateSet, candidate: EffectCandidate,
                    ) -> Candidates:
    """Return a set with friction that is the same in both directions for one that is not."""
    found = fitted.without(candidate)
    for component in candidate.components:
        known = {(part.effect.name, part.drive) for c in found for part in c.components}
        for name in dict.fromkeys(map(candidate.effect.symmetric.__getitem__, component.names)):
            if (name, component.drive) not in known:
                effect = catalogue()[name]
                found = joined(found, [replace(placed(
                    fits.design, effect, component.drive, {},
                    tuple(c.name for c in effect.coefficients)), course=component.course)])
    return found


def _on_more_drives(fits: FittedSets, fitted: CandidateSet) -> Iterator[Candidates]:
    """Yield a set with an effect on one drive more, in the shape of its strongest drive."""
    for candidate in fitted.effects:
        if candidate.drives is None:
            continue
        strongest = max(candidate.components,
                        key=lambda component: fits.drop_cost(fitted, component))
        for d in fits.regression.drives:
            if d not in candidate.drives and fits.design.acts_on(candidate.effect, d):
                yield exchanged(fitted, candidate, EffectCandidate.of([
                    *candidate.components, replace(placed(
                        fits.design, candidate.effect, d, strongest.parameters, strongest.names),
                        is_shared=strongest.is_shared)]))


def _with_fewer(fits: FittedSets, best: CandidateSet) -> Iterator[Candidates]:
    for candidate in best.candidates if len(best.candidates) > 1 else ():
        yield best.without(candidate)
    for effect in best.effects:
        if effect.effect.symmetric:
            yield _same_both_ways(fits, best, effect)


def _otherwise(fits: FittedSets, best: CandidateSet) -> Iterator[Candidates]:
    """Yield a set with one of its effects on fewer drives, or with other coefficients."""
    for candidate in best.effects:
        effect = candidate.effect
        # The drives where it matters most; fewer of them may be better though one less is not.
        strength = {component: fits.drop_cost(best, component)
                    for component in candidate.components}
        ranked = sorted(candidate.components, key=lambda component: -strength[component])
        most = 3 * fits.decisions.rival_margin
        if _may_share(fits, candidate):
            yield exchanged(best, candidate, fits.of_one_shape(best, candidate))
        for count in range(1, len(ranked)):
            if sum(strength[component] for component in ranked[count:]) < most:
                yield exchanged(best, candidate, EffectCandidate.of(ranked[:count]))
        if len({component.names for component in candidate.components}) > 1:
            for names in effect.variants:
                yield exchanged(best, candidate, EffectCandidate.of(
                    fits.components.variant(component, names)
                    for component in candidate.components))
        for component in candidate.components:
            for other in fits.components.variants(component):
                # The others take part in every scan.
                if other.names != component.names and not set(other.names) <= set(effect.scanned):
                    yield exchanged(best, candidate, with_instead(candidate, component, other))
