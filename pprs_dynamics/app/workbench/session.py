# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A session of the workbench: recordings, ticked effects, and background jobs on one model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from pprs_dynamics.app.api.inputs import Given, Inputs
from pprs_dynamics.app.workbench import view_state
from pprs_dynamics.app.workbench.jobs import Jobs
from pprs_dynamics.app.workbench.masks import shares_in, span_mask
from pprs_dynamics.app.workbench.ticks import Ticks
from pprs_dynamics.app.workbench.view_state import NOT_KNOWN, DriveError, Share
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.quantities import word_little
from pprs_dynamics.inference.diagnosis.sentences import word_reference
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.system.json_records import for_json


class Session:
    """A model, its recordings, and effects that are ticked, shown, adopted and undone.

    Nothing on disk changes before `export`.

    Parameters
    ----------
    model : DriveModel
    recordings : mapping of str to Recording
        To fit to, by name.
    inputs : Inputs, optional
        Model and recordings with their files, in place of the recordings.

    Attributes
    ----------
    ticks : Ticks
    jobs : Jobs

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """

    def __init__(self, model: DriveModel, recordings: Mapping[str, Recording],
                 inputs: Inputs | None = None) -> None:
        self.ticks = Ticks(model, (inputs or Inputs(model, recordings, {})).require_recordings())
        self.jobs = Jobs(self.ticks)

    @classmethod
    def open(cls, recordings: Sequence[str | PathLike[str]],
             model: str | PathLike[str] = 'config/paper.yaml',
             validation: Sequence[str | PathLike[str]] = (),
             reference: Given | None = None) -> Session:
        """Read a model and recordings as all commands do.

        With `reference` runs, effects are changes since then; () are those of the model file.

        Raises
        ------
        PprsError
            Where a file cannot be read, or repeats another one; as `read_reference`.
        """
        session = cls.of(Inputs.read(model, recordings, validation).since(reference))
        session.ticks.change_recordings(Inputs.checked)
        return session

    @classmethod
    def of(cls, inputs: Inputs) -> Session:
        """Start with recordings that were read, whose units are not checked yet.

        Raises
        ------
        PprsError
            As `measure_residuals`.
        """
        inputs = inputs.within_memory()
        try:
            return cls(inputs.model, inputs.recordings, inputs)
        except PprsError:
            # Positions in millimetres are reported as such, not as a pose out of reach.
            inputs.checked()
            raise

    def export(self, path: str | PathLike[str], with_ticked: bool = False) -> None:
        """Write the model with its ledger, or with the ticked effects in addition.

        Raises
        ------
        PprsError
            As `Ticks.ticked_model`; where the file cannot be written, or is the input model.
        """
        model = self.ticks.ticked_model() if with_ticked else self.ticks.model
        write_model(path, model.values, self.ticks.inputs.base)

    def errors(self) -> dict[str, DriveError]:
        """Return the error of every measured drive: of the model, with ticks, and of the noise."""
        return view_state.errors_of(self.ticks.fits, self.ticks.view, self.jobs.noise)

    def overall(self) -> DriveError:
        """Return the error over all samples and drives."""
        noise = list(self.jobs.noise.values())
        return DriveError(root_mean_square(self.ticks.fits.before),
                          root_mean_square(self.ticks.view.residual),
                          root_mean_square(noise) if noise else NOT_KNOWN)

    def shares(self, start: float, end: float, drives: Sequence[str] | None = None) -> list[Share]:
        """Return the share of the squared error in a span [s] that each unticked effect explains.

        Raises
        ------
        SessionError
            For an unknown drive.
        """
        ticks = self.ticks
        return shares_in(span_mask(ticks, start, end, drives), ticks.fits, ticks.view)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the page, without curves."""
        ticks, jobs = self.ticks, self.jobs
        with ticks.steady():
            view, fits, model, diagnosis = ticks.view, ticks.fits, ticks.model, jobs.diagnosis
            reported = {effect.name for effect in diagnosis.effects} if diagnosis else None
            return {
                'revision': ticks.revision, 'fitted_since': ticks.fitted_since,
                'stage': view.stage, 'is_settled': view.is_settled,
                'is_approximate': view.is_approximate,
                'departure': for_json(view.departure), 'notice': view.notice,
                'drives': list(fits.drives),
                'errors': for_json(self.errors()),
                'overall': for_json(self.overall()), **view_state.units_to_dict(model),
                'effects': [view_state.effect_to_dict(view, effect, fits, reported)
                            for effect in fits.candidates()],
                'verdict': diagnosis.verdict if diagnosis else None,
                'reference': None if fits.since is None else {
                    **fits.since.to_dict(), 'text': list(word_reference(fits.since))},
                'little': word_little(little_explained(
                    model, fits.fits.design.residuals, view.residual)),
                'steps': [step.to_dict() for step in read_steps(model.values)],
                'undoes': ticks.undoes, 'redoes': ticks.redoes,
                'jobs': {kind: job.to_dict() for kind, job in jobs.of_kind.items()},
                'adoption': jobs.adoption.to_dict() if jobs.adoption else None,
                'experiment': jobs.experiment.to_dict() if jobs.experiment else None,
                'recordings': view_state.recordings_to_dict(
                    ticks.inputs.recordings, fits, view.residual),
                'held_out': [{'key': key, 'name': recording.name}
                             for key, recording in ticks.inputs.validation.items()]}
