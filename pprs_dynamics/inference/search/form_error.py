# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The form error of idealised effects, and whether a candidate is no more than that.

Real friction, springs and cords differ from the catalogue's forms by up to `Decisions.form_share`
of their force. Masses, gravity and sensors are exact: admissible, and no form error of others. An
idealised candidate is inadmissible if its force
beyond all other candidates is smaller than the form error of these: the data cannot separate the
two. With other candidates the input model's friction counts with `Decisions.own_form_share`.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions, outside_cost
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect

# Independent shapes over which a form error is spread; a candidate is one of them. Measured on 62
# paired recordings with 1 and 4: as many right but for one, and with 1 Coulomb and viscous friction
# of like size are no longer two effects.
SHAPES = 4
# Ends of the names of coefficients that are of one direction, and of the other.
SIDES = {'forward': 'backward', 'backward': 'forward', 'driving': 'driven_back',
         'driven_back': 'driving'}
Squares = dict[int, float]  # whitened squares of a force by drive


class FormErrors:
    """Form errors of the sets of one design.

    Parameters
    ----------
    design : Design
    regression : Regression
    decisions : Decisions
    """

    def __init__(self, design: Design, regression: Regression, decisions: Decisions) -> None:
        self.regression, self.decisions = regression, decisions
        # Reference runs contain what the forces of the input model lack of real ones.
        given = () if design.carried is not None else design.given.effects
        self._shares = {
            effect.name: decisions.form_share if isinstance(effect, CatalogueEffect)
            else decisions.own_form_share
            for effect in given if effect.name in regression.residuals.parts and (
                effect.idealised if isinstance(effect, CatalogueEffect)
                else effect.name.endswith('friction'))}
        self._own = {effect.name for effect in given if not isinstance(effect, CatalogueEffect)}
        self._given = {
            name: {d: regression.series[d].sums(regression.series[d].transform(
                regression.residuals.parts[name][:, d]) ** 2) for d in regression.drives}
            for name in self._shares}

    @outside_cost('a row is inadmissible if one of its effects is smaller than the form error of '
                  'the others')
    def reason(self, fitted: CandidateSet) -> str:
        """Return which candidate may be the form error of others; '' for none."""
        forces = self.forces(fitted)
        for candidate in fitted.candidates:
            names: tuple[str, ...] = ()
            if isinstance(candidate, EffectCandidate) and self._is_symmetric(fitted, candidate):
                names = ('friction that is the same in both directions',)
            else:
                drives = {d for block in fitted.blocks_of(candidate) for d in block.rows}
                allowed, others = self.beside(fitted, candidate, drives,
                                              len(fitted.candidates) > 1, forces)
                if others and self._beyond_others(fitted, candidate) < allowed:
                    names = others
            if names:
                return f'{candidate.name} may be the form error of {", ".join(names)}'
        return ''

    def forces(self, fitted: CandidateSet) -> list[tuple[EffectCandidate, Squares]]:
        """Return the idealised effects of a set with the squares of their forces."""
        return [(effect, self._squares(fitted, effect)) for effect in fitted.effects
                if effect.effect.idealised]

    def beside(self, fitted: CandidateSet, candidate: Candidate, drives: set[int],
               with_own: bool = True, forces: list[tuple[EffectCandidate, Squares]] | None = None,
               ) -> tuple[float, tuple[str, ...]]:
        """Return the whitened square of the form errors of other effects, and their names.

        Parameters
        ----------
        fitted : CandidateSet
        candidate : Candidate
        drives : set of int
            On which they count.
        with_own : bool
            With that of the input model's friction.
        forces : list, optional
            Of `forces`, where it is known.
        """
        if isinstance(candidate, EffectCandidate) and not (
                candidate.effect.idealised or candidate.effect.shows_at_reversals):
            return 0.0, ()  # little looks like masses, gravity and sensors
        share = self.decisions.form_share / SHAPES ** 0.5
        squares = {
            other.name: share ** 2 * sum(size for d, size in of_drives.items() if d in drives)
            for other, of_drives in (self.forces(fitted) if forces is None else forces)
            if other is not candidate and (len(drives) > 1 or _is_free(other))}
        for name, by_band in self._given.items():
            is_own = name in self._own
            if not is_own or with_own:
                squares[name] = (self._shares[name] if is_own else share) ** 2 * sum(
                    float(by_band[d] @ self.regression.weights(fitted.fit, d)) for d in drives)
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
            half += sum(self._of_block(fitted, block, (c - mirrored) / 2).values())
            whole += sum(self._of_block(fitted, block, (c + mirrored) / 2).values())
        return half < self.decisions.form_share ** 2 * whole

    def _beyond_others(self, fitted: CandidateSet, candidate: Candidate) -> float:
        """Return the whitened square of a candidate's force that no refit of others replaces."""
        blocks = fitted.blocks_of(candidate)
        if any(block.mean is not None for block in blocks):
            return sum(self._squares(fitted, candidate).values())
        # What its own form leaves open goes with it: alone it would imitate the candidate.
        index = fitted.fit.index_of([*blocks, *(
            block for component in candidate.components
            for block in fitted.nuisance.get(component, {}).values())])
        std = np.sqrt(np.maximum(fitted.fit.covariance[index, index], 0))
        # Constraints hold some coefficients, of which the variance is 0; units must not count.
        index, std = index[std > 0], std[std > 0]
        scaled = fitted.fit.coefficients[index] / std
        correlation = fitted.fit.covariance[np.ix_(index, index)] / np.outer(std, std)
        return float(scaled @ np.linalg.pinv(correlation, hermitian=True) @ scaled)

    def _squares(self, fitted: CandidateSet, candidate: Candidate) -> Squares:
        """Return the whitened squares of a candidate's force."""
        found: Squares = {}
        for block in fitted.blocks_of(candidate):
            for d, size in self._of_block(fitted, block, fitted.fit.of(block)).items():
                found[d] = found.get(d, 0.0) + size
        return found

    def _of_block(self, fitted: CandidateSet, block: Block, c: Array) -> Squares:
        """Return the whitened squares of a block's force with coefficients c (k,)."""
        return {d: float(self.regression.weights(fitted.fit, d) @ (
            self.regression.products([block], d)[block, block] @ c @ c)) for d in block.rows}


def _is_free(effect: EffectCandidate) -> bool:
    """Return whether the form error of an effect is another one on every drive.

    That of a force on the tool is felt by all drives at once, so that nothing on one drive is it.
    """
    return effect.drives is not None or issubclass(effect.effect, PassiveJointEffect)
