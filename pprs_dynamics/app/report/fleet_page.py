# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page of a fleet: a map of robots and quantities; a click shows a trend, another a recording.

Trends are drawn by the browser from numbers in the page, so that thousands of them fit into it.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from pprs_dynamics.app.fleet.trend import FleetTrends, Quantity, Trend
from pprs_dynamics.app.fleet.trend_sentences import change_text, reach_text, sentences
from pprs_dynamics.app.report.charts import plotly_objects
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import BLUE, GREY, RED
from pprs_dynamics.arrays import Array

# Numbers of trends that a page holds: beyond, the quietest are not drawn but stay in the map.
MOST_VALUES = 300_000
SATURATED = 10.0  # standard deviations at which the map's colour is full
MOST_ERRORS = 50
ROW, HEAD = 26, 260  # heights of the map [px]
LEAST_ROWS = 4  # so that its colour scale has room


def fleet_page(fleet: FleetTrends, beside: str | None = None,
               given: Sequence[str] = ()) -> Page:
    """Return the page, most important first.

    Parameters
    ----------
    fleet : FleetTrends
    beside : str, optional
        Column of the manifest to be drawn beside every trend.
    given : sequence of str
        Options of the survey that the command for a single recording needs, too.
    """
    changed = [robot for robot in fleet.robots if fleet.flagged(robot)]
    page = Page(f'Fleet: {len(changed)} of {len(fleet.robots)} robots changed')
    lines = sentences(fleet)
    page.text(lines[0], 'lead')
    if lines[1:]:
        page.bullets(lines[1:])
    if fleet.trends:
        page.heading('Robots and quantities')
        page.figure(fleet_map(fleet), 'Colour: standard deviations from the robot\'s own first '
                    'recordings, or, by the button, from the fleet\'s median. Framed: a change '
                    'that chance does not explain. Click a field for its trend, and a point there '
                    'for the recording.')
        data = {**_data(fleet, changed, beside), 'given': ''.join(
            f' {shlex.quote(word)}' for word in given)}
        page.interactive('<h2 id="trend-title">Trend</h2><div id="trend" role="img"></div>'
                         '<section id="recording" class="card" hidden></section>',
                         'fleet-data', json.dumps(data, allow_nan=False),
                         ['dom.mjs', 'fleet.mjs'])
    if fleet.errors:
        page.heading('Recordings without a result')
        page.table(('recording', 'robot', 'reason'),
                   [(one['recording'], one['robot'], one['error'])
                    for one in fleet.errors[:MOST_ERRORS]])
    return page


def fleet_map(fleet: FleetTrends) -> Any:
    """Return the map of robots and quantities."""
    go = plotly_objects()
    robots, quantities = list(fleet.robots), _columns(fleet)
    labels = [quantity.label for quantity in quantities]
    shape = (len(robots), len(quantities))
    first, others = np.full(shape, np.nan), np.full(shape, np.nan)
    at = {robot: k for k, robot in enumerate(robots)}
    place = {quantity: k for k, quantity in enumerate(quantities)}
    marks: list[tuple[str, str]] = []
    for trend in fleet.trends:
        if trend.quantity in place:
            i, j = at[trend.robot], place[trend.quantity]
            first[i, j], others[i, j] = trend.from_first, trend.from_fleet
            if trend.flagged:
                marks.append((labels[j], trend.robot))
    figure = go.Figure([_field(go, robots, labels, first, True),
                        _field(go, robots, labels, others, False)])
    figure.add_trace(go.Scatter(
        x=[x for x, _ in marks], y=[y for _, y in marks], mode='markers', hoverinfo='skip',
        marker={'symbol': 'square-open', 'size': 15, 'color': 'black', 'line': {'width': 2}},
        showlegend=False))
    button = {'type': 'buttons', 'direction': 'right', 'x': 1.0, 'y': 1.02, 'xanchor': 'right',
              'yanchor': 'bottom', 'buttons': [
                  {'label': label, 'method': 'update',
                   'args': [{'visible': [k == 0, k == 1, True]}]}
                  for k, label in enumerate(('from its start', 'from the fleet'))]}
    figure.update_layout(
        height=HEAD + ROW * max(len(robots), LEAST_ROWS), updatemenus=[button],
        xaxis={'tickangle': -60, 'type': 'category', 'automargin': True},
        yaxis={'autorange': 'reversed', 'type': 'category', 'automargin': True},
        margin={'l': 60, 'r': 20, 't': 50, 'b': 140})
    return figure


def _field(go: Any, robots: Sequence[str], labels: Sequence[str], values: Array,
           visible: bool) -> Any:
    return go.Heatmap(
        x=labels, y=list(robots), z=[[None if np.isnan(v) else round(float(v), 2) for v in row]
                                     for row in values],
        zmin=-SATURATED, zmax=SATURATED, colorscale='RdBu_r', zmid=0, visible=visible, xgap=1,
        ygap=1, colorbar={'title': {'text': 'standard<br>deviations', 'font': {'size': 12}},
                          'thickness': 14, 'tickvals': [-SATURATED, 0.0, SATURATED]},
        hovertemplate='%{y}<br>%{x}<br>%{z:.1f} standard deviations<extra></extra>')


def _columns(fleet: FleetTrends) -> list[Quantity]:
    """Return the map's quantities: effects and errors, and the model's numbers that changed."""
    changed = {trend.quantity for trend in fleet.trends if trend.flagged}
    return [quantity for quantity in fleet.quantities
            if quantity.rank != 1 or quantity in changed]


def _data(fleet: FleetTrends, changed: Sequence[str], beside: str | None) -> dict[str, Any]:
    shown = set(_columns(fleet))
    trends = sorted((trend for trend in fleet.trends if trend.quantity in shown),
                    key=lambda trend: -trend.changes.statistic)
    number = {sha256: k for k, sha256 in enumerate(fleet.recordings)}
    drawn, values = {}, 0
    for trend in trends:
        values += len(trend.value)
        if values > MOST_VALUES:
            break
        drawn[f'{trend.robot}\0{trend.quantity.label}'] = _trend(trend, number)
    first = fleet.flagged(changed[0])[0] if changed else None
    return {
        'trends': drawn, 'beside': beside, 'colours': [BLUE, RED, GREY],
        'first': None if first is None else [first.robot, first.quantity.label],
        'recordings': [[one['recording'], one['path'], one['time'],
                        one['conditions'].get(beside) if beside else None]
                       for one in fleet.recordings.values()]}


def _trend(trend: Trend, number: dict[str, int]) -> dict[str, Any]:
    text = f'{change_text(trend)}{reach_text(trend)}' if trend.flagged else ''
    return {'t': [round(float(day), 4) for day in trend.time],
            'y': _plain(trend.value), 's': _plain(2 * trend.std),
            'f': _plain(trend.changes.fitted), 'unit': trend.quantity.unit, 'text': text,
            'limit': None if trend.reach is None else trend.reach.limit,
            'r': [number[sha256] for sha256 in trend.recordings]}


def _plain(values: Array) -> list[float | None]:
    return [float(f'{value:.6g}') if np.isfinite(value) else None for value in values]
