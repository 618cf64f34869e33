# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a session: each once, in metres, with what its numbers rather mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.recording import Recording, read_for
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.measurement.residuals.conventions import find_mistakes
from pprs_dynamics.measurement.residuals.readings import POSITION_UNIT
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.physics.model.parameter_file import find_file


def refuse_repeats(fitted: Mapping[str, Recording], held_out: Mapping[str, Recording]) -> None:
    """Raise SessionError where a recording holds the samples of another."""
    repeat = find_repeat(list(fitted.values()), ()) or find_repeat(
        list(held_out.values()), list(fitted.values()))
    if repeat is not None:
        raise SessionError(f'{repeat[1]}, but every recording may be given once')


def refuse_paths(paths: Sequence[str]) -> None:
    """Raise SessionError where a path is given twice."""
    for path in paths:
        if paths.count(path) > 1:
            raise SessionError(f'{path} is given twice, but every recording may be given once')


@dataclass(frozen=True)
class Files:
    """Model and recordings as they were read.

    Parameters
    ----------
    model : ForceModel
    recordings, validation : dict of str to Recording
        By path.
    base : Path
        The model's file.
    """

    model: ForceModel
    recordings: dict[str, Recording]
    validation: dict[str, Recording]
    base: Path

    @classmethod
    def read(cls, recordings: Sequence[str | PathLike[str]], model: str | PathLike[str],
             validation: Sequence[str | PathLike[str]] = (), topic: str | None = None) -> Files:
        """Read files by the readers of all commands.

        Raises
        ------
        PprsError
            Where one cannot be read, or holds the samples of another.
        """
        base = find_file(model)
        found = load_model(base)
        refuse_paths([str(path) for path in (*recordings, *validation)])
        fitted, held_out = ({str(path): read(path, found, topic) for path in paths}
                            for paths in (recordings, validation))
        refuse_repeats(fitted, held_out)
        return cls(found, fitted, held_out, base)


def read(path: str | PathLike[str], model: ForceModel, topic: str | None = None) -> Recording:
    """Read a recording of a model's drives; currents become efforts by their gains."""
    return read_for(model, path, topic)


def with_mistakes(model: ForceModel, recording: Recording) -> Recording:
    """Return a recording with what its numbers rather mean among its findings.

    Raises
    ------
    UnreadableFileError
        For positions that are no metres.
    """
    mistakes = find_mistakes(model, recording)
    for finding in mistakes:
        if finding.kind == POSITION_UNIT and isinstance(model, DriveModel):
            raise UnreadableFileError(recording.name, f'{finding.what}, must be metres')
    return replace(recording, findings=(*mistakes, *recording.findings))
