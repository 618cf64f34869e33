# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding an effect to a model: its row of the table, the held-out test, and the decision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.adoption import BLOCKS, VALIDATION, Adoption
from pprs_dynamics.inference.adoption.fit_curve import (
    CurveRequest,
    fit_curve,
    held_out_residuals,
    with_curve,
    without_curve,
)
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.adoption.requested_row import (
    PlacementError,
    requested_model,
    requested_row,
)
from pprs_dynamics.inference.diagnosis.answer import Answer
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import change, listed, plain
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, rms
from pprs_dynamics.inference.search.decisions import outside_cost
from pprs_dynamics.inference.search.estimates import calibrations
from pprs_dynamics.inference.search.held_out import PredictiveGain, predictive_gain
from pprs_dynamics.inference.search.table import ModelTable, Row
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import ACTIVE_FRICTION, PASSIVE_FRICTION
from pprs_dynamics.physics.model.ledger import original_values

DIAGNOSED = 0.8  # share of the work that a diagnosis is, for the progress bar
# Standard errors by which the first effect, and further ones, must lower the held-out error.
FIRST_ERRORS, FURTHER_ERRORS = 1.0, 2.0
MOVING = 5.0  # widths of reversal, above which a drive moves
PUSHES = 0.1  # of the moving time, in which friction may give power back
WEAK = 'Held-out blocks of the same recordings are weak evidence; confirm with --validate'


def adopt(
    model: DriveModel, request: EffectRequest | CurveRequest, recordings: Sequence[Recording],
    validate: Sequence[Recording] = (), force: bool = False,
    progress: Callable[[float], None] | None = None, diagnosis: Diagnosis | None = None,
    reference: Reference | None = None,
) -> Adoption:
    """Return a model with an effect, or why it should not have it.

    The values are those of the diagnosis: of the best set that has the effect. A curve of the same
    drive that the model has already is replaced.

    Parameters
    ----------
    model : DriveModel
    request : EffectRequest or CurveRequest
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Held out, and decisive; without any, blocks of the recordings are.
    force : bool, optional
        Adopt it in spite of objections.
    progress : callable, optional
        Called with the share of the work that is done.
    diagnosis : Diagnosis, optional
        Of `original(model)` on the same recordings, with its table; for a curve of the model.
    reference : Reference, optional
        Since which the effect is a change. Errors are then those in addition to its errors.

    Raises
    ------
    EffectRequestError
        For an effect that cannot act in this robot, and for a curve since a reference.
    CurveError
        Where the recordings cannot give the curve.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    start = model
    if isinstance(request, EffectRequest):
        start = original(model)
        request = request.placed(start)
    elif reference is not None:
        raise EffectRequestError(f'{request.name}: a curve contains the error of the reference, '
                                 'too; since a reference, request an effect')
    if diagnosis is None or (diagnosis.selection is None and isinstance(request, EffectRequest)):
        diagnosis = diagnose(start, recordings, (), lambda share: report(DIAGNOSED * share),
                             reference=reference)
    case = _Case(model, recordings, validate, diagnosis, reference)
    if isinstance(request, CurveRequest):
        found = _with_curve(case, request, report)
    else:
        try:
            found = _with_effect(case, request)
        except (ModelError, PlacementError) as error:
            force = False
            found = case.adoption(request, model, 2 * case.residuals(recordings, model), (), None, (
                f'its fit gives no model: {error}',))
    report(1.0)
    is_sure = not found.objections
    reason = '; '.join(found.objections) or f'the error on {case.held_out} ' + change(
        found.held_out_before, found.held_out_after, found.unit)
    remarks = (*found.remarks, WEAK) if is_sure and not validate else found.remarks
    return replace(found, adopted=is_sure or force, reason=reason, remarks=remarks)


def original(model: DriveModel) -> DriveModel:
    """Return a model with its numbers as they were before anything was fitted to them.

    Tolerances are limits about what the file said at first. Counted from the last fit, they
    would let a number drift.
    """
    values = original_values(model.values)
    if all(values[key] == value for key, value in model.values.items()):
        return model
    return replace(DriveModel.from_parameters(values), source=model.source)


@dataclass(frozen=True)
class _Case:
    """A model and the data that decide about a request."""

    model: DriveModel
    recordings: Sequence[Recording]
    validate: Sequence[Recording]
    diagnosis: Diagnosis
    reference: Reference | None

    @property
    def held_out(self) -> str:
        """What decides, for a sentence."""
        return ('the validation recordings' if self.validate
                else 'held-out blocks of the recordings')

    @property
    def table(self) -> ModelTable:
        """All rows of the diagnosis."""
        assert self.diagnosis.selection is not None
        return self.diagnosis.selection

    def residuals(self, recordings: Sequence[Recording], *models: DriveModel) -> list[Residuals]:
        """Return the residuals of models, less the error that a reference has as well."""
        found = [measure_residuals(model, recordings)[0] for model in models]
        if self.reference is None:
            return found
        shown = self.reference.shown_by(recordings)
        return [replace(residuals, measured=residuals.measured - shown) for residuals in found]

    @outside_cost('adopt refuses an effect that does not lower the error, on the recordings and '
                  'held out')
    def objections(self, gain: PredictiveGain | None, errors: Sequence[float], where: str,
                   unit: str) -> tuple[str, ...]:
        """Return why an effect does not lower the error on some data for certain; none if it does.

        Parameters
        ----------
        gain : PredictiveGain or None
            Of the model with the effect.
        errors : (before, after)
            Over all drives [N].
        where : str
            The data, for the sentence.
        unit : str
            Of the errors.
        """
        asked = FURTHER_ERRORS if any(
            isinstance(effect, CatalogueEffect) for effect in self.model.effects) else FIRST_ERRORS
        if gain is None:
            return (f'the error on {where} cannot be computed',)
        if gain.confirms(asked):
            return ()
        why = (f'on {listed(gain.losing)} it rises for certain' if gain.losing else
               f'the fall is {gain.certainty:.2g} standard errors, must be more than {asked:g}')
        return (f'the error on {where} {change(errors[0], errors[1], unit)}; {why}',)

    def adoption(self, request: EffectRequest | CurveRequest, after: DriveModel,
                 residuals: Sequence[Residuals], held_out: Sequence[float],
                 gain: PredictiveGain | None, objections: tuple[str, ...]) -> Adoption:
        """Return the undecided adoption of a model, with all objections.

        Parameters
        ----------
        request : EffectRequest or CurveRequest
        after : DriveModel
        residuals : (before, after)
            On the recordings.
        held_out : (before, after)
            Errors on blocks of the recordings [N]; on validation recordings they are computed.
        gain : PredictiveGain or None
            On held-out data.
        objections : tuple of str
        """
        before, with_it = residuals
        errors = [rms(before), rms(with_it)]
        if self.validate:
            held_out = [rms(each) for each in self.residuals(self.validate, self.model, after)]
        if after is not self.model:
            objections += (
                self.objections(predictive_gain(before, with_it), errors, 'the recordings',
                                before.unit)
                or self.objections(gain, held_out, self.held_out, before.unit))
        first, last = held_out or errors
        return Adoption(
            request, request.drives, self.model, after, before, with_it, first, last,
            VALIDATION if self.validate else BLOCKS, self.diagnosis.noise_floors,
            self.diagnosis.noise_floor, objections=objections,
            reference=() if self.reference is None else self.reference.names)


def _with_effect(case: _Case, request: EffectRequest) -> Adoption:
    """Return the undecided adoption of an effect.

    Raises
    ------
    ModelError, PlacementError
        Where the effect gives no model.
    """
    diagnosis, table = case.diagnosis, case.table
    margin = diagnosis.decisions.rival_margin
    row = requested_row(table, request, margin)
    answer = Answer(table, row, case.validate, diagnosis.decisions)
    effect = next(effect for effect in answer.effects if effect.name == request.name)
    after, gone = requested_model(answer, request, effect)
    refused = [component.drive for component in row.fits.refused(row.fitted)
               if component.effect is effect.effect]
    places = listed([answer.drives[d] for d in refused if d is not None])
    impossible = (f'the values of {request.name} that fit best are impossible'
                  f'{places and f" on {places}"}: beyond its bounds, or more is taken away than '
                  'the model has',) if refused else ()
    residuals = case.residuals(case.recordings, case.model, after)
    pushing = () if gone or not request.effect.is_friction else _of_friction(
        effect, after, residuals[-1])
    found = case.adoption(
        request, after, residuals, (effect.held_out_before, effect.held_out_after), effect.gain,
        (*_of_table(case, request, row, effect), *impossible, *pushing))
    rivals = tuple(dict.fromkeys(
        other for rival in table.rivals(margin)
        if request.name in (*rival.missing, *rival.instead)
        for other in (rival.instead if request.name in rival.missing else rival.missing)))
    others = [c.name for c in row.effects if c.name != request.name]
    remarks = [f'{listed(rivals, "or")} explains the data about as well'] if rivals else []
    remarks += [f'The value of {listed(effect.at_bound)} is at the limit of the values that were '
                'tried'] if effect.at_bound else []
    remarks += [f'{request.name}{" of " + place.rstrip(".") if place else ""} is removed from the '
                'model: the recordings show none of it' for place in gone]
    remarks += [f'The recordings also show {listed(others)}'] if others else []
    prefix = f'effects.{request.name}.'
    return replace(
        found, drives=effect.drives, remarks=tuple(remarks), rivals=rivals,
        moments=effect.moments, parameters={
            key: replace(estimate, value=float(after.values[prefix + key]))
            for key, estimate in effect.parameters.items() if prefix + key in after.values},
        calibrated=tuple(number for number in calibrations(
            answer.fits, answer.fitted) if number.after != number.before))


def _of_table(case: _Case, request: EffectRequest, row: Row, effect: FoundEffect,
              ) -> tuple[str, ...]:
    """Return why the table does not report the requested effect; nothing where it does."""
    diagnosis, table = case.diagnosis, case.table
    if effect.course is not None:
        return (f'it is there{effect.when} only, and a model has it all the time: record the '
                'machine in its present state',)
    best = next((c for c in table.best.effects if c.name == request.name), None)
    known = table.first.design.named(best.drives) if best else None
    if known and (missed := [drive for drive in effect.drives or () if drive not in known]):
        return (f'the recordings show {request.name} on {listed(known)}, not on {listed(missed)}',)
    if best or any(request.name in rival.instead
                   for rival in table.rivals(diagnosis.decisions.rival_margin)):
        return ()
    more = f'the set with {request.name} costs {plain(row.cost - table.best.cost, 2)} more'
    for first in diagnosis.effects:
        on = f' on {listed(first.drives)}' if first.drives else ''
        return (f'{first.name}{on} explains these recordings better: {more}',)
    if request.present(case.model):
        return (f'{request.name} is in the model already, and the recordings support no other '
                f'values: {more}',)
    return (f'the recordings do not support {request.name}: {more} than the model without it',)


@outside_cost('adopt refuses friction that pushes along the motion')
def _of_friction(effect: FoundEffect, model: DriveModel, residuals: Residuals) -> tuple[str, ...]:
    """Return whether friction of a model would push along the motion, on a drive or in all."""
    on_drives = [each.name for each in model.effects if each.name == ACTIVE_FRICTION or (
        isinstance(each, DriveEffect) and each.is_friction)]
    elsewhere = [each.name for each in model.effects if each.name == PASSIVE_FRICTION or (
        isinstance(each, StructureEffect) and each.is_friction)]
    velocity = residuals.variables['velocity']
    moving = np.abs(velocity) > MOVING * np.asarray(model.reversal.velocity)
    power = velocity * sum(residuals.parts.get(name, 0.0) for name in (
        on_drives if effect.drives else [*on_drives, *elsewhere]))
    for place in effect.drives or ('all drives',):
        chosen = ([residuals.drives.index(place)] if effect.drives
                  else range(len(residuals.drives)))
        moves = moving[:, chosen].any(axis=1)
        share = float(np.mean(power[moves][:, chosen].sum(axis=1) < 0)) if moves.any() else 0.0
        if share > PUSHES:
            return (f'friction on {place} would push along the motion in {share:.0%} of the '
                    'moving time',)
    return ()


def _with_curve(case: _Case, request: CurveRequest, report: Callable[[float], None]) -> Adoption:
    """Return the undecided adoption of a measured curve."""
    model, drive = case.model, request.drive
    bare = without_curve(model, drive)
    start, _ = measure_residuals(bare, case.recordings)
    fitted = fit_curve(start, request)
    after = with_curve(bare, drive, fitted)
    if case.validate:
        given, found = (measure_residuals(each, case.validate)[0] for each in (bare, after))
    else:
        given, found = start, held_out_residuals(
            start, request, lambda share: report(DIAGNOSED + (1 - DIAGNOSED) * share))
    count = len(model.drives)
    # Chosen among the curves of every drive over every variable.
    evidence = fitted.evidence - 2 * float(np.log(count * (len(OWN) + len(OF) * (count - 1))))
    against = () if evidence > 0 else (
        f'the recordings support no curve over {request.variable} on {drive}: evidence '
        f'{evidence:.3g} (threshold 0)',)
    remarks = [f'A measured curve is no cause: {fitted.freedom:.0f} degrees of freedom over '
               f'{request.variable} from {fitted.curve.start:.4g} to {fitted.curve.end:.4g}; '
               'beyond that range it is constant']
    if case.diagnosis.effects:
        others = listed([effect.name for effect in case.diagnosis.effects])
        remarks.append(f'The recordings also show {others}: adopt causes first, a curve in their '
                       'place is valid for this motion only')
    return replace(
        case.adoption(request, after, case.residuals(case.recordings, model, after),
                      (rms(given), rms(found)), predictive_gain(given, found), against),
        parameters=fitted.parameters(drive, start.units_of(drive).effort), curve=fitted,
        remarks=tuple(remarks))
