# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs workbench`: try effects on recordings in the browser.

Serves one page on this machine; its first line on stdout is the address with a token.
"""

from __future__ import annotations

import argparse
import re
from typing import Any

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.commands.arguments import UsageError, add_shared, whole
from pprs_dynamics.app.workbench.server.hub import Hub, Offered, is_folder
from pprs_dynamics.app.workbench.server.serve import serve
from pprs_dynamics.errors import optional_library
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.plain_text import displayed

HOST = '127.0.0.1'
ANY = ('', '0.0.0.0', '::', '*')
ROS_NAME = re.compile(r'/|/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')

EXAMPLE = 'pprs workbench run.mcap --validate other.mcap'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='*',
                        help='bag or table, as for all commands; or a folder of them, to choose '
                        'from in the browser')
    add_shared(parser, 'validate', 'reference', 'topic', validate='a recording that is not fitted: '
               'adoptions are judged on it; may be repeated')
    parser.add_argument('--live', action='store_true',
                        help='subscribe to joint_states, and set effects on running nodes')
    parser.add_argument('--live-topic', metavar='NAME', type=_ros_name,
                        help='topic of --live (default: that of --topic, else joint_states)')
    parser.add_argument('--port', type=whole(0, 65535), default=0,
                        help='port of the server (default: any free one)')
    parser.add_argument('--host', type=_one_address, default=HOST,
                        help=f'address of the server (default {HOST}: this machine only)')
    parser.add_argument('--no-browser', action='store_true', help='open no browser')
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[], metavar='ARGUMENT',
                        help='arguments of the node of --live, as of any ROS 2 node: namespace (-r '
                        '__ns:=/NAME), remappings, joint_prefix, use_sim_time, QoS; must come last')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    given = [path for path in options.recordings if not is_folder(path)]
    # What cannot be read ends the command; measuring takes longer, and goes on behind the page.
    inputs = Inputs.read(
        options.model, given, options.validate, options.topic).since(options.reference)
    live = _live(options, inputs.model) if options.live else None
    serve(Hub(inputs, Offered.of(options.recordings), live), options.host, options.port,
          not options.no_browser)
    return 0


def _one_address(text: str) -> str:
    """Read an address that browsers can call: requests must name it."""
    if text in ANY:
        raise argparse.ArgumentTypeError(f'{text!r} must be the one address or name by which '
                                         'browsers will call this machine')
    return text


def _ros_name(text: str) -> str:
    """Read the name of a node or a namespace, absolute or not."""
    if not ROS_NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f'{displayed(text)!r} must be a name of ROS 2: letters, '
                                         'digits and _ between /')
    return text


def _live(options: argparse.Namespace, model: DriveModel) -> Any:
    live = optional_library('pprs_dynamics.ros.live_joint_states', 'rclpy', 'live data', 'ros')
    try:
        return live.LiveNodes(model, options.live_topic or options.topic or 'joint_states',
                              arguments=['--ros-args', *options.ros_args])
    except RuntimeError as error:  # the public base of rclpy's own
        raise UsageError(f'--ros-args: {" ".join(str(error).split())}') from None
