# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs trend`: show what changed on which robot, and when."""

from __future__ import annotations

import argparse

from pprs_dynamics.app.commands.arguments import add_shared, write_json
from pprs_dynamics.app.fleet.trend import FleetTrends, fleet_trends
from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.terminal import console, shown

EXAMPLE = 'pprs trend store --report trend.html'
MOST_DRAWN, MOST_LISTED = 40, 50
HEIGHT = 170  # [px] of a row


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('store', metavar='STORE', help='folder that pprs survey wrote')
    add_shared(parser, 'report', report='write a page with every quantity that changed')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    fleet = fleet_trends(options.store)
    for text in fleet.text:
        screen.print(shown(text))
    if options.json:
        write_json(options.json, fleet)
    if options.report:
        screen.print(f'page: {shown(fleet_page(fleet).write(options.report))}', soft_wrap=True)
    return 0


def fleet_page(fleet: FleetTrends) -> Page:
    """Return the page of all changes, with a figure of each quantity."""
    changed = fleet.changes
    count = len({trend.robot for trend in changed})
    page = Page(f'Fleet: {count} of {len(fleet.robots)} robots changed')
    first, *others = fleet.text
    page.text(first, 'lead')
    page.bullets(others)
    if changed:
        drawn = changed[:MOST_DRAWN]
        figure = charts.rows_over_time(
            len(drawn), 80 + HEIGHT * len(drawn), showlegend=False,
            titles=[f'<b>{trend.robot}</b>, {trend.name} [{trend.unit}]' for trend in drawn])
        figure.update_xaxes(title_text='', ticksuffix='', hoverformat='%Y-%m-%d %H:%M')
        for row, trend in enumerate(drawn, start=1):
            figure.add_trace(charts.trace(
                trend.time.dt.strftime('%Y-%m-%dT%H:%M:%S'), trend.value, trend.name,
                charts.MODEL, mode='markers', hovertemplate=f'%{{y:.4g}} {trend.unit}'),
                row=row, col=1)
            for step in trend.steps:
                figure.add_vline(x=step.time[:19], row=row, col=1,
                                 line={'color': charts.ERROR, 'dash': 'dash'})
        page.figure(figure, 'Quantities that changed, the clearest first. Dashed: the first '
                    'recording after a step.')
    page.heading('Recordings without a result') if fleet.refused else None
    page.bullets([f'{path}: {reason}' for path, reason in fleet.refused.items()][:MOST_LISTED])
    return page
