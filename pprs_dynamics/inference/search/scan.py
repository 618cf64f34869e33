# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Scan: effects, and their drives, that would lower the cost of a set.

A scan takes all terms in all shapes at the noise of a set's fit, where the gain of each is a matter
of sums that are known. It proposes; a fit with its own noise decides (`search.search`).
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence

import numpy as np

from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.search.candidates import (
    Candidates,
    CandidateSet,
    Component,
    EffectCandidate,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect

PROPOSED = -12.0  # lowest score of a proposal
SLOW_LEFT = 1e-3  # of the power of slow noise, where fast noise alone proposes


Scored = tuple[float, Component]  # its gain less its prior cost


class Scan:
    """Scan of the effects that may be added to fitted sets.

    Parameters
    ----------
    fits : FittedSets
    """

    def __init__(self, fits: FittedSets) -> None:
        self.fits = fits
        self._offers: dict[Hashable, dict[type[CatalogueEffect], list[Scored]]] = {}

    def proposals(self, base: CandidateSet, count: int | None = None, least: float = PROPOSED,
                  ) -> list[Candidates]:
        """Return sets with one effect more, or one on more drives, by a scan at a set's noise.

        Parameters
        ----------
        base : CandidateSet
        count : int, optional
            At most; by default all.
        least : float
            By which the cost must fall at the set's noise.
        """
        scored: list[tuple[float, Candidates]] = []
        for effect, found in self.offers(base).items():
            old = next((c for c in base.effects if c.effect is effect), None)
            # A body on another link is another explanation where all are asked for.
            is_each = count is None and effect.is_of_one_place
            for offered in [[offer] for offer in found] if is_each else [found]:
                score, chosen = self.best_drives(effect, offered, old)
                if score > least and chosen:
                    kept = tuple(c for c in base.candidates if c is not old)
                    scored.append((score, (*kept, EffectCandidate.of(
                        [*(old.components if old else ()), *chosen]))))
        scored.sort(key=lambda scored: -scored[0])
        return [candidates for _, candidates in scored[:count]]

    def offers(self, base: CandidateSet) -> dict[type[CatalogueEffect], list[Scored]]:
        """Return gains less prior costs of components, by effect; one for each drive or place."""
        components, fit = self.fits.components, base.fit
        known = (base.key, fit.coefficients.tobytes(), fit.amplitudes.tobytes())
        if known in self._offers:
            return self._offers[known]
        taken = {(component.effect, component.drive) for component in base.blocks}

        offers: list[tuple[Component, float]] = []
        for local in components.local.values():
            offers += local.offers(fit).values()
            self.fits.stepped()
        offers += components.shared_offers(fit)
        best: dict[Hashable, Scored] = {}
        for component, gain in offers:
            place = (component.effect, component.drive)
            key = (*place, component.effect.places_of(component.names))
            net = gain - components.component_prior_cost(component).total
            if place not in taken and (key not in best or net > best[key][0]):
                best[key] = (net, component)
        found: dict[type[CatalogueEffect], list[Scored]] = {}
        for scored in best.values():
            found.setdefault(scored[1].effect, []).append(scored)
        self._offers[known] = found
        return found

    def offered(self, effect: type[CatalogueEffect], drives: Collection[int] | None,
                base: CandidateSet) -> EffectCandidate | None:
        """Return an effect on some drives, or where it reduces the cost of a set most.

        In the best shape at the noise of the set; None where it cannot act.
        """
        found = self.offers(base).get(effect, [])
        if drives is None or not issubclass(effect, DriveEffect):
            chosen = self.best_drives(effect, found, None)[1] if found else []
        else:
            chosen = [component for _, component in found if component.drive in drives]
        return EffectCandidate.of(chosen) if len(chosen) >= len(drives or (0,)) else None

    def best_drives(
        self, effect: type[CatalogueEffect], found: Sequence[Scored],
        old: EffectCandidate | None,
    ) -> tuple[float, list[Component]]:
        """Return the drives on which an effect pays, and the score of all together."""
        prior_costs = self.fits.prior_costs
        found = sorted(found, key=lambda scored: -scored[0])
        if not issubclass(effect, DriveEffect):
            return found[0][0] - prior_costs.of_name(), [found[0][1]]
        there = len(old.components) if old else 0
        before = prior_costs.of_drives(there) if there else -prior_costs.of_name()
        nets = np.cumsum([net for net, _ in found])
        scores = [nets[m] + before - prior_costs.of_drives(there + m + 1)
                  for m in range(len(found))]
        best = int(np.argmax(scores))
        return float(scores[best]), [component for _, component in found[:best + 1]]


def with_fast_noise(regression: Regression, fit: JointFit) -> JointFit:
    """Return a fit under the noise of the higher frequencies alone.

    The slow part of a noise spectrum may be what is missing. It only proposes.
    """
    amplitudes = fit.amplitudes.copy()
    amplitudes[:, 1:][:, regression.noise_shapes.is_slow] *= SLOW_LEFT
    return regression.at(fit.blocks, amplitudes)
