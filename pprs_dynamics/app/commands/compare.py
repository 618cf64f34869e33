# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs compare`: show where model and measurement differ."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.api.compare import compare
from pprs_dynamics.app.commands.arguments import add_shared, answer, output_file, show
from pprs_dynamics.app.report.terminal import shown, staged_bar

EXAMPLE = 'pprs compare run.mcap --model robot.yaml --report page.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'as-it-is', 'report')
    parser.add_argument('--mcap', metavar='FILE.mcap', type=output_file('.mcap'),
                        help='bag to write: measured effort, effort of the model, its parts and '
                        'the residual, as sensor_msgs/JointState')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen, result = answer(compare, options, whole=True, topic=options.topic)
    show(result, options, screen)
    if options.mcap:
        with staged_bar(screen) as progress:
            result.write_bag(options.mcap, progress)
        screen.print(f'bag: {shown(options.mcap)}', soft_wrap=True)
    return 0
