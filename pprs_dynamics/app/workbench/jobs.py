# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Background work of a session: diagnosis, adoption, and the design of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import count
from threading import Thread
from typing import Any, Generic, TypeVar

from pprs_dynamics.app.api.next_experiment import ExperimentResult, next_experiment
from pprs_dynamics.app.workbench.tick_fits import TickFits
from pprs_dynamics.app.workbench.ticks import SessionError, Ticks
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.adopt import adopt, original
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.experiments.next_experiment import check_duration
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.worker_process import run_in_process as run

Result = TypeVar('Result')
NUMBERS = count(1)  # each job has one of its own


class Cancelled(Exception):
    """A cancelled job. Not a `PprsError`: nothing may take it for bad input."""


class Job(Generic[Result]):
    """One piece of work in a thread of its own.

    Parameters
    ----------
    kind, what : str
        'adopt', 'diagnose' or 'experiment'; and of what.
    work : callable
        Called with a function that it must call with the share that is done; this raises
        `Cancelled` after `cancel`.
    changed : callable, optional
        Called when the progress changes, and at the end.
    """

    def __init__(self, kind: str, what: str, work: Callable[[Callable[[float], None]], Result],
                 changed: Callable[[], None] = lambda: None) -> None:
        self.kind, self.what, self.share, self.number = kind, what, 0.0, next(NUMBERS)
        self._work, self._changed, self._is_called_off = work, changed, False
        self._future: Future[Result] = Future()

    def start(self) -> Job[Result]:
        """Begin, and return the job."""
        Thread(target=self._run, name=f'{self.kind} {self.what}', daemon=True).start()
        return self

    @property
    def is_running(self) -> bool:
        """True until it has ended, however."""
        return not self._future.done()

    def cancel(self) -> None:
        """Call it off; it ends at its next report of progress."""
        self._is_called_off = True

    def result(self, timeout: float | None = None) -> Result:
        """Wait for the end and return the result.

        Raises
        ------
        Cancelled
            Where it was called off.
        TimeoutError
            Where it takes longer [s].
        PprsError
            As the work.
        """
        return self._future.result(timeout)

    def to_dict(self) -> dict[str, Any]:
        """Return kind, progress and error, for JSON."""
        error = None if self.is_running else self._future.exception()
        is_cancelled = isinstance(error, Cancelled)  # work that was done by then counts
        return {'number': self.number, 'kind': self.kind, 'what': self.what,
                'share': round(self.share, 3), 'is_running': self.is_running,
                'is_cancelled': is_cancelled,
                'error': '' if error is None or is_cancelled else
                str(error) if isinstance(error, PprsError) else f'{type(error).__name__}: {error}'}

    def _report(self, share: float) -> None:
        if self._is_called_off:
            raise Cancelled(self.what)
        # A bar never goes back.
        if share > self.share + 0.01:
            self.share = min(share, 1.0)
            self._changed()

    def _run(self) -> None:
        try:
            self._report(0.0)
            self._future.set_result(self._work(self._report))
        except BaseException as error:  # raised again by `result`
            self._future.set_exception(error)
        self._changed()


run_in_process = partial(run, niceness=2)  # answers to the page have priority
Progress = Callable[[float], None]


class Jobs:
    """Runs work of seconds to minutes in processes of its own, one job of each kind at a time.

    Attributes
    ----------
    of_kind : dict of str to Job
        The last 'diagnose', 'adopt' and 'experiment'.
    adoption : Adoption or None
    experiment : ExperimentResult or None
        The last results.
    """

    def __init__(self, ticks: Ticks) -> None:
        self._ticks = ticks
        self._diagnosis: tuple[TickFits, Diagnosis] | None = None
        self.adoption: Adoption | None = None
        self.experiment: ExperimentResult | None = None
        self.of_kind: dict[str, Job[Any]] = {}

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis of the present model on the present recordings; None before it."""
        return (self._diagnosis[1] if self._diagnosis and self._diagnosis[0] is self._ticks.fits
                else None)

    @property
    def noise(self) -> dict[str, float]:
        """Noise of every drive, rms [N], by the diagnosis; empty before it."""
        return dict(self.diagnosis.noise_floors) if self.diagnosis else {}

    def diagnose(self) -> Job[Diagnosis]:
        """Start the diagnosis, which also estimates the noise."""
        fits, inputs = self._ticks.fits, self._ticks.inputs

        def work(report: Progress) -> Diagnosis:
            found: Diagnosis = run_in_process(_diagnosed, original(fits.model), fits.recordings,
                                              inputs.reference, report=report)
            self._diagnosis = fits, found
            return found
        return self._begin('diagnose', '', work)

    def adopt(self, effect: str, force: bool = False, revision: int | None = None) -> Job[Adoption]:
        """Start the check of `pprs adopt`; the model takes the effect unless it is refused.

        A ticked effect is adopted on the drives of its tick.

        Raises
        ------
        EffectRequestError
            For an effect that does not exist.
        SessionError
            Where another adoption is running.
        StaleError
            Where the session is at another revision.
        """
        ticks = self._ticks
        with ticks.steady():
            ticks.require(revision)
            tick, fits = ticks.view.ticks.get(effect), ticks.fits
            request = EffectRequest.named(
                effect, fits.design.named(tick.best.drives) if tick else None, ticks.model)
            last = self.of_kind.get('adopt')
            if last is not None and last.is_running:
                raise SessionError(f'{last.what} is being adopted, must end first')
            return self._begin('adopt', effect, partial(self._adopted, fits, request, force))

    def _adopted(self, fits: TickFits, request: EffectRequest, force: bool, report: Progress,
                 ) -> Adoption:
        self._await_diagnosis(report)
        ticks, inputs = self._ticks, self._ticks.inputs
        answer: Adoption = run_in_process(
            partial(adopt, diagnosis=self.diagnosis, reference=inputs.reference), fits.model,
            request, fits.recordings, inputs.held_out, force,
            report=lambda share: report(0.9 * share))
        if answer.adopted:
            after = ticks.fits_of(inputs.ledger.entered(answer), inputs)
            report(0.95)
            with ticks.changing(None, f'{request.name} adopted'):
                if fits is not ticks.fits:
                    raise SessionError('the model was changed while the effect was judged')
                ticks.use(after, {name: tick for name, tick in ticks.view.ticks.items()
                                  if name != request.name})
        self.adoption = answer
        return answer

    def _await_diagnosis(self, report: Progress) -> None:
        """Wait for a running diagnosis, which the adoption would make again."""
        job = self.of_kind.get('diagnose')
        while job is not None and job.is_running:
            report(0.4 * job.share)
            with suppress(TimeoutError, Cancelled, PprsError):
                job.result(0.1)

    def next_experiment(self, duration: float = 20.0) -> Job[ExperimentResult]:
        """Start the design of the motion that best separates the remaining candidates.

        Raises
        ------
        PprsError
            For a duration that no design is made for.
        """
        check_duration(duration)
        fits = self._ticks.fits

        def work(report: Progress) -> ExperimentResult:
            found: ExperimentResult = run_in_process(
                _designed, fits.model, fits.recordings, duration, report=report)
            self.experiment = found
            return found
        return self._begin('experiment', '', work)

    def cancel(self, kind: str) -> None:
        """Cancel the job of a kind, if there is any."""
        if kind in self.of_kind:
            self.of_kind[kind].cancel()

    def _begin(self, kind: str, of: str, work: Callable[[Progress], Any]) -> Job[Any]:
        with self._ticks.steady():
            self.cancel(kind)
            job = self.of_kind[kind] = Job(kind, of, work, self._ticks.notify)
        return job.start()


def _diagnosed(model: DriveModel, recordings: Sequence[Recording], reference: Reference | None,
               progress: Progress) -> Diagnosis:
    """Return a diagnosis without its searches, which are large."""
    return replace(diagnose(model, recordings, (), progress, reference=reference), selection=None)


def _designed(model: DriveModel, recordings: Sequence[Recording], duration: float,
              progress: Progress) -> ExperimentResult:
    return next_experiment(model, recordings, duration=duration,
                           progress=lambda _, share: progress(share))
