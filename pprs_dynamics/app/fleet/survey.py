# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Survey of one recording: read, checked, compared, diagnosed or fitted; the rows of its results.

`examine` is what workers run. It never raises for what is wrong with a recording: that becomes a
row with the reason.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path, PurePosixPath
from time import perf_counter
from typing import Any

import numpy as np

from pprs_dynamics import __version__
from pprs_dynamics.app.fleet.manifest import ManifestEntry, filesystem, is_remote
from pprs_dynamics.app.fleet.named_effects import fit_named_effects
from pprs_dynamics.app.fleet.store import AUTO, OWN, key_of
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.fit.reference_runs import read_reference
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.estimates import estimate_present
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import Recording, describe, read_recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.system.plain_text import displayed
from pprs_dynamics.system.threads import use_one_thread

FITTED = 'fitted'  # the verdict where only named effects were fitted
# Of the model's error over the changing effort on a drive, beyond which units, signs and order of
# drives are looked at: wrong ones leave as much as the effort or more.
SUSPECT = 1.0
MODELS_KEPT = 8  # built models that a worker remembers


@dataclass(frozen=True)
class SurveyJob:
    """A recording, the model to judge it by, and how.

    Parameters
    ----------
    entry : ManifestEntry
    values : mapping
        Flat keys and values of the model.
    model : str
        Its fingerprint.
    options : str
        'auto', or effects as EFFECT or EFFECT:drive+drive, divided by commas.
    topic : str, optional
    reference : tuple of str, optional
        Runs since which it is diagnosed what has changed; () for those of the model file.
    source : str
        The model's file.
    """

    entry: ManifestEntry
    values: Mapping[str, Any]
    model: str
    options: str = AUTO
    topic: str | None = None
    reference: tuple[str, ...] | None = None
    source: str = ''

    @property
    def told_options(self) -> str:
        """The options as a store tells them, reference runs among them."""
        if self.reference is None:
            return self.options
        return f'{self.options} since {", ".join(self.reference) or "reference"}'

    def key(self, content: str) -> str:
        """Return the key of its rows; `content` is the recording's SHA-256."""
        return key_of(content, self.model, self.told_options, __version__)


@dataclass(frozen=True)
class SurveyResult:
    """Rows of a recording.

    Parameters
    ----------
    key : str
    rows : list of dict
    failed : bool
        True where another attempt may succeed.
    """

    key: str
    rows: list[dict[str, Any]]
    failed: bool = False

    @property
    def error(self) -> str | None:
        """Why there is no result, if there is none."""
        return self.rows[0].get('error')


def requests_of(options: str, model: ForceModel) -> tuple[EffectRequest, ...]:
    """Return the effects that options name; errors as `EffectRequest`."""
    return tuple(EffectRequest.of(text.strip().replace('+', ','), tuple(model.drives)).placed(model)
                 for text in options.split(',') if text.strip())


def identify(path: str) -> str | None:
    """Return the SHA-256 of a recording's content; None where it cannot be read."""
    try:
        if not is_remote(path):
            return fingerprint(path)
        system, within = filesystem(path)
        if system.isdir(within):
            with local_copy(path) as copy:
                return fingerprint(copy)
        with system.open(within, 'rb') as file:
            return hashlib.file_digest(file, 'sha256').hexdigest()
    except Exception:  # libraries of file systems raise what they like; examine tells the reason
        return None


@contextmanager
def local_copy(path: str) -> Iterator[str]:
    """Give a local path of a recording; of a remote one a copy that lasts as long as the block.

    Raises
    ------
    UnreadableFileError
        Where it cannot be fetched.
    """
    if not is_remote(path):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix='pprs-survey-') as folder:
        system, within = filesystem(path)
        target = Path(folder) / PurePosixPath(within).name
        try:
            system.get(within, str(target), recursive=bool(system.isdir(within)))
        except Exception as error:
            raise UnreadableFileError(path, f'cannot be fetched: {error}') from None
        yield str(target)


def examine(job: SurveyJob, content: str | None) -> SurveyResult:
    """Return the rows of a recording.

    Parameters
    ----------
    job : SurveyJob
    content : str or None
        The recording's SHA-256, of `identify`.
    """
    use_one_thread()
    began = perf_counter()
    common = _common(job, content)
    key, path = job.key(content or job.entry.path), job.entry.path
    try:
        with local_copy(job.entry.path) as path:
            rows, failed = _examined(job, path, common), False
    except PprsError as error:
        # A copy's name says nothing to anybody.
        text = displayed(str(error).replace(path, job.entry.path))
        # What could not even be read may be there the next time.
        rows, failed = [{**common, 'error': text}], content is None
    except Exception as error:  # of the package itself, but no end of a survey
        text = f'unexpected {type(error).__name__}: {error}'
        rows, failed = [{**common, 'error': text}], True
    seconds = perf_counter() - began
    return SurveyResult(key, [{**row, 'seconds': seconds} for row in rows], failed)


def lost(job: SurveyJob, content: str | None, reason: str) -> SurveyResult:
    """Return the row of a recording whose worker did not come back."""
    return SurveyResult(job.key(content or job.entry.path),
                        [{**_common(job, content), 'error': reason}], failed=True)


def _common(job: SurveyJob, content: str | None) -> dict[str, Any]:
    entry = job.entry
    return {'recording': displayed(PurePosixPath(entry.path.rstrip('/')).name),
            'path': displayed(entry.path), 'sha256': content,
            'time': None if entry.time is None else datetime.fromtimestamp(entry.time, UTC),
            'model': job.model, 'options': job.told_options, 'version': __version__,
            'conditions': list(entry.conditions.items())}


@lru_cache(MODELS_KEPT)
def _model(fingerprint: str, values: tuple[tuple[str, Any], ...], source: str = '') -> ForceModel:
    return build_model(dict(values), source)


@lru_cache(MODELS_KEPT)
def _reference(fingerprint: str, values: tuple[tuple[str, Any], ...], source: str,
               files: tuple[str, ...]) -> Reference:
    return read_reference(_model(fingerprint, values, source), files)


def _examined(job: SurveyJob, path: str, common: dict[str, Any]) -> list[dict[str, Any]]:
    values = tuple((key, tuple(value) if isinstance(value, list) else value)  # as files have lists
                   for key, value in job.values.items())
    model = _model(job.model, values, job.source)
    reference = None if job.reference is None else _reference(
        job.model, values, job.source, job.reference)
    recording = read_recording(path, model.recorded, job.topic)
    summary = describe(recording)
    if common['time'] is None:
        common = {**common, 'time': datetime.fromtimestamp(recording.epoch + summary.start, UTC)}
    rows, drives, verdict = _judged(model, recording, job, reference)
    common = {**common, 'duration': summary.duration, 'verdict': verdict}
    return [{**common, 'drive': drive, **numbers} for drive, numbers in drives.items()] + [
        {**common, **drives.get(row.get('drive') or '', {}), **row} for row in rows]


Examined = tuple[list[dict[str, Any]], dict[str, dict[str, float]], str]
"""Rows of values, numbers by drive, and the verdict."""


def _judged(model: ForceModel, recording: Recording, job: SurveyJob,
            reference: Reference | None) -> Examined:
    """Return what is found; a recording of other units, signs or drives is refused.

    The search for these takes longer than a fit, so that there only what fits badly is searched.
    """
    if job.options == AUTO:
        _refuse_mistakes(model, recording, job)
        return _diagnosed(model, recording, reference)
    try:
        rows, residuals, noise = fit_named_effects(model, recording,
                                                   requests_of(job.options, model))
    except PprsError:
        _refuse_mistakes(model, recording, job)
        raise
    drives = _drives(residuals, noise)
    if any(one['relative'] > SUSPECT for one in drives.values()):
        _refuse_mistakes(model, recording, job)
    return rows, drives, FITTED


def _refuse_mistakes(model: ForceModel, recording: Recording, job: SurveyJob) -> None:
    for finding in find_mistakes(model, recording):
        raise UnreadableFileError(displayed(job.entry.path), finding.text)


def _drives(residuals: Residuals, noise: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return rms, relative and noise of every drive that was measured."""
    found = {}
    for d, drive in enumerate(residuals.drives):
        known = np.isfinite(residuals.measured[:, d])
        if known.any():
            rms = root_mean_square(residuals.error[known, d])
            swing = float(np.std(residuals.measured[known, d]))
            found[drive] = {'rms': rms, 'relative': rms / swing if swing else float('nan'),
                            'noise': float(noise.get(drive, np.nan))}
    return found


def _diagnosed(model: ForceModel, recording: Recording,
               reference: Reference | None) -> Examined:
    diagnosis = diagnose(model, [recording], reference=reference)
    rows: list[dict[str, Any]] = []
    for effect in diagnosis.effects:
        for key, one in effect.parameters.items():
            drive, parameter = effect.effect.place_and_parameter(key)
            rows.append({'drive': drive or None, 'effect': effect.name, 'parameter': parameter,
                         'value': one.value, 'std': one.std, 'unit': one.unit,
                         'evidence': effect.evidence})
    rows += _as_in_model(diagnosis, {(row['drive'], row['effect']) for row in rows})
    rows += [{'effect': OWN, 'parameter': one.label, 'value': one.after, 'std': one.std,
              'unit': one.unit} for one in diagnosis.calibrated]
    return rows, _drives(diagnosis.residuals, diagnosis.noise_floors), diagnosis.verdict


def _as_in_model(diagnosis: Diagnosis, told: Container[tuple[str | None, str]],
                 ) -> Iterator[dict[str, Any]]:
    """Yield what the model's effects are, where a recording says nothing else of them."""
    selection = diagnosis.selection
    assert selection is not None
    for effect in diagnosis.model.effects:
        if not isinstance(effect, (DriveEffect, StructureEffect)):
            continue
        for key, one in estimate_present(selection.last, selection.reported, effect).items():
            drive, parameter = effect.place_and_parameter(key)
            if (drive or None, effect.name) not in told:
                yield {'drive': drive or None, 'effect': effect.name, 'parameter': parameter,
                       'value': one.value, 'std': one.std, 'unit': one.unit}
