# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Entry points of the nodes; they tell in one sentence where ROS 2 itself is missing."""

from __future__ import annotations

import gc
import importlib
import signal
import sys

from pprs_dynamics.system.threads import use_one_thread


def feedforward() -> int:
    """Run `ros2 run pprs_dynamics feedforward`."""
    return _run('feedforward', 'FeedforwardNode')


def monitor() -> int:
    """Run `ros2 run pprs_dynamics monitor`."""
    return _run('monitor', 'MonitorNode')


def play_trajectory() -> int:
    """Run `ros2 run pprs_dynamics play_trajectory`."""
    return _run('play_trajectory', 'PlayTrajectoryNode')


def simulated_robot() -> int:
    """Run `ros2 run pprs_dynamics simulated_robot`."""
    return _run('simulated_robot', 'SimulatedRobotNode')


def _run(module: str, node: str) -> int:
    use_one_thread()
    # Libraries make objects that stay, which looking for garbage among them only delays.
    gc.disable()
    # From here on a signal waits until the node can end properly, also while libraries load.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        import rclpy  # noqa: F401
    except ImportError:
        print(f'{module} needs ROS 2: source an installation (Jazzy or Kilted), or '
              "pip install 'pprs_dynamics[ros]'", file=sys.stderr)
        return 2
    from pprs_dynamics.ros.run import run_node

    return run_node(getattr(importlib.import_module(f'pprs_dynamics.ros.{module}'), node))
