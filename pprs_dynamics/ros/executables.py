# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Entry points of the nodes: usage, and one sentence where ROS 2 itself is missing."""

from __future__ import annotations

import argparse
import gc
import importlib
import importlib.util
import itertools
import signal
import sys
from functools import partial

from pprs_dynamics.errors import PprsError
from pprs_dynamics.system.bounded_yaml import parse, read_text
from pprs_dynamics.system.threads import use_one_thread

# [s] A message asks for the interpreter some five times: with Python's 5 ms each, messages at
# 200 Hz pile up behind the compiler.
SWITCH_INTERVAL = 0.0002


def trajectory_proxy() -> int:
    """Run `ros2 run pprs_dynamics trajectory_proxy`."""
    if importlib.util.find_spec('control_msgs') is None:
        print('trajectory_proxy needs control_msgs: apt install ros-$ROS_DISTRO-control-msgs',
              file=sys.stderr)
        return 2
    return _run('trajectory_proxy', 'TrajectoryProxyNode', has_actions=True)


def _run(module: str, node: str, has_actions: bool = False) -> int:
    _check_arguments(module, sys.argv[1:])
    use_one_thread()
    sys.setswitchinterval(SWITCH_INTERVAL)
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
    from pprs_dynamics.ros.node.executor import PromptExecutor, StoppableExecutor
    from pprs_dynamics.ros.node.preparation import end_if_preparing
    from pprs_dynamics.ros.run_node import run_node

    status = run_node(getattr(importlib.import_module(f'pprs_dynamics.ros.{module}'), node),
                      executor_type=StoppableExecutor if has_actions else PromptExecutor)
    end_if_preparing(status)
    return status


def _check_arguments(name: str, arguments: list[str]) -> None:
    """Exit for --help, for arguments outside of --ros-args, and for unreadable files.

    ROS 2 passes over what stands outside of --ros-args: a model given there would not be used.
    """
    parser = argparse.ArgumentParser(
        name, f'{name} [--ros-args [--params-file FILE] [-p NAME:=VALUE] [-r FROM:=TO] ...]',
        add_help=False, allow_abbrev=False,
        description='A ROS 2 node. Files, parameters and remappings follow --ros-args.',
        epilog=f'docs/nodes.md lists topics and parameters; `ros2 param describe /{name} '
               'PARAMETER` explains one while the node runs.')
    parser.add_argument('-h', '--help', action='help', help='show this and exit')
    _, stray = parser.parse_known_args(_outside_ros_args(arguments))
    if stray:
        parser.error(f'{stray[0]} is outside of --ros-args, where it has no effect')
    for option, file in itertools.pairwise(arguments):
        if option == '--params-file':
            try:
                parse(read_text(file), file)
            except PprsError as error:  # where ROS 2 would name lines of its own source
                parser.exit(2, f'{name}: {error}\n')


def _outside_ros_args(arguments: list[str]) -> list[str]:
    """Return the arguments outside of --ros-args ... --."""
    outside, inside = [], False
    for argument in arguments:
        if argument == ('--' if inside else '--ros-args'):
            inside = not inside
        elif not inside:
            outside.append(argument)
    return outside


# Entry points of setup.py.
feedforward = partial(_run, 'feedforward', 'FeedforwardNode')
monitor = partial(_run, 'monitor', 'MonitorNode')
play_trajectory = partial(_run, 'play_trajectory', 'PlayTrajectoryNode')
simulated_robot = partial(_run, 'simulated_robot', 'SimulatedRobotNode')
