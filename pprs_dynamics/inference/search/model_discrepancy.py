# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model discrepancy: how much of the error the lack of fit of effects may be.

The catalogue's friction, springs and cords are only nearly of the form that real ones have, and so
is the model's own friction: they may leave a small share of their force. Masses, gravity and
sensors (but for a play, of which no encoder says how a link passes through it) are exact, and
nothing else's lack of fit looks like them by much.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.physics.effects.effect import CatalogueEffect


def discrepancy_ratio(design: Design, regression: Regression, decisions: Decisions,
                      fitted: CandidateSet, candidate: Candidate,
                      ) -> tuple[float, tuple[str, ...]]:
    """Return a candidate's force beyond the others over what their lack of fit may leave."""
    drives = {d for block in fitted.blocks_of(candidate) for d in block.rows}
    allowed, names = lack_of_fit(design, regression, decisions, fitted, candidate, drives)
    square = beyond_others(regression, fitted, candidate)
    return float(np.sqrt(square / max(allowed, 1e-300))), names


def lack_of_fit(design: Design, regression: Regression, decisions: Decisions,
                fitted: CandidateSet, candidate: Candidate, drives: set[int],
                ) -> tuple[float, tuple[str, ...]]:
    """Return the whitened square that others may leave where a candidate acts, and of which."""
    # Masses, gravity and sensors are exact: nothing else's lack of fit looks like them by much.
    exact = isinstance(candidate, EffectCandidate) and not (
        candidate.effect.idealised or candidate.effect.shows_at_reversals)
    share = decisions.exact_share if exact else decisions.form_share
    allowed, names = 0.0, []
    for other in fitted.effects:
        if other is candidate or not other.effect.idealised:
            continue
        size = sum(whitened_square(regression, fitted, block, drives)
                   for block in fitted.blocks_of(other))
        if size > 0:
            allowed += share ** 2 * size
            names.append(other.name)
    own = 0.0
    if design.carried is None:  # else what the model's own forces lack of real ones is known
        for effect in design.given.effects:
            if isinstance(effect, CatalogueEffect) and effect.idealised:
                allowed += share ** 2 * _square_of_part(regression, fitted, effect.name, drives)
                names.append(effect.name)
        own = 0.0 if exact else decisions.own_form_share ** 2 * _own_friction(
            design, regression, fitted, drives)
    if own > allowed:
        names = ["the model's own friction"]
    return allowed + own, tuple(names)


def beyond_others(regression: Regression, fitted: CandidateSet, candidate: Candidate) -> float:
    """Return the whitened square of what no refit of the others makes good."""
    blocks = fitted.blocks_of(candidate)
    if any(block.mean is not None for block in blocks):
        return sum(whitened_square(regression, fitted, block, set(block.rows))
                   for block in blocks)
    index = fitted.fit.index_of(blocks)
    c = fitted.fit.coefficients[index]
    return float(c @ np.linalg.solve(fitted.fit.covariance[np.ix_(index, index)], c))


def whitened_square(regression: Regression, fitted: CandidateSet, block: Block,
                    drives: set[int]) -> float:
    """Return the whitened square of a block's force on some drives."""
    total = 0.0
    c = fitted.fit.of(block)
    for d in drives & set(block.rows):
        gram = np.tensordot(regression.weights(fitted.fit, d),
                            regression.products(block, [block], d)[0], 1)
        total += float(c @ gram @ c)
    return total


def _own_friction(design: Design, regression: Regression, fitted: CandidateSet,
                  drives: set[int]) -> float:
    """Return the whitened square of the friction that the given model has on some drives."""
    own = [effect.name for effect in design.given.effects
           if not isinstance(effect, CatalogueEffect) and effect.name.endswith('friction')]
    return sum(_square_of_part(regression, fitted, name, drives) for name in own)


def _square_of_part(regression: Regression, fitted: CandidateSet, name: str,
                    drives: set[int]) -> float:
    """Return the whitened square of a part of the given model's force on some drives."""
    force = regression.residuals.parts.get(name)
    if force is None:
        return 0.0
    white = [regression.whitened(fitted.fit, d, force[:, d]) for d in drives]
    return sum(float(error @ error) for error in white)
