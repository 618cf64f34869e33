# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding an effect to a model: fitted, judged on data it was not fitted to, taken or refused.

What decides is the model as it would be written, evaluated on the recordings again; and a wrong
effect that lowers the error a little is refused because the recordings call for another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption import objections
from pprs_dynamics.inference.adoption.adoption import BLOCKS, VALIDATION, Adoption
from pprs_dynamics.inference.adoption.fit_curve import (
    CurveRequest,
    FittedCurve,
    fit_curve,
    held_out_residuals,
    with_curve,
    without_curve,
)
from pprs_dynamics.inference.adoption.fit_effect import StandingError, fit_effect
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, rms
from pprs_dynamics.inference.search.estimates import Calibration, Estimate
from pprs_dynamics.inference.search.held_out import predictive_gain
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import original_values

# Shares of the work, for the progress bar.
DIAGNOSIS, FIT = 0.5, 0.85
DIAGNOSIS_BEFORE_CURVE = 0.7
WEAK = 'blocks of the same recordings are weak evidence: give one'


def adopt(
    model: DriveModel, request: EffectRequest | CurveRequest, recordings: Sequence[Recording],
    validate: Sequence[Recording] = (), force: bool = False,
    progress: Callable[[float], None] | None = None, diagnosis: Diagnosis | None = None,
    reference: Reference | None = None,
) -> Adoption:
    """Return a model with an effect, or why it should not have it.

    A curve of the same drive that the model has already is replaced.

    Parameters
    ----------
    model : DriveModel
    request : EffectRequest or CurveRequest
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted, and what decides; else blocks of the recordings do.
    force : bool, optional
        Adopt it in spite of objections.
    progress : callable, optional
        Called with the share of the work that is done.
    diagnosis : Diagnosis, optional
        On the same recordings, where it is known already: of `original(model)`, and for a curve
        of the model itself. The fit is made with its decisions.
    reference : Reference, optional
        Since which the effect is a change; of `original(model)` or what that was then. Errors are
        then those beyond what it shows as well.

    Raises
    ------
    EffectRequestError
        For an effect that cannot act in what the model is of, and for a curve since a reference.
    CurveError
        Where the recordings cannot give the curve.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    if isinstance(request, CurveRequest):
        if reference is not None:
            raise EffectRequestError(f'{request.name}: a curve holds what was there before, too, '
                                     'must be an effect where it is to be a change since a '
                                     'reference')
        if diagnosis is None:
            diagnosis = diagnose(model, recordings, (),
                                 lambda share: report(DIAGNOSIS_BEFORE_CURVE * share))
        return _adopt_curve(
            _Case(model, model, request, recordings, validate, force, diagnosis), request, report)
    start = original(model)
    request = request.placed(start)
    if diagnosis is None:
        diagnosis = diagnose(start, recordings, (), lambda share: report(DIAGNOSIS * share),
                             reference=reference)
    case = _Case(model, start, request, recordings, validate, force, diagnosis, reference)
    named = next((one for one in diagnosis.effects if one.name == request.name), None)
    # Where the recordings call for it, beside what else they call for, is known by now.
    placed = replace(request, drives=named.drives) if named and not request.drives else request
    try:
        fitted = fit_effect(start, placed, recordings,
                            lambda share: report(DIAGNOSIS + (FIT - DIAGNOSIS) * share),
                            diagnosis.decisions,
                            None if reference is None else reference.carried_over)
    except (ModelError, StandingError) as error:
        return case.without_model(str(error))
    if fitted is None:
        return case.without_model(f'{request.name} cannot act on what the recordings show')
    before, after = case.residuals(fitted.model)
    found = [*objections.of_other_effects(request, fitted, diagnosis),
             *objections.of_constraints(fitted, after, diagnosis.decisions)]
    rivals = tuple(name for names in diagnosis.indistinguishable if request.name in names
                   for name in names if name != request.name)
    if named is None and not rivals and objections.is_rival(request, fitted, diagnosis):
        rivals = (diagnosis.effects[0].name,)
    remarks = [f'{", ".join(rivals)} would explain these recordings as well'] if rivals else []
    remarks += [f'{", ".join(fitted.at_bound)} stands at the edge of what was tried'
                ] if fitted.at_bound else []
    others = [one.name for one in diagnosis.effects if one.name != request.name]
    if fitted.nothing_left:
        where = ', '.join(filter(None, (one.rstrip('.') for one in fitted.nothing_left)))
        what = f'{request.name} of {where}' if where else request.name
        remarks.append(f'{what} is taken out of the model: these recordings leave nothing of it')
    if others and named:
        remarks.append(f'the recordings call for {", ".join(others)}, too')
    if validate:
        # What the model's own numbers gain by being fitted is not the effect's.
        given, without, with_it = case.beyond(validate, model, fitted.plain, fitted.model)
        held_out, gain = (rms(given), rms(with_it)), predictive_gain(without, with_it)
    else:
        without, with_it = (one.residuals for one in fitted.held_out)
        held_out = fitted.held_out[0].error, fitted.held_out[1].error
        gain = fitted.held_out[0].gain(fitted.held_out[1])
    # Columns of shapes hold near the model only: the fitted model itself must do better, too.
    found += objections.of_prediction(
        predictive_gain(before, after), before, after, model, 'the recordings'
        ) or objections.of_prediction(gain, without, with_it, model, case.held_out)
    report(1.0)
    return case.answer(fitted.model, fitted.drives, found, [*remarks, *case.weakness(found)],
                       before, after, held_out, fitted.parameters, tuple(fitted.calibrated), rivals,
                       moments=fitted.moments)


def original(model: DriveModel) -> DriveModel:
    """Return a model with its numbers as they were before anything was fitted to them.

    Tolerances are limits about what the file said at first; counted from where the last fit
    left a number, they would let it walk away.
    """
    values = original_values(model.values)
    if all(values[key] == value for key, value in model.values.items()):
        return model
    return replace(DriveModel.from_parameters(values), source=model.source)


@dataclass(frozen=True)
class _Case:
    """What is asked."""

    model: DriveModel
    start: DriveModel
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

    def residuals(self, after: DriveModel) -> tuple[Residuals, Residuals]:
        """Return those of the model as given and of another on the recordings."""
        before = (self.diagnosis.residuals if self.start is self.model
                  else self.beyond(self.recordings, self.model)[0])
        return before, self.beyond(self.recordings, after)[0]

    def beyond(self, recordings: Sequence[Recording], *models: DriveModel) -> list[Residuals]:
        """Return the residuals of models, less what the reference shows as well."""
        found = [measure_residuals(one, recordings)[0] for one in models]
        if self.reference is None:
            return found
        shown = self.reference.shown_by(recordings)
        return [replace(one, measured=one.measured - shown) for one in found]

    def weakness(self, objections: list[str]) -> list[str]:
        """Return what to say of the evidence for an effect that nothing speaks against."""
        return [] if objections or self.validate else [
            f'{WEAK} in another regime (other speeds, other payload) with --validate']

    def without_model(self, reason: str) -> Adoption:
        """Return the refusal of an effect whose fit gives no model."""
        (before,) = self.beyond(self.recordings, self.model)
        held_out = rms(self.beyond(self.validate, self.model)[0] if self.validate else before)
        refused = self.answer(self.model, self.request.drives, [reason], [], before, before,
                              (held_out, held_out), {})
        return replace(refused, adopted=False, forced=False,
                       reason=f'its fit gives no model: {reason}')

    def answer(
        self, after: DriveModel, drives: tuple[str, ...] | None, found: list[str],
        remarks: list[str], residuals_before: Residuals, residuals_after: Residuals,
        held_out: tuple[float, float], parameters: dict[str, Estimate],
        calibrated: tuple[Calibration, ...] = (), rivals: tuple[str, ...] = (),
        curve: FittedCurve | None = None, moments: Mapping[str, Estimate] | None = None,
    ) -> Adoption:
        """Return the answer to all objections that were found."""
        adopted = not found or self.force
        falls = f'{held_out[0]:.4g} to {held_out[1]:.4g} {residuals_before.unit}'
        reason = '; '.join(found) or f'the error on {self.held_out} falls from {falls}'
        return Adoption(
            self.request, drives, adopted, bool(found) and self.force, reason, tuple(found),
            tuple(remarks), parameters, calibrated, rivals, self.model, after, residuals_before,
            residuals_after, rms(residuals_before), rms(residuals_after), *held_out,
            VALIDATION if self.validate else BLOCKS, self.diagnosis.noise_floor,
            self.diagnosis.noise_floors, curve, moments or {},
            () if self.reference is None else self.reference.names)


def _adopt_curve(case: _Case, request: CurveRequest, report: Callable[[float], None]) -> Adoption:
    model, drive, noise = case.model, request.drive, case.diagnosis.noise[request.drive]
    plain = without_curve(model, drive)
    start, _ = measure_residuals(plain, case.recordings)
    fitted = fit_curve(start, request, noise)
    after = with_curve(plain, drive, fitted)
    residuals, _ = measure_residuals(after, case.recordings)
    before = start if plain is model else measure_residuals(model, case.recordings)[0]
    if case.validate:
        given, found = (measure_residuals(one, case.validate)[0] for one in (plain, after))
    else:
        given, found = start, held_out_residuals(
            start, request, noise, lambda share: report(
                DIAGNOSIS_BEFORE_CURVE + (1 - DIAGNOSIS_BEFORE_CURVE) * share))
    held_out = rms(given), rms(found)
    count = len(model.drives)
    # Chosen among the curves of every drive over every variable.
    evidence = fitted.evidence - 2 * float(np.log(count * (len(OWN) + len(OF) * (count - 1))))
    against = [] if evidence > 0 else [
        f'no curve over {request.variable} is called for on {drive}: evidence {evidence:.3g}, '
        'where 0 is the threshold']
    against += objections.of_prediction(
        predictive_gain(given, found), given, found, model, case.held_out)
    remarks = [f'a measured curve, not a cause: {fitted.freedom:.0f} degrees of freedom over '
               f'{request.variable} from {fitted.curve.start:.4g} to {fitted.curve.end:.4g}; '
               'beyond, it goes on with its last value']
    if case.diagnosis.effects:
        remarks.append('the recordings call for '
                       f'{", ".join(one.name for one in case.diagnosis.effects)}: a curve that '
                       'stands for it holds for this motion only; adopt causes first')
    if not case.validate:
        remarks.append(f'{WEAK} along another motion with --validate')
    report(1.0)
    return case.answer(after, request.drives, against, remarks, before, residuals, held_out,
                       fitted.parameters(drive, start.units_of(drive).effort), curve=fitted)
