# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Plotly figures of a diagnosis: before and after, one per finding, what effects contribute."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.app.report.comparison_figures import (
    ERROR,
    LEGEND,
    LINES,
    MARGIN,
    MEASURED,
    MODEL,
    SECONDS,
    along,
    axis_of,
    curves_of,
    hover,
    in_two_rows,
)
from pprs_dynamics.app.report.page import plotly_objects
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.fit_curve import CurveRequest, curve_variable
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import FoundEffect
from pprs_dynamics.inference.diagnosis.partial import partial_residual, remaining_residuals
from pprs_dynamics.inference.diagnosis.rivals import RivalEffect
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.residuals.residuals import Residuals

POINTS = 400  # of a curve, and of the errors around it
AFTER, FLOOR, RIVAL, OTHER = '#009E73', '#1a1a1a', '#E69F00', '#bbbbbb'


def before_and_after(before: Residuals, after: Residuals, drive: int, floor: float) -> Any:
    """Return measured effort with both models above, and both errors below."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=[0.55, 0.45])
    units = before.units_of(before.drives[drive])
    time, measured, given, found = curves_of(
        before, before.measured[:, drive], before.model[:, drive], after.model[:, drive])
    for name, values, colour, row in (
            ('measured', measured, MEASURED, 1), ('model as given', given, ERROR, 1),
            ('model with what was found', found, AFTER, 1),
            ('error as given', measured - given, ERROR, 2),
            ('error with what was found', measured - found, AFTER, 2)):
        figure.add_trace(go.Scatter(
            x=time, y=values, name=name, mode='lines', showlegend=row == 1,
            hovertemplate=hover(units), line={'color': colour, 'width': 1.2}), row=row, col=1)
    for level in (-2 * floor, 2 * floor):
        figure.add_hline(y=level, row=2, col=1, line={'color': FLOOR, 'width': 1, 'dash': 'dot'})
    return in_two_rows(figure, before.drives[drive], units)


def curve_with_band(answer: Adoption) -> Any:
    """Return a measured curve over its variable, its band, and the errors that it stands for."""
    assert isinstance(answer.request, CurveRequest)
    assert answer.curve is not None
    go = plotly_objects()
    after, curve = answer.residuals_after, answer.curve.curve
    drive = after.drives.index(answer.request.drive)
    seen = curve_variable(after, answer.request)
    factor, label = axis_of(curve.variable, after, answer.request.drive)
    left = after.error[:, drive] + curve.force(seen)
    shown = np.linspace(0, len(seen) - 1, min(len(seen), POINTS)).astype(int)
    x = np.linspace(curve.start, curve.end, POINTS)
    y, band = curve.force(x), 2 * answer.curve.band(x)
    units = after.units_of(answer.request.drive)
    figure = go.Figure()
    figure.add_trace(go.Scatter(
        x=factor * seen[shown], y=left[shown], mode='markers', name='without it',
        marker={'size': 3, 'color': OTHER}, hoverinfo='skip'))
    figure.add_trace(go.Scatter(
        x=factor * np.concatenate((x, x[::-1])), y=np.concatenate((y + band, (y - band)[::-1])),
        fill='toself', line={'width': 0}, fillcolor='rgba(0, 158, 115, 0.25)',
        name='two standard deviations', hoverinfo='skip'))
    figure.add_trace(go.Scatter(x=factor * x, y=y, mode='lines', name='measured curve',
                                line={'color': AFTER, 'width': 1.5}, hovertemplate=hover(units)))
    figure.update_layout(height=300, margin=MARGIN, legend=LEGEND, xaxis_title=label,
                         yaxis_title=f'{answer.request.drive} [{units.effort}]')
    return figure


def contributions(residuals: Residuals, forces: dict[str, Any]) -> Any:
    """Return what each effect contributes to each drive over time.

    Parameters
    ----------
    residuals : Residuals
    forces : mapping of str to (M, D) array
        By name [N].
    """
    go = plotly_objects()
    figure = go.Figure()
    for drive, drive_name in enumerate(residuals.drives):
        acting = {name: force[:, drive] for name, force in forces.items()
                  if np.any(force[:, drive])}
        if not acting:
            continue
        time, *curves = curves_of(residuals, *acting.values())
        for number, (name, values) in enumerate(zip(acting, curves, strict=True)):
            figure.add_trace(go.Scatter(
                x=time, y=values, name=name, mode='lines', showlegend=True,
                meta={'drive': drive_name},
                hovertemplate=hover(residuals.units_of(drive_name)),
                line={'color': LINES[number % len(LINES)], 'width': 1.3}))
    figure.update_layout(height=320, margin=MARGIN, legend=LEGEND, hovermode='x unified',
                         xaxis={'title': 'time [s]', **SECONDS},
                         yaxis_title=f'force [{residuals.unit}]')
    return figure


def effect_pictures(diagnosis: Diagnosis, found: FoundEffect | RivalEffect,
                    ) -> list[tuple[Any, str]]:
    """Return what one effect has to explain and what it makes of it, with captions.

    The first is along what it depends on, where that tells most of it; the last over time.
    """
    go = plotly_objects()
    part = partial_residual(diagnosis, found)
    residuals = diagnosis.residuals
    drive = residuals.drives[part.drive]
    units = residuals.units_of(drive)
    without = 'measured, all but this in the model'
    figures = []
    if part.profile is not None:
        middle = (part.profile.edges[1:] + part.profile.edges[:-1]) / 2
        factor, label = axis_of(part.variable, residuals, drive)
        figure = go.Figure([
            go.Scatter(x=factor * middle, y=part.profile.mean, mode='markers', name=without,
                       marker={'color': MEASURED, 'size': 6}, hovertemplate=hover(units),
                       error_y={'type': 'data', 'array': 2 * part.profile.uncertainty,
                                'width': 0, 'thickness': 1}),
            go.Scatter(x=factor * middle, y=part.fitted, mode='lines', name=found.name,
                       hovertemplate=hover(units), line={'color': MODEL, 'width': 2})])
        figure.update_layout(height=320, margin=MARGIN, legend=LEGEND, xaxis_title=label,
                             hovermode='x unified', yaxis={
                                 'title': f'force on {drive} [{units.effort}]',
                                 'rangemode': 'tozero'})
        figures.append((figure, f'{found.name} on {drive}: means over bins with two standard '
                        'deviations, and the fitted effect.'))
    time = residuals.time[part.span]
    figure = go.Figure([
        go.Scatter(x=time, y=values[part.span].astype(np.float32), name=name, mode='lines',
                   hovertemplate=hover(units), line={'color': colour, 'width': width})
        for name, values, colour, width in ((without, part.error, MEASURED, 1.0),
                                            (found.name, part.force, MODEL, 2.0))])
    figure.update_layout(height=320, margin=MARGIN, legend=LEGEND, hovermode='x unified',
                         xaxis={'title': 'time [s]', **SECONDS},
                         yaxis={'title': f'force on {drive} [{units.effort}]',
                                'rangemode': 'tozero'})
    figures.append((figure, f'{found.name} on {drive}, where it changes most.'))
    return figures


def unknown_picture(diagnosis: Diagnosis, statement: Statement) -> Any | None:
    """Return the shape of what remains along what it depends on."""
    noise = diagnosis.noise.get(statement.drive)
    return None if noise is None else along(remaining_residuals(diagnosis), noise, statement,
                                            'what remains')


def evidence_bars(diagnosis: Diagnosis) -> Any:
    """Return the evidence for each candidate for the first place."""
    go = plotly_objects()
    unit = diagnosis.residuals.unit
    ranked = sorted(diagnosis.candidates, key=lambda one: one.evidence)
    adopted = {one.name for one in diagnosis.effects}
    rivals = {name for names in diagnosis.indistinguishable for name in names[1:]}
    colours = [MODEL if one.name in adopted else RIVAL if one.name in rivals else OTHER
               for one in ranked]
    figure = go.Figure(go.Bar(
        x=[one.evidence for one in ranked], y=[one.name for one in ranked], orientation='h',
        marker={'color': colours}, text=[f'{one.evidence:.0f}' for one in ranked],
        textposition='outside', cliponaxis=False,
        hovertext=[f'error after: {one.error_after:.3f} {unit}' for one in ranked],
        hoverinfo='text'))
    figure.add_vline(x=0, line={'color': FLOOR, 'width': 1.2, 'dash': 'dash'})
    lowest, highest = (end(0.0, *(one.evidence for one in ranked)) for end in (min, max))
    reach = highest - lowest or 1.0
    figure.update_layout(
        height=90 + 26 * len(ranked), xaxis_title='evidence', margin={**MARGIN, 't': 15, 'r': 60},
        yaxis={'automargin': True},
        xaxis={'range': [lowest - 0.12 * reach * (lowest < 0), highest + 0.15 * reach]})
    return figure
