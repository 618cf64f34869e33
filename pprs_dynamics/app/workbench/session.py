# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A session: recordings, a model, and effects that are ticked, looked at, adopted, taken back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from typing import Any

from pprs_dynamics.app.workbench.apart import run_apart
from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.app.workbench.jobs import Cancelled, Job
from pprs_dynamics.app.workbench.long_work import DesignedMotion, designed, diagnosed, judged
from pprs_dynamics.app.workbench.masks import Mask, quantity, region_mask, shares_in, span_mask
from pprs_dynamics.app.workbench.reading import (
    Files,
    read,
    refuse_paths,
    refuse_repeats,
    with_mistakes,
)
from pprs_dynamics.app.workbench.shown import (
    Share,
    effect_to_dict,
    finite,
    names_of,
    recordings_to_dict,
    units_to_dict,
)
from pprs_dynamics.app.workbench.tick_board import TickBoard
from pprs_dynamics.app.workbench.what_if import WhatIf
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.adopt import original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.ledger_entry import LedgerBook, RecordingEntry
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.experiments.next_experiment import check_duration
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.arm_model import ArmModel
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.ledger import Step, read_steps, without_last_step
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.model.model_writer import write_model


class Session(TickBoard):
    """Recordings, a model, and what effects would do to its error.

    Nothing on disk changes before `export`.

    Parameters
    ----------
    model : ForceModel
    recordings : mapping of str to Recording
        To fit to, by path or by whatever name.
    validation : mapping of str to Recording, optional
        Never fitted, adoptions are judged on them.
    base : path, optional
        The model's file, whose comments exported models keep.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """

    def __init__(self, model: ForceModel, recordings: Mapping[str, Recording],
                 validation: Mapping[str, Recording] | None = None,
                 base: str | PathLike[str] | None = None) -> None:
        if not recordings:
            raise SessionError('no recording is given, must be at least one')
        self.recordings, self.validation = dict(recordings), dict(validation or {})
        self.base = base
        self.diagnosis: Diagnosis | None = None
        self.last_adoption: Adoption | None = None
        self.experiment: DesignedMotion | None = None
        self._files: set[str] = set()  # the ledger has the hashes of these; of others' samples
        self.jobs: dict[str, Job[Any]] = {}
        super().__init__(WhatIf(model, list(self.recordings.values())))

    @classmethod
    def open(cls, recordings: Sequence[str | PathLike[str]],
             model: str | PathLike[str] = 'config/paper.yaml',
             validation: Sequence[str | PathLike[str]] = (), topic: str | None = None) -> Session:
        """Read files by the readers of all commands.

        Raises
        ------
        PprsError
            Where one cannot be read, or holds the samples of another.
        """
        session = cls.of(Files.read(recordings, model, validation, topic))
        session.find_mistakes()
        return session

    @classmethod
    def of(cls, files: Files) -> Session:
        """Begin with files that were read; what their numbers rather mean is not looked for yet.

        Raises
        ------
        PprsError
            As `measure_residuals`.
        """
        try:
            session = cls(files.model, files.recordings, files.validation, files.base)
        except PprsError:
            # Positions in millimetres are told as that, not as a pose out of reach.
            for recording in files.recordings.values():
                with_mistakes(files.model, recording)
            raise
        session._files = {*files.recordings, *files.validation}
        return session

    def add(self, path: str | PathLike[str], is_held_out: bool = False) -> None:
        """Take one more recording, read by the reader of all commands.

        Raises
        ------
        PprsError
            Where it cannot be read, holds the samples of another, or the model cannot follow it.
        """
        refuse_paths([*self.recordings, *self.validation, str(path)])
        more = {str(path): with_mistakes(self.model, read(path, self.model))}
        fitted = self.recordings if is_held_out else {**self.recordings, **more}
        held_out = {**self.validation, **more} if is_held_out else self.validation
        refuse_repeats(fitted, held_out)
        self._files |= {*more}
        if is_held_out:
            self.validation = held_out
            self.tell()
            return
        what_if = WhatIf(self.model, list(fitted.values()))
        with self._lock:
            self.recordings, self.diagnosis = fitted, None
            self._use(what_if, self.shown.ticks)

    def find_mistakes(self) -> None:
        """Look for units, signs and orders that are not SI's, and add them to the findings.

        Raises
        ------
        UnreadableFileError
            For positions that are no metres.
        """
        for listed in (self.recordings, self.validation):
            listed.update({path: with_mistakes(self.model, one) for path, one in listed.items()})
        self.tell()

    @property
    def steps(self) -> list[Step]:
        """The ledger of the model, oldest first."""
        return read_steps(self.model.values)

    # Pointing at data

    def span(self, start: float, end: float, drives: Sequence[str] | None = None) -> Mask:
        """Return the samples between two times [s], on some drives or all."""
        return span_mask(self.data, start, end, self._indices(drives))

    def region(self, x: str, y: str, x_range: tuple[float, float], y_range: tuple[float, float],
               drive: str) -> Mask:
        """Return a drive's samples in a region of the scatter of y over x, see `quantities`."""
        d, = self._indices([drive])
        x_values, y_values = (quantity(self.what_if, self.shown, name, d) for name in (x, y))
        return region_mask(x_values, y_values, x_range, y_range, self.data, d)

    def shares(self, mask: Mask) -> list[Share]:
        """Return what each unticked effect explains of the error in a mask, less its price."""
        return shares_in(mask, self.what_if, self.shown)

    def _indices(self, drives: Sequence[str] | None) -> list[int]:
        for name in drives or ():
            if name not in self.drives:
                raise SessionError(f'unknown drive {name!r}, must be one of '
                                   f'{", ".join(self.drives)}')
        return [d for d, name in enumerate(self.drives) if drives is None or name in drives]

    # In the background

    def diagnose(self) -> Job[Diagnosis]:
        """Begin to look for what the recordings call for; it tells the noise, too."""
        what_if = self.what_if

        def work(report: Callable[[float], None]) -> Diagnosis:
            found: Diagnosis = run_apart(diagnosed, original(what_if.model), what_if.recordings,
                                         report=report)
            with self._lock:
                if what_if is self.what_if:
                    self.diagnosis, self.noise_floors = found, found.noise_floors
            return found
        return self._begin('diagnose', '', work)

    def adopt(self, effect: str, drives: Sequence[str] | None = None, force: bool = False,
              revision: int | None = None) -> Job[Adoption]:
        """Begin the check of `pprs adopt`; the model takes the effect where nothing speaks against.

        Drives that are not given are those of the tick.

        Raises
        ------
        EffectRequestError
            For an effect or a drive that does not exist.
        SessionError
            Where another adoption is under way.
        StaleError
            Where the session is at another revision.
        """
        with self._changing(revision):
            tick = self.shown.ticks.get(effect)
            on = drives or (names_of(tick.best, self.drives) if tick else None)
            request = EffectRequest.of(f'{effect}:{",".join(on)}' if on else effect, self.drives)
            request.require_place(self.model)
            if 'adopt' in self.jobs and self.jobs['adopt'].is_running:
                raise SessionError(f'{self.jobs["adopt"].what} is being adopted, must end first')
            what_if = self.what_if

            def work(report: Callable[[float], None]) -> Adoption:
                return self._adopted(what_if, request, force, report)
            return self._begin('adopt', effect, work)

    def _adopted(self, what_if: WhatIf, request: EffectRequest, force: bool,
                 report: Callable[[float], None]) -> Adoption:
        self._await_diagnosis(report)
        answer: Adoption = run_apart(
            judged, what_if.model, request, what_if.recordings, list(self.validation.values()),
            force, self.diagnosis, report=lambda share: report(0.9 * share))
        if answer.adopted:
            book = LedgerBook(self._entries(self.recordings), self._entries(self.validation))
            after = WhatIf(book.entered(answer), what_if.recordings)
            report(0.95)
            with self._lock:
                if what_if is not self.what_if:
                    raise SessionError('the model was changed while the effect was judged')
                self.diagnosis = None
                self._use(after, {name: tick for name, tick in self.shown.ticks.items()
                                  if name != request.name})
        self.last_adoption = answer
        return answer

    def _entries(self, recordings: Mapping[str, Recording]) -> tuple[RecordingEntry, ...]:
        return tuple(RecordingEntry.of(path, one) if path in self._files
                     else RecordingEntry.of_samples(one) for path, one in recordings.items())

    def _await_diagnosis(self, report: Callable[[float], None]) -> None:
        """Wait for a diagnosis that is under way: an adoption would make it again."""
        job = self.jobs.get('diagnose')
        while job is not None and job.is_running:
            report(0.4 * job.share)
            with suppress(TimeoutError, Cancelled, PprsError):
                job.result(0.1)

    def next_experiment(self, duration: float = 20.0, seed: int = 0) -> Job[DesignedMotion]:
        """Begin to design the motion that would tell what these recordings leave open.

        Raises
        ------
        PprsError
            For a model of another mechanism, or a duration that no design is made for.
        """
        model = self.model
        if not isinstance(model, (DriveModel, ArmModel)):
            raise SessionError(f'no motions are designed for {model.title}')
        check_duration(duration)

        def work(report: Callable[[float], None]) -> DesignedMotion:
            found: DesignedMotion = run_apart(designed, model, self.what_if.recordings, duration,
                                              seed, report=report)
            self.experiment = found
            return found
        return self._begin('experiment', '', work)

    def cancel(self, kind: str) -> None:
        """Call off work in the background: 'adopt', 'diagnose' or 'experiment'."""
        if kind in self.jobs:
            self.jobs[kind].cancel()

    def _begin(self, kind: str, of: str,
               work: Callable[[Callable[[float], None]], Any]) -> Job[Any]:
        self.cancel(kind)
        self.jobs[kind] = Job(kind, of, work, lambda job: self.tell())
        return self.jobs[kind].start()

    def undo(self, revision: int | None = None) -> Step:
        """Take the last step of the ledger back, and return it.

        Raises
        ------
        ModelError
            Where there is none.
        StaleError
            Where the session is at another revision.
        """
        with self._changing(revision):
            values, step = without_last_step(self.model.values)
            model = replace(build_model(values), source=self.model.source)
            self.diagnosis = None
            self._use(WhatIf(model, self.what_if.recordings), self.shown.ticks)
            return step

    # What goes out

    def ticked_model(self) -> ForceModel:
        """Return the model with the ticked effects as they are shown, without a ledger entry.

        Raises
        ------
        SessionError
            Where it is not evaluated yet, or where no model may have these values.
        """
        shown = self.settle()
        while not shown.is_settled:  # somebody ticked in between
            shown = self.settle()
        if not shown.ticks:
            return self.model
        if shown.exact is None:
            raise SessionError(f'no model has these values: {shown.notice}')
        return shown.exact.model

    def export(self, path: str | PathLike[str], with_ticked: bool = False) -> None:
        """Write the model with its ledger, or with what is ticked besides.

        Raises
        ------
        PprsError
            As `ticked_model`; where the file cannot be written, or is the model that was given.
        """
        model = self.ticked_model() if with_ticked else self.model
        write_model(path, model.values, self.base)

    def to_dict(self) -> dict[str, Any]:
        """Return all that one screen shows, but for the curves."""
        with self._lock:
            shown, diagnosis, adoption = self.shown, self.diagnosis, self.last_adoption
            called_for = {one.name for one in diagnosis.effects} if diagnosis else set()
            return {
                'revision': self.revision, 'version': self.version, 'stage': shown.stage,
                'is_settled': shown.is_settled, 'is_approximate': shown.is_approximate,
                'departure': finite(shown.departure), 'notice': shown.notice,
                'drives': list(self.drives), 'noise_is_guess': self.noise_floors is None,
                'errors': {name: one.to_dict() for name, one in self.errors().items()},
                'overall': self.overall().to_dict(), **units_to_dict(self.model),
                'effects': [effect_to_dict(shown, effect, self.model, effect.name in called_for)
                            for effect in self.candidates],
                'verdict': diagnosis.verdict if diagnosis else None,
                'steps': [step.to_dict() for step in self.steps],
                'jobs': {kind: job.to_dict() for kind, job in self.jobs.items()},
                'adoption': adoption.to_dict() if adoption else None,
                'experiment': self.experiment.promise if self.experiment else None,
                'recordings': recordings_to_dict(
                    list(self.recordings.values()), self.what_if, self.now),
                'held_out': [one.name for one in self.validation.values()]}
