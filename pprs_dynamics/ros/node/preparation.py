# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Compiling the equations while the node answers already, by uncompiled ones."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from typing import Any

from rclpy.node import Node

from pprs_dynamics.physics.mechanism.evaluation import compiling_here
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.preparation import prepare

NAME = 'preparation'


def prepare_beside(node: Node, model: DriveModel) -> threading.Thread:
    """Start loading or compiling what a model needs in a thread of its own.

    Compiled kernels load in a second. The first time after an installation they are compiled,
    which takes 15 s and more on a busy machine; a sample takes 0.3 ms meanwhile instead of 10 us,
    of a hexapod 6 ms.

    Returns
    -------
    Thread
        Alive while it lasts.
    """
    # Made anew there: buffers of a model serve one thread at a time.
    thread = threading.Thread(target=_prepare, args=(node.get_logger(), model), name=NAME,
                              daemon=True)
    thread.start()
    return thread


def end_if_preparing(status: int) -> None:
    """End the process at once, with an exit status, if equations are still being compiled.

    Nothing stops a compiler, and Python's own end walks through registries that it goes on
    filling: some ends then came with a traceback ("dictionary changed size during iteration").
    """
    if any(thread.name == NAME for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _prepare(logger: Any, model: DriveModel) -> None:
    began = time.monotonic()
    with compiling_here():
        prepare(type(model).from_parameters(dict(model.values), model.source))
    if gc.get_freeze_count():  # else it is for the program that runs this node
        gc.freeze()  # no walk through Numba's objects in the middle of a control cycle
    logger.info(f'equations are compiled, after {time.monotonic() - began:.1f} s')
