# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Start a node, spin it, and end cleanly; a user's mistake is one sentence and status 2."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.node.executor import PromptExecutor, StoppableExecutor, StopSignals
from pprs_dynamics.ros.node.parameters import with_hint


class Finished(Exception):
    """Raised by a node whose work is done."""


def run_node(factory: Callable[[], Node],
             executor_type: type[StoppableExecutor] = PromptExecutor) -> int:
    """Spin one node until SIGINT, SIGTERM or `Finished`.

    A node with a method `finish` gets it called while it can still publish; one with actions needs
    rclpy's own executor.

    Returns
    -------
    int
        Exit status: 0, or 2 for bad parameters.
    """
    signals = StopSignals()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except PprsError as error:
        return _complain(with_hint(error))
    except RuntimeError as error:  # the public base of rclpy's own
        # An unreadable parameter file, or arguments that are none.
        return _complain(' '.join(with_hint(error).split()))
    node = None
    # Two threads answered 44 of 5 000 messages at 1 kHz; one answers all.
    executor = executor_type()
    signals.stop(executor)
    try:
        node = factory()
        executor.add_node(node)
        # These objects are permanent: the garbage collector need not visit a quarter of a
        # million of them in the middle of a control cycle, nor now.
        gc.freeze()
        gc.enable()
        executor.spin()
    except PprsError as error:
        return _complain(with_hint(error))
    except (KeyboardInterrupt, ExternalShutdownException, Finished):
        pass
    finally:
        if node is not None and rclpy.ok():
            getattr(node, 'finish', lambda: None)()
        executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _complain(sentence: str) -> int:
    print(sentence, file=sys.stderr)
    return 2
