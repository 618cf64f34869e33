"""Start a node, spin it, and end cleanly; a user's mistake is one sentence and status 2."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from pprs_dynamics.errors import PprsError


class Finished(Exception):
    """Raised by a node whose work is done."""


def run_node(factory: Callable[[], Node], args: list[str] | None = None) -> int:
    """Spin one node until SIGINT, SIGTERM or `Finished`.

    Returns
    -------
    int
        Exit status: 0, or 2 for bad parameters.
    """
    try:
        rclpy.init(args=args)
    except Exception as error:
        # rcl reports an unreadable parameter file with a generic error of its extension module.
        return _complain(' '.join(str(error).split()))
    try:
        node = factory()
    except PprsError as error:
        rclpy.try_shutdown()
        return _complain(str(error))
    # Two threads answered 44 of 5 000 messages at 1 kHz; one answers all.
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException, Finished):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _complain(sentence: str) -> int:
    print(sentence, file=sys.stderr)
    return 2
