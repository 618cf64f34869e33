# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Long work in the background: a thread that shows its progress, and a process that computes.

Both can be called off. The process is a fresh Python that gets function and arguments as a pickle
on its standard input, so that scripts and notebooks need no `if __name__ == '__main__'`.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future, wait
from itertools import count
from threading import Event, Thread
from typing import Any, BinaryIO, Generic, TypeVar

from pprs_dynamics.errors import PprsError

Result = TypeVar('Result')
NUMBERS = count(1)  # each job has one of its own
SHARE, RESULT, ERROR = 'share', 'result', 'error'
PATIENCE = 0.2  # [s] between looks whether the work was called off
START = 'from pprs_dynamics.app.workbench.background import main; main()'
NICENESS = 2  # whoever clicks comes first


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


class EndedError(PprsError, RuntimeError):
    """Work whose process ended without an answer."""


def run_in_process(work: Callable[..., Any], *arguments: Any,
                   report: Callable[[float], None]) -> Any:
    """Return work(*arguments, progress=…), computed in another process.

    Parameters
    ----------
    work : callable
        Of a module, so that the other process finds it.
    arguments
        That can be pickled.
    report : callable
        Called with the share that is done, and often enough besides; what it raises ends the
        process.

    Raises
    ------
    EndedError
        Where the process ended by itself.
    Exception
        Whatever the work raised.
    """
    # In a group of its own: Ctrl-C in a terminal is for the command, which calls the work off.
    with subprocess.Popen([sys.executable, '-c', START], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, process_group=0) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        share, answers = 0.0, []

        def read(stream: BinaryIO) -> None:
            nonlocal share
            while True:
                try:
                    kind, value = pickle.load(stream)
                except (EOFError, OSError, pickle.UnpicklingError):
                    return
                if kind == SHARE:
                    share = value
                else:
                    answers.append((kind, value))
        reader = Thread(target=read, args=(process.stdout,), daemon=True)
        reader.start()
        try:
            # First where modules are found, then what is of them.
            pickle.dump(list(sys.path), process.stdin)
            pickle.dump((work, arguments), process.stdin)
            process.stdin.flush()
            while reader.is_alive():
                reader.join(PATIENCE)
                report(share)
        except BrokenPipeError:
            pass  # it ended; what it said is read below
        except BaseException:
            process.kill()
            raise
        finally:
            reader.join()  # before the pipe that it reads from is closed
    if not answers:
        raise EndedError(f'the process that worked on it ended with status {process.returncode}')
    kind, value = answers[0]
    if kind == ERROR:
        raise value
    return value


def main() -> None:
    """Do what stands on the standard input, and answer on the standard output."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), 'wb')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever the work prints
    os.nice(NICENESS)

    def send(kind: str, value: Any) -> None:
        try:
            answers.write(pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL))
            answers.flush()
        except BrokenPipeError:
            os._exit(1)  # the workbench has ended: nobody reads the answer or an error
    try:
        sys.path[:] = pickle.load(sys.stdin.buffer)
        work, arguments = pickle.load(sys.stdin.buffer)
        result = work(*arguments, progress=lambda share: send(SHARE, share))
        content = pickle.dumps((RESULT, result), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        send(ERROR, _carried(error))
        return
    answers.write(content)
    answers.flush()


def _carried(error: Exception) -> Exception:
    """Return an error that can be sent: itself, or its sentence."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EndedError(str(error)) if isinstance(error, PprsError) else RuntimeError(
            f'{type(error).__name__}: {error}')
    return error
