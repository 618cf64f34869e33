# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base model that recordings call for, and how well it predicts what it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.fit.arm_fit import ArmFit, columns_of, fit_arm
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import model_numbers
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import calibrations
from pprs_dynamics.inference.search.explained_effort import (
    explained_shares,
    little_explained,
)
from pprs_dynamics.inference.search.fitted_model import fitted_model, linearised
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.numbers import finite

RECORDINGS, HALVES, VALIDATION = 'recordings', 'halves', 'validation'


class FitError(PprsError, ValueError):
    """A fit that has nothing to do."""


@dataclass(frozen=True)
class FittedNumber:
    """A number of the model, before and after, with its standard deviation."""

    key: str
    drive: str
    before: float
    after: float
    std: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return the number for JSON."""
        return {'key': self.key, 'drive': self.drive, 'before': self.before, 'after': self.after,
                'std': self.std if np.isfinite(self.std) else None, 'unit': self.unit}


PART_OF_IT = ('what was wrong with the robot in these runs is part of the model now: fit healthy '
              'runs without load, and diagnose others')


@dataclass(frozen=True)
class BaseFit:
    """A fitted base model.

    Parameters
    ----------
    model : DriveModel
    numbers : tuple of FittedNumber
    told : tuple of str
        What the motion determines and what it does not, as sentences.
    before, after, held_out : dict of str to float
        rms error by drive: of the input model and of the fitted one on the recordings, and on
        held-out data.
    held_out_on : {'recordings', 'halves', 'validation'}
        Each recording, or half of the only one, predicted from the others; or the validation.
    explained_before, explained : dict of str to float
        Share of each drive's effort that the model explained, and that the fitted one explains.
    little : dict of str to float
        Drives of whose effort the fitted model explains little, with the shares.
    """

    model: DriveModel
    numbers: tuple[FittedNumber, ...]
    told: tuple[str, ...]
    before: dict[str, float]
    after: dict[str, float]
    held_out: dict[str, float]
    held_out_on: str
    explained_before: dict[str, float]
    explained: dict[str, float]
    little: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return the fit for JSON."""
        return {'numbers': [one.to_dict() for one in self.numbers], 'notes': list(self.told),
                'error_before': self.before, 'error_after': self.after,
                'held_out': self.held_out, 'held_out_on': self.held_out_on,
                'explained_before': {name: finite(one)
                                     for name, one in self.explained_before.items()},
                'explained': {name: finite(one) for name, one in self.explained.items()}}


def fit_base(model: DriveModel, recordings: Sequence[Recording],
             validate: Sequence[Recording] = (),
             progress: Callable[[float], None] | None = None) -> BaseFit:
    """Return the base model that fits recordings best.

    Parameters
    ----------
    model : DriveModel
        Of an arm all inertia and friction is fitted; of the others what `tolerances` leave open.
    recordings : sequence of Recording
        Of free motion.
    validate : sequence of Recording, optional
        For the held-out error, instead of a part of the recordings.
    progress : callable, optional

    Raises
    ------
    FitError
        Where nothing is left open.
    PprsError
        As `measure_residuals`.
    """
    require_open_numbers(model)
    report = progress or (lambda share: None)
    fitted, numbers, told = _fitted(model, recordings)
    report(0.4)
    if validate:
        held_out, on = errors_of(fitted, validate), VALIDATION
    else:
        parts, on = list(recordings), RECORDINGS
        if len(parts) == 1:
            parts, on = halves(parts[0]), HALVES
        squares = [_squares(_fitted(model, [*parts[:k], *parts[k + 1:]])[0], [part])
                   for k, part in enumerate(parts)]
        held_out = _rms(model, np.concatenate(squares))
    report(0.9)
    before, after = (measure_residuals(one, recordings)[0] for one in (model, fitted))
    return BaseFit(fitted, numbers, (*told, PART_OF_IT), rms_by_drive(before),
                   rms_by_drive(after), held_out, on,
                   explained_shares(before), explained_shares(after),
                   little_explained(fitted, after))


def require_open_numbers(model: DriveModel) -> None:
    """Raise FitError where a model has nothing that a fit may move."""
    if not _is_fitted_whole(model) and not model_numbers(model):
        raise FitError('tolerances: the model gives none, must name the numbers that are to be '
                       'fitted, e.g. masses.payload: 0.05')


def _is_fitted_whole(model: DriveModel) -> bool:
    """Return whether all numbers are fitted, and not those alone that tolerances leave open."""
    return model.is_mechanism


def halves(recording: Recording) -> list[Recording]:
    """Return the first and the second half of a recording."""
    parts = recording.segments
    middle = sum(part.stop - part.start for part in parts) // 2
    first, second, done = [], [], 0
    for part in parts:
        cut = min(max(part.start + middle - done, part.start), part.stop)
        first.append(slice(part.start, cut))
        second.append(slice(cut, part.stop))
        done += part.stop - part.start
    return [replace(recording, segments=tuple(part for part in found if part.stop > part.start))
            for found in (first, second)]


def errors_of(model: DriveModel, recordings: Sequence[Recording]) -> dict[str, float]:
    """Return the rms error by drive on recordings."""
    return _rms(model, _squares(model, recordings))


def _squares(model: DriveModel, recordings: Sequence[Recording]) -> Array:
    return measure_residuals(model, recordings)[0].error ** 2


def _rms(model: DriveModel, squares: Array) -> dict[str, float]:
    known = np.isfinite(squares).sum(axis=0)
    return {drive: float(np.sqrt(np.nanmean(squares[:, d]))) for d, drive in
            enumerate(model.drives) if known[d]}


def _fitted(model: DriveModel, recordings: Sequence[Recording],
            ) -> tuple[DriveModel, tuple[FittedNumber, ...], tuple[str, ...]]:
    if _is_fitted_whole(model):
        fit = fit_arm(model, columns_of(model, recordings))
        return fit.model, _numbers(model, fit), _told(model, fit)
    # As in a diagnosis without any effect: the tolerance is the prior, and how friction turns over
    # is left free.
    fits = FittedSets(Design.of(model, recordings), DECISIONS)
    fits, found = linearised(fits, fits.evaluate(()))
    return fitted_model(fits, found), tuple(
        FittedNumber(one.label, '', one.before, one.after, one.std, one.unit)
        for one in calibrations(fits, found)), ()


def _numbers(model: DriveModel, fit: ArmFit) -> tuple[FittedNumber, ...]:
    """Return the fitted numbers of each joint; those of links are in `_told`."""
    found = []
    widths = {'friction.reversal_velocities': np.full(len(model.drives), np.inf)}
    for key, std in {**fit.std, **widths}.items():
        units = [unit.strip() for unit in model.keys[key].unit.split(',')]
        for k, drive in enumerate(model.drives):
            unit = units[0] if model.units[k].turns else units[-1]
            before = model.values[key][k] or (
                model.values['friction.reversal_velocity'] if key in widths else 0.0)
            found.append(FittedNumber(key, drive, float(before), float(fit.model.values[key][k]),
                                      float(std[k]), unit))
    return tuple(found)


def _told(model: DriveModel, fit: ArmFit) -> tuple[str, ...]:
    before, after = (float(np.sum(one)) for one in (model.robot.masses, fit.model.robot.masses))
    told = [f'all links together have {after:.4g} kg, {before:.4g} kg in the description',
            f'the motion determines {fit.determined} combinations of the {fit.total} inertial '
            'parameters of the links; all others stay near those of the URDF']
    if fit.weak_links:
        told.append('it cannot tell the masses of the links that '
                    f'{", ".join(fit.weak_links)} move one by one')
    if fit.standing:
        told.append(f'{", ".join(fit.standing)} hardly moves: its friction stays as it was')
    if model.efforts_in_amperes:
        told.append('efforts are currents times robot.gain: a gain that is wrong by '
                    '1 % makes all numbers wrong by 1 %')
    return tuple(told)


@dataclass(frozen=True)
class Refit:
    """A base model fitted again, taken or not.

    Parameters
    ----------
    fit : BaseFit
    taken : bool
        Whether the error on data that took no part in the fit falls.
    reason : str
    """

    fit: BaseFit
    taken: bool
    reason: str

    def to_dict(self) -> dict[str, Any]:
        """Return the refit for JSON."""
        return {**self.fit.to_dict(), 'taken': self.taken, 'reason': self.reason}


def refit_base(model: DriveModel, recordings: Sequence[Recording],
               validate: Sequence[Recording] = (),
               progress: Callable[[float], None] | None = None) -> Refit:
    """Return the base model fitted again; its effects are unchanged.

    A base model that was fitted without them holds a part of what they explain: its friction that
    of loads and temperatures, its links that of a cable.

    Parameters
    ----------
    model : DriveModel
        With effects.
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        On which the error must fall; else each recording, or half of the only one, is predicted
        from the others.
    progress : callable, optional

    Raises
    ------
    FitError
        Where the model has nothing that can be fitted.
    PprsError
        As `measure_residuals`.
    """
    found = fit_base(model, recordings, validate, progress)
    before = errors_of(model, validate) if validate else found.before
    drives = [drive for drive in before if drive in found.held_out]
    # Drives of different sizes and units count alike.
    ratio = root_mean_square([
        found.held_out[drive] / max(before[drive], 1e-300) for drive in drives])
    where = ('the validation recordings' if validate else 'its halves, each predicted from the '
             'other,' if found.held_out_on == HALVES else 'recordings predicted from the others')
    change = f'the error on {where} is {ratio:.3g} of that before, over all drives'
    return Refit(found, ratio < 1, f'{change}: base model fitted again' if ratio < 1 else
                 f'{change}, must fall: the base model stays as it was')
