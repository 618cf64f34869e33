# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The row of a table of models that answers a request for an effect, and the model of that row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.answer import Answer
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.search.candidates import EffectCandidate
from pprs_dynamics.inference.search.decisions import outside_cost
from pprs_dynamics.inference.search.estimates import Calibration, Estimate, estimate_present
from pprs_dynamics.inference.search.estimates import calibrations as moved_numbers
from pprs_dynamics.inference.search.fitted_model import linearised, model_at, parts_of
from pprs_dynamics.inference.search.reversal_widths import with_widths
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.inference.search.table import ModelTable, Row
from pprs_dynamics.physics.effects.added_body import AddedBody
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.uncertainties import UNCERTAINTIES, with_uncertainties

SURE = 2.0  # standard deviations by which a number must differ from 0


class PlacementError(PprsError, ValueError):
    """An effect that cannot act where it is requested."""


def requested_row(table: ModelTable, request: EffectRequest, margin: float) -> Row:
    """Return the row that answers a request: the best one, a rival, or the effect alone.

    Parameters
    ----------
    table : ModelTable
    request : EffectRequest
        On its drives the effect is fitted; without drives, where it lowers the cost.
    margin : float
        Of cost, within which another row is a rival of the best one.

    Raises
    ------
    PlacementError
        Where the effect has no force in these recordings.
    """
    known = [table.best, *(rival.row for rival in table.rivals(margin))]
    row = next((row for row in known if _candidate(row, request) is not None), None)
    if row is None and request.name in table.alone:
        row = Row(table.first, table.alone[request.name])
    found = None if row is None else _candidate(row, request)
    if row is not None and found is not None and (
            request.drives is None or row.fits.design.named(found.drives) == request.drives):
        return row if row.is_exact else Row.exact(row.fits, row.fitted)
    fits = table.first if row is None else row.fits
    rest = () if row is None or found is None else row.fitted.without(found)
    wanted = None if request.drives is None else {
        fits.design.drives.index(name) for name in request.drives}
    kept = [] if found is None else [c for c in found.components if c.drive in (wanted or ())]
    scan = Scan(fits)
    offers = scan.offers(fits.evaluate(rest)).get(request.effect, [])
    if wanted is None:
        chosen = scan.best_drives(request.effect, offers, None)[1] if offers else []
    else:
        chosen = [*kept, *(component for _, component in offers
                           if component.drive in wanted - {c.drive for c in kept})]
    if len(chosen) < len(wanted or (None,)):
        asked = request.drives or fits.design.drives
        standing = [name for name in asked
                    if not fits.design.moves(fits.design.drives.index(name))]
        raise PlacementError(f'{", ".join(standing)} hardly moved in the recordings' if standing
                             else f'{request.name} has no force in these recordings')
    fitted = fits.refined(fits.evaluate((*rest, EffectCandidate.of(chosen))))
    return Row(*linearised(fits, fitted), 0.0)


def _candidate(row: Row, request: EffectRequest) -> EffectCandidate | None:
    return next((c for c in row.effects if c.name == request.name), None)


@dataclass(frozen=True)
class RequestedModel:
    """The input model with the requested effect of a row, and without it.

    Parameters
    ----------
    answer : Answer
        Of the row.
    request : EffectRequest
    """

    answer: Answer
    request: EffectRequest

    @cached_property
    def effect(self) -> FoundEffect:
        """The requested effect of the row, with its values and its held-out errors."""
        return next(effect for effect in self.answer.effects if effect.name == self.request.name)

    @cached_property
    def model(self) -> DriveModel:
        """The model with the effect alone; other effects of the row are left out.

        Raises
        ------
        ModelError
            For values that no model may have.
        """
        answer, name = self.answer, self.request.name
        base, placed = parts_of(answer.fits, answer.fitted)
        model = with_widths(model_at(answer.design, base, [
            effect for effect in placed if effect.effect.name == name]),
            answer.design, answer.widths)
        known = {effect.name: estimate_present(answer.fits, answer.fitted, effect)
                 for effect in model.effects if effect.name != name
                 and isinstance(effect, (DriveEffect, StructureEffect))
                 and answer.design.given.values.get('effects.active')
                 and effect.name in answer.design.given.values['effects.active']}
        return _without(_with_uncertainties(model, {**known, name: self.effect.parameters}),
                        name, self.gone)

    @property
    def calibrations(self) -> tuple[Calibration, ...]:
        """Numbers of the model that move within their tolerances."""
        answer = self.answer
        return tuple(number for number in moved_numbers(answer.fits, answer.fitted, answer.widths)
                     if number.after != number.before)

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Values as the model file has them, with the uncertainties of the diagnosis."""
        values, prefix = self.model.values, f'effects.{self.request.name}.'
        return {key: replace(estimate, value=float(values[prefix + key]))
                for key, estimate in self.effect.parameters.items() if prefix + key in values}

    @cached_property
    @outside_cost('adopt removes an effect of the model of which the recordings show none')
    def gone(self) -> tuple[str, ...]:
        """Where the input model has the effect and the recordings leave none of it.

        As the beginnings of keys: `drive.`, `link.`, or '' for all of it.
        """
        effect, design = self.request.effect, self.answer.design
        candidate = next(c for c in self.answer.fitted.effects if c.name == effect.name)
        sizes = {p.name for p in effect.linear or effect.shape if not p.is_angle and (
            p.name.endswith('mass') or not issubclass(effect, AddedBody))}
        found = []
        for component in candidate.components:
            if design.present(effect, component.drive) is None:
                continue
            places = {name.rpartition('.')[0] for name in component.names
                      if effect.is_of_one_place}
            prefix = (f'{design.drives[component.drive]}.' if component.drive is not None
                      else ''.join(f'{place}.' for place in places))
            mine = [number for key, number in self.effect.parameters.items()
                    if key.startswith(prefix) and effect.place_and_parameter(key)[1] in sizes]
            if mine and all(abs(number.value) <= SURE * number.std for number in mine):
                found.append(prefix)
        return tuple(found)


def _with_uncertainties(model: DriveModel, known: Mapping[str, Mapping[str, Estimate]],
                        ) -> DriveModel:
    """Return a model with the uncertainties of its effects' parameters."""
    values = dict(model.values)
    for name, parameters in known.items():
        values = with_uncertainties(values, name, {
            key: float(f'{number.std:.3g}') for key, number in parameters.items()
            if np.isfinite(number.std) and number.std > 0 and f'effects.{name}.{key}' in values})
    return replace(DriveModel.from_parameters(values), source=model.source)


def _without(model: DriveModel, name: str, places: Sequence[str]) -> DriveModel:
    """Return a model without an effect in some places; without all of it where none is left."""
    if not places:
        return model
    gone = tuple(f'{block}.{name}.{place}' for block in ('effects', UNCERTAINTIES)
                 for place in places)
    values = {key: value for key, value in model.values.items() if not key.startswith(gone)}
    if not any(key.startswith(f'effects.{name}.') for key in values):
        values['effects.active'] = [other for other in values['effects.active'] if other != name]
    return replace(DriveModel.from_parameters(values), source=model.source)
