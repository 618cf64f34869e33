# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Model discrepancy: how much of the error the lack of fit of effects may be.

The catalogue's friction, springs and cords are only nearly of the form that real ones have, and so
is the model's own friction: they may leave a small share of their force. Masses, gravity and
sensors are exact, and nothing else's lack of fit looks like them by much.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import Candidate, CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.physics.effects.effect import CatalogueEffect

WAVES = 6  # over position, and over velocity, by which a form is off


def discrepancy_ratio(design: Design, regression: Regression, decisions: Decisions,
                      found: CandidateSet, candidate: Candidate,
                      ) -> tuple[float, tuple[str, ...]]:
    """Return a candidate's force beyond the others over what their lack of fit may leave."""
    # Masses, gravity and sensors are exact: nothing else's lack of fit looks like them by much.
    exact = isinstance(candidate, EffectCandidate) and not (
        candidate.effect.idealised or candidate.effect.shows_at_reversals)
    share = decisions.exact_share if exact else decisions.form_share
    drives = {d for block in found.blocks_of(candidate) for d in block.rows}
    allowed, names = 0.0, []
    for other in found.effects:
        if other is candidate or not other.effect.idealised:
            continue
        size = sum(whitened_square(regression, found, block, drives)
                   for block in found.blocks_of(other))
        if size > 0:
            allowed += share ** 2 * size
            names.append(other.name)
    own = 0.0
    if design.carried is None:  # else what the model's own forces lack of real ones is known
        for effect in design.given.effects:
            if isinstance(effect, CatalogueEffect) and effect.idealised:
                allowed += share ** 2 * _square_of_part(regression, found, effect.name, drives)
                names.append(effect.name)
        own = 0.0 if exact else decisions.own_form_share ** 2 * _own_friction(
            design, regression, found, drives)
    if own > allowed:
        names = ["the model's own friction"]
    square = beyond_others(regression, found, candidate)
    return float(np.sqrt(square / max(allowed + own, 1e-300))), tuple(names)


@dataclass(frozen=True)
class LackOfFit:
    """What forms may leave on each drive: those of effects, and of the given model's own parts.

    Forces are summed before their share is taken: what others nearly cancel is no force of a
    machine.

    Parameters
    ----------
    design : Design
    of_effects, of_own : (M, D) array
        Force of the effects that idealise, and of the model's own friction, times the share that
        their forms may leave [N].
    """

    design: Design
    of_effects: Array
    of_own: Array

    @classmethod
    def of(cls, design: Design, decisions: Decisions, idealised: Iterable[Array]) -> LackOfFit:
        """Return it beside effects that idealise, by their forces (M, D) [N]."""
        forces, own = np.zeros((2, *design.residuals.measured.shape))
        for force in idealised:
            forces = forces + force
        if design.carried is None:  # else what the model's own forces lack of real ones is known
            parts = design.residuals.parts
            for effect in design.given.effects:
                if isinstance(effect, CatalogueEffect) and effect.idealised:
                    forces = forces + parts.get(effect.name, 0.0)
            for name in _own_friction_parts(design):
                own = own + parts.get(name, 0.0)
        return cls(design, decisions.form_share * forces, decisions.own_form_share * own)

    def excess(self, d: int, left: float, noise: float, decisions: Decisions) -> float:
        """Return what a set leaves on a drive over what noise and its effects' forms may.

        That the model's own friction is off has to be told where it shows beyond the noise.

        Parameters
        ----------
        d : int
        left, noise : float
            rms [N].
        decisions : Decisions
        """
        allowed = float(np.hypot(decisions.left_ratio * noise, self.rms(d)))
        return left / max(allowed, 1e-300)

    def rms(self, d: int) -> float:
        """Return what the forms of effects may leave on a drive, rms [N]."""
        return float(np.sqrt(np.mean(np.square(self.of_effects[:, d]))))

    def waves(self, d: int) -> Array:
        """Return forces (R, M) on a drive, whose squares add up to those of what may be left.

        Each force times waves over the drive's position and velocity: forms are off where a drive
        is, or at a speed, and not everywhere alike.
        """
        order = np.pi * np.arange(1, WAVES + 1)[:, None]
        waves = []
        for name in ('position', 'velocity'):
            z = self.design.residuals.variables[name][:, d]
            span = float(np.ptp(z))
            if span > 0:
                waves.append(np.sqrt(2) * np.cos(order * (z - z.min()) / span))
        every = np.concatenate(waves) if waves else np.zeros((0, len(self.design.residuals)))
        every /= np.sqrt(max(len(every), 1))
        return np.concatenate([force[:, d] * every for force in (self.of_effects, self.of_own)])


def beyond_others(regression: Regression, found: CandidateSet, candidate: Candidate) -> float:
    """Return the whitened square of what no refit of the others makes good."""
    blocks = found.blocks_of(candidate)
    if any(block.mean is not None for block in blocks):
        return sum(whitened_square(regression, found, block, set(block.rows))
                   for block in blocks)
    index = found.fit.index_of(blocks)
    c = found.fit.coefficients[index]
    return float(c @ np.linalg.solve(found.fit.covariance[np.ix_(index, index)], c))


def whitened_square(regression: Regression, found: CandidateSet, block: Block,
                    drives: set[int]) -> float:
    """Return the whitened square of a block's force on some drives."""
    total = 0.0
    c = found.fit.of(block)
    for d in drives & set(block.rows):
        gram = np.tensordot(regression.weights(found.fit, d),
                            regression.products(block, [block], d)[0], 1)
        total += float(c @ gram @ c)
    return total


def _own_friction(design: Design, regression: Regression, found: CandidateSet,
                  drives: set[int]) -> float:
    """Return the whitened square of the friction that the given model has on some drives."""
    return sum(_square_of_part(regression, found, name, drives)
               for name in _own_friction_parts(design))


def _own_friction_parts(design: Design) -> list[str]:
    """Return the names of the given model's parts that are friction of its own."""
    return [effect.name for effect in design.given.effects
            if not isinstance(effect, CatalogueEffect) and effect.name.endswith('friction')]


def _square_of_part(regression: Regression, found: CandidateSet, name: str,
                    drives: set[int]) -> float:
    """Return the whitened square of a part of the given model's force on some drives."""
    force = regression.residuals.parts.get(name)
    if force is None:
        return 0.0
    white = [regression.whitened(found.fit, d, force[:, d]) for d in drives]
    return sum(float(one @ one) for one in white)
