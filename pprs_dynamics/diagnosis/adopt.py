"""Adding an effect to a model: fitted, judged on data it was not fitted to, taken or refused.

What decides is the model as it would be written, evaluated on the recordings again; and a wrong
effect that lowers the error a little is refused because the recordings call for another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis import objections
from pprs_dynamics.diagnosis.adoption import (
    Calibration,
    Estimate,
    estimate_present,
    fitted_model,
)
from pprs_dynamics.diagnosis.diagnose import Diagnosis, diagnose
from pprs_dynamics.diagnosis.joint_fit import JointFit, Regression
from pprs_dynamics.diagnosis.judging import MARGIN
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.diagnosis.paired_errors import block_gains, rms
from pprs_dynamics.diagnosis.trial import Offer, StandingError, try_effect
from pprs_dynamics.effects.drive_effect import DriveEffect
from pprs_dynamics.errors import ModelError
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.ledger import original_values
from pprs_dynamics.model.model_file import build_model
from pprs_dynamics.regression.design import Design
from pprs_dynamics.residuals.measuring import measure_residuals
from pprs_dynamics.residuals.residuals import Residuals

BLOCKS, VALIDATION = 'blocks', 'validation'
# Shares of the work, for the progress bar.
DIAGNOSIS, TRIAL = 0.5, 0.85


@dataclass(frozen=True)
class Adoption:
    """The answer to an offered effect.

    Parameters
    ----------
    offer : Offer
    drives : tuple of str or None
        On which it was fitted.
    adopted, forced : bool
        Forced: in spite of objections.
    reason : str
        Why, in one sentence.
    objections, remarks : tuple of str
    parameters : dict of str to Estimate
    calibrated : tuple of Calibration
        Numbers of the model that moved within their tolerances.
    rivals : tuple of str
        Effects that explain the recordings as well.
    before, after : ForceModel
        As given; and with the effect. The latter is the former where the effect gives no model.
    residuals_before, residuals_after : Residuals
        On the recordings.
    error_before, error_after, held_out_before, held_out_after : float
        [N]
    held_out_on : {'blocks', 'validation'}
    noise_floor : float
        What the fit leaves [N].
    """

    offer: Offer
    drives: tuple[str, ...] | None
    adopted: bool
    forced: bool
    reason: str
    objections: tuple[str, ...]
    remarks: tuple[str, ...]
    parameters: dict[str, Estimate]
    calibrated: tuple[Calibration, ...]
    rivals: tuple[str, ...]
    before: ForceModel
    after: ForceModel
    residuals_before: Residuals
    residuals_after: Residuals
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    held_out_on: str
    noise_floor: float

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.offer.name

    def as_data(self) -> dict[str, Any]:
        """Return the keys of the interface, and what the README adds to them."""
        return {
            'adopted': self.adopted, 'reason': self.reason, 'effect': self.effect,
            'drives': None if self.drives is None else list(self.drives),
            'error_before': self.error_before, 'error_after': self.error_after,
            'held_out_before': self.held_out_before, 'held_out_after': self.held_out_after,
            'held_out_on': self.held_out_on, 'noise_floor': self.noise_floor,
            'forced': self.forced, 'objections': list(self.objections),
            'remarks': list(self.remarks), 'rivals': list(self.rivals),
            'parameters': {key: one.as_data() for key, one in self.parameters.items()},
            'calibrated': [{'key': one.label, 'before': one.before, 'after': one.after,
                            'std': one.std, 'unit': one.unit} for one in self.calibrated]}


def adopt(
    model: ForceModel, offer: Offer, recordings: Sequence[Recording],
    validate: Sequence[Recording] = (), force: bool = False,
    progress: Callable[[float], None] | None = None, diagnosis: Diagnosis | None = None,
) -> Adoption:
    """Return a model with an effect, or why it should not have it.

    Parameters
    ----------
    model : ForceModel
    offer : Offer
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted, and what decides; else blocks of the recordings do.
    force : bool, optional
        Adopt it in spite of objections.
    progress : callable, optional
        Called with the share of the work that is done.
    diagnosis : Diagnosis, optional
        Of `original(model)` on the same recordings, where it is known already.

    Raises
    ------
    OfferError
        For an effect that cannot act in what the model is of.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    offer.require_place(model)
    start = original(model)
    case = _Case(model, start, offer, recordings, validate, force)
    if offer.present(model):
        return _fit_anew(case, report)
    if diagnosis is None:
        diagnosis = diagnose(start, recordings, (), lambda share: report(DIAGNOSIS * share))
    try:
        trial = try_effect(start, offer, recordings,
                           lambda share: report(DIAGNOSIS + (TRIAL - DIAGNOSIS) * share))
    except (ModelError, StandingError) as error:
        return case.without_model(str(error))
    if trial is None:
        return _fit_anew(case, report)
    before, after = case.residuals(trial.regression, trial.model)
    found = [*objections.of_other_effects(offer, trial, diagnosis),
             *objections.of_identifiability(trial), *objections.of_physics(trial, after)]
    rivals = tuple(name for names in diagnosis.indistinguishable if offer.name in names
                   for name in names if name != offer.name)
    remarks = [f'{", ".join(rivals)} would explain these recordings as well'] if rivals else []
    remarks += [f'{", ".join(trial.at_bound)} stands at the edge of what was tried'
                ] if trial.at_bound else []
    others = [one.name for one in diagnosis.effects if one.name != offer.name]
    if others and any(one.name == offer.name for one in diagnosis.effects):
        remarks.append(f'the recordings call for {", ".join(others)}, too')
    noises, period = trial.fit.noises, trial.regression.design.residuals.period
    if validate:
        held_out, gains = case.validated(trial.plain, trial.model, noises, period)
    else:
        held_out, gains = (trial.held_out_before, trial.held_out_after), trial.block_gains
    floor = floor_of(trial.regression, trial.fit.rest)
    found += [*objections.of_linearity(floor, rms(after)),
              *objections.of_held_out_error(*held_out, gains, model, case.held_out)]
    report(1.0)
    return case.answer(trial.model, trial.drives, found, remarks, rivals, trial.parameters,
                       tuple(trial.calibrated), before, after, held_out, floor)


def original(model: ForceModel) -> ForceModel:
    """Return a model with its numbers as they were before anything was fitted to them.

    Tolerances are limits about what the file said at first; counted from where the last fit
    left a number, they would let it walk away.
    """
    values = original_values(model.values)
    if all(values[key] == value for key, value in model.values.items()):
        return model
    return replace(build_model(values), source=model.source)


@dataclass(frozen=True)
class _Case:
    """What is asked."""

    model: ForceModel
    start: ForceModel
    offer: Offer
    recordings: Sequence[Recording]
    validate: Sequence[Recording]
    force: bool

    @property
    def held_out(self) -> str:
        """What decides, for a sentence."""
        return ('the validation recordings' if self.validate
                else 'held-out blocks of the recordings')

    def residuals(self, regression: Regression, after: ForceModel) -> tuple[Residuals, Residuals]:
        """Return those of the model as given and of another on the recordings."""
        before = (regression.design.residuals if self.start is self.model
                  else measure_residuals(self.model, self.recordings)[0])
        return before, measure_residuals(after, self.recordings)[0]

    def validated(self, plain: ForceModel, fitted: ForceModel, noises: dict[int, NoiseModel],
                  period: float) -> tuple[tuple[float, float], Array]:
        """Return errors on the validation recordings, and what the effect gains per block."""
        given, before, after = (measure_residuals(one, self.validate)[0]
                                for one in (self.model, plain, fitted))
        # What the model's own numbers gain by being fitted is not the effect's.
        return (rms(given), rms(after)), block_gains(before, after, noises, period)

    def without_model(self, reason: str) -> Adoption:
        """Return the refusal of an effect whose fit gives no model."""
        before, _ = measure_residuals(self.model, self.recordings)
        error = rms(before)
        held_out = rms(measure_residuals(self.model, self.validate)[0]) if self.validate else error
        return Adoption(
            self.offer, self.offer.drives, False, False, f'its fit gives no model: {reason}',
            (reason,), (), {}, (), (), self.model, self.model, before, before, error, error,
            held_out, held_out, VALIDATION if self.validate else BLOCKS, error)

    def answer(
        self, after: ForceModel, drives: tuple[str, ...] | None, found: list[str],
        remarks: list[str], rivals: tuple[str, ...], parameters: dict[str, Estimate],
        calibrated: tuple[Calibration, ...], residuals_before: Residuals,
        residuals_after: Residuals, held_out: tuple[float, float], noise_floor: float,
    ) -> Adoption:
        """Return the answer to all objections that were found."""
        adopted = not found or self.force
        falls = f'{held_out[0]:.4g} to {held_out[1]:.4g} N'
        reason = '; '.join(found) or f'the error on {self.held_out} falls from {falls}'
        if not found and not self.validate:
            remarks = [*remarks, 'blocks of the same recordings are weak evidence: give one in '
                       'another regime (other speeds, other payload) with --validate']
        return Adoption(
            self.offer, drives, adopted, bool(found) and self.force, reason, tuple(found),
            tuple(remarks), parameters, calibrated, rivals, self.model, after, residuals_before,
            residuals_after, rms(residuals_before), rms(residuals_after), *held_out,
            VALIDATION if self.validate else BLOCKS, noise_floor)


def floor_of(regression: Regression, rest: dict[int, Any]) -> float:
    """Return the root of the mean square of what a fit leaves, over samples and drives [N]."""
    squares = [rest[d][series.known] ** 2 for d, series in regression.series.items()]
    total = sum(float(one.sum()) for one in squares)
    return float((total / max(sum(len(one) for one in squares), 1)) ** 0.5)


def _fit_anew(case: _Case, report: Callable[[float], None]) -> Adoption:
    """Return the model with what it has fitted anew, where that gains anything."""
    design = Design.of(case.start, case.recordings, lambda share: report(0.7 * share))
    regression, name = Regression(design), case.offer.name
    noises = {d: series.fit_noise(series.error) for d, series in regression.series.items()}
    fit = regression.fit((), noises)
    try:
        fitted = fitted_model(regression, fit)
    except ModelError as error:
        return case.without_model(str(error))
    before, after = case.residuals(regression, fitted)
    floor = floor_of(regression, fit.rest)
    gains = block_gains(before, after, fit.noises, design.residuals.period)
    free = sum(column.kind == 'present' for column in design.base)
    evidence = float(gains.sum() - free * np.log(regression.samples)) - MARGIN
    found = [] if evidence > 0 else [
        f'{name} is in the model already, and to fit it anew would gain nothing: the error would '
        f'go from {rms(before):.4g} to {rms(after):.4g} N (evidence {evidence:.3g}, where 0 is '
        'the threshold)']
    held_out = rms(before), regression.held_out_error((), fit.noises)
    if case.validate:
        held_out, gains = case.validated(case.model, fitted, fit.noises, design.residuals.period)
    if not found:
        found = [*objections.of_linearity(floor, rms(after)),
                 *objections.of_held_out_error(*held_out, gains, case.model, case.held_out)]
    report(1.0)
    effect = next(one for one in fitted.effects if one.name == name)
    return case.answer(
        fitted, tuple(effect.drives) if isinstance(effect, DriveEffect) else None, found, [], (),
        _present_parameters(regression, fit, fitted, case.offer), (), before, after, held_out,
        floor)


def _present_parameters(regression: Regression, fit: JointFit, fitted: ForceModel,
                        offer: Offer) -> dict[str, Estimate]:
    """Return parameters of an effect in the model; deviations where they are coefficients."""
    known: dict[str, Estimate] = {}
    if offer.effect.coefficients == offer.effect.linear:
        known = estimate_present(regression, fit, offer.name).parameters
    units = {one.name: one.unit for one in offer.effect.parameters}
    prefix = f'effects.{offer.name}.'
    return {key: known.get(key) or Estimate(float(value), float('nan'),
                                            units[key.rpartition('.')[2]])
            for name, value in fitted.values.items() if name.startswith(prefix)
            for key in [name.removeprefix(prefix)]}
