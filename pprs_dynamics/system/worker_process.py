# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A process that computes one call at a time, reports its progress and can be ended at any time.

It is a fresh Python that gets functions and arguments as pickles on its standard input. Scripts and
notebooks therefore need no `if __name__ == '__main__'`, as they would with multiprocessing.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, Queue
from threading import Thread
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
        self._answers: Queue[tuple[str, Any]] = Queue()
        # In a group of its own: Ctrl-C in a terminal is for the program that ends this process.
        self._process = subprocess.Popen(
            [sys.executable, '-c', START], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            process_group=0)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()
        self._sender: Thread | None = None
        self._write(niceness, list(sys.path))

    def submit(self, work: Callable[..., Any], *arguments: Any) -> None:
        """Begin with work(*arguments, progress=…); `answer` returns its result."""
        self.share = 0.0
        # In a thread: a pipe takes less than a recording, and Python starts slowly.
        self._sender = Thread(target=self._write, args=((work, arguments),), daemon=True)
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
        try:
            kind, value = self._answers.get(timeout=timeout)
        except Empty:
            raise TimeoutError from None
        if kind == ERROR:
            raise value
        return value

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()
        self._reader.join()  # before the pipe that it reads from is closed
        if self._sender is not None:
            self._sender.join()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()  # type: ignore[union-attr]

    def _write(self, *values: Any) -> None:
        with suppress(OSError):  # it has ended, as `answer` reports
            for value in values:
                pickle.dump(value, self._process.stdin)  # type: ignore[arg-type]
            self._process.stdin.flush()  # type: ignore[union-attr]

    def _read(self) -> None:
        with suppress(EOFError, OSError, pickle.UnpicklingError):
            while True:
                kind, value = pickle.load(self._process.stdout)  # type: ignore[arg-type]
                if kind == SHARE:
                    self.share = value
                else:
                    self._answers.put((kind, value))
        self._answers.put((ERROR, EndedError(
            f'the process that worked on it ended with status {self._process.wait()}')))


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
    """Answer calls on the standard input with results on the standard output, until it ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), 'wb')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever the work prints

    def send(kind: str, value: Any) -> None:
        content = pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL)
        try:
            answers.write(content)
            answers.flush()
        except BrokenPipeError:
            os._exit(1)  # nobody is there any more to read it

    calls = sys.stdin.buffer
    with suppress(OSError):
        os.nice(pickle.load(calls))
    sys.path[:] = pickle.load(calls)
    while True:
        try:
            work, arguments = pickle.load(calls)
        except EOFError:
            return
        try:
            send(RESULT, work(*arguments, progress=lambda share: send(SHARE, share)))
        except Exception as error:
            send(ERROR, _carried(error))


def _carried(error: Exception) -> Exception:
    """Return an error that can be sent: itself, or its sentence."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EndedError(str(error)) if isinstance(error, PprsError) else RuntimeError(
            f'{type(error).__name__}: {error}')
    return error
