"""Plotly figures of a diagnosis: before and after, the fall of the error, one per finding."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.diagnosis.diagnose import Diagnosis
from pprs_dynamics.diagnosis.error_steps import ErrorStep
from pprs_dynamics.diagnosis.found_effects import FoundEffect
from pprs_dynamics.diagnosis.partial import (
    partial_residual,
    remaining_profile,
    remaining_residuals,
)
from pprs_dynamics.diagnosis.statements import UNITS, WORDS, Statement
from pprs_dynamics.report.comparison_figures import ERROR, LINES, MEASURED, MODEL, curve
from pprs_dynamics.report.page import plotly_objects
from pprs_dynamics.residuals.noise import NoiseSpectrum
from pprs_dynamics.residuals.profiles import error_spectrum
from pprs_dynamics.residuals.residuals import Residuals

AFTER, FLOOR, RISE = '#009E73', '#1a1a1a', '#D55E00'
MARGIN = {'l': 60, 'r': 20, 't': 40, 'b': 45}
LEGEND = {'orientation': 'h', 'y': 1.02, 'x': 0.0, 'yanchor': 'bottom', 'xanchor': 'left'}


def before_and_after(before: Residuals, after: Residuals, drive: int, floor: float) -> Any:
    """Return measured effort with both models above, and both errors below."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=[0.55, 0.45])
    curves = (('measured', before, before.measured, MEASURED, 1),
              ('model as given', before, before.model, ERROR, 1),
              ('model with what was found', after, after.model, AFTER, 1),
              ('error as given', before, before.error, ERROR, 2),
              ('error with what was found', after, after.error, AFTER, 2))
    for name, residuals, values, colour, row in curves:
        time, shown = curve(residuals, values[:, drive])
        figure.add_trace(go.Scatter(
            x=time, y=shown, name=name, mode='lines', showlegend=row == 1,
            line={'color': colour, 'width': 1.2}), row=row, col=1)
    for level in (-2 * floor, 2 * floor):
        figure.add_hline(y=level, row=2, col=1, line={'color': FLOOR, 'width': 1, 'dash': 'dot'})
    figure.update_yaxes(title_text='effort [N]', row=1, col=1)
    figure.update_yaxes(title_text='error [N]', row=2, col=1)
    figure.update_xaxes(title_text='time [s]', row=2, col=1)
    figure.update_layout(template='plotly_white', height=400, hovermode='x unified',
                         legend={**LEGEND, 'title': {'text': f'<b>{before.drives[drive]}</b>'}},
                         margin={**MARGIN, 't': 55})
    return figure


def waterfall(steps: Sequence[ErrorStep], drives: Sequence[str], floor: float,
              floors: Mapping[str, float]) -> Any:
    """Return how the error falls step by step, overall and by drive, the noise floor drawn."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    titles = ['all drives', *drives]
    columns = 3
    rows = 1 + -(-len(drives) // columns)
    specs: list[list[Any]] = [[{'colspan': columns}, *[None] * (columns - 1)],
                              *([{}] * columns for _ in range(rows - 1))]
    figure = make_subplots(rows=rows, cols=columns, specs=specs, subplot_titles=titles,
                           vertical_spacing=0.13, horizontal_spacing=0.06)
    labels = [step.label if k == 0 else f'+ {step.label}' for k, step in enumerate(steps)]
    for number in range(len(titles)):
        row, column = (1, 1) if number == 0 else (2 + (number - 1) // columns,
                                                  1 + (number - 1) % columns)
        levels = np.array([step.overall if number == 0 else step.drives[number - 1]
                           for step in steps])
        if not np.isfinite(levels).all():
            continue
        changes = np.diff(levels)
        base = [0.0, *np.minimum(levels[:-1], levels[1:]), 0.0]
        heights = [levels[0], *np.abs(changes), levels[-1]]
        colours = [MEASURED, *[AFTER if change <= 0 else RISE for change in changes], MODEL]
        place = [*labels, 'what is left'] if number == 0 else [
            *('given' if k == 0 else f'+{k}' for k in range(len(labels))), 'left']
        texts = [f'{levels[0]:.3g}', *[f'{change:+.3g}' for change in changes],
                 f'{levels[-1]:.3g}']
        figure.add_trace(go.Bar(
            x=place, y=heights, base=base, marker={'color': colours}, showlegend=False,
            text=texts if number == 0 else None, textposition='outside', cliponaxis=False,
            hovertext=[f'{label}: {text} N' for label, text in zip(
                [*labels, 'what is left'], texts, strict=True)], hoverinfo='text'),
            row=row, col=column)
        level = floor if number == 0 else floors.get(drives[number - 1], np.nan)
        figure.add_hline(y=level, row=row, col=column,
                         line={'color': FLOOR, 'width': 1.2, 'dash': 'dash'})
        figure.update_yaxes(range=[0, 1.18 * max(float(levels.max()), level)], row=row, col=column)
    figure.update_yaxes(title_text='error rms [N]', col=1)
    figure.update_layout(template='plotly_white', height=280 + 190 * (rows - 1),
                         bargap=0.35, margin=MARGIN)
    return figure


def contributions(diagnosis: Diagnosis) -> Any:
    """Return what each effect contributes over time; a menu of drives."""
    go = plotly_objects()
    residuals = diagnosis.residuals
    strength = np.sqrt(sum(np.mean(one.force ** 2, axis=0) for one in diagnosis.effects))
    first = int(np.argmax(strength))
    figure, owners = go.Figure(), []
    for drive in range(len(residuals.drives)):
        for number, one in enumerate(diagnosis.effects):
            if not np.any(one.force[:, drive]):
                continue
            time, shown = curve(residuals, one.force[:, drive])
            figure.add_trace(go.Scatter(
                x=time, y=shown, name=one.name, mode='lines', visible=drive == first,
                showlegend=True, line={'color': LINES[number % len(LINES)], 'width': 1.3}))
            owners.append(drive)
    shown_drives = sorted(set(owners))
    figure.update_layout(
        template='plotly_white', height=360, margin={**MARGIN, 't': 60},
        xaxis_title='time [s]', yaxis_title='force [N]',
        legend={**LEGEND, 'x': 0.14}, updatemenus=[{
            'x': 0.0, 'y': 1.02, 'xanchor': 'left', 'yanchor': 'bottom',
            'active': shown_drives.index(first), 'buttons': [
                {'label': residuals.drives[drive], 'method': 'update',
                 'args': [{'visible': [owner == drive for owner in owners]}]}
                for drive in shown_drives]}])
    return figure


def effect_picture(diagnosis: Diagnosis, found: FoundEffect) -> Any:
    """Return what one effect has to explain, and what it makes of it, on its strongest drive."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    part = partial_residual(diagnosis, found)
    residuals = diagnosis.residuals
    two = part.profile is not None
    figure = make_subplots(rows=1, cols=1 + two, horizontal_spacing=0.1,
                           column_widths=[0.45, 0.55] if two else [1.0])
    if part.profile is not None:
        middle = (part.profile.edges[1:] + part.profile.edges[:-1]) / 2
        factor, label = axis_of(part.variable)
        figure.add_trace(go.Scatter(
            x=factor * middle, y=part.profile.mean, mode='markers', name='measured, without it',
            showlegend=False, marker={'color': MEASURED, 'size': 6},
            error_y={'type': 'data', 'array': 2 * part.profile.uncertainty, 'width': 0,
                     'thickness': 1}), row=1, col=1)
        figure.add_trace(go.Scatter(
            x=factor * middle, y=part.fitted, mode='lines', name=found.name, showlegend=False,
            line={'color': MODEL, 'width': 2}), row=1, col=1)
        figure.update_xaxes(title_text=label, row=1, col=1)
    time = residuals.time[part.span]
    for name, values, colour, width in (('measured, without it', part.error, MEASURED, 1.0),
                                        (found.name, part.force, MODEL, 2.0)):
        figure.add_trace(go.Scatter(x=time, y=values[part.span], name=name, mode='lines',
                                    line={'color': colour, 'width': width}), row=1, col=1 + two)
    figure.update_xaxes(title_text='time [s], where it is largest', row=1, col=1 + two)
    figure.update_yaxes(rangemode='tozero')
    figure.update_yaxes(title_text=f'force on {residuals.drives[part.drive]} [N]', col=1)
    figure.update_layout(template='plotly_white', height=300, margin={**MARGIN, 't': 30},
                         legend=LEGEND)
    return figure


def unknown_picture(diagnosis: Diagnosis, statement: Statement) -> Any | None:
    """Return the shape of what remains along what it depends on."""
    if statement.variable == 'frequency':
        noise = diagnosis.noise.get(statement.drive)
        return None if noise is None else _spectrum(diagnosis, statement, noise)
    go = plotly_objects()
    variable = 'velocity' if statement.variable == 'direction' else statement.variable
    profile = remaining_profile(diagnosis, statement.drive, variable)
    if profile is None:
        return None
    factor, label = axis_of(variable)
    middle = factor * (profile.edges[1:] + profile.edges[:-1]) / 2
    figure = go.Figure()
    if statement.kind == 'scatter':
        figure.add_trace(go.Scatter(x=middle, y=profile.rms, mode='lines+markers',
                                    line={'color': ERROR}, name='rms'))
        name = 'rms'
    else:
        above, below = (profile.mean + sign * 2 * profile.uncertainty for sign in (1, -1))
        figure.add_trace(go.Scatter(
            x=np.concatenate((middle, middle[::-1])), y=np.concatenate((above, below[::-1])),
            fill='toself', fillcolor='rgba(213, 94, 0, 0.18)', line={'width': 0}, mode='lines',
            name='± two standard deviations', hoverinfo='skip'))
        figure.add_trace(go.Scatter(x=middle, y=profile.mean, mode='lines+markers',
                                    line={'color': ERROR}, marker={'size': 5}, name='mean'))
        name = 'mean'
    if statement.range is not None and statement.variable == variable:
        low, high = (factor * end for end in statement.range)
        figure.add_vrect(x0=low, x1=high, fillcolor='#E69F00', opacity=0.15, line_width=0)
    figure.add_hline(y=0, line={'color': MEASURED, 'width': 0.8})
    figure.update_layout(template='plotly_white', height=320, margin={**MARGIN, 't': 40},
                         xaxis_title=label, legend=LEGEND,
                         yaxis_title=f'{name} of what remains on {statement.drive} [N]')
    return figure


def evidence_bars(diagnosis: Diagnosis) -> Any:
    """Return the evidence for each candidate for the first place."""
    go = plotly_objects()
    ranked = sorted(diagnosis.candidates, key=lambda one: one.evidence)
    adopted = {one.name for one in diagnosis.effects}
    rivals = {name for names in diagnosis.indistinguishable for name in names[1:]}
    colours = [MODEL if one.name in adopted else '#E69F00' if one.name in rivals else '#bbbbbb'
               for one in ranked]
    figure = go.Figure(go.Bar(
        x=[one.evidence for one in ranked], y=[one.name for one in ranked], orientation='h',
        marker={'color': colours}, text=[f'{one.evidence:.0f}' for one in ranked],
        textposition='outside', cliponaxis=False,
        hovertext=[f'error after: {one.error_after:.4f} N' for one in ranked], hoverinfo='text'))
    figure.add_vline(x=0, line={'color': FLOOR, 'width': 1.2, 'dash': 'dash'})
    lowest, highest = (end(0.0, *(one.evidence for one in ranked)) for end in (min, max))
    reach = highest - lowest or 1.0
    figure.update_layout(
        template='plotly_white', height=90 + 32 * len(ranked), xaxis_title='evidence',
        margin={**MARGIN, 'l': 160, 't': 15, 'r': 60},
        xaxis={'range': [lowest - 0.1 * reach * (lowest < 0), highest + 0.1 * reach]})
    return figure


def axis_of(variable: str) -> tuple[float, str]:
    """Return factor from SI and label of an axis."""
    name, of, other = variable.partition(' of ')
    factor, unit = UNITS[name]
    return factor, f'{WORDS.get(name, name)}{of}{other} [{unit}]'


def _spectrum(diagnosis: Diagnosis, statement: Statement, noise: NoiseSpectrum) -> Any:
    go = plotly_objects()
    residuals = remaining_residuals(diagnosis)
    found = error_spectrum(residuals, residuals.drives.index(statement.drive), noise)
    keep = found.frequency > 0
    figure = go.Figure(go.Scatter(x=found.frequency[keep], y=found.power[keep], mode='lines',
                                  line={'color': ERROR, 'width': 1.2}))
    if statement.range is not None:
        figure.add_vrect(x0=0.98 * statement.range[0], x1=1.02 * statement.range[1],
                         fillcolor='#E69F00', opacity=0.3, line_width=0)
    figure.update_layout(
        template='plotly_white', height=320, margin={**MARGIN, 't': 30}, showlegend=False,
        xaxis={'type': 'log', 'title': 'frequency [Hz]'},
        yaxis={'type': 'log', 'title': f'what remains on {statement.drive} [N²/Hz]',
               'exponentformat': 'power'})
    return figure
