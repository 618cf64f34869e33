# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Worker process for long work, with progress and cancellation.

The process is a fresh Python that gets function and arguments as a pickle on its standard input,
so that scripts and notebooks need no `if __name__ == '__main__'`.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from threading import Thread
from typing import Any, BinaryIO

from pprs_dynamics.errors import PprsError

SHARE, RESULT, ERROR = 'share', 'result', 'error'
PATIENCE = 0.2  # [s] between looks whether the work was called off
START = 'from pprs_dynamics.app.workbench.worker_process import main; main()'
NICENESS = 2  # whoever clicks comes first


class EndedError(PprsError, RuntimeError):
    """Work whose process ended without an answer."""


def run_in_process(work: Callable[..., Any], *arguments: Any,
                   report: Callable[[float], None]) -> Any:
    """Return work(*arguments, progress), computed in another process.

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
    with subprocess.Popen([sys.executable, '-c', START], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as process:
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
        answers.write(pickle.dumps((kind, value), pickle.HIGHEST_PROTOCOL))
        answers.flush()
    try:
        sys.path[:] = pickle.load(sys.stdin.buffer)
        work, arguments = pickle.load(sys.stdin.buffer)
        result = work(*arguments, lambda share: send(SHARE, share))
        content = pickle.dumps((RESULT, result), pickle.HIGHEST_PROTOCOL)
    except BrokenPipeError:
        return  # nobody waits any more
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
