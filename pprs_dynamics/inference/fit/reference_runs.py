# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Reference runs: their files, also those that a model file names, read and checked."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.inference.fit.reference import Reference, ReferenceRunError
from pprs_dynamics.inference.readings.check import with_mistakes
from pprs_dynamics.inference.residuals.long_recordings import excerpts_within_memory
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import values_before_changes
from pprs_dynamics.physics.model.parameter_values import (
    ReferenceFile,
    reference_files,
    with_reference,
)
from pprs_dynamics.system.plain_text import displayed

RunFile = str | PathLike[str] | Recording
OTHER = 'a reference must be another run than what is diagnosed'


def read_reference(model: DriveModel, files: Sequence[RunFile] = (),
                   diagnosed: Sequence[Recording] = (), as_it_is: bool = False) -> Reference:
    """Return the fit of reference runs; without any, of those that the model's file names.

    They are fitted to the model as it was then: without what was adopted as a change since.

    Parameters
    ----------
    model : DriveModel
    files : sequence of path or Recording, optional
    diagnosed : sequence of Recording, optional
        Which none of them may be.
    as_it_is : bool, optional
        Whatever units and signs of files look like.

    Raises
    ------
    ReferenceRunError
        Where there is none, or it says nothing of this robot.
    UnreadableFileError
        Where one is not there, is not what the model was fitted to any more, or is diagnosed.
    MisreadError
        Where a file looks as if it were in other units, signs or another order than it says.
    PprsError
        As `read_recording` and `measure_residuals`.
    """
    then = values_before_changes(model.values)
    if then != dict(model.values):
        model = DriveModel.from_parameters(then, model.source)
    given = files or [file.path for file in _own(model)]
    runs = excerpts_within_memory(model, [
        run if isinstance(run, Recording) else with_mistakes(
            model, read_recording(run, model.recorded), refuse=not as_it_is) for run in given])
    repeat = find_repeat(runs, diagnosed)
    if repeat is not None:
        raise UnreadableFileError(runs[repeat[0]].name, f'{repeat[1]}, but {OTHER}')
    return Reference.of(model, runs)


def _own(model: DriveModel) -> tuple[ReferenceFile, ...]:
    name = displayed(model.source or 'the model')
    found = reference_files(model.values, model.source)
    if not found:
        raise ReferenceRunError(
            f'{name} names no reference run, must be given: --reference FREE_RUN; `pprs fit '
            'FREE_RUN --model … --output base.yaml` writes it into a model file')
    for file in found:
        if not file.path.exists():
            raise UnreadableFileError(file.path, f'the reference that {name} names is not there: '
                                      'put it back, or give it with --reference FILE')
        if fingerprint(file.path) != file.sha256:
            raise UnreadableFileError(
                file.path, f'it is not what {name} was fitted to (its SHA-256 is another): fit the '
                'model again, or accept it with --reference FILE')
    return found


def with_own_reference(model: DriveModel, paths: Sequence[Path]) -> DriveModel:
    """Return a model that names the files it was fitted to."""
    files = [ReferenceFile(path.absolute(), fingerprint(path)) for path in paths]
    return DriveModel.from_parameters(with_reference(model.values, files), model.source)
