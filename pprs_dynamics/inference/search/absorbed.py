# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the discrepancy of adopted effects absorbs: the rest of a set may be no more than that.

The catalogue's friction, springs and cords are only nearly of the form that real ones have, and so
is the model's own friction. A further candidate on the same drives, whose whitened force beyond
all others is a small share of theirs, is within their discrepancy: it is told as such and not
adopted. Not so where a drive would keep an error that stands out of its noise without it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.fitted_sets import LEAST_IMPROVEMENT, FittedSets
from pprs_dynamics.inference.search.model_discrepancy import discrepancy_ratio
from pprs_dynamics.inference.search.possible_values import is_possible
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.physics.effects.drive_effect import DriveEffect


@dataclass(frozen=True)
class Absorbed:
    """A candidate within the model discrepancy of others.

    Parameters
    ----------
    candidate : Candidate
    beside : CandidateSet
        In which it was.
    of : tuple of str
        Whose lack of fit it may be.
    instead : tuple of (EffectCandidate, CandidateSet)
        Others of which the same holds, and the set without each of these in its place.
    """

    candidate: Candidate
    beside: CandidateSet
    of: tuple[str, ...]
    instead: tuple[tuple[EffectCandidate, CandidateSet], ...] = ()


def without_absorbed(search: Search, map_set: CandidateSet,
                     ) -> tuple[CandidateSet, CandidateSet, tuple[Absorbed, ...]]:
    """Return the MAP set, the one that is reported, and what that lacks of it as discrepancy.

    What was best together with them may not be without: then something else may stand for it.
    Where that, with a discrepancy of its own, costs less than the set given, it is the MAP set.
    """
    fits, cheapest = search.fits, search.best
    reported, absorbed = beyond_discrepancy(fits, map_set)
    while reported.total > map_set.total + fits.decisions.rival_margin:
        replaced = search.replaced(reported, lambda other: not _absorbable(fits, other)
                                   and is_possible(fits, other))
        if replaced is reported:
            break
        reported = replaced
    if (search.best is not cheapest
            and search.best.cost < map_set.cost - LEAST_IMPROVEMENT):
        return without_absorbed(search, search.best)
    if absorbed:
        # What paid beside them only is not kept for their sake, and neither are shapes.
        reported = fits.refined(fits.pruned(reported))
    names = {candidate.name for candidate in reported.candidates}
    return map_set, reported, tuple(pair for pair in absorbed if pair.candidate.name not in names)


def beyond_discrepancy(fits: FittedSets, map_set: CandidateSet,
                       ) -> tuple[CandidateSet, tuple[Absorbed, ...]]:
    """Return what a set holds beyond the discrepancy of its effects, and what is within it."""
    absorbed: list[Absorbed] = []
    rest = map_set
    while absorbable := _absorbable(fits, rest):
        # Of two that look like each other, either is small beyond the other.
        less = {candidate: fits.evaluate(rest.without(candidate)) for candidate in absorbable}
        less = {candidate: smaller for candidate, smaller in less.items()
                if _is_of_loads(fits, rest, candidate)
                or _over_noise(fits, map_set, smaller) <= fits.decisions.left_ratio}
        if not less:
            break
        gone = min(less, key=lambda candidate: less[candidate].total)
        absorbed.append(Absorbed(gone, rest, absorbable[gone], tuple(
            (other, fits.evaluate(rest.without(other))) for other in less
            if other is not gone and isinstance(other, EffectCandidate))
            if isinstance(gone, EffectCandidate) else ()))
        rest = less[gone]
    return rest, tuple(absorbed)


def _is_of_loads(fits: FittedSets, fitted: CandidateSet, candidate: Candidate) -> bool:
    """Return whether a candidate is friction of drives that an effect beside it loads.

    Friction may follow such loads or not, which is known to first order only.
    """
    return (isinstance(candidate, EffectCandidate) and candidate.effect.is_friction
            and issubclass(candidate.effect, DriveEffect)
            and any(fits.components.term(component).bare for other in fitted.effects
                    if other is not candidate for component in other.components))


def _over_noise(fits: FittedSets, map_set: CandidateSet, smaller: CandidateSet) -> float:
    """Return the largest rms that a set leaves on a drive, over the noise beside the MAP set."""
    regression = fits.regression
    noise = [regression.noise_floor(map_set.fit, d) for d in regression.drives]
    return float(np.max(regression.left(smaller.fit) / np.maximum(noise, 1e-300)))


def _absorbable(fits: FittedSets, fitted: CandidateSet) -> dict[Candidate, tuple[str, ...]]:
    """Return the candidates within the model discrepancy of others, and of which."""
    ratios = {candidate: discrepancy_ratio(fits.design, fits.regression, fits.decisions, fitted,
                                           candidate) for candidate in fitted.candidates}
    return {candidate: names for candidate, (ratio, names) in ratios.items() if ratio < 1}
