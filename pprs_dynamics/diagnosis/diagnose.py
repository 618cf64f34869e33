"""Which physical effect a model lacks: the whole way from recordings to an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.adoption import (
    Calibration,
    calibrations,
    contributed_force,
    estimate_all,
    estimate_present,
    fitted_model,
)
from pprs_dynamics.diagnosis.cautions import find_cautions
from pprs_dynamics.diagnosis.form import form_allowance
from pprs_dynamics.diagnosis.found_effects import FoundEffect, RankedEffect, joined, listed
from pprs_dynamics.diagnosis.joint_fit import JointFit, Regression
from pprs_dynamics.diagnosis.judging import Judged, actives_of
from pprs_dynamics.diagnosis.paired_errors import rms
from pprs_dynamics.diagnosis.selection import Selector
from pprs_dynamics.diagnosis.stages import Stage, Way, find_way
from pprs_dynamics.diagnosis.unexplained import Unexplained, allowed_by_model, find_unexplained
from pprs_dynamics.diagnosis.wording import Statement
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.residuals.measuring import measure_residuals
from pprs_dynamics.residuals.residuals import Residuals


@dataclass(frozen=True)
class Diagnosis:
    """The answer.

    Parameters
    ----------
    verdict : {'unknown', 'ambiguous', 'effect', 'adequate'}
    effects : tuple of FoundEffect
        In the order of adoption.
    indistinguishable : tuple of tuple of str
        Each an adopted effect and its rivals.
    candidates, suspects : tuple of RankedEffect
    depends_on : tuple of Statement
        What no effect explains.
    of_form : tuple of Statement
        Remainders that are the form of an adopted effect.
    calibrated : tuple of Calibration
        Numbers that moved within their tolerances.
    warnings, notes : tuple of str
    model : ForceModel
        As given.
    adopted : ForceModel
        With the effects.
    residuals : Residuals
        Of the model as given.
    remaining : (M, D) array
        What is left with the effects [N].
    noise_floor : float
        Root of the mean square of the noise, over drives [N].
    held_out_on : {'blocks', 'validation'}
    selector : Selector, optional
        The columns and fits of the first search, for looking closer.
    """

    verdict: str
    effects: tuple[FoundEffect, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    candidates: tuple[RankedEffect, ...]
    suspects: tuple[RankedEffect, ...]
    depends_on: tuple[Statement, ...]
    of_form: tuple[Statement, ...]
    calibrated: tuple[Calibration, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    model: ForceModel
    adopted: ForceModel
    residuals: Residuals
    remaining: Array
    noise_floor: float
    held_out_on: str = 'blocks'
    selector: Selector | None = field(default=None, repr=False, compare=False)

    def as_data(self) -> dict[str, Any]:
        """Return the JSON of the interface, and what the README adds to it."""
        return {
            'verdict': self.verdict,
            'effects': [one.as_data() for one in self.effects],
            'indistinguishable': [list(names) for names in self.indistinguishable],
            'candidates': [one.as_data() for one in self.candidates],
            'depends_on': [
                {'drive': s.drive, 'variable': s.variable, 'share_of_error': s.share_of_error,
                 'range': None if s.range is None else list(s.range), 'text': s.text}
                for s in self.depends_on],
            'suspects': [{'name': s.name, 'drives': listed(s.drives), 'evidence': s.evidence}
                         for s in self.suspects],
            'calibrated': [{'key': c.label, 'before': c.before, 'after': c.after, 'std': c.std,
                            'unit': c.unit} for c in self.calibrated],
            'held_out_on': self.held_out_on, 'noise_floor': self.noise_floor,
            'warnings': list(self.warnings)}


def diagnose(
    model: ForceModel, recordings: Sequence[Recording], validate: Sequence[Recording] = (),
    progress: Callable[[float], None] | None = None,
) -> Diagnosis:
    """Return which physical effect a model lacks, as far as recordings can tell.

    Parameters
    ----------
    model : ForceModel
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted: held-out errors are taken on them, instead of on blocks.
    progress : callable, optional
        Called with the share of the work that is done.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    way = find_way(model, recordings, lambda share: report(0.85 * share))
    first, bent, stage = way.first, way.bent, way.last
    early = _effects_of(first, bent, validate) if bent else []
    allowed = sum((form_allowance(one.effect, one.force) for one in early),
                  allowed_by_model(first.design))
    unexplained = find_unexplained(stage.selector, stage.selection, allowed)
    report(0.95)
    return _answer(way, early, unexplained, validate)


def _answer(way: Way, early: list[FoundEffect], unexplained: Unexplained,
            validate: Sequence[Recording]) -> Diagnosis:
    first, stage = way.first, way.last
    regression, fit = stage.regression, stage.selection.fit
    known = {one.candidate.name for one in way.bent}
    late = _effects_of(stage, sorted(
        stage.selection.adopted, key=lambda one: one.candidate.name not in known), validate)
    for k, one in enumerate(early):
        early[k] = replace(one, parameters=estimate_present(regression, fit, one.name).parameters)
    if early and late:
        late[0] = replace(late[0], error_before=early[-1].error_after,
                          held_out_before=early[-1].held_out_after)
    elif late and stage is not first:
        error, held_out = _errors_as_given(first, validate)
        late[0] = replace(late[0], error_before=error, held_out_before=held_out)
    drives = first.design.drives
    effects = joined(early, late, drives)
    sets = tuple((name, *others) for name, others in way.rivals.items() if others)
    verdict = ('unknown' if unexplained.statements else 'ambiguous' if sets
               else 'effect' if effects else 'adequate')
    moved = [c for c in calibrations(regression, fit, first.design.model)
             if abs(c.after - c.before) > 2 * c.std]
    noise = np.concatenate([rest[regression.series[d].known] for d, rest in fit.rest.items()])
    return Diagnosis(
        verdict, tuple(effects), sets,
        tuple(_ranked(one, drives, first.regression) for one in first.selection.candidates),
        tuple(_ranked(one, drives, regression) for one in stage.selection.suspects),
        unexplained.statements, unexplained.of_form, tuple(moved),
        find_cautions(stage.design, regression, stage.selector, stage.selection, effects),
        first.design.notes, first.design.model, fitted_model(regression, fit),
        first.design.residuals, unexplained.remaining, float(np.sqrt(np.mean(noise ** 2))),
        'validation' if validate else 'blocks', first.selector)


def _errors_as_given(first: Stage, validate: Sequence[Recording]) -> tuple[float, float]:
    """Return the error of the model as given, and the one on what it was not fitted to [N]."""
    error = first.regression.error((), np.zeros(len(first.design.base)))
    if validate:
        return error, rms(measure_residuals(first.design.model, validate)[0])
    return error, first.regression.held_out_error((), first.selection.fit.noises)


def _effects_of(stage: Stage, adopted: Sequence[Judged], validate: Sequence[Recording],
                ) -> list[FoundEffect]:
    """Return what a stage adopted, with the errors as one after the other is added."""
    design, regression, fit = stage.design, stage.regression, stage.selection.fit
    drives, base = design.drives, len(design.base)
    steps = [_fit_of_first(stage, adopted, k) for k in range(len(adopted) + 1)]
    errors = [regression.error((), np.zeros(base)),
              *(regression.error(step.active, step.coefficients) for step in steps[1:])]
    if validate:
        models = [design.model, *(fitted_model(regression, step) for step in steps[1:])]
        held_out = [rms(measure_residuals(one, validate)[0]) for one in models]
    else:
        held_out = [regression.held_out_error(step.active, step.noises) for step in steps]
    places: dict[int, tuple[int, int]] = {}
    place = base
    for number, active in enumerate(fit.active):
        places[id(active)] = (place, number)
        place += active.size
    estimates = estimate_all(regression, fit)
    effects = []
    for k, one in enumerate(adopted):
        mine = [estimates[places[id(active)][1]] for active in one.candidate.active]
        own = np.concatenate([fit.coefficients[places[id(active)][0]:][:active.size]
                              for active in one.candidate.active])
        effects.append(FoundEffect(
            one.candidate.effect, _names(one, drives),
            {key: value for found in mine for key, value in found.parameters.items()},
            one.evidence, errors[k], errors[k + 1], held_out[k], held_out[k + 1],
            contributed_force(design, one.candidate.active, own),
            tuple(key for found in mine for key in found.at_bound)))
    return effects


def _fit_of_first(stage: Stage, adopted: Sequence[Judged], count: int) -> JointFit:
    """Return the fit of the first adopted effects."""
    selection = stage.selection
    if count == len(selection.adopted):
        return selection.fit
    return stage.regression.fit(actives_of(adopted[:count]), selection.fit.noises, iterations=1)


def _ranked(one: Judged, drives: tuple[str, ...], regression: Regression) -> RankedEffect:
    return RankedEffect(one.candidate.name, _names(one, drives), one.evidence,
                        regression.error(one.fit.active, one.fit.coefficients))


def _names(one: Judged, drives: tuple[str, ...]) -> tuple[str, ...] | None:
    found = one.candidate.drives
    return None if found is None else tuple(drives[d] for d in sorted(found))
