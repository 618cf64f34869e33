# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Lack of fit of adopted effects: what a set holds beyond them may be no more than that.

The catalogue's friction, springs and cords are only nearly of the form that real ones have, and so
is the model's own friction. A further candidate on the same drives, whose whitened force beyond
all others is a small share of theirs, is within their model error: it is told as such and not
adopted. Not so where a drive would keep an error that stands out of its noise without it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.fitted_sets import LEAST_IMPROVEMENT, FittedSets
from pprs_dynamics.inference.search.model_discrepancy import discrepancy_ratio
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.physics.effects.drive_effect import DriveEffect


@dataclass(frozen=True)
class Remainder:
    """A candidate within the model error of others.

    Parameters
    ----------
    candidate : Candidate
    found : CandidateSet
        In which it was.
    of : tuple of str
        Whose lack of fit it may be.
    """

    candidate: Candidate
    found: CandidateSet
    of: tuple[str, ...]


def without_remainders(search: Search, best: CandidateSet,
                       ) -> tuple[CandidateSet, CandidateSet, tuple[Remainder, ...]]:
    """Return the best set, that without candidates within the model error of others, and these.

    What was best together with them may not be without: then something else may stand for it.
    Where that, with a lack of fit of its own, costs less than the set given, it is the best.
    """
    fits, before = search.fits, search.best
    kept, remainders = beyond_lack_of_fit(fits, best)
    while kept.total > best.total + fits.decisions.rival_margin:
        better = search.replaced(kept, lambda one: not _small(fits, one))
        if better is kept:
            break
        kept = better
    if search.best is not before and search.best.cost < best.cost - LEAST_IMPROVEMENT:
        return without_remainders(search, search.best)
    if remainders:
        # What paid beside them only is not kept for their sake, and neither are shapes.
        kept = fits.refined(fits.pruned(kept))
    names = {candidate.name for candidate in kept.candidates}
    return best, kept, tuple(one for one in remainders if one.candidate.name not in names)


def beyond_lack_of_fit(fits: FittedSets, best: CandidateSet,
                       ) -> tuple[CandidateSet, tuple[Remainder, ...]]:
    """Return what a set holds beyond the model error of its effects, and what is within it."""
    remainders: list[Remainder] = []
    kept = best
    while small := _small(fits, kept):
        # Of two that look like each other, either is small beyond the other.
        without = {candidate: fits.evaluate(kept.without(candidate)) for candidate in small}
        without = {candidate: found for candidate, found in without.items()
                   if _is_of_loads(fits, kept, candidate)
                   or _over_noise(fits, best, found) <= fits.decisions.left_ratio}
        if not without:
            break
        least = min(without, key=lambda candidate: without[candidate].total)
        remainders.append(Remainder(least, kept, small[least]))
        kept = without[least]
    return kept, tuple(remainders)


def _is_of_loads(fits: FittedSets, found: CandidateSet, candidate: Candidate) -> bool:
    """Return whether a candidate is friction of drives that an effect beside it loads.

    Friction may follow such loads or not, which is known to first order only.
    """
    return (isinstance(candidate, EffectCandidate) and candidate.effect.is_friction
            and issubclass(candidate.effect, DriveEffect)
            and any(fits.library.term(one).bare for other in found.effects
                    if other is not candidate for one in other.components))


def _over_noise(fits: FittedSets, best: CandidateSet, found: CandidateSet) -> float:
    """Return the largest rms that a set leaves on a drive, over the noise beside the best set."""
    regression = fits.regression
    noise = [regression.noise_floor(best.fit, d) for d in regression.drives]
    return float(np.max(regression.left(found.fit) / np.maximum(noise, 1e-300)))


def _small(fits: FittedSets, found: CandidateSet) -> dict[Candidate, tuple[str, ...]]:
    """Return the candidates within the model error of others, and of which."""
    small = {}
    for candidate in found.candidates:
        share, names = discrepancy_ratio(
            fits.design, fits.regression, fits.decisions, found, candidate)
        if share < 1:
            small[candidate] = names
    return small
