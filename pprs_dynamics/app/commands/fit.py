# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs fit: the base model that recordings of free motion call for."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import MODEL, add_details, add_report, output_file
from pprs_dynamics.app.commands.output import tell
from pprs_dynamics.app.commands.recordings import add_recordings, add_validation, read_inputs
from pprs_dynamics.app.front_door.fit import fit
from pprs_dynamics.app.report.progress import staged_bar
from pprs_dynamics.app.report.terminal import console, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)
    add_validation(parser)
    parser.add_argument('--output', metavar='FILE.yaml', type=output_file(*MODEL), required=True,
                        help='model file that is written')
    add_report(parser)
    add_details(parser, 'print every fitted number')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    inputs = read_inputs(options, screen)
    with staged_bar(screen) as progress:
        result = fit(inputs.model, inputs, progress=progress)
    result.save(options.output)
    tell(result, options, screen)
    screen.print(f'model: {shown(options.output)}')
    return 0
