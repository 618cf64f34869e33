"""Lack of fit of adopted effects: what a set holds beyond them may be no more than that.

The catalogue's friction, springs and cords are only nearly of the form that real ones have, and so
is the model's own friction. A further candidate on the same drives, whose whitened force beyond
all others is a small share of theirs, is within their model error: it is told as such and not
adopted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.regression.joint_fit import Block
from pprs_dynamics.selection.candidates import (
    Candidate,
    CandidateSet,
    EffectCandidate,
)
from pprs_dynamics.selection.search import Search


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
                       ) -> tuple[CandidateSet, tuple[Remainder, ...]]:
    """Return the set without candidates that are within the model error of others."""
    remainders: list[Remainder] = []
    while True:
        shares = {candidate: _share_of_allowance(search, best, candidate)
                  for candidate in best.candidates}
        smallest = min(shares, key=lambda candidate: shares[candidate][0], default=None)
        if smallest is None or shares[smallest][0] >= 1:
            return best, tuple(remainders)
        remainders.append(Remainder(smallest, best, shares[smallest][1]))
        best = search.evaluate(tuple(c for c in best.candidates if c is not smallest), best)


def _share_of_allowance(search: Search, found: CandidateSet, candidate: Candidate,
                        ) -> tuple[float, tuple[str, ...]]:
    """Return a candidate's force beyond the others over what their lack of fit may leave."""
    decisions = search.decisions
    # Masses, gravity and sensors are exact: nothing else's lack of fit looks like them by much.
    exact = isinstance(candidate, EffectCandidate) and not candidate.effect.idealised
    share = decisions.own_form_share if exact else decisions.form_share
    drives = {d for block in candidate.blocks for d in block.rows}
    allowed, names = 0.0, []
    for other in found.effects:
        if other is candidate or not other.effect.idealised:
            continue
        size = sum(whitened_square(search, found, block, drives) for block in other.blocks)
        if size > 0:
            allowed += share ** 2 * size
            names.append(other.name)
    for effect in search.design.given.effects:
        if isinstance(effect, CatalogueEffect) and effect.idealised:
            allowed += share ** 2 * _square_of_part(search, found, effect.name, drives)
            names.append(effect.name)
    own = decisions.own_form_share ** 2 * _own_friction(search, found, drives)
    if own > allowed:
        names = ["the model's own friction"]
    square = beyond_others(found, candidate)
    return float(np.sqrt(square / max(allowed + own, 1e-300))), tuple(names)


def beyond_others(found: CandidateSet, candidate: Candidate) -> float:
    """Return the whitened square of what no refit of the others makes good."""
    free = [block for block in candidate.blocks if not block.is_fixed]
    if not free:
        return np.inf
    index = np.concatenate([np.arange(place.start, place.stop) for place in (
        found.fit.places[block] for block in free)])
    c = found.fit.coefficients[index]
    return float(c @ np.linalg.solve(found.fit.covariance[np.ix_(index, index)], c))


def whitened_square(search: Search, found: CandidateSet, block: Block, drives: set[int]) -> float:
    """Return the whitened square of a block's force on some drives."""
    regression, total = search.regression, 0.0
    c = found.fit.of(block)
    for d in drives & set(block.rows):
        gram = np.tensordot(regression.weights(found.fit, d),
                            regression.products(block, block, d), 1)
        total += float(c @ gram @ c)
    return total


def _own_friction(search: Search, found: CandidateSet, drives: set[int]) -> float:
    """Return the whitened square of the friction that the given model has on some drives."""
    own = [effect.name for effect in search.design.given.effects
           if not isinstance(effect, CatalogueEffect) and effect.name.endswith('friction')]
    return sum(_square_of_part(search, found, name, drives) for name in own)


def _square_of_part(search: Search, found: CandidateSet, name: str, drives: set[int]) -> float:
    """Return the whitened square of a part of the given model's force on some drives."""
    force = search.regression.residuals.parts.get(name)
    if force is None:
        return 0.0
    white = [search.regression.whitened(found.fit, d, force[:, d]) for d in drives]
    return sum(float(one @ one) for one in white)
