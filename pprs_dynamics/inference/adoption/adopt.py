# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding an effect to a model: its row of the table, the held-out test, and the decision."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.adoption import BLOCKS, VALIDATION, Adoption
from pprs_dynamics.inference.adoption.fit_curve import (
    CurveRequest,
    FittedCurve,
    fit_curve,
    held_out_residuals,
    with_curve,
    without_curve,
)
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.adoption.requested_row import (
    PlacementError,
    RequestedModel,
    requested_row,
)
from pprs_dynamics.inference.diagnosis.answer import Answer
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import change, listed, plain
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, rms, rms_by_drive
from pprs_dynamics.inference.search.decisions import outside_cost
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.inference.search.held_out import PredictiveGain, predictive_gain
from pprs_dynamics.inference.search.table import Row
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN
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
    start = model if isinstance(request, CurveRequest) else original(model)
    is_curve = isinstance(request, CurveRequest)
    if isinstance(request, CurveRequest) and reference is not None:
        raise EffectRequestError(f'{request.name}: a curve contains the error of the reference, '
                                 'too; since a reference, request an effect')
    if isinstance(request, EffectRequest):
        request = request.placed(start)
    if diagnosis is None or (diagnosis.selection is None and not is_curve):
        diagnosis = diagnose(start, recordings, (), lambda share: report(DIAGNOSED * share),
                             reference=reference)
    case = _Case(model, request, recordings, validate, force, diagnosis, reference)
    answer = (_adopt_curve(case, request, report) if isinstance(request, CurveRequest)
              else _adopt_effect(case, request))
    report(1.0)
    return answer


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
    """A request with everything that decides about it."""

    model: DriveModel
    request: EffectRequest | CurveRequest
    recordings: Sequence[Recording]
    validate: Sequence[Recording]
    force: bool
    diagnosis: Diagnosis
    reference: Reference | None = None

    @property
    def held_out(self) -> str:
        """What decides, for a sentence."""
        return ('the validation recordings' if self.validate
                else 'held-out blocks of the recordings')

    def errors(self, recordings: Sequence[Recording], *models: DriveModel) -> list[Residuals]:
        """Return the residuals of models, less the error that a reference has as well."""
        found = [measure_residuals(model, recordings)[0] for model in models]
        if self.reference is None:
            return found
        shown = self.reference.shown_by(recordings)
        return [replace(one, measured=one.measured - shown) for one in found]

    @outside_cost('adopt refuses an effect that does not lower the error, on the recordings and '
                  'held out')
    def objections(self, gain: PredictiveGain | None, residuals: Sequence[Residuals], where: str,
                   sizes: Sequence[float] = ()) -> list[str]:
        """Return why an effect does not lower the error on some data for certain; none if it does.

        Parameters
        ----------
        gain : PredictiveGain or None
            Of the model with the effect.
        residuals : sequence of Residuals
            Before and after, for the sentence.
        where : str
            The data, for the sentence.
        sizes : (before, after), optional
            Errors over all drives, where `residuals` are of other data.
        """
        asked = FURTHER_ERRORS if any(
            isinstance(effect, CatalogueEffect) for effect in self.model.effects) else FIRST_ERRORS
        if gain is None:
            return [f'the error on {where} cannot be computed']
        if gain.confirms(asked):
            return []
        rank = min if gain.losing else max
        drive = rank(gain.by_drive, key=lambda name: gain.by_drive[name])
        before, after = (rms_by_drive(one)[drive] for one in residuals)
        text = (f'the error on {where} {change(sizes[0], sizes[1], residuals[0].unit)}' if sizes
                else f'the error of {drive} on {where} '
                f'{change(before, after, residuals[0].units_of(drive).effort)}')
        return [f'{text}: worse by {-gain.by_drive[drive]:.2g} standard errors' if gain.losing
                else f'{text}; over all drives the fall is {gain.certainty:.2g} standard errors, '
                f'must be more than {asked:g}']

    def answer(
        self, after: DriveModel, drives: tuple[str, ...] | None, found: list[str],
        remarks: list[str], residuals: Sequence[Residuals],
        held_out: Sequence[float], parameters: dict[str, Estimate],
        calibrated: tuple[Calibration, ...] = (), rivals: tuple[str, ...] = (),
        curve: FittedCurve | None = None, moments: Mapping[str, Estimate] | None = None,
    ) -> Adoption:
        """Return the answer, with all objections that were found."""
        adopted, unit = not found or self.force, residuals[0].unit
        if not (found or self.validate):
            remarks = [*remarks, WEAK]
        return Adoption(
            self.request, drives, adopted, bool(found) and self.force,
            '; '.join(found) or f'the error on {self.held_out} '
            f'{change(held_out[0], held_out[1], unit)}',
            tuple(found), tuple(remarks), parameters, calibrated, rivals, self.model, after,
            residuals[0], residuals[1], rms(residuals[0]), rms(residuals[1]), held_out[0],
            held_out[1],
            VALIDATION if self.validate else BLOCKS, self.diagnosis.noise_floor,
            self.diagnosis.noise_floors, curve, moments or {},
            () if self.reference is None else self.reference.names)


def _adopt_effect(case: _Case, request: EffectRequest) -> Adoption:
    diagnosis, table = case.diagnosis, case.diagnosis.selection
    assert table is not None
    margin = diagnosis.decisions.rival_margin
    try:
        row = requested_row(table, request, margin)
        found = RequestedModel(Answer(table, row, case.validate, diagnosis.decisions), request)
        effect, after = found.effect, found.model
    except (ModelError, PlacementError) as error:
        (before,) = case.errors(case.recordings, case.model)
        size = rms(case.errors(case.validate, case.model)[0] if case.validate else before)
        refused = case.answer(case.model, request.drives, [f'its fit gives no model: {error}'], [],
                              (before, before), (size, size), {})
        return replace(refused, adopted=False, forced=False)
    residuals = case.errors(case.recordings, case.model, after)
    against = [*_of_table(case, row, effect), *(
        [] if not effect.objection or effect.is_only_refuted else [effect.objection])]
    if request.effect.is_friction and not found.gone:
        against += _of_friction(effect.drives or ('',), after, residuals[1])
    held_out = [effect.held_out_before, effect.held_out_after]
    tested = residuals
    if case.validate:
        tested = case.errors(case.validate, case.model, after)
        held_out = [rms(residual) for residual in tested]
    gain = predictive_gain(residuals[0], residuals[1])
    against += (case.objections(gain, residuals, 'the recordings')
                or case.objections(effect.gain, tested, case.held_out,
                                   () if case.validate else held_out))
    rivals = tuple(dict.fromkeys(
        other for rival in table.rivals(margin)
        if request.name in (*rival.missing, *rival.instead)
        for other in (rival.instead if request.name in rival.missing else rival.missing)))
    others = [c.name for c in row.effects if c.name != request.name]
    remarks = [f'{listed(rivals, "or")} explains the data about as well'] if rivals else []
    remarks += [f'The value of {listed(effect.at_bound)} is at the limit of the values that were '
                'tried'] if effect.at_bound else []
    remarks += [f'{request.name}{" of " + place.rstrip(".") if place else ""} is removed from the '
                'model: the recordings show none of it' for place in found.gone]
    remarks += [f'The recordings also show {listed(others)}'] if others else []
    return case.answer(after, effect.drives, against, remarks, residuals, held_out,
                       found.parameters, found.calibrations, rivals,
                       moments=effect.moments)


def _of_table(case: _Case, row: Row, effect: FoundEffect) -> list[str]:
    """Return why the table does not report the requested effect; nothing where it does."""
    request, diagnosis, table = case.request, case.diagnosis, case.diagnosis.selection
    assert table is not None
    if effect.course is not None:
        return [f'it is there{effect.when} only, and a model has it all the time: record the '
                'machine in its present state']
    best = next((c for c in table.best.effects if c.name == request.name), None)
    known = table.first.design.named(best.drives) if best else None
    missed = [drive for drive in effect.drives or () if known and drive not in known]
    if missed:
        return [f'the recordings show {request.name} on {listed(known or ())}, not on '
                f'{listed(missed)}']
    if best or any(request.name in rival.instead
                   for rival in table.rivals(diagnosis.decisions.rival_margin)):
        return []
    more = f'the set with {request.name} costs {plain(row.cost - table.best.cost, 2)} more'
    if diagnosis.effects:
        first = diagnosis.effects[0]
        on = f' on {listed(first.drives)}' if first.drives else ''
        return [f'{first.name}{on} explains these recordings better: {more}']
    if diagnosis.depends_on:
        return [f'no effect of the catalogue has the form of the error: '
                f'{diagnosis.depends_on[0].text}']
    if isinstance(request, EffectRequest) and request.present(case.model):
        return [f'{request.name} is in the model already, and the recordings support no other '
                f'values: {more}']
    return [f'the recordings do not support {request.name}: {more} than the model without it']


@outside_cost('adopt refuses friction that pushes along the motion')
def _of_friction(places: Sequence[str], model: DriveModel, residuals: Residuals) -> list[str]:
    """Return whether friction of a model would push along the motion; '' is all joints."""
    own, passive = np.zeros((2, *residuals.model.shape))
    for effect in model.effects:
        is_friction = isinstance(effect, CatalogueEffect) and effect.is_friction
        if effect.name == ACTIVE_FRICTION or (is_friction and isinstance(effect, DriveEffect)):
            own += residuals.parts.get(effect.name, 0.0)
        elif effect.name == PASSIVE_FRICTION or is_friction:
            passive += residuals.parts.get(effect.name, 0.0)
    velocity = residuals.variables['velocity']
    moving = np.abs(velocity) > MOVING * np.asarray(model.reversal.velocity)
    shares = {drive: _share(own[:, d] * velocity[:, d] < 0, moving[:, d])
              for d, drive in enumerate(residuals.drives)}
    shares[''] = _share(((own + passive) * velocity).sum(axis=1) < 0, moving.any(axis=1))
    worst = max(places, key=lambda place: shares[place])
    return [] if shares[worst] < PUSHES else [
        f'friction {f"on {worst}" if worst else "of the joints"} would push along the motion in '
        f'{shares[worst]:.0%} of the moving time']


def _share(true: Any, among: Any) -> float:
    count = int(among.sum())
    return float((true & among).sum()) / count if count else 0.0


def _adopt_curve(case: _Case, request: CurveRequest, report: Callable[[float], None]) -> Adoption:
    model, drive = case.model, request.drive
    plain_model = without_curve(model, drive)
    start, _ = measure_residuals(plain_model, case.recordings)
    fitted = fit_curve(start, request)
    after = with_curve(plain_model, drive, fitted)
    residuals, _ = measure_residuals(after, case.recordings)
    before = start if plain_model is model else measure_residuals(model, case.recordings)[0]
    if case.validate:
        given, found = (measure_residuals(one, case.validate)[0] for one in (plain_model, after))
    else:
        given, found = start, held_out_residuals(
            start, request, lambda share: report(DIAGNOSED + (1 - DIAGNOSED) * share))
    count = len(model.drives)
    # Chosen among the curves of every drive over every variable.
    evidence = fitted.evidence - 2 * float(np.log(count * (len(OWN) + len(OF) * (count - 1))))
    against = [] if evidence > 0 else [
        f'the recordings support no curve over {request.variable} on {drive}: evidence '
        f'{evidence:.3g} (threshold 0)']
    against += case.objections(predictive_gain(given, found), (given, found), case.held_out)
    remarks = [f'A measured curve is no cause: {fitted.freedom:.0f} degrees of freedom over '
               f'{request.variable} from {fitted.curve.start:.4g} to {fitted.curve.end:.4g}; '
               'beyond that range it is constant']
    if case.diagnosis.effects:
        remarks.append('The recordings also show '
                       f'{listed([one.name for one in case.diagnosis.effects])}: adopt causes '
                       'first, a curve in their place is valid for this motion only')
    return case.answer(after, request.drives, against, remarks, (before, residuals),
                       (rms(given), rms(found)),
                       fitted.parameters(drive, start.units_of(drive).effort), curve=fitted)
