# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs compare: model against measurement, and where it fails."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import PAGE, add_details, output_file
from pprs_dynamics.app.commands.output import tell
from pprs_dynamics.app.commands.recordings import add_recordings, read_inputs
from pprs_dynamics.app.front_door.compare import compare
from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.terminal import console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    add_details(parser)
    parser.add_argument('--report', metavar='FILE.html', type=output_file(*PAGE),
                        help='write a page with all figures')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    inputs = read_inputs(options, screen)
    with staged_bar(screen) as progress:
        result = compare(inputs.model, inputs, progress=progress)
    tell(result, options, screen)
    return 0
