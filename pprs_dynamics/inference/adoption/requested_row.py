# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The row of a table of models that answers a request for an effect, and the model of that row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.answer import Answer
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.search.candidates import EffectCandidate
from pprs_dynamics.inference.search.decisions import outside_cost
from pprs_dynamics.inference.search.estimates import Estimate, estimate_present
from pprs_dynamics.inference.search.fitted_model import linearised, model_at, parts_of
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.inference.search.table import ModelTable, Row
from pprs_dynamics.physics.effects.added_body import AddedBody
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.effects_block import UNCERTAINTIES, with_uncertainties

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


def requested_model(answer: Answer, request: EffectRequest, effect: FoundEffect,
                    ) -> tuple[DriveModel, tuple[str, ...]]:
    """Return the input model with the requested effect alone, and where the effect is removed.

    Parameters
    ----------
    answer : Answer
        Of the row that has the effect.
    request : EffectRequest
    effect : FoundEffect

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    base, placed = parts_of(answer.fits, answer.fitted)
    model = model_at(answer.design, base, [
        each for each in placed if each.effect.name == request.name])
    known = {each.name: estimate_present(answer.fits, answer.fitted, each)
             for each in model.effects if each.name != request.name
             and isinstance(each, (DriveEffect, StructureEffect))
             and each.name in (answer.design.given.values.get('effects.active') or ())}
    gone = _gone(answer, request, effect)
    return _without(_with_uncertainties(model, {**known, request.name: effect.parameters}),
                    request.name, gone), gone


@outside_cost('adopt removes an effect of the model of which the recordings show none')
def _gone(answer: Answer, request: EffectRequest, found: FoundEffect) -> tuple[str, ...]:
    """Return where the input model has the effect and the recordings show none of it.

    As the beginnings of keys: `drive.`, `link.`, or '' for all of it.
    """
    effect, design = request.effect, answer.design
    candidate = next(c for c in answer.fitted.effects if c.name == effect.name)
    sizes = {p.name for p in effect.linear or effect.shape if not p.is_angle and (
        p.name.endswith('mass') or not issubclass(effect, AddedBody))}
    prefixes = []
    for component in candidate.components:
        if design.present(effect, component.drive) is None:
            continue
        places = {name.rpartition('.')[0] for name in component.names if effect.is_of_one_place}
        prefix = (f'{design.drives[component.drive]}.' if component.drive is not None
                  else ''.join(f'{place}.' for place in places))
        mine = [number for key, number in found.parameters.items()
                if key.startswith(prefix) and effect.place_and_parameter(key)[1] in sizes]
        if mine and all(abs(number.value) <= SURE * number.std for number in mine):
            prefixes.append(prefix)
    return tuple(prefixes)


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
