# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base model that recordings call for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.app.report.terminal import PlainTable, escape, plain_rows, stacked, text_table
from pprs_dynamics.drives import common_effort
from pprs_dynamics.inference.diagnosis.quantities import (
    measured,
    sentence,
    with_uncertainty,
    word_little,
)
from pprs_dynamics.inference.fit.base_fit import HALVES, RECORDINGS, VALIDATION, BaseFit, fit_base
from pprs_dynamics.inference.fit.reference_runs import with_own_reference
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.model_writer import write_model

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import Figure

HELD_OUT = {RECORDINGS: 'each recording predicted from the others',
            HALVES: 'each half of the recording predicted from the other',
            VALIDATION: 'the validation recordings'}


@dataclass(frozen=True, repr=False, eq=False)
class FitResult(Result):
    """Result of `pprs fit`.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    fit : BaseFit
        The numbers, and the errors before, after and held out.
    """

    rows = 'numbers'  # what `table` shows
    json_of = 'fit'
    inputs: Inputs
    fit: BaseFit

    @property
    def model(self) -> DriveModel:
        """The fitted model."""
        return self.fit.model

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file, with the comments and further keys of the one that was given.

        Raises
        ------
        PprsError
            Where it cannot be written, or is the file that was given.
        """
        write_model(path, self.model.values, self.inputs.base)

    @property
    def _headline(self) -> str:
        """Warning that the model explains little of the efforts; '' where it explains enough."""
        return f'{word_little(self.fit.little)}, fitted nevertheless' if self.fit.little else ''

    @property
    def _errors(self) -> PlainTable:
        """Drives, units, errors before, after and held out."""
        fit, model = self.fit, self.inputs.model
        return ('drive', 'unit', 'before', 'after', 'held out'), [
            (drive, unit.effort, *(measured(errors[drive]) if drive in errors else ''
                                   for errors in (fit.error_before, fit.error_after, fit.held_out)))
            for drive, unit in zip(model.drives, model.units, strict=True)
            if drive in fit.error_after]

    @property
    def _numbers(self) -> PlainTable:
        return ('number', 'drive', 'before', 'after, ± two standard deviations'), [
            (number.key, number.drive,
             with_uncertainty(number.before, 0.0, number.unit, abs(number.after)),
             with_uncertainty(number.after, number.std if isfinite(number.std) else 0.0,
                              number.unit)) for number in self.fit.numbers]

    def view(self) -> Any:
        """Return errors and notes for the terminal; the page has every number."""
        errors = text_table(*plain_rows(self._errors), right=(2, 3, 4))
        return stacked(*filter(None, [escape(self._headline)]),
                       f'Error, rms. Held out: {HELD_OUT[self.fit.held_out_on]}.', errors,
                       *(escape(sentence(note)) for note in self.fit.notes))

    def page(self) -> Page:
        """Return the page of `pprs fit --report`."""
        page = Page('Base model')
        if self._headline:
            page.text(sentence(self._headline), 'lead')
        page.sources(self.inputs.model.source, *self.inputs.names)
        page.errors([ErrorRow(name, self.fit.error_before[name], after)
                     for name, after in self.fit.error_after.items()],
                    'Error, rms, before (grey) and with the fitted numbers (blue).')
        page.table(*self._errors)
        page.text(f'Held out: {HELD_OUT[self.fit.held_out_on]}.', 'note')
        page.bullets([sentence(entry) for entry in self.fit.notes])
        with page.fold('Every number'):
            page.table(*self._numbers)
        return page

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, after and held out."""
        return plot_errors({'before': self.fit.error_before, 'after': self.fit.error_after,
                            'held out': self.fit.held_out},
                           common_effort(self.inputs.model.units))


def fit(model: Model, recordings: Recordings, validate: Recordings = (), *,
        topic: str | None = None, progress: Progress | None = None, as_it_is: bool = False,
        ) -> FitResult:
    """Fit a base model: inertia and friction, or what `tolerances` leave open; see `fit_base`.

    Parameters
    ----------
    model, recordings, validate, topic, progress, as_it_is
        As in `diagnose`; recordings of free motion.

    Returns
    -------
    FitResult

    Raises
    ------
    FitError
        Where nothing is left open.
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(
        model, recordings, validate, topic, progress, as_it_is=as_it_is).require_measurements()
    found = fit_base(inputs.model, inputs.fitted, inputs.held_out, stage(progress, 'fitting'))
    if set(inputs.recordings) <= inputs.paths:
        found = replace(found, model=with_own_reference(
            found.model, [Path(name) for name in inputs.recordings]))
    return FitResult(inputs, found)
