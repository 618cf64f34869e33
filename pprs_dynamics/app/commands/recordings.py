# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""RECORDING arguments of commands: declared and read in one way."""

from __future__ import annotations

import argparse
from typing import Any

from pprs_dynamics.app.commands.arguments import add_topic
from pprs_dynamics.app.front_door.inputs import Inputs
from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.terminal import shown


def add_recordings(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Declare RECORDING… and --topic."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='+' if required else '*',
                        help='rosbag2 folder, .mcap, .db3, .csv or .csv.gz')
    add_topic(parser)


def add_validation(parser: argparse.ArgumentParser,
                   what: str = 'held-out errors are taken on it') -> None:
    """Declare --validate."""
    parser.add_argument('--validate', metavar='RECORDING', action='append', default=[],
                        help=f'a recording that is never fitted: {what}; may be repeated')


def read_inputs(options: argparse.Namespace, screen: Any) -> Inputs:
    """Read model and recordings of the arguments, and print what is wrong with the latter.

    Raises
    ------
    PprsError
        As `Inputs.of`.
    """
    with staged_bar(screen) as progress:
        inputs = Inputs.of(options.model, options.recordings, getattr(options, 'validate', ()),
                           options.topic, progress)
    for recording in (*inputs.fitted, *inputs.held_out):
        for finding in recording.findings:
            screen.print(f'[yellow]![/] {shown(recording.name)}: {shown(finding.text)}')
    return inputs
