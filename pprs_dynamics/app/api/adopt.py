# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding effects to a model, fitted and checked on data that they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.diagnose import DiagnosisResult
from pprs_dynamics.app.api.inputs import Given, Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.adoption_report import adoption_page, adoption_view, run_view
from pprs_dynamics.app.report.history_report import history_page
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.drives import common_effort
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.adopt import adopt as adopt_effect
from pprs_dynamics.inference.adoption.adopt import original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.loop import REFUSED, AdoptionRun
from pprs_dynamics.inference.adoption.loop import adopt_all as adopt_effects
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.inference.fit.base_fit import BaseFit, fit_base, require_open_numbers
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure


class RefusedError(PprsError, ValueError):
    """A model of an adoption that was refused."""


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionResult(Result):
    """What `pprs adopt` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    adoption : Adoption
        The answer with all that it was decided from.
    """

    inputs: Inputs
    adoption: Adoption

    @property
    def adopted(self) -> bool:
        """Whether the model takes the effect."""
        return self.adoption.adopted

    @property
    def reason(self) -> str:
        """Why, in one sentence."""
        return self.adoption.reason

    @cached_property
    def model(self) -> DriveModel:
        """The model with the effect and its entry in the ledger; as given, where it is refused."""
        return self.inputs.ledger.entered(self.adoption) if self.adopted else self.inputs.model

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file, with the comments and further keys of the one that was given.

        Raises
        ------
        RefusedError
            Where the effect was not adopted.
        PprsError
            Where it cannot be written, or is the file that was given.
        """
        if not self.adopted:
            raise RefusedError(f'{self.adoption.effect} is refused: {self.reason}')
        write_model(path, self.model.values, self.inputs.base)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs adopt --json` writes."""
        return self.adoption.to_dict()

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return adoption_view(self.adoption)

    def page(self, saved_as: str = 'better.yaml') -> Page:
        """Return the page of `pprs adopt --report`; its next command names the file of `save`."""
        return adoption_page(self.adoption, self.inputs.fitted, self.inputs.held_out,
                             replace(self.inputs.files, model=saved_as).command(
                                 'diagnose', held_out=True))

    def table(self) -> DataFrame:
        """Return a row per parameter: its value, std and unit."""
        found = self.adoption.parameters
        return data_frame([{'value': entry.value, 'std': entry.std, 'unit': entry.unit}
                           for entry in found.values()], list(found), 'parameter')

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, after, and the noise."""
        return _plot(self.adoption, self.adoption)


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionRunResult(Result):
    """What `pprs diagnose --adopt-all` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    run : AdoptionRun
        What was adopted and refused, one after the other.
    refit : BaseFit, optional
        Of the base model with the adopted effects.
    """

    inputs: Inputs
    run: AdoptionRun
    refit: BaseFit | None = None

    @property
    def model(self) -> DriveModel:
        """The model with all that was adopted, and its ledger."""
        if self.refit is not None and self.refit.ratio < 1:
            return self.refit.model
        return self.run.model

    @property
    def refused(self) -> bool:
        """Whether it ended because the remaining effects were refused."""
        return self.run.ended == REFUSED

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file, as `AdoptionResult.save`; as it was, with nothing to adopt.

        Raises
        ------
        RefusedError
            Where nothing was adopted because it was refused.
        PprsError
            Where it cannot be written, or is the file that was given.
        """
        if self.refused and not self.run.adopted:
            raise RefusedError(self.run.reason)
        write_model(path, self.model.values, self.inputs.base)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs diagnose --adopt-all --json` writes as `adoption`."""
        refit = {} if self.refit is None else {'refit': {
            **self.refit.to_dict(), 'taken': self.refit.ratio < 1, 'reason': self.refit.change}}
        return {**self.run.to_dict(), **refit}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return run_view(self.run, self.inputs.files.command(
            'next-experiment', '--output', 'next.csv'), details)

    def page(self) -> Page:
        """Return the page of `pprs history --report` of the model."""
        return history_page('the adopted model', read_steps(self.model.values),
                            common_effort(self.model.units))

    def table(self) -> DataFrame:
        """Return a row per step: the effect, whether it was adopted, errors [N], the reason."""
        return data_frame([
            {'effect': step.effect, 'adopted': step.adopted, 'error_before': step.error_before,
             'error_after': step.error_after, 'held_out_before': step.held_out_before,
             'held_out_after': step.held_out_after, 'reason': step.reason}
            for step in self.run.steps])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before all, after all, and the noise.

        Raises
        ------
        RefusedError
            Where nothing was adopted.
        """
        if not self.run.adopted:
            raise RefusedError(f'nothing was adopted: {self.run.reason}')
        return _plot(self.run.adopted[0], self.run.adopted[-1])


def adopt(model: Model, effect: str, recordings: Recordings, validate: Recordings = (), *,
          force: bool = False, diagnosis: DiagnosisResult | None = None,
          topic: str | None = None, progress: Progress | None = None, as_it_is: bool = False,
          reference: Given | None = None) -> AdoptionResult:
    """Add an effect to a model: fit it, check it on data it was not fitted to, take or refuse it.

    Parameters
    ----------
    model : DriveModel or path
    effect : str
        Its name, on the drives that the recordings call for; or 'EFFECT:drive,drive'; or
        'measured_curve:DRIVE@VARIABLE'.
    recordings, validate : path, Recording, or a sequence of them
        To fit to; and never fitted, optional.
    force : bool
        Take it in spite of objections.
    diagnosis : DiagnosisResult, optional
        Of this model on these recordings, where it is known: it is not made again.
    topic, progress, as_it_is : optional
        As in `compare`.
    reference : path, Recording, or a sequence of them, optional
        As in `diagnose`: the effect is a change since then. Errors of the reference are subtracted.

    Returns
    -------
    AdoptionResult

    Raises
    ------
    EffectRequestError
        For an effect or a drive that does not exist, or does not act in the model.
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(
        model, recordings, validate, topic, progress, as_it_is=as_it_is).require_measurements()
    request = requested(effect, inputs.model)
    inputs = inputs.since(reference, original(inputs.model))
    return AdoptionResult(inputs, adopt_effect(
        inputs.model, request, inputs.fitted, inputs.held_out, force,
        stage(progress, f'adopting {request.name}'),
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference))


def adopt_all(model: Model, recordings: Recordings, validate: Recordings = (), *,
              refit: Recordings | None = None, diagnosis: DiagnosisResult | None = None,
              topic: str | None = None, progress: Progress | None = None,
              reference: Given | None = None) -> AdoptionRunResult:
    """Diagnose and adopt until no effect is missing.

    Parameters
    ----------
    model, recordings, validate, diagnosis, topic, progress, reference
        As in `adopt`.
    refit : path, Recording, or a sequence of them, optional
        To which the base model is then fitted again, as `fit` does, with the adopted effects. It is
        taken if the error on other data falls. An empty sequence means `recordings`.

    Returns
    -------
    AdoptionRunResult

    Raises
    ------
    FitError
        Where there is nothing to fit again.
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(model, recordings, validate, topic, progress).require_recordings()
    inputs = inputs.since(reference, original(inputs.model))
    again: list[Recording] = []
    if refit is not None:
        require_open_numbers(inputs.model)
        again = Inputs.of(inputs.model, refit, inputs.held_out, topic,
                          progress, as_it_is=inputs.as_it_is).fitted or inputs.fitted
    run = adopt_effects(
        inputs.model, inputs.fitted, inputs.held_out, inputs.ledger.entered, progress,
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference)
    if not again or not run.adopted:
        return AdoptionRunResult(inputs, run)
    return AdoptionRunResult(inputs, run, fit_base(
        run.model, again, inputs.held_out, stage(progress, 'fitting the base')))


def _plot(first: Adoption, last: Adoption) -> Figure:
    return plot_errors({'before': rms_by_drive(first.residuals_before),
                        'after': rms_by_drive(last.residuals_after),
                        'noise': last.noise_floors}, last.unit)
