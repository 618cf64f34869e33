# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The smallest size of an effect that would have been reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.inference.regression.base_columns import units_of
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.components import placed
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter


@dataclass(frozen=True)
class DetectableSize:
    """The smallest size at which an effect would have been reported, by drive or structure.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drive : str or None
    parameter : Parameter
        The one number that it has.
    size : float
        Of that.
    unit : str
    """

    effect: type[CatalogueEffect]
    drive: str | None
    parameter: Parameter
    size: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of `detectable` in the JSON."""
        return {'name': self.effect.name, 'drive': self.drive, 'parameter': self.parameter.name,
                'size': self.size, 'unit': self.unit}


def detectable_sizes(fits: FittedSets, fitted: CandidateSet) -> tuple[DetectableSize, ...]:
    """Return the smallest sizes at which effects of one number would have been reported.

    Each alone in addition to a set, at its noise. The deviance must fall by the prior cost of the
    effect and the margin of rivals, and its force must exceed the form errors of the others. For
    a coefficient c of information S and prior precision L the deviance falls by
    (c S)^2 / (S + L) - ln(1 + S / L).

    Parameters
    ----------
    fits : FittedSets
    fitted : CandidateSet
        Whose effects and those of the given model are left out.
    """
    known = {effect.name for effect in fits.design.given.effects} | {
        candidate.name for candidate in fitted.effects}
    found = []
    for component in _of_one_number(fits):
        if component.effect.name in known:
            continue
        block = fits.components.block(component)
        information = float(fits.regression.own_information(fitted.fit, block)[0, 0])
        prior = float(block.precision[0, 0])
        if information <= prior:  # the recordings say less of it than is expected anyway
            continue
        candidate = EffectCandidate.of([component])
        asked = (fits.components.prior_cost(candidate).total
                 + fits.decisions.rival_margin + np.log1p(information / prior))
        beside, _ = fits.form_errors.beside(fitted, candidate, set(block.rows), False)
        c = np.array([max(np.sqrt(asked * (information + prior)) / information,
                          np.sqrt(beside / information))])
        units = units_of(fits.design.given, component.drive)
        values = component.values(c)
        numbers = [p for p in component.effect.linear if values[p.name]]
        if not component.is_within(c, units) or len(numbers) != 1:
            continue  # no machine has so much of it; a body somewhere else has a place as well
        (parameter,) = numbers
        drive = None if component.drive is None else fits.design.drives[component.drive]
        found.append(DetectableSize(component.effect, drive, parameter,
                                    abs(values[parameter.name]), units.of(parameter.unit)))
    return tuple(found)


def _of_one_number(fits: FittedSets) -> Iterator[Component]:
    """Yield the effects that have a number and no shape, on each drive that they may be on."""
    components = fits.components
    yield from (component for component in (*components.structure, *components.spanning)
                if len(component.names) == 1 and not component.shape and not (
                    issubclass(component.effect, MeasurementEffect)
                    and component.effect.not_linear_in))
    for d, local in components.local.items():
        for effect in local.effects:
            if not effect.shape and len(effect.variants) == len(effect.variants[0]) == 1:
                yield placed(fits.design, effect, d, {}, effect.variants[0])
