# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fit of the base model to recordings, and its error on data that were not fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.fit.mechanism_fit import Fitted, fit_mechanism
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import model_numbers
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import FittedNumber, calibrations
from pprs_dynamics.inference.search.explained_effort import explained_shares, little_explained
from pprs_dynamics.inference.search.fitted_model import fitted_model, linearised
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.json_records import JsonRecord

RECORDINGS, HALVES, VALIDATION = 'recordings', 'halves', 'validation'
PART_OF_IT = ('a fault of the robot in these runs is now part of the model. Fit healthy runs '
              'without load, and diagnose other runs')


class FitError(PprsError, ValueError):
    """A fit that has nothing to do."""


@dataclass(frozen=True)
class BaseFit(JsonRecord):
    """A fitted base model.

    Parameters
    ----------
    model : DriveModel
    numbers : tuple of FittedNumber
        Numbers of the model, before and after the fit.
    notes : tuple of str
        What the motion determines and what it does not, as sentences.
    error_before, error_after : dict of str to float
        RMS error of each drive with the input model, and with the fitted one [N, N m].
    held_out : dict of str to float
        RMS error of each drive on held-out data [N, N m].
    held_out_on : {'recordings', 'halves', 'validation'}
        Each recording, or half of the only one, predicted from the others; or --validate.
    explained : dict of str to float
        Share of each drive's effort that the fitted model explains.
    little : dict of str to float
        Drives of whose effort the fitted model explains little, with the shares.
    """

    json_keys = ('numbers', 'error_before', 'error_after', 'notes', 'held_out', 'held_out_on',
                 'explained')

    model: DriveModel
    numbers: tuple[FittedNumber, ...]
    notes: tuple[str, ...]
    error_before: dict[str, float]
    error_after: dict[str, float]
    held_out: dict[str, float]
    held_out_on: str
    explained: dict[str, float]
    little: dict[str, float]


def fit_base(model: DriveModel, recordings: Sequence[Recording],
             validate: Sequence[Recording] = (),
             progress: Callable[[float], None] | None = None) -> BaseFit:
    """Return the base model that fits recordings best; its effects are unchanged.

    Parameters
    ----------
    model : DriveModel
        Of an arm, and of a slide without `tolerances`, inertia and friction are fitted; else what
        `tolerances` leave open.
    recordings : sequence of Recording
        Of free motion.
    validate : sequence of Recording, optional
        For the held-out error; else each recording, or half of the only one, is predicted from
        the others.
    progress : callable, optional

    Raises
    ------
    FitError
        Where nothing is left open.
    PprsError
        As `measure_residuals`.
    """
    if not model.has_links and not model_numbers(model):
        raise FitError('tolerances: the model gives none, must name the numbers that are to be '
                       'fitted, e.g. masses.payload: 0.05')
    report = progress or (lambda share: None)
    fitted, numbers, notes = _fitted(model, recordings)
    report(0.4)
    parts, on = list(recordings), RECORDINGS
    if validate:
        folds, on = [(fitted, validate)], VALIDATION
    else:
        if len(parts) == 1:
            parts, on = halves(parts[0]), HALVES
        folds = [(_fitted(model, [*parts[:k], *parts[k + 1:]])[0], [part])
                 for k, part in enumerate(parts)]
    report(0.9)
    before, after = (measure_residuals(tried, recordings)[0] for tried in (model, fitted))
    return BaseFit(fitted, numbers, (*notes, PART_OF_IT), rms_by_drive(before),
                   rms_by_drive(after), _errors(folds), on,
                   explained_shares(after), little_explained(fitted, after))


def halves(recording: Recording) -> list[Recording]:
    """Return two parts of a recording with as many measured efforts each."""
    measured = np.flatnonzero(np.isfinite(recording.effort).any(axis=1))
    end, middle = recording.segments[-1].stop, int(measured[len(measured) // 2])
    return [replace(recording, segments=tuple(
        slice(max(part.start, low), min(part.stop, high)) for part in recording.segments
        if max(part.start, low) < min(part.stop, high)))
        for low, high in ((0, middle), (middle, end))]


def _errors(folds: Sequence[tuple[DriveModel, Sequence[Recording]]]) -> dict[str, float]:
    """Return the rms error by drive of models, each on recordings of its own, over all."""
    error = np.concatenate([measure_residuals(model, recordings)[0].error
                            for model, recordings in folds])
    return {drive: float(np.sqrt(np.nanmean(error[:, d] ** 2)))
            for d, drive in enumerate(folds[0][0].drives) if np.isfinite(error[:, d]).any()}


def _fitted(model: DriveModel, recordings: Sequence[Recording]) -> Fitted:
    if model.has_bodies or not model_numbers(model):
        return fit_mechanism(model, recordings)
    # As in a diagnosis without any effect: the tolerance is the prior, and the width in which
    # friction reverses is free.
    fits = FittedSets(Design.of(model, recordings), DECISIONS)
    fits, found = linearised(fits, fits.evaluate(()))
    return fitted_model(fits, found), calibrations(fits, found), ()
