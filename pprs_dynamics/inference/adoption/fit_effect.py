# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One effect fitted to recordings with all that the model has, whoever asked for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.regression.base_columns import ModelNumber
from pprs_dynamics.inference.regression.carried_over import CarriedOver
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.inference.search.estimates import (
    Calibration,
    Estimate,
    calibrations,
    estimate,
    estimate_present,
)
from pprs_dynamics.inference.search.fitted_model import fitted_model
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.held_out import HeldOut, hold_out
from pprs_dynamics.inference.search.relinearisation import relinearised
from pprs_dynamics.inference.search.reversal_widths import estimate_widths, with_widths
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.added_body import AddedBody
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import set_number
from pprs_dynamics.physics.model.uncertainties import UNCERTAINTIES, with_uncertainties

SURE = 2.0  # standard deviations, by which a number that is something differs from 0
LEAST_MOVE = 0.02  # of a number's deviation; less is left as the file has it


class StandingError(PprsError, ValueError):
    """Friction that is to be fitted on drives that stand."""


@dataclass(frozen=True)
class EffectFit:
    """A model with an effect, and how its fit came about.

    Parameters
    ----------
    request : EffectRequest
    drives : tuple of str or None
        On which it was fitted.
    model : DriveModel
        With the effect.
    plain : DriveModel
        Without it, its own numbers fitted alike.
    parameters : dict of str to Estimate
    at_bound : tuple of str
    calibrated : list of Calibration
    evidence : float
        By which the cost falls with the effect.
    fits : FittedSets
        Around the model with the effect.
    fitted : CandidateSet
    held_out : tuple of HeldOut
        Blocks of the recordings, each predicted from the others, without the effect and with it.
    nothing_left : tuple of str
        What keys of parameters begin with where the model had the effect and recordings leave
        nothing of it: a drive, a link, or nothing for all of it. `model` has it there no more.
    moments : mapping of str to Estimate
        First moments of added bodies: see `Estimates`.
    """

    request: EffectRequest
    drives: tuple[str, ...] | None
    model: DriveModel
    plain: DriveModel
    parameters: dict[str, Estimate]
    at_bound: tuple[str, ...]
    calibrated: list[Calibration]
    evidence: float
    fits: FittedSets
    fitted: CandidateSet
    held_out: tuple[HeldOut, HeldOut]
    nothing_left: tuple[str, ...] = ()
    moments: Mapping[str, Estimate] = field(default_factory=dict)


def fit_effect(
    model: DriveModel, request: EffectRequest, recordings: Sequence[Recording],
    progress: Callable[[float], None] | None = None, decisions: Decisions = DECISIONS,
    carry_over: Callable[[Design], CarriedOver] | None = None,
) -> EffectFit | None:
    """Return the model with an effect, new or with other numbers; None where it cannot act.

    `carry_over` says what a reference run knows of the recordings.

    Raises
    ------
    ModelError
        Where the fit gives values that no model may have.
    StandingError
        Where friction is asked for on drives that hardly moved.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    design = Design.of(model, recordings, lambda share: report(0.3 * share), request.name)
    design = design.beside(carry_over and carry_over(design))
    _require_motion(design, request)
    fits = FittedSets(design, decisions)
    without = fits.evaluate(())
    found = Search(fits).best_of(request.effect, _numbers(design, request))
    report(0.6)
    if found is None:
        return None
    # At the noise of the fit with the effect, so that losses of both are comparable.
    plain_set = replace(without, fit=fits.regression.at((), found.fit.amplitudes))
    before = hold_out(fits, plain_set)
    evidence = without.cost - found.cost
    last, found = relinearised(fits, found)
    report(0.8)
    after = hold_out(last, found)
    widths = estimate_widths(last, found)
    candidate = found.effects[0]
    said = estimate(last, found, candidate, request.drives is not None)
    moved = [one for one in calibrations(last, found, widths) if _is_move(design, one)]
    final = _with_numbers(with_widths(fitted_model(last, found), last.design, widths), model, moved)
    prefix = f'effects.{request.name}.'
    parameters = {key: Estimate(float(final.values[prefix + key]), one.std, one.unit)
                  for key, one in said.parameters.items() if prefix + key in final.values}
    beside = {one.name: estimate_present(last, found, one) for one in model.effects
              if isinstance(one, (DriveEffect, StructureEffect)) and one.name != request.name}
    nothing = _nothing_left(design, candidate, parameters)
    final = _with_uncertainties(final, {**beside, request.name: parameters}, nothing)
    report(1.0)
    return EffectFit(
        request, design.named(candidate.drives), final, fitted_model(fits, plain_set), parameters,
        said.at_bound, moved, evidence, last, found, (before, after), nothing, said.moments)


def _numbers(design: Design, request: EffectRequest) -> tuple[int, ...] | None:
    return None if request.drives is None else tuple(
        design.drives.index(name) for name in request.drives)


def _require_motion(design: Design, request: EffectRequest) -> None:
    """Raise StandingError for friction on drives that stand, where these are asked for or all."""
    if not request.effect.is_friction:
        return
    asked = request.drives or design.drives
    standing = [name for name in asked if not design.moves(design.drives.index(name))]
    if standing and (request.drives or len(standing) == len(asked)):
        raise StandingError(f'{", ".join(standing)} hardly moved in the recordings, must move '
                            'where friction is to be fitted')


def _is_move(design: Design, one: Calibration) -> bool:
    """Return whether a number moves at all against what its tolerance allows."""
    deviations = {(column.number.key, column.number.element): column.number.deviation
                  for column in design.base if isinstance(column, ModelNumber)}
    # Widths of reversal have no tolerance: they are told where they differ for certain.
    return abs(one.after - one.before) > LEAST_MOVE * deviations.get((one.key, one.element), 0.0)


def _with_numbers(fitted: DriveModel, start: DriveModel, moved: Sequence[Calibration],
                  ) -> DriveModel:
    """Return a fitted model in which only some numbers are not as they were at the start."""
    values = {**fitted.values, **{key: start.values[key] for key in start.keys}}
    for one in moved:
        set_number(values, one.key, one.element, one.after)
    return replace(DriveModel.from_parameters(values), source=fitted.source)


def _nothing_left(design: Design, candidate: EffectCandidate,
                  parameters: Mapping[str, Estimate]) -> tuple[str, ...]:
    """Return where the given model has an effect of which the recordings leave nothing.

    As what keys of its parameters begin with: `drive.`, `link.`, or '' for all of it.
    """
    effect = candidate.effect
    sizes = {p.name for p in effect.linear or effect.shape if not p.is_angle and (
        p.name.endswith('mass') or not issubclass(effect, AddedBody))}
    found = []
    for one in candidate.components:
        if design.present(effect, one.drive) is None:
            continue
        places = {name.rpartition('.')[0] for name in one.names if effect.is_of_one_place}
        prefix = (f'{design.drives[one.drive]}.' if one.drive is not None
                  else ''.join(f'{place}.' for place in places))
        mine = [estimate for key, estimate in parameters.items() if key.startswith(prefix)
                and effect.place_and_parameter(key)[1] in sizes]
        if mine and all(abs(one.value) <= SURE * one.std for one in mine):
            found.append(prefix)
    return tuple(found)


def _with_uncertainties(fitted: DriveModel, known: Mapping[str, Mapping[str, Estimate]],
                        nothing: Sequence[str]) -> DriveModel:
    """Return a fitted model with what is known of its effects' parameters.

    Parameters
    ----------
    fitted : DriveModel
    known : mapping of str to mapping of str to Estimate
        By effect, the one that was asked for last.
    nothing : sequence of str
        See `_nothing_left`, of the last: it goes there, and all of it where that is everywhere.
    """
    values = dict(fitted.values)
    for name, parameters in known.items():
        values = with_uncertainties(values, name, {
            key: float(f'{one.std:.3g}') for key, one in parameters.items()
            if np.isfinite(one.std) and one.std > 0 and f'effects.{name}.{key}' in values})
    if nothing:
        name = list(known)[-1]
        gone = tuple(f'{block}.{name}.{prefix}' for block in ('effects', UNCERTAINTIES)
                     for prefix in nothing)
        values = {key: value for key, value in values.items() if not key.startswith(gone)}
        if not any(key.startswith(f'effects.{name}.') for key in values):
            values['effects.active'] = [one for one in values['effects.active'] if one != name]
    return replace(DriveModel.from_parameters(values), source=fitted.source)
