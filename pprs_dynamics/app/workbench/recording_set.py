# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a session: each once, in metres, with what its numbers rather mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.inference.adoption.ledger_entry import LedgerBook, RecordingEntry
from pprs_dynamics.inference.residuals.conventions import find_mistakes
from pprs_dynamics.inference.residuals.readings import POSITION_UNIT
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.physics.model.parameter_file import find_file


@dataclass(frozen=True)
class RecordingSet:
    """What is fitted, and what adoptions are judged on.

    Parameters
    ----------
    fitted, held_out : mapping of str to Recording
        By path or by whatever name.
    files : frozenset of str
        Those that are paths: the ledger has the hashes of these, and of others' samples.

    """

    fitted: Mapping[str, Recording]
    held_out: Mapping[str, Recording] = field(default_factory=dict)
    files: frozenset[str] = frozenset()

    @classmethod
    def read(cls, model: ForceModel, recordings: Sequence[str | PathLike[str]],
             validation: Sequence[str | PathLike[str]], topic: str | None) -> RecordingSet:
        """Read files by the readers of all commands.

        Raises
        ------
        PprsError
            Where one cannot be read, or holds the samples of another.
        """
        paths = [str(path) for path in (*recordings, *validation)]
        _refuse_repeated(paths)
        fitted, held_out = ({str(path): read_recording(path, model.recorded, topic)
                             for path in listed} for listed in (recordings, validation))
        return cls(fitted, held_out, frozenset(paths)).once()

    def once(self) -> RecordingSet:
        """Return itself, or raise SessionError where a recording holds the samples of another."""
        fitted, held_out = list(self.fitted.values()), list(self.held_out.values())
        repeat = find_repeat(fitted, ()) or find_repeat(held_out, fitted)
        if repeat is not None:
            raise SessionError(f'{repeat[1]}, but every recording may be given once')
        return self

    def with_more(self, model: ForceModel, path: str, is_held_out: bool) -> RecordingSet:
        """Return the set with one more file.

        Raises
        ------
        PprsError
            As `read`.
        """
        _refuse_repeated([*self.fitted, *self.held_out, path])
        more = {path: with_mistakes(model, read_recording(path, model.recorded, None))}
        return RecordingSet(self.fitted if is_held_out else {**self.fitted, **more},
                            {**self.held_out, **more} if is_held_out else self.held_out,
                            self.files | {path}).once()

    def with_mistakes(self, model: ForceModel) -> RecordingSet:
        """Return the set with what numbers rather mean among the findings.

        Raises
        ------
        UnreadableFileError
            For positions that are no metres.
        """
        fitted, held_out = ({path: with_mistakes(model, one) for path, one in listed.items()}
                            for listed in (self.fitted, self.held_out))
        return RecordingSet(fitted, held_out, self.files)

    def book(self) -> LedgerBook:
        """Return what the ledger says of them."""
        return LedgerBook(self._entries(self.fitted), self._entries(self.held_out))

    def _entries(self, recordings: Mapping[str, Recording]) -> tuple[RecordingEntry, ...]:
        return tuple(RecordingEntry.of(path, one) if path in self.files
                     else RecordingEntry.of_samples(one) for path, one in recordings.items())


@dataclass(frozen=True)
class Files:
    """Model and recordings as they were read.

    Parameters
    ----------
    model : ForceModel
    recordings : RecordingSet
    base : Path
        The model's file.
    """

    model: ForceModel
    recordings: RecordingSet
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
        return cls(found, RecordingSet.read(found, recordings, validation, topic), base)


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


def _refuse_repeated(paths: Sequence[str]) -> None:
    for path in paths:
        if paths.count(path) > 1:
            raise SessionError(f'{path} is given twice, but every recording may be given once')
