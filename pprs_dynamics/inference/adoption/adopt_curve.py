# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding a measured curve to a model: fitted, judged on data it was not fitted to, or refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.inference.adoption import objections
from pprs_dynamics.inference.adoption.adoption import BLOCKS, VALIDATION, Adoption
from pprs_dynamics.inference.adoption.fit_curve import (
    CurveRequest,
    FittedCurve,
    fit_curve,
    held_out_error,
    price,
)
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis, diagnose
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.paired_errors import block_gains, rms
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN, MeasuredCurve
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import build_model

ACTIVE = 'effects.active'
DIAGNOSIS = 0.7  # of the work, for the progress bar


def adopt_curve(
    model: ForceModel, request: CurveRequest, recordings: Sequence[Recording],
    validate: Sequence[Recording] = (), force: bool = False,
    progress: Callable[[float], None] | None = None, diagnosis: Diagnosis | None = None,
) -> Adoption:
    """Return a model with a curve, or why it should not have it; see `adopt`.

    A curve of the same drive that the model has already is replaced.

    Raises
    ------
    CurveError, PprsError
        Where the recordings cannot give the curve, and as `measure_residuals`.
    """
    report = progress or (lambda share: None)
    diagnosis = diagnosis or diagnose(
        model, recordings, (), lambda share: report(DIAGNOSIS * share))
    plain = without_curve(model, request.drive)
    start, _ = measure_residuals(plain, recordings)
    noise = diagnosis.noise[request.drive]
    fitted = fit_curve(start, request, noise)
    after = with_curve(plain, request.drive, fitted)
    residuals = measure_residuals(after, recordings)[0]
    before = start if plain is model else measure_residuals(model, recordings)[0]
    if validate:
        given, found = (measure_residuals(one, validate)[0] for one in (plain, after))
    else:
        given, found = start, _with_error(start, request, held_out_error(
            start, request, noise, lambda share: report(DIAGNOSIS + (1 - DIAGNOSIS) * share)))
    held_out = rms(given), rms(found)
    gains = block_gains(given, found, {request.drive: noise})
    where = 'the validation recordings' if validate else 'held-out blocks of the recordings'
    evidence = fitted.evidence - price(
        len(model.drives), len(OWN) + len(OF) * (len(model.drives) - 1))
    against = [] if evidence > 0 else [
        f'no curve over {request.variable} is called for on {request.drive}: evidence '
        f'{evidence:.3g}, where 0 is the threshold']
    against += objections.of_held_out_error(*held_out, gains, model, where)
    remarks = [f'a measured curve, not a cause: {fitted.freedom:.0f} degrees of freedom over '
               f'{request.variable} from {fitted.curve.start:.4g} to {fitted.curve.end:.4g}; '
               'beyond, it goes on with its last value']
    if diagnosis.effects:
        remarks.append('the recordings call for '
                       f'{", ".join(one.name for one in diagnosis.effects)}: a curve that stands '
                       'for it holds for this motion only; adopt causes first')
    if not validate:
        remarks.append('blocks of the same recordings are weak evidence: give one along another '
                       'motion with --validate')
    reason = '; '.join(against) or (
        f'the error on {where} falls from {held_out[0]:.4g} to {held_out[1]:.4g} {start.unit}')
    report(1.0)
    return Adoption(
        request, request.drives, not against or force, bool(against) and force, reason,
        tuple(against), tuple(remarks), _parameters(request, fitted, start), (), (), model, after,
        before, residuals, rms(before), rms(residuals), *held_out,
        VALIDATION if validate else BLOCKS, diagnosis.noise_floor, diagnosis.noise_floors, fitted)


def with_curve(model: ForceModel, drive: str, fitted: FittedCurve) -> ForceModel:
    """Return a model with a curve on a drive."""
    curve, prefix = fitted.curve, f'effects.{MeasuredCurve.name}.{drive}'
    active = [name for name in model.values.get(ACTIVE, ()) if name != MeasuredCurve.name]
    return _built(model, {
        **model.values, ACTIVE: [*active, MeasuredCurve.name],
        f'{prefix}.variable': curve.variable, f'{prefix}.from': curve.start,
        f'{prefix}.to': curve.end, f'{prefix}.periodic': curve.periodic,
        f'{prefix}.values': list(curve.values)})


def without_curve(model: ForceModel, drive: str) -> ForceModel:
    """Return a model without a drive's curve: itself, where there is none."""
    prefix = f'effects.{MeasuredCurve.name}.'
    if not any(key.startswith(f'{prefix}{drive}.') for key in model.values):
        return model
    values = {key: value for key, value in model.values.items()
              if not key.startswith(f'{prefix}{drive}.')}
    if not any(key.startswith(prefix) for key in values):
        values[ACTIVE] = [name for name in values[ACTIVE] if name != MeasuredCurve.name]
    return _built(model, values)


def _built(model: ForceModel, values: dict[str, Any]) -> ForceModel:
    return replace(build_model(values), source=model.source)


def _with_error(residuals: Residuals, request: CurveRequest, error: Any) -> Residuals:
    """Return residuals whose model has what makes up a drive's error."""
    drive, change = residuals.drives.index(request.drive), np.zeros_like(residuals.model)
    change[:, drive] = np.nan_to_num(residuals.error[:, drive] - error)
    return replace(residuals, model=residuals.model + change)


def _parameters(request: CurveRequest, fitted: FittedCurve, residuals: Residuals,
                ) -> dict[str, Estimate]:
    unit = residuals.units_of(request.drive).effort
    spread = np.sqrt(np.diag(fitted.covariance))
    return {f'{request.drive}.values[{k}]': Estimate(value, float(std), unit)
            for k, (value, std) in enumerate(zip(fitted.curve.values, spread, strict=True))}
