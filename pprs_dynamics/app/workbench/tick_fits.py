# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sets of effects on one model, fitted at given noise and with their own noise.

At given noise a fit is linear and takes milliseconds, as all products of columns are summed up
before. Noise, shapes and the exact forces of the fitted model follow after.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import RLock

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.adoption.adopt import original
from pprs_dynamics.inference.diagnosis.diagnosis import SinceReference
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.candidates import CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import Estimate, estimate
from pprs_dynamics.inference.search.fitted_model import fitted_model, linear_residual, linearised
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

Place = tuple[int | None, str]
"""Drive, None in the structure, and name of a parameter."""


@dataclass(frozen=True)
class Tick:
    """An effect that takes part.

    Parameters
    ----------
    best : EffectCandidate
        As the fit would have it.
    chosen : mapping of Place to float
        Parameters that somebody set to values of their own.
    """

    best: EffectCandidate
    chosen: Mapping[Place, float] = field(default_factory=dict)

    @property
    def effect(self) -> type[CatalogueEffect]:
        """Ticked effect."""
        return self.best.effect


@dataclass(frozen=True, eq=False)
class Offer:
    """An unticked effect, on the drives where it reduces the cost most.

    Parameters
    ----------
    candidate : EffectCandidate
    gain, evidence : float
        Fall of the penalised deviance at given noise; and the same less the prior cost.
    residual : (M, D) array
        What would be left [N].
    """

    candidate: EffectCandidate
    gain: float
    evidence: float
    residual: Array = field(repr=False)


class TickFits:
    """Fits of one model that answer ticks.

    Parameters
    ----------
    model : DriveModel
        In force. Its ledger gives the values that estimates count from.
    recordings : sequence of Recording
    reference : Reference, optional
        Whose forces are taken from all errors.

    Attributes
    ----------
    before : (M, D) array
        Residual of the model [N].
    since : SinceReference or None
        What the reference says of the recordings.

    Raises
    ------
    PprsError
        As `measure_residuals` and `Regression`.
    """

    def __init__(self, model: DriveModel, recordings: Sequence[Recording],
                 reference: Reference | None = None) -> None:
        self.model, self.recordings = model, tuple(recordings)
        start = original(model)
        self.design, self.since = Design.of(start, recordings), None
        if reference is not None:
            self.design = self.design.beside(reference.carried_over(self.design))
            self.since = SinceReference.of(reference, self.design)
        self.fits = FittedSets(self.design, DECISIONS)
        self.scan = Scan(self.fits)
        self.none = self.fits.evaluate(())
        self._scanning = RLock()  # of the library
        self.measured = self.design.residuals.measured
        self.before = (self.design.residuals.error if start is model else
                       self.measured - measure_residuals(model, recordings)[0].model)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names."""
        return self.design.drives

    # Candidates

    def candidates(self) -> list[type[CatalogueEffect]]:
        """Return the effects that the model may lack, by name."""
        design = self.design
        offered = [self.model.bound(effect) for effect in catalogue().values()
                   if self.model.offers(effect)]
        return [effect for effect in offered if (
            any(design.acts_on(effect, d) for d in range(len(self.drives)))
            if issubclass(effect, DriveEffect)
            else any(term.effect is effect for term in design.structure))]

    def offered(self, effect: type[CatalogueEffect], drives: Sequence[int] | None,
                found: CandidateSet) -> EffectCandidate | None:
        """Return an effect on some drives, or where it reduces the cost of a set most.

        In the best shape that a scan knows at the noise of the set; None where it cannot act.
        """
        with self._scanning:
            return self.scan.offered(effect, drives, found)

    def _proposed(self, found: CandidateSet) -> list[EffectCandidate]:
        """Return every effect on the drives where it reduces the cost of a set most."""
        added = (sets[-1] for sets in self.scan.proposals(found, least=-np.inf))
        return [candidate for candidate in added if isinstance(candidate, EffectCandidate)]

    def offers(self, found: CandidateSet) -> list[Offer]:
        """Return the gain of every effect that is not in a set, the best first."""
        there = {c.effect for c in found.effects}
        # A fit that was ended before it stood still has the deviance of the noise before.
        found = self.at(found.effects, found)
        with self._scanning:
            return sorted((self.offer(found, candidate) for candidate in self._proposed(found)
                           if candidate.effect not in there), key=lambda offer: -offer.evidence)

    def offer(self, found: CandidateSet, candidate: EffectCandidate) -> Offer:
        """Return the gain of one candidate in addition to a set, at its noise."""
        more = self.at((*found.effects, candidate), found)
        return Offer(candidate, found.fit.deviance - more.fit.deviance, found.total - more.total,
                     self.residual(more).astype(np.float32))

    def with_chosen(self, tick: Tick) -> EffectCandidate:
        """Return a tick's candidate with the chosen shapes."""
        placements = []
        for component in tick.best.components:
            shape = {name: tick.chosen.get((component.drive, name), value)
                     for name, value in component.shape}
            placements.append(replace(component, shape=tuple(sorted(shape.items()))))
        return EffectCandidate.of(placements)

    # Fits

    def at(self, candidates: Sequence[EffectCandidate], near: CandidateSet) -> CandidateSet:
        """Return a set under the noise of another: linear, in milliseconds."""
        return self.fits.at_noise_of(near, tuple(candidates))

    def held(self, found: CandidateSet, ticks: Sequence[Tick]) -> CandidateSet:
        """Return a set with the chosen linear parameters; the others are refitted."""
        blocks: list[Block] = []
        values: list[float] = []
        by_effect = {tick.effect: tick for tick in ticks}
        for candidate in found.effects:
            chosen = by_effect[candidate.effect].chosen
            for placement in candidate.components:
                linear = {parameter.name for parameter in candidate.effect.linear}
                mine = {name: value for (d, name), value in chosen.items()
                        if d == placement.drive and name in linear}
                if not mine:
                    continue
                c = found.coefficients(placement)
                wanted = candidate.effect.to_coefficients({**placement.values(c), **mine})
                blocks.append(found.blocks[placement])
                values += [wanted[name] for name in placement.names]
        if not blocks:
            return found
        return self.fits.held(found, found.fit.index_of(blocks), np.array(values))

    # Values of a set

    def residual(self, found: CandidateSet) -> Array:
        """Return the residual of the linear fit, (M, D) [N]."""
        return linear_residual(self.fits, found)

    def values(self, found: CandidateSet) -> dict[str, dict[str, float]]:
        """Return the parameters of every effect of a set, by drive.parameter."""
        values: dict[str, dict[str, float]] = {}
        for candidate in found.effects:
            mine = values[candidate.name] = {}
            for component in candidate.components:
                every = {**component.values(found.coefficients(component)), **component.parameters}
                mine.update({self.key(component.drive, name): float(value)
                             for name, value in every.items()})
        return values

    def estimates(self, found: CandidateSet) -> dict[str, dict[str, Estimate]]:
        """Return the parameters of every effect of a set with their uncertainty."""
        return {candidate.name: estimate(self.fits, found, candidate, True).parameters
                for candidate in found.effects}

    def key(self, drive: int | None, name: str) -> str:
        """Return the name of a parameter, with its drive's before it."""
        return name if drive is None else f'{self.drives[drive]}.{name}'

    def exact(self, found: CandidateSet, is_free: bool,
              ) -> tuple[DriveModel, Array, dict[str, dict[str, Estimate]] | None]:
        """Return the fitted model, and its residual without linearisation, (M, D) [N].

        Where an effect of the set is nonlinear, and nothing is held, the set is fitted around
        its own model first, and its parameters are those around the fitted model.

        Raises
        ------
        PprsError
            For values that no model may have, or that cannot be followed.
        """
        fits, parameters = self.fits, None
        if is_free and any(c.effect.nonlinear for c in found.effects):
            fits, found = linearised(fits, found)
            parameters = {c.name: estimate(fits, found, c, True).parameters for c in found.effects}
        model = fitted_model(fits, found)
        # By the fitted delay, not the apparent one, efforts belong to motion before a segment.
        residual = (measure_residuals(model, self.recordings)[0].error if self.since is None
                    else self.measured - fits.design.exact_forces(model))
        return model, residual, parameters
