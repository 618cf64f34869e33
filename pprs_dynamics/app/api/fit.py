# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The base model that recordings call for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.fit_report import fit_page, fit_view
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.drives import common_effort
from pprs_dynamics.inference.fit.base_fit import BaseFit, fit_base
from pprs_dynamics.inference.fit.reference_runs import with_own_reference
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.model_writer import write_model

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure


@dataclass(frozen=True, repr=False, eq=False)
class FitResult(Result):
    """What `pprs fit` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    fit : BaseFit
        The numbers, and the errors before, after and held out.
    """

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

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs fit --json` writes."""
        return self.fit.to_dict()

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return fit_view(self.inputs.model, self.fit, details)

    def page(self) -> Page:
        """Return the page of `pprs fit --report`."""
        return fit_page(self.inputs.model, self.fit,
                        [recording.name for recording in self.inputs.fitted],
                        [recording.name for recording in self.inputs.held_out])

    def table(self) -> DataFrame:
        """Return a row per fitted number: before, after, std, unit."""
        return data_frame([vars(number) for number in self.fit.numbers])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, after and held out."""
        return plot_errors({'before': self.fit.before, 'after': self.fit.after,
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
