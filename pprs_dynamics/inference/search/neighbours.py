# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sets that differ by little from a set: a candidate, a drive or a coefficient less, or more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from pprs_dynamics.inference.search.candidates import (
    Candidate,
    CandidateSet,
    Component,
    EffectCandidate,
)
from pprs_dynamics.inference.search.components import placed
from pprs_dynamics.inference.search.fitted_sets import LEAST_IMPROVEMENT, Candidates, FittedSets


def with_instead(candidate: EffectCandidate, gone: Component, *instead: Component,
                 ) -> EffectCandidate:
    """Return the candidate with something else, or nothing, for one of its components."""
    return EffectCandidate.of([*(component for component in candidate.components
                                 if component is not gone),
                               *instead])


def exchanged(fitted: CandidateSet, old: Candidate, new: Candidate) -> Candidates:
    """Return the candidates of a set with another one for one of them."""
    return tuple(new if c is old else c for c in fitted.candidates)


def simplified(fits: FittedSets, fitted: CandidateSet) -> CandidateSet:
    """Return a set without candidates and drives, and in variants, as long as that costs less."""
    return _descended(fits, fitted,
                      lambda fitted: [*_with_fewer(fitted), *_otherwise(fits, fitted)])


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


def _on_more_drives(fits: FittedSets, fitted: CandidateSet) -> Iterator[Candidates]:
    """Yield a set with one of its effects on another drive more, as it is where it is strongest."""
    for candidate in fitted.effects:
        if candidate.drives is None:
            continue
        strongest = max(candidate.components,
                        key=lambda component: fits.drop_cost(fitted, component))
        for d in fits.regression.drives:
            if d not in candidate.drives and fits.design.acts_on(candidate.effect, d):
                yield exchanged(fitted, candidate, EffectCandidate.of([
                    *candidate.components, placed(fits.design, candidate.effect, d,
                                                  strongest.parameters, strongest.names)]))


def _with_fewer(best: CandidateSet) -> Iterator[Candidates]:
    for candidate in best.candidates if len(best.candidates) > 1 else ():
        yield best.without(candidate)


def _otherwise(fits: FittedSets, best: CandidateSet) -> Iterator[Candidates]:
    """Yield a set with one of its effects on fewer drives, or with other coefficients."""
    for candidate in best.effects:
        effect = candidate.effect
        # The drives where it matters most; fewer of them may be better though one less is not.
        strength = {component: fits.drop_cost(best, component)
                    for component in candidate.components}
        ranked = sorted(candidate.components, key=lambda component: -strength[component])
        most = 3 * fits.decisions.rival_margin
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
