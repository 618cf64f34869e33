# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The error that idealised forms leave, and whether a candidate is no more than that.

Friction, springs and cords of the catalogue have nearly the form of real ones. They leave up to
`Decisions.form_share` of their force. Masses, gravity and sensors are exact. A candidate of a set
is inadmissible where its force beyond all other candidates is smaller than the form error of
these: the data cannot separate it from that error. Beside others the input model's own friction
counts with `Decisions.own_form_share`, too.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.physics.effects.effect import CatalogueEffect

# Independent shapes over which a form error is spread, of which a candidate is one.
DIRECTIONS = 4
# Ends of the names of coefficients that are of one direction, and of the other.
SIDES = {'forward': 'backward', 'backward': 'forward', 'driving': 'driven_back',
         'driven_back': 'driving'}


class FormErrors:
    """Form errors of the sets of one design.

    Parameters
    ----------
    design : Design
    regression : Regression
    decisions : Decisions
    """

    def __init__(self, design: Design, regression: Regression, decisions: Decisions) -> None:
        self.design, self.regression, self.decisions = design, regression, decisions
        # Reference runs contain what the forces of the input model lack of real ones.
        given = () if design.carried is not None else design.given.effects
        self.given = [effect.name for effect in given
                      if isinstance(effect, CatalogueEffect) and effect.idealised
                      and effect.name in regression.residuals.parts]
        self.own = [effect.name for effect in given
                    if not isinstance(effect, CatalogueEffect) and effect.name.endswith('friction')
                    and effect.name in regression.residuals.parts]
        self._forces = {
            (name, d): regression.series[d].transform(regression.residuals.parts[name][:, d])
            for name in (*self.given, *self.own) for d in regression.drives}

    def hide(self, fitted: CandidateSet, candidate: Candidate) -> tuple[str, ...]:
        """Return the effects whose form error may be all of a candidate; none where it is more."""
        if isinstance(candidate, EffectCandidate) and self._is_symmetric(fitted, candidate):
            return ('friction that is the same in both directions',)
        drives = {d for block in fitted.blocks_of(candidate) for d in block.rows}
        allowed, names = self.beside(fitted, candidate, drives, len(fitted.candidates) > 1)
        return names if self._beyond_others(fitted, candidate) < allowed else ()

    def beside(self, fitted: CandidateSet, candidate: Candidate, drives: set[int],
               with_own: bool = True) -> tuple[float, tuple[str, ...]]:
        """Return the whitened square of the form errors beside a candidate, and whose they are.

        `with_own`: with that of the input model's own friction.
        """
        exact = isinstance(candidate, EffectCandidate) and not (
            candidate.effect.idealised or candidate.effect.shows_at_reversals)
        share = (self.decisions.exact_share if exact else
                 self.decisions.form_share / DIRECTIONS ** 0.5)
        squares: dict[str, float] = {}
        for other in fitted.effects:
            if other is not candidate and other.effect.idealised:
                squares[other.name] = share ** 2 * sum(
                    self._square(fitted, block, drives) for block in fitted.blocks_of(other))
        squares |= {name: share ** 2 * self._given(fitted, name, drives) for name in self.given}
        if with_own and not exact:
            squares |= {name: self.decisions.own_form_share ** 2 * self._given(
                fitted, name, drives) for name in self.own}
        return sum(squares.values()), tuple(name for name, square in squares.items() if square > 0)

    def _is_symmetric(self, fitted: CandidateSet, candidate: EffectCandidate) -> bool:
        """Return whether friction that differs by direction does so by less than its form error."""
        if not candidate.effect.is_friction:
            return False
        half, whole = 0.0, 0.0
        for component in candidate.components:
            block, known = fitted.blocks[component], list(component.names)
            others = [SIDES.get(word, word).join(name.rsplit(word, 1)) if (
                word := next((side for side in SIDES if name.endswith(side)), '')) else ''
                for name in known]
            if not known or not set(others) <= set(known):
                return False
            c = fitted.fit.of(block)
            mirrored = c.copy()
            mirrored[:len(known)] = c[[known.index(other) for other in others]]
            for d in block.rows:
                gram = np.tensordot(self.regression.weights(fitted.fit, d),
                                    self.regression.products(block, [block], d)[0], 1)
                half += float((c - mirrored) @ gram @ (c - mirrored)) / 4
                whole += float((c + mirrored) @ gram @ (c + mirrored)) / 4
        return half < self.decisions.form_share ** 2 * whole

    def _given(self, fitted: CandidateSet, name: str, drives: set[int]) -> float:
        """Return the whitened square of a part of the input model's force on some drives."""
        return sum(float(np.sum(self._forces[name, d] ** 2 * self.regression.series[d].spread(
            self.regression.weights(fitted.fit, d)))) for d in drives)

    def _beyond_others(self, fitted: CandidateSet, candidate: Candidate) -> float:
        """Return the whitened square of a candidate's force that no refit of others replaces."""
        blocks = fitted.blocks_of(candidate)
        if any(block.mean is not None for block in blocks):
            return sum(self._square(fitted, block, set(block.rows)) for block in blocks)
        index = fitted.fit.index_of(blocks)
        c = fitted.fit.coefficients[index]
        # Constraints hold some coefficients, of which the variance is 0.
        inverse = np.linalg.pinv(fitted.fit.covariance[np.ix_(index, index)], hermitian=True)
        return float(c @ inverse @ c)

    def _square(self, fitted: CandidateSet, block: Block, drives: set[int]) -> float:
        """Return the whitened square of a block's force on some drives."""
        total, c = 0.0, fitted.fit.of(block)
        for d in drives & set(block.rows):
            gram = np.tensordot(self.regression.weights(fitted.fit, d),
                                self.regression.products(block, [block], d)[0], 1)
            total += float(c @ gram @ c)
        return total
