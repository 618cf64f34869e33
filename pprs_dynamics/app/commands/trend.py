# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs trend: what changes in a fleet, since when, and when it reaches a limit."""

from __future__ import annotations

import argparse
import math

from pprs_dynamics.app.commands.arguments import UsageError, add_report
from pprs_dynamics.app.commands.input_output import write_json
from pprs_dynamics.app.fleet.store import Store
from pprs_dynamics.app.fleet.trend import fleet_trends
from pprs_dynamics.app.fleet.trend_sentences import sentences, to_dict
from pprs_dynamics.app.report.fleet_page import fleet_page
from pprs_dynamics.app.report.terminal import console, shown
from pprs_dynamics.system.numbers import parse_number


def _limit(text: str) -> tuple[str, float]:
    name, _, number = text.partition('=')
    try:
        value = parse_number(number)
    except ValueError:
        value = math.nan
    if not name or not math.isfinite(value):
        raise argparse.ArgumentTypeError(
            f'{text!r} must be QUANTITY=NUMBER, such as coulomb_friction.force=2.0')
    return name, value


EXAMPLE = 'pprs trend store --report trend.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('store', metavar='STORE', help='folder that pprs survey wrote')
    add_report(parser, 'write a page: a map of the fleet, and every trend')
    parser.add_argument('--limit', metavar='QUANTITY=NUMBER', type=_limit, action='append',
                        default=[], help='tell when a slope reaches it; may be repeated')
    parser.add_argument('--beside', metavar='COLUMN',
                        help='column of the manifest to be drawn beside every trend')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    fleet = fleet_trends(Store(options.store), dict(options.limit))
    names = {quantity.name for quantity in fleet.quantities}
    for name, _ in options.limit:
        if name not in names:
            raise UsageError(f'--limit: unknown quantity {name!r}, must be one of '
                             f'{", ".join(sorted(names))}')
    columns = {name for one in fleet.recordings.values() for name in one['conditions']}
    if options.beside and options.beside not in columns:
        raise UsageError(f'--beside: unknown column {options.beside!r}, must be one of '
                         f'{", ".join(sorted(columns)) or "those of the manifest (there is none)"}')
    for text in sentences(fleet):
        screen.print(shown(text))
    if options.json:
        write_json(options.json, to_dict(fleet))
    if options.report:
        screen.print(f'page: {shown(fleet_page(fleet, options.beside).write(options.report))}')
    return 0
