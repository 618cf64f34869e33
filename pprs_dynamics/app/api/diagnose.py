# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Which physical effect a model lacks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import (
    Given,
    Inputs,
    Model,
    Progress,
    Recordings,
    stage,
)
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.diagnosis_report import diagnosis_page, diagnosis_view
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.inference.diagnosis.answer import rival_effects
from pprs_dynamics.inference.diagnosis.diagnose import diagnose as diagnose_recordings
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.physics.model.drive_model import DriveModel

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure


@dataclass(frozen=True, repr=False, eq=False)
class DiagnosisResult(Result):
    """What `pprs diagnose` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    diagnosis : Diagnosis
        The answer with all that it was decided from.
    """

    inputs: Inputs
    diagnosis: Diagnosis

    @property
    def verdict(self) -> str:
        """One of 'adequate', 'effect', 'ambiguous', 'unknown'."""
        return self.diagnosis.verdict

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """What is missing, in the order of adoption."""
        return self.diagnosis.effects

    @property
    def fitted(self) -> DriveModel:
        """The model with what is missing, not checked as `adopt` does."""
        return self.diagnosis.adopted

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs diagnose --json` writes."""
        return self.diagnosis.to_dict()

    def view(self, details: bool = False, next_step: bool = True) -> Any:
        """Return what the terminal shows, with the command to go on with, or without."""
        return diagnosis_view(self.diagnosis, self._words, details, next_step)

    def page(self) -> Page:
        """Return the page of `pprs diagnose --report`."""
        after, _ = measure_residuals(self.fitted, self.inputs.fitted)
        return diagnosis_page(
            self.diagnosis, self._words, after,
            [recording.name for recording in self.inputs.fitted],
            [recording.name for recording in self.inputs.held_out], self._rivals)

    def table(self) -> DataFrame:
        """Return a row per parameter of each missing effect: its value, std, unit, evidence."""
        return data_frame([
            {'effect': found.name, 'parameter': key, 'value': each.value, 'std': each.std,
             'unit': each.unit, 'evidence': found.evidence}
            for found in self.effects for key, each in found.parameters.items()])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, with the effects, and the noise."""
        residuals = self.diagnosis.residuals
        after = replace(residuals, model=residuals.measured - self.diagnosis.remaining)
        return plot_errors(
            {'before': rms_by_drive(residuals), 'with what is missing': rms_by_drive(after),
             'noise': self.diagnosis.noise_floors}, residuals.unit)

    @cached_property
    def _rivals(self) -> Any:
        return rival_effects(self.diagnosis, self.inputs.held_out)

    @cached_property
    def _words(self) -> Any:
        return word_diagnosis(self.diagnosis, self.inputs.files, self._rivals)


def diagnose(model: Model, recordings: Recordings, validate: Recordings = (), *,
             topic: str | None = None, progress: Progress | None = None, as_it_is: bool = False,
             reference: Given | None = None) -> DiagnosisResult:
    """Find the physical effect that a model lacks, from recordings.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
        To fit to.
    validate : path, Recording, or a sequence of them, optional
        Of other motions, never fitted: held-out errors are taken on them, instead of on blocks.
    topic, progress, as_it_is : optional
        As in `compare`.
    reference : path, Recording, or a sequence of them, optional
        Runs from a day on which the machine was right: what has changed since then is looked for,
        not what the model lacks. An empty sequence: those that the model file names.

    Returns
    -------
    DiagnosisResult

    Raises
    ------
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(
        model, recordings, validate, topic, progress, as_it_is=as_it_is).require_recordings().since(
            reference)
    found = diagnose_recordings(
        inputs.model, inputs.fitted, inputs.held_out, stage(progress, 'diagnosing'),
        as_it_is=inputs.as_it_is, reference=inputs.reference)
    if own := inputs.fitted_to:
        found = replace(found, warnings=(
            f'the model was fitted to {listed(own)}: what was wrong with the robot then is part of '
            'the model, and cannot be found in it; diagnose another run', *found.warnings))
    return DiagnosisResult(inputs, found)
