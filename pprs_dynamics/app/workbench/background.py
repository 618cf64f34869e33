# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Long work in the background: a thread that shows its progress and can be cancelled."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, wait
from itertools import count
from threading import Event, Thread
from typing import Any, Generic, TypeVar

from pprs_dynamics.errors import PprsError

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
        `Cancelled` once the job is called off.
    ended : callable, optional
        Called with the job when its progress changes, and at its end.
    """

    def __init__(self, kind: str, what: str, work: Callable[[Callable[[float], None]], Result],
                 changed: Callable[[Job[Any]], None] | None = None) -> None:
        self.kind, self.what, self.share = kind, what, 0.0
        self.number = next(NUMBERS)
        self._future: Future[Result] = Future()
        self._work, self._changed = work, changed or (lambda job: None)
        self._cancel = Event()
        self._thread = Thread(target=self._run, name=f'{kind} {what}', daemon=True)

    def start(self) -> Job[Result]:
        """Begin, and return the job."""
        self._thread.start()
        return self

    @property
    def is_running(self) -> bool:
        """True until it has ended, however."""
        return not self._future.done()

    @property
    def error(self) -> BaseException | None:
        """What it ended with, if that was no result."""
        return None if self.is_running else self._future.exception()

    @property
    def is_cancelled(self) -> bool:
        """True where it ended because it was called off; work that was done by then counts."""
        return isinstance(self.error, Cancelled)

    def cancel(self) -> None:
        """Call it off; it ends at its next report of progress."""
        self._cancel.set()

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
        if not wait([self._future], timeout).done:
            raise TimeoutError(f'{self.kind} {self.what} has not ended after {timeout:g} s')
        return self._future.result()

    def to_dict(self) -> dict[str, Any]:
        """Return how it stands."""
        error = self.error
        return {'number': self.number, 'kind': self.kind, 'what': self.what,
                'share': round(self.share, 3), 'is_running': self.is_running,
                'is_cancelled': self.is_cancelled,
                'error': str(error) if isinstance(error, PprsError) else
                '' if error is None or isinstance(error, Cancelled) else
                f'{type(error).__name__}: {error}'}

    def _report(self, share: float) -> None:
        if self._cancel.is_set():
            raise Cancelled(self.what)
        # A bar never goes back.
        if share > self.share + 0.01:
            self.share = min(share, 1.0)
            self._changed(self)

    def _run(self) -> None:
        try:
            self._report(0.0)
            self._future.set_result(self._work(self._report))
        except BaseException as error:  # raised again by `result`
            self._future.set_exception(error)
        self._changed(self)
