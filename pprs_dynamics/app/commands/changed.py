# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs changed: which effects and numbers changed between two recordings, and how sure that is."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.api.changed import changed
from pprs_dynamics.app.commands import arguments
from pprs_dynamics.app.commands.input_output import tell
from pprs_dynamics.app.report.terminal import console, staged_bar

EXAMPLE = 'pprs changed monday.mcap friday.mcap --model base.yaml --report changed.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('before', metavar='BEFORE', help='recording of before, e.g. of a repair')
    parser.add_argument('after', metavar='AFTER', help='recording of after, of a like motion')
    arguments.add_topic(parser)
    arguments.add_details(parser)
    arguments.add_report(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    with staged_bar(screen) as progress:
        result = changed(options.model, options.before, options.after, topic=options.topic,
                         progress=progress)
    tell(result, options, screen)
    return 0
