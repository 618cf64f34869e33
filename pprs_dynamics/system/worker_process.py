# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A process that computes one call at a time, reports its progress and can be ended at any time.

It is a fresh Python that gets functions and arguments as pickles through a pipe. Scripts and
notebooks therefore need no `if __name__ == '__main__'`, as they would with multiprocessing.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Thread
from time import monotonic
from typing import Any

from pprs_dynamics.errors import PprsError

SHARE, RESULT, ERROR = 'share', 'result', 'error'
LOOK = 0.2  # [s] between reports of progress
START = 'from pprs_dynamics.system.worker_process import main; main()'


class EndedError(PprsError, RuntimeError):
    """Work whose process ended without an answer."""


class WorkerProcess:
    """A process for calls of module functions, until `close`.

    Parameters
    ----------
    niceness : int
        Added to that of this process.

    Attributes
    ----------
    share : float
        Share of the present call that is done, by its progress.
    """

    def __init__(self, niceness: int) -> None:
        self.share = 0.0
        self._pipe, theirs = Pipe()
        # In a group of its own: Ctrl-C in a terminal is for the program that ends this process.
        self._process = subprocess.Popen(
            [sys.executable, '-c', START, str(theirs.fileno())], stdin=subprocess.DEVNULL,
            pass_fds=(theirs.fileno(),), process_group=0)
        theirs.close()
        self._sender: Thread | None = None
        self._send(niceness, list(sys.path))

    def submit(self, work: Callable[..., Any], *arguments: Any) -> None:
        """Begin with work(*arguments, progress=…); `answer` returns its result."""
        self.share = 0.0
        # In a thread: a pipe takes less than a recording, and Python starts slowly.
        self._sender = Thread(target=self._send, args=((work, arguments),), daemon=True)
        self._sender.start()

    def answer(self, timeout: float) -> Any:
        """Return the result of the call.

        Raises
        ------
        TimeoutError
            Where it is not there after a time [s].
        EndedError
            Where the process ended.
        Exception
            Whatever the work raised.
        """
        until, kind = monotonic() + timeout, SHARE
        while kind == SHARE:
            try:
                if not self._pipe.poll(max(until - monotonic(), 0.0)):
                    raise TimeoutError
                kind, value = self._pipe.recv()
            except (EOFError, ConnectionError):
                raise EndedError('the process that worked on it ended with status '
                                 f'{self._process.wait()}') from None
            if kind == SHARE:
                self.share = value
        if kind == ERROR:
            raise value
        return value

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()
        if self._sender is not None:
            self._sender.join()
        self._pipe.close()

    def _send(self, *values: Any) -> None:
        with suppress(OSError):  # it has ended, as `answer` reports
            for value in values:
                self._pipe.send(value)


def run_in_process(work: Callable[..., Any], *arguments: Any, niceness: int,
                   report: Callable[[float], None]) -> Any:
    """Return work(*arguments, progress=…), computed in another process.

    Parameters
    ----------
    work : callable
        Of a module, so that the other process finds it.
    arguments
        That can be pickled.
    niceness : int
        See `WorkerProcess`.
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
    process = WorkerProcess(niceness)
    try:
        process.submit(work, *arguments)
        while True:
            try:
                return process.answer(LOOK)
            except TimeoutError:
                report(process.share)
    finally:
        process.close()


def main() -> None:
    """Answer calls from the pipe that the first argument is the number of, until it is closed."""
    pipe: Any = Connection(int(sys.argv[1]))
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever the work prints
    with suppress(OSError):
        os.nice(pipe.recv())
    sys.path[:] = pipe.recv()
    with suppress(EOFError, ConnectionError):  # nobody is there any more
        while True:
            work, arguments = pipe.recv()
            try:
                answer = RESULT, work(*arguments, progress=lambda share: pipe.send((SHARE, share)))
            except ConnectionError:
                return
            except Exception as error:
                answer = ERROR, _carried(error)
            pipe.send(answer)


def _carried(error: Exception) -> Exception:
    """Return an error that can be sent: itself, or its sentence."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EndedError(str(error)) if isinstance(error, PprsError) else RuntimeError(
            f'{type(error).__name__}: {error}')
    return error
