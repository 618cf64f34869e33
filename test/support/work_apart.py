# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Work for other processes, in a module that they import at once."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from pprs_dynamics.errors import PprsError


def sleep(seconds: float, progress: Any) -> str:
    for _ in range(int(100 * seconds)):
        progress(0.5)
        time.sleep(0.01)
    return 'slept'


def fail(progress: Any) -> None:
    raise PprsError('the value is 1, must be 2')


def end(progress: Any) -> None:
    os._exit(3)


def work(item: str) -> str:
    if item == 'kills':
        os.kill(os.getpid(), signal.SIGKILL)
    return item
