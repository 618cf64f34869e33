# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Page of a fleet: what changed in sentences, and each changed quantity over time."""

from __future__ import annotations

from pprs_dynamics.app.fleet.trend import FleetTrends
from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page

MOST_DRAWN, MOST_LISTED = 40, 50
HEIGHT = 170  # [px] of a row


def fleet_page(fleet: FleetTrends) -> Page:
    """Return the page."""
    changed = fleet.changed
    count = len({trend.robot for trend in changed})
    page = Page(f'Fleet: {count} of {len(fleet.robots)} robots changed')
    first, *others = fleet.sentences()
    page.text(first, 'lead')
    page.bullets(others)
    if changed:
        drawn = changed[:MOST_DRAWN]
        figure = charts.rows_over_time(len(drawn), 80 + HEIGHT * len(drawn), showlegend=False)
        figure.update_xaxes(title_text='', ticksuffix='', hoverformat='%Y-%m-%d %H:%M')
        for row, trend in enumerate(drawn, start=1):
            figure.add_trace(charts.trace(
                trend.time.dt.strftime('%Y-%m-%dT%H:%M:%S'), trend.value, trend.name,
                charts.MODEL, mode='markers', hovertemplate=f'%{{y:.4g}} {trend.unit}'),
                row=row, col=1)
            figure.add_annotation(text=f'<b>{trend.robot}</b>, {trend.name} [{trend.unit}]',
                                  x=0, y=1, xref='x domain', yref='y domain', xanchor='left',
                                  yanchor='bottom', showarrow=False, row=row, col=1)
            for step in trend.steps:
                figure.add_vline(x=f'{step.time:%Y-%m-%dT%H:%M:%S}', row=row, col=1,
                                 line={'color': charts.ERROR, 'dash': 'dash'})
        page.figure(figure, 'Quantities that changed, the clearest first. Dashed: the first '
                    'recording after a step.')
    page.heading('Recordings without a result') if fleet.refused else None
    page.bullets([f'{path}: {reason}' for path, reason in fleet.refused.items()][:MOST_LISTED])
    return page
