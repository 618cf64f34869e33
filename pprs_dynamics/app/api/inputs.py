# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Models and recordings as callers give them: files or what is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.errors import MisreadError, PprsError, UnreadableFileError
from pprs_dynamics.inference.readings.check import with_mistakes
from pprs_dynamics.inference.readings.findings import no_measurements
from pprs_dynamics.inference.residuals.long_recordings import excerpts_within_memory
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.measurement.files.repeats import find_repeat
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, find_file
from pprs_dynamics.physics.model.parameter_values import reference_files
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from pprs_dynamics.inference.adoption.adoption import LedgerBook
    from pprs_dynamics.inference.diagnosis.next_step import GivenFiles
    from pprs_dynamics.inference.fit.reference import Reference

File = str | PathLike[str]
Model = DriveModel | File
Progress = Callable[[str, float], None]  # what is being done, and the share of it that is done
# Every recording is evidence once.
ONCE = 'every recording may be given once'
OTHER = 'what is held out must be another recording'


def stage(progress: Progress | None, what: str) -> Callable[[float], None]:
    """Return the progress callback of one stage."""
    return lambda share: progress(what, share) if progress else None


class InputError(PprsError, ValueError):
    """Recordings that are not there, or are none."""


@dataclass(frozen=True)
class Inputs:
    """A model and the recordings it is held against, read and checked.

    Parameters
    ----------
    model : DriveModel
    recordings, validation : mapping of str to Recording
        To fit to, and never fitted; by path, or by name where they came from no file.
    paths : frozenset of str
        Which of those names are paths.
    base : Path or None
        The model's file; None for a model from memory.
    model_path : str, optional
        Name of the model's file as given, `config/paper.yaml` for the paper's; None from memory.
    topic : str
        As given; '' for none.
    as_it_is : bool
        Whether recordings are taken as their names and units say, whatever they look like.
    reference : Reference, optional
        Run since which it is asked what has changed.
    reference_paths : tuple of str, optional
        Its files; none of them: those that the model file names.
    """

    model: DriveModel
    recordings: Mapping[str, Recording]
    validation: Mapping[str, Recording]
    paths: frozenset[str] = frozenset()
    base: Path | None = None
    model_path: str | None = None
    topic: str = ''
    as_it_is: bool = False
    reference: Reference | None = None
    reference_paths: tuple[str, ...] | None = None

    @classmethod
    def of(cls, model: Model, recordings: Recordings, validate: Recordings = (),
           topic: str | None = None, progress: Progress | None = None,
           whole: bool = False, as_it_is: bool = False) -> Inputs:
        """Read and check paths; recordings in memory are not checked.

        Of recordings that are too long for a fit excerpts are taken, but where the `whole` is
        asked for.

        Raises
        ------
        UnreadableFileError
            Where a file cannot be read, or holds the samples of another.
        MisreadError
            Where a file looks as if it were in other units, signs or another order than it says,
            but with `as_it_is`.
        ModelError
            Where the model is none.
        """
        if isinstance(recordings, Inputs):
            found = recordings
        else:
            held_out = () if isinstance(validate, Inputs) else validate
            found = replace(cls.read(model, recordings, held_out, topic, progress),
                            as_it_is=as_it_is)
            stage(progress, 'checking units and signs')(0.0)
            found = found.checked()
        return found if whole else found.within_memory()

    @classmethod
    def read(cls, model: Model, recordings: Given, validate: Given = (),
             topic: str | None = None, progress: Progress | None = None) -> Inputs:
        """Read as `of`, but units and signs are not looked at yet."""
        _require_kinds(recordings, validate)
        found = model if isinstance(model, DriveModel) else DriveModel.load(find_file(model))
        base = Path(found.source) if found.source and Path(found.source).is_file() else None
        shipped = base is not None and base == find_file(DEFAULT_MODEL)
        given = base if isinstance(model, DriveModel) else model
        path = DEFAULT_MODEL if shipped else None if given is None else str(given)
        fitted, held_out = (_read_all(found, listed, topic, progress)
                            for listed in (recordings, validate))
        _refuse_repeats(fitted, [], ONCE)
        _refuse_repeats(held_out, fitted.values(), OTHER)
        _require_efforts({**fitted, **held_out})
        entries = [*listed_recordings(recordings), *listed_recordings(validate)]
        paths = frozenset(str(entry) for entry in entries if not isinstance(entry, Recording))
        return cls(found, fitted, held_out, paths, base, path, topic or '')

    def _each(self, change: Callable[[Mapping[str, Recording]], dict[str, Recording]]) -> Inputs:
        return replace(self, recordings=change(self.recordings), validation=change(self.validation))

    def checked(self) -> Inputs:
        """Return this with what the numbers of files rather mean among the findings.

        Raises
        ------
        MisreadError
            Where one looks as if it were in other units, signs or another order than it says, but
            with `as_it_is`.
        """
        return self._each(lambda given: {
            name: with_mistakes(self.model, recording, refuse=not self.as_it_is)
            if name in self.paths else recording for name, recording in given.items()})

    def within_memory(self) -> Inputs:
        """Return this with no more of each recording than a fit can hold."""
        return self._each(lambda given: dict(zip(given, excerpts_within_memory(
            self.model, list(given.values())), strict=True)))

    def with_more(self, path: File, is_held_out: bool = False) -> Inputs:
        """Return this with one more file; errors as `of`."""
        try:
            more = Inputs.of(self.model, path, as_it_is=self.as_it_is)
        except UnreadableFileError:
            if not self.topic:
                raise
            # The file may contain several topics.
            more = Inputs.of(self.model, path, topic=self.topic, as_it_is=self.as_it_is)
        _refuse_repeats(more.recordings, [*self.fitted, *self.held_out], ONCE)
        if self.reference is not None:
            from pprs_dynamics.inference.fit.reference_runs import OTHER as OTHER_RUN

            _refuse_repeats(more.recordings, self.reference.recordings, OTHER_RUN)
        found = replace(self, paths=self.paths | more.paths)
        return (replace(found, validation={**self.validation, **more.recordings}) if is_held_out
                else replace(found, recordings={**self.recordings, **more.recordings}))

    def without(self, name: str) -> Inputs:
        """Return this with one recording fewer.

        Raises
        ------
        InputError
            For one that is not there, or the last one to fit to.
        """
        if name not in {**self.recordings, **self.validation}:
            raise InputError(f'no recording {displayed(name)}, must be one of '
                             f'{", ".join(map(displayed, (*self.recordings, *self.validation)))}')
        fewer, held_out = ({key: recording for key, recording in given.items() if key != name}
                           for given in (self.recordings, self.validation))
        return replace(self, recordings=fewer, validation=held_out,
                       paths=self.paths - {name}).require_recordings()

    def since(self, reference: Given | None, model: DriveModel | None = None) -> Inputs:
        """Return this with reference runs, () for the model's own; unchanged for None.

        They are fitted to the model, or to another one that is given.

        Raises
        ------
        PprsError
            As `read_reference`.
        """
        from pprs_dynamics.inference.fit.reference_runs import read_reference

        if reference is None:
            return self
        runs = listed_recordings(reference)
        return replace(
            self, reference=read_reference(model or self.model, runs,
                                           [*self.fitted, *self.held_out], self.as_it_is),
            reference_paths=tuple(str(run) for run in runs if not isinstance(run, Recording)))

    @property
    def fitted_to(self) -> tuple[str, ...]:
        """Recordings that the model was fitted to, by the hashes in its file."""
        hashes = {file.sha256 for file in reference_files(self.model.values, self.model.source)}
        return tuple(displayed(name) for name in self.recordings
                     if hashes and name in self.paths and fingerprint(name) in hashes)

    def require_recordings(self) -> Inputs:
        """Return this, or raise InputError where there is no recording to fit to."""
        if not self.recordings:
            raise InputError('no recording is given, must be at least one')
        return self

    def require_measurements(self) -> Inputs:
        """Return this, or raise MisreadError where efforts of files look like no measurement.

        Not so with `as_it_is`. For what would write them into a model.
        """
        for name in () if self.as_it_is else self.recordings:
            found = no_measurements([self.recordings[name].findings])
            if found:
                raise MisreadError(displayed(name), [entry.what for entry in found],
                                   [entry.line for entry in found])
        return self.require_recordings()

    @property
    def fitted(self) -> list[Recording]:
        """The recordings to fit to."""
        return list(self.recordings.values())

    @property
    def held_out(self) -> list[Recording]:
        """The recordings that are never fitted."""
        return list(self.validation.values())

    @property
    def names(self) -> tuple[list[str], list[str]]:
        """Names of the recordings to fit to, and of those that are held out."""
        return ([recording.name for recording in self.fitted],
                [recording.name for recording in self.held_out])

    @property
    def files(self) -> GivenFiles:
        """Their names, for commands that can be copied; placeholders for what has no file."""
        # Here and below: reading alone, as `pprs info` does, needs no statistics.
        from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, GivenFiles

        model = self.model_path or PLACEHOLDERS.model
        if not {*self.recordings, *self.validation} <= self.paths:
            return replace(PLACEHOLDERS, model=model)
        return GivenFiles(tuple(self.recordings), tuple(self.validation), model, self.topic,
                          self.reference_paths)

    @property
    def ledger(self) -> LedgerBook:
        """Ledger that enters adoptions on these recordings into a model."""
        from pprs_dynamics.inference.adoption.adoption import LedgerBook, RecordingEntry

        def entries(recordings: Mapping[str, Recording]) -> tuple[RecordingEntry, ...]:
            return tuple(RecordingEntry(recording, name if name in self.paths else None)
                         for name, recording in recordings.items())
        return LedgerBook(entries(self.recordings), entries(self.validation))


Given = File | Recording | Sequence[File | Recording]
Recordings = Given | Inputs


def read_checked(model: DriveModel, path: File, topic: str | None = None,
                 progress: Progress | None = None) -> Recording:
    """Read a recording of a model's drives; what its numbers rather mean is in its findings."""
    return with_mistakes(model, _read(model, path, topic, progress))


def _read(model: DriveModel, path: File, topic: str | None, progress: Progress | None) -> Recording:
    report = stage(progress, f'reading {displayed(path)}')
    return read_recording(path, model.recorded, topic,
                          lambda done, total: report(done / total if total else 0.0))


def _read_all(model: DriveModel, given: Given, topic: str | None, progress: Progress | None,
              ) -> dict[str, Recording]:
    """Return recordings by path or name; two from memory may have the same name."""
    found: dict[str, Recording] = {}
    for entry in listed_recordings(given):
        recording = entry if isinstance(entry, Recording) else _read(model, entry, topic, progress)
        name = entry.name if isinstance(entry, Recording) else str(entry)
        same = sum(key == name or key.startswith(f'{name} (') for key in found)
        found[f'{name} ({same + 1})' if same else name] = recording
    return found


def listed_recordings(given: Given) -> Sequence[File | Recording]:
    """Return one or several recordings as a list."""
    return [given] if isinstance(given, (str, PathLike, Recording)) else given


def _require_kinds(recordings: Given, validate: Given) -> None:
    """Raise InputError for recordings that are neither a path nor a Recording."""
    for name, given in (('recordings', recordings), ('validate', validate)):
        listed = listed_recordings(given) if isinstance(given, (PathLike, Sequence)) else [given]
        for entry in listed:
            if not isinstance(entry, (Recording, str, PathLike)):
                raise InputError(f'{name}: one is of type {type(entry).__name__}, must be a path '
                                 'or a Recording (Recording.from_arrays makes one of arrays)')


def _require_efforts(recordings: Mapping[str, Recording]) -> None:
    """Raise UnreadableFileError for a recording without usable samples or without efforts."""
    for name, recording in recordings.items():
        if not recording.segments:
            raise UnreadableFileError(name, f'none of its {len(recording.time)} samples can be '
                                      'used, must have a longer part without a gap')
        if not np.isfinite(recording.effort).any():
            cut_off = [finding.text for finding in recording.findings
                       if finding.kind == 'mostly_saturated']
            raise UnreadableFileError(name, '; '.join(cut_off) or (
                'no effort of any drive is recorded, must be recorded with the positions '
                '(<drive>/effort in a CSV, effort in JointState)'))


def _refuse_repeats(found: Mapping[str, Recording], earlier: Iterable[Recording], rule: str,
                    ) -> None:
    repeat = find_repeat([*found.values()], [*earlier])
    if repeat is not None:
        index, clause = repeat
        raise UnreadableFileError([*found][index], f'{clause}, but {rule}')
