# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Survey of one recording: read, checked, diagnosed or fitted; the rows of its results.

Workers run `examine`. A recording that is refused is a row with the reason.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics import __version__
from pprs_dynamics.app.fleet.recordings import AUTO, MODEL, SurveyedRecording
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.comparison import compare
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.components import placed, shapes_of
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import (
    Estimate,
    FittedNumber,
    calibrations,
    estimate,
    estimate_present,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import Recording, describe, read_recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import displayed
from pprs_dynamics.system.threads import use_one_thread

FITTED, REFUSED = 'fitted', 'refused'  # verdicts: named effects were fitted; no result
# Error over the changing effort of a drive, beyond which units, signs and the order of the drives
# are checked. Wrong ones have an error as large as the effort.
SUSPECT = 1.0

model_of = lru_cache(maxsize=8)(DriveModel.load)


@dataclass(frozen=True)
class SurveyJob:
    """A recording, its model file, and 'auto' or the effects to fit, divided by commas."""

    entry: SurveyedRecording
    model: str
    options: str = AUTO

    @property
    def common(self) -> dict[str, Any]:
        """Columns that all rows of the recording share; hash '' for one that cannot be read."""
        path = Path(self.entry.path)
        try:
            content = fingerprint(path)
        except PprsError:
            content = ''
        return {'recording': displayed(path.name), 'path': displayed(path), 'sha256': content,
                'robot': displayed(self.entry.robot), 'time': self.entry.time,
                'model': model_of(self.model).fingerprint, 'options': self.options,
                'version': __version__}


def key(common: Mapping[str, Any]) -> str:
    """Return the name of a recording's file in a store."""
    parts = [common[name] for name in ('sha256', 'robot', 'model', 'options', 'version')]
    return hashlib.sha256(json.dumps(parts).encode(errors='surrogateescape')).hexdigest()[:40]


def requests_of(options: str, model: DriveModel) -> tuple[EffectRequest, ...]:
    """Return the effects that options name, as EFFECT or EFFECT:drive+drive; errors as theirs."""
    return tuple(EffectRequest.of(text.strip().replace('+', ','), model)
                 for text in options.split(',') if text.strip())


def examine(job: SurveyJob) -> list[dict[str, Any]]:
    """Return the rows of a recording."""
    use_one_thread()
    common, model = job.common, model_of(job.model)
    try:
        recording = read_recording(job.entry.path, model.recorded)
        summary = describe(recording)
        judge = _diagnosed if job.options == AUTO else _fitted
        rows, drives, verdict = judge(model, recording, job)
    except PprsError as error:
        return [{**common, 'verdict': REFUSED, 'error': displayed(str(error))}]
    time = common['time'] or datetime.fromtimestamp(recording.epoch + summary.start, UTC)
    common |= {'time': time, 'duration': summary.duration, 'verdict': verdict}
    return [{**common, 'drive': drive, **numbers} for drive, numbers in drives.items()] + [
        {**common, **drives.get(row.get('drive') or '', {}), **row} for row in rows]


Judged = tuple[list[dict[str, Any]], dict[str, dict[str, Any]], str]
"""Rows of values, numbers by drive, and the verdict."""


def _row(effect: type[CatalogueEffect], key: str, found: Estimate, **more: float) -> dict[str, Any]:
    """Return the row of a parameter, by its key with its drive."""
    drive, parameter = effect.place_and_parameter(key)
    return {'drive': drive or None, 'effect': effect.name, 'parameter': parameter,
            **vars(found), **more}


def _numbers(calibrated: Sequence[FittedNumber]) -> list[dict[str, Any]]:
    """Return the rows of the model's numbers that are open within tolerances."""
    return [{'effect': MODEL, 'parameter': number.key, 'value': number.after,
             'std': number.std, 'unit': number.unit} for number in calibrated]


def _diagnosed(model: DriveModel, recording: Recording, job: SurveyJob) -> Judged:
    _refuse_mistakes(model, recording, job)
    diagnosis = diagnose(model, [recording])
    rows = [_row(effect.effect, key, found, evidence=effect.evidence)
            for effect in diagnosis.effects for key, found in effect.parameters.items()]
    rows += _as_in_model(diagnosis, {(row['drive'], row['effect']) for row in rows})
    rows += _numbers(diagnosis.calibrated)
    return rows, _drives(diagnosis.residuals, diagnosis.noise_floors), diagnosis.verdict


def _fitted(model: DriveModel, recording: Recording, job: SurveyJob) -> Judged:
    # The check of units and signs takes longer than a fit: only a bad fit is checked.
    try:
        rows, residuals, noise = fit_named_effects(
            model, recording, requests_of(job.options, model))
    except PprsError:
        _refuse_mistakes(model, recording, job)
        raise
    drives = _drives(residuals, noise)
    if any(numbers['relative'] > SUSPECT for numbers in drives.values()):
        _refuse_mistakes(model, recording, job)
    return rows, drives, FITTED


def _refuse_mistakes(model: DriveModel, recording: Recording, job: SurveyJob) -> None:
    for finding in find_mistakes(model, recording):
        raise UnreadableFileError(displayed(job.entry.path), finding.text)


def _drives(residuals: Residuals, noise: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Return rms, relative error and noise of every drive that was measured."""
    compared = compare(residuals, ((), {}), noise)
    return {name: {'rms': drive.rms, 'relative': drive.relative, 'noise': drive.noise_floor}
            for name, drive in compared.drives.items()}


def _as_in_model(diagnosis: Diagnosis, reported: Container[tuple[str | None, str]],
                 ) -> Iterator[dict[str, Any]]:
    """Yield the effects of the model that the recording does not change."""
    selection = diagnosis.selection
    assert selection is not None
    for effect in diagnosis.model.effects:
        if not isinstance(effect, (DriveEffect, StructureEffect)):
            continue
        estimates = estimate_present(selection.best.fits, selection.best.fitted, effect)
        for key, found in estimates.items():
            row = _row(type(effect), key, found)
            if (row['drive'], row['effect']) not in reported:
                yield row


def fit_named_effects(model: DriveModel, recording: Recording, requests: Sequence[EffectRequest],
                      ) -> tuple[list[dict[str, Any]], Residuals, dict[str, float]]:
    """Return the values of named effects and of the model's numbers, fitted together.

    No search: every effect is fitted on every drive that is asked for, whether it pays or not, so
    that its values can be followed from recording to recording. Of an effect that the model has,
    its rows hold what the recording says that it is, not what it changes.

    Returns
    -------
    rows : list of dict
        drive, effect, parameter, value, std, unit, evidence.
    residuals : Residuals
        Of the model as given.
    noise : dict of str to float
        Noise of the fit, by drive [N].

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    fits = FittedSets(Design.of(model, [recording]), DECISIONS)
    candidates = tuple(EffectCandidate.of(components) for request in requests
                       if (components := list(_components(fits, request))))
    # Without constraints: values of an effect that is not there scatter about 0.
    found = fits.at_noise_of(fits.evaluate(candidates), candidates)
    rows = []
    for candidate in candidates:
        rest = tuple(other for other in candidates if other is not candidate)
        evidence = fits.at_noise_of(found, rest).total - found.total
        rows += [_row(candidate.effect, key, value, evidence=evidence) for key, value in estimate(
            fits, found, candidate, True).parameters.items()]
    design = fits.design
    return ([*rows, *_numbers(calibrations(fits, found))], design.residuals,
            {design.drives[d]: fits.regression.noise_floor(found.fit, d)
             for d in fits.regression.drives})


def _components(fits: FittedSets, request: EffectRequest) -> Iterator[Component]:
    """Yield an effect in the structure, or on each drive in the shape that gains most."""
    effect, design = request.effect, fits.design
    if not issubclass(effect, DriveEffect):
        yield from (placed(design, term.effect, None, {}, term.names) for term in design.structure
                    if term.effect.name == effect.name
                    and any(np.any(rows) for rows in term.rows.values()))
        return
    names = tuple(coefficient.name for coefficient in effect.coefficients)
    alone = fits.evaluate(()).fit
    for d in fits.regression.drives:
        if design.acts_on(effect, d) and design.drives[d] in (request.drives or design.drives):
            there = design.present(effect, d)
            shapes = shapes_of(design, effect, d) if there is None or not effect.shape else [
                {parameter.name: there[parameter.name] for parameter in effect.shape}]
            yield max((placed(design, effect, d, shape, names) for shape in shapes),
                      key=lambda component: fits.regression.gain(
                          alone, fits.components.block(component)))
