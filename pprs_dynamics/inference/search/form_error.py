# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The form error of idealised effects, and whether a candidate is no more than that.

Real friction, springs and cords differ from the catalogue's forms by up to `Decisions.form_share`
of their force. Masses, gravity and sensors are exact: admissible, and no form error of others. A
set with an idealised candidate is inadmissible if the candidate's force beyond all others is
smaller than the form error of these: the data cannot separate the two. The set without the
candidate then explains as much by a form error, and costs as little. With other candidates the
input model's friction counts with `Decisions.own_form_share`.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import (
    Candidate,
    Candidates,
    CandidateSet,
    EffectCandidate,
)
from pprs_dynamics.inference.search.decisions import Decisions, outside_cost
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import PassiveJointEffect

# Independent shapes over which a form error is spread; a candidate is one of them. Measured on 62
# paired recordings with 1 and 4: as many right but for one, and with 1 Coulomb and viscous friction
# of like size are no longer two effects.
SHAPES = 4
PARTS = {'active_friction': "the model's friction of drives",
         'passive_friction': "the model's friction of passive joints"}  # as they are printed
Squares = dict[int, float]  # whitened squares of a force by drive
# The idealised effects with a force on a drive, and their whitened forces there.
Forces = dict[int, tuple[list[EffectCandidate], Array]]


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
                  'the others; the row without this effect costs no more')
    def reason(self, fitted: CandidateSet, covariance: Array) -> tuple[str, Candidates | None]:
        """Return why a candidate may be a form error, and the set of which it may be one.

        Of several the candidate that the others replace best; '' and None where there is none.

        Parameters
        ----------
        fitted : CandidateSet
        covariance : (P, P) array
            Of its coefficients without constraints.
        """
        forces, least = self.forces(fitted), 1.0
        found: tuple[str, Candidates | None] = '', None
        for candidate in fitted.candidates:
            drives = {d for block in fitted.blocks_of(candidate) for d in block.rows}
            allowed, names = self.beside(fitted, candidate, drives, len(fitted.candidates) > 1,
                                         forces)
            if not names:
                continue
            size = self._beyond_others(fitted, candidate, covariance)
            if size < least * allowed:
                least = size / allowed
                found = (f'{_in_words(candidate.name)} may be the form error of '
                         f'{" and ".join(map(_in_words, names))}',
                         fitted.without(candidate))
        return found

    def forces(self, fitted: CandidateSet) -> Forces:
        """Return the whitened forces of a set's idealised effects by drive."""
        effects = [effect for effect in fitted.effects if effect.effect.idealised]
        found: Forces = {}
        for d in self.regression.drives:
            acting = {effect: [block for block in fitted.blocks_of(effect) if d in block.rows]
                      for effect in effects}
            acting = {effect: blocks for effect, blocks in acting.items() if blocks}
            if acting:
                forces = np.array([sum(fitted.fit.of(block) @ block.rows[d] for block in blocks)
                                   for blocks in acting.values()])
                found[d] = list(acting), forces * np.sqrt(self.regression.series[d].spread(
                    self.regression.weights(fitted.fit, d)))
        return found

    def beside(self, fitted: CandidateSet, candidate: Candidate, drives: set[int],
               with_own: bool = True, forces: Forces | None = None,
               ) -> tuple[float, tuple[str, ...]]:
        """Return the whitened square of the form errors of other effects, and their names.

        It is a share of the sum of their forces: two that cancel are no force of a machine.

        Parameters
        ----------
        fitted : CandidateSet
        candidate : Candidate
        drives : set of int
            On which they count.
        with_own : bool
            With that of the input model's friction.
        forces : mapping, optional
            Of `forces`, where it is known.
        """
        at_reversals = (isinstance(candidate, EffectCandidate)
                        and candidate.effect.shows_at_reversals)
        if isinstance(candidate, EffectCandidate) and not (
                candidate.effect.idealised or at_reversals):
            return 0.0, ()  # little looks like masses, gravity and sensors
        share = self.decisions.form_share / SHAPES ** 0.5
        square, names = 0.0, dict[str, None]()
        for d, (effects, white) in (self.forces(fitted) if forces is None else forces).items():
            others = [k for k, other in enumerate(effects) if d in drives
                      and other is not candidate and (len(drives) > 1 or _is_free(other))
                      # The form of a spring is not off where the drive reverses.
                      and (other.effect.is_friction or not at_reversals)]
            total = white[others].sum(axis=0)
            square += share ** 2 * float(total @ total)
            names |= dict.fromkeys(effects[k].name for k in others)
        for name, by_band in self._given.items():
            is_own = name in self._own
            if not is_own or with_own:
                own = (self._shares[name] if is_own else share) ** 2 * sum(
                    float(by_band[d] @ self.regression.weights(fitted.fit, d)) for d in drives)
                square += own
                names |= {name: None} if own > 0 else {}
        return square, tuple(names)

    def _beyond_others(self, fitted: CandidateSet, candidate: Candidate, covariance: Array,
                       ) -> float:
        """Return the whitened square of a candidate's force that no refit of others replaces."""
        blocks = fitted.blocks_of(candidate)
        if any(block.mean is not None for block in blocks):
            return sum(self._squares(fitted, candidate).values())
        # What its own form leaves open goes with it: alone it would imitate the candidate.
        index = fitted.fit.index_of([*blocks, *(
            block for component in candidate.components
            for block in fitted.nuisance.get(component, {}).values())])
        std = np.sqrt(np.diag(covariance)[index])  # units must not count
        scaled = fitted.fit.coefficients[index] / std
        correlation = covariance[np.ix_(index, index)] / np.outer(std, std)
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


def _in_words(name: str) -> str:
    """Return the printed name of an effect, a pattern or a part of the input model."""
    pattern, _, variable = name.partition(', ')
    return f'the pattern over {variable}' if variable and pattern == 'unknown' else (
        PARTS.get(name, name))


def _is_free(effect: EffectCandidate) -> bool:
    """Return whether the form error of an effect is another one on every drive.

    That of a force on the tool is felt by all drives at once, so that nothing on one drive is it.
    """
    return effect.drives is not None or issubclass(effect.effect, PassiveJointEffect)
