# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs trend`: show what changed on which robot, and when."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import add_shared
from pprs_dynamics.app.commands.input_output import write_json
from pprs_dynamics.app.fleet.trend import fleet_trends
from pprs_dynamics.app.report.terminal import console, shown

EXAMPLE = 'pprs trend store --report trend.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('store', metavar='STORE', help='folder that pprs survey wrote')
    add_shared(parser, 'report', report='write a page with every quantity that changed')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    fleet = fleet_trends(options.store)
    for text in fleet.sentences():
        screen.print(shown(text))
    if options.json:
        write_json(options.json, fleet.to_dict())
    if options.report:
        from pprs_dynamics.app.report.fleet_page import fleet_page

        screen.print(f'page: {shown(fleet_page(fleet).write(options.report))}', soft_wrap=True)
    return 0
