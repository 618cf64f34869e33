# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Plotly figures of a comparison: over time, against variables, over the workspace, spectrum."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from pprs_dynamics.app.report.page import plotly_objects
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.diagnosis.comparison import Comparison
from pprs_dynamics.inference.diagnosis.statements import WORDS, Statement, read_in
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.profiles import Profile, error_profile, error_spectrum
from pprs_dynamics.inference.residuals.residuals import Residuals

MEASURED, MODEL, ERROR, MARK = '#666666', '#0072B2', '#D55E00', '#E69F00'
LINES = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9')
POINTS = 1500  # pairs of extremes shown per curve; a screen has fewer columns
WORST_SPANS = 3
WORST_DURATION = 1.0  # [s]
MAP_CELLS = 20
FINE_BINS = 24
VARIABLES = ('velocity', 'position', 'acceleration', 'load', 'rod_angle', 'time', 'platform_x',
             'platform_y', 'platform_z', 'platform_tilt', 'platform_turn')
MARGIN = {'l': 70, 'r': 15, 't': 30, 'b': 40}
LEGEND = {'orientation': 'h', 'y': 1.02, 'x': 0.0, 'yanchor': 'bottom', 'xanchor': 'left'}
# The unit stands at the last tick and in what the cursor shows.
SECONDS = {'ticksuffix': ' s', 'showticksuffix': 'last', 'hoverformat': '.3f'}


def hover(units: DriveUnits) -> str:
    """Return what the cursor shows of an effort."""
    return f'%{{y:.3f}} {units.effort}'


def thinned(time: Array, *curves: Array, points: int = POINTS) -> tuple[Array, ...]:
    """Return at most 2 `points` samples, the same of all curves, that keep every peak of each.

    They are the extremes of equal spans. Samples that are not finite are left out where their
    span has others.
    """
    at = extremes(*curves, points=points)
    return tuple(values[at] for values in (time, *curves))


def extremes(*curves: Array, points: int) -> np.typing.NDArray[np.int_]:
    """Return the samples of `thinned`."""
    count = len(curves[0])
    if count <= 2 * points:
        return np.arange(count)
    edges = np.linspace(0, count, points // len(curves) + 1).astype(int)
    kept: list[int] = []
    for start, stop in pairwise(edges.tolist()):
        found = set()
        for values in curves:
            part = values[start:stop]
            if np.isfinite(part).any():
                found |= {start + int(np.nanargmin(part)), start + int(np.nanargmax(part))}
        kept += sorted(found or {start})
    return np.array(kept)


def over_time(residuals: Residuals, drive: int, worst: list[tuple[float, float]]) -> Any:
    """Return measured and model above, their difference below, the worst spans marked."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=[0.6, 0.4])
    units = residuals.units_of(residuals.drives[drive])
    time, measured, model = curves_of(residuals, residuals.measured[:, drive],
                                      residuals.model[:, drive])
    for name, values, colour, row in (
            ('measured', measured, MEASURED, 1), ('model', model, MODEL, 1),
            ('measured minus model', measured - model, ERROR, 2)):
        figure.add_trace(go.Scatter(x=time, y=values, name=name, mode='lines',
                                    hovertemplate=hover(units),
                                    line={'color': colour, 'width': 1.3}), row=row, col=1)
    for start, end in worst:
        figure.add_vrect(x0=start, x1=end, fillcolor=MARK, opacity=0.25, line_width=0)
    return in_two_rows(figure, residuals.drives[drive], units)


def in_two_rows(figure: Any, drive: str, units: DriveUnits) -> Any:
    """Lay out efforts above errors over one time axis."""
    figure.update_xaxes(**SECONDS)
    figure.update_yaxes(title_text=f'effort [{units.effort}]', row=1, col=1)
    figure.update_yaxes(title_text=f'error [{units.effort}]', row=2, col=1)
    figure.update_xaxes(title_text='time [s]', row=2, col=1)
    figure.update_layout(height=400, hovermode='x unified', margin={**MARGIN, 't': 55},
                         legend={**LEGEND, 'title': {'text': f'<b>{drive}</b>'}})
    return figure


def worst_spans(residuals: Residuals, drive: int) -> list[tuple[float, float]]:
    """Return the spans of one second with the largest squared error, worst first [s]."""
    squares = np.nan_to_num(residuals.error[:, drive]) ** 2
    length = max(1, round(WORST_DURATION / residuals.period))
    if len(squares) <= length:
        return []
    energy = np.convolve(squares, np.ones(length), 'valid')
    spans = []
    for _ in range(WORST_SPANS):
        start = int(np.argmax(energy))
        if energy[start] <= 0:
            break
        spans.append((float(residuals.time[start]), float(residuals.time[start + length - 1])))
        energy[max(0, start - length):start + length] = 0
    return spans


def against_variables(residuals: Residuals, comparison: Comparison) -> list[tuple[Any, str]]:
    """Return mean error over bins of every variable with its uncertainty, and captions."""
    go = plotly_objects()
    figures = []
    for name in VARIABLES:
        if residuals.variable(name, 0) is None:
            continue
        figure = go.Figure()
        for drive, drive_name in enumerate(residuals.drives):
            noise = comparison.localisation.drives[drive_name].noise
            profile = None if noise is None else error_profile(residuals, drive, name, noise)
            if profile is not None:
                figure.add_trace(_means(go, profile, name, residuals, drive_name,
                                        {'drive': drive_name}))
        figure.add_hline(y=0, line={'color': MEASURED, 'width': 0.8})
        figure.update_layout(height=240, margin={**MARGIN, 't': 10}, showlegend=False,
                             xaxis_title=axis_of(name, residuals)[1],
                             yaxis_title=f'mean error [{residuals.unit}]')
        figures.append((figure, f'Against {WORDS.get(name, name)}.'))
    return figures


def _means(go: Any, profile: Profile, variable: str, residuals: Residuals, drive: str,
           meta: Any = None) -> Any:
    factor, unit = read_in(variable, residuals.units_of(variable.partition(' of ')[2] or drive))
    middle = factor * (profile.edges[1:] + profile.edges[:-1]) / 2
    return go.Scatter(
        x=middle, y=profile.mean, mode='lines+markers', line={'color': ERROR}, meta=meta,
        marker={'size': 5}, name='mean', error_y={
            'type': 'data', 'array': 2 * profile.uncertainty, 'width': 0, 'thickness': 1},
        hovertemplate=f'%{{x:.4g}} {unit}: {hover(residuals.units_of(drive))}<extra></extra>')


def along(residuals: Residuals, noise: NoiseSpectrum, statement: Statement, what: str,
          ) -> Any | None:
    """Return an error along what a statement says that it depends on.

    Parameters
    ----------
    residuals : Residuals
        Whose error is drawn.
    noise : NoiseSpectrum
        Of the drive.
    statement : Statement
    what : str
        Name of the error, for the axis.
    """
    go = plotly_objects()
    drive = residuals.drives.index(statement.drive)
    if statement.variable == 'frequency':
        return _line(residuals, noise, statement, what)
    variable = 'velocity' if statement.variable == 'direction' else statement.variable
    profile = _profile(residuals, drive, variable, noise)
    if profile is None:
        return None
    units = residuals.units_of(statement.drive)
    factor, label = axis_of(variable, residuals, statement.drive)
    figure = go.Figure()
    if statement.kind == 'scatter':
        middle = factor * (profile.edges[1:] + profile.edges[:-1]) / 2
        figure.add_trace(go.Scatter(x=middle, y=profile.rms, mode='lines+markers', name='rms',
                                    hovertemplate=hover(units), line={'color': ERROR}))
    else:
        figure.add_trace(_means(go, profile, variable, residuals, statement.drive))
    if statement.range is not None and statement.variable == variable:
        low, high = (factor * end for end in statement.range)
        figure.add_vrect(x0=low, x1=high, fillcolor=MARK, opacity=0.15, line_width=0)
    figure.add_hline(y=0, line={'color': MEASURED, 'width': 0.8})
    kind = 'rms' if statement.kind == 'scatter' else 'mean'
    figure.update_layout(height=300, margin={**MARGIN, 't': 15}, showlegend=False,
                         xaxis_title=label,
                         yaxis_title=f'{kind} {what} on {statement.drive} [{units.effort}]')
    return figure


def _profile(residuals: Residuals, drive: int, variable: str, noise: NoiseSpectrum,
             ) -> Profile | None:
    """Return means over bins of a variable, also of another drive's."""
    name, of, other = variable.partition(' of ')
    if of:
        values = residuals.variable(name, residuals.drives.index(other))
        if values is None:
            return None
        residuals = replace(residuals, variables={**residuals.variables, variable: values})
    return error_profile(residuals, drive, variable, noise, FINE_BINS)


def _line(residuals: Residuals, noise: NoiseSpectrum, statement: Statement, what: str) -> Any:
    go = plotly_objects()
    unit = _power(residuals.units_of(statement.drive).effort)
    found = error_spectrum(residuals, residuals.drives.index(statement.drive), noise)
    keep = found.frequency > 0
    figure = go.Figure()
    for name, power, colour in (('error', found.power, ERROR),
                                ('noise', found.background, MEASURED)):
        figure.add_trace(go.Scatter(
            x=found.frequency[keep], y=power[keep], mode='lines', name=name,
            line={'color': colour, 'width': 1.2}, hovertemplate=f'%{{y:.3g}} {unit}'))
    if statement.range is not None:
        figure.add_vrect(x0=0.98 * statement.range[0], x1=1.02 * statement.range[1],
                         fillcolor=MARK, opacity=0.3, line_width=0)
    return _over_frequency(figure, 300, f'{what} on {statement.drive} [{unit}]')


def _over_frequency(figure: Any, height: int, title: str) -> Any:
    figure.update_layout(
        height=height, margin=MARGIN, legend=LEGEND, hovermode='x unified',
        xaxis={'type': 'log', 'title': 'frequency [Hz]', 'dtick': 1, 'ticksuffix': ' Hz',
               'showticksuffix': 'last'},
        yaxis={'type': 'log', 'title': title, 'exponentformat': 'e', 'dtick': 1})
    return figure


def _power(unit: str) -> str:
    return f'({unit})²/Hz' if ' ' in unit else f'{unit}²/Hz'


def axis_of(variable: str, residuals: Residuals, drive: str = '') -> tuple[float, str]:
    """Return factor from SI and label of an axis: of one drive, or of all."""
    name, of, other = variable.partition(' of ')
    chosen = other or drive
    found = list(dict.fromkeys(read_in(name, residuals.units_of(one)) for one in (
        (chosen,) if chosen else residuals.drives)))
    unit = ' or '.join(unit for _, unit in found)
    return found[0][0], f'{WORDS.get(name, name)}{of}{other} [{unit}]'


def over_workspace(residuals: Residuals) -> Any | None:
    """Return the rms error of each drive over the platform's x and y; None on one axis."""
    go = plotly_objects()
    x, y = residuals.variables.get('platform_x'), residuals.variables.get('platform_y')
    if x is None or y is None or np.ptp(x) == 0 or np.ptp(y) == 0:
        return None
    edges = [np.linspace(axis.min(), axis.max(), MAP_CELLS + 1) for axis in (x, y)]
    middles = [(axis[1:] + axis[:-1]) / 2 for axis in edges]
    figure = go.Figure()
    for drive, name in enumerate(residuals.drives):
        error = residuals.error[:, drive]
        known = np.isfinite(error)
        total = np.histogram2d(x[known], y[known], edges, weights=error[known] ** 2)[0]
        samples = np.histogram2d(x[known], y[known], edges)[0]
        held = samples > 0
        i, j = np.nonzero(held)
        figure.add_trace(go.Scatter(
            x=1e3 * middles[0][i], y=1e3 * middles[1][j], mode='markers', meta={'drive': name},
            marker={'symbol': 'square', 'size': 15, 'colorscale': 'Cividis',
                    'color': np.sqrt(total[held] / samples[held]).astype(np.float32),
                    'colorbar': {'title': 'rms [N]'}},
            hovertemplate='x %{x:.1f} mm, y %{y:.1f} mm: %{marker.color:.3f} N<extra></extra>'))
    figure.update_layout(height=460, xaxis_title='platform x [mm]', margin={**MARGIN, 't': 10},
                         showlegend=False,
                         yaxis_title='platform y [mm]')
    figure.update_yaxes(scaleanchor='x')
    return figure


def spectrum(residuals: Residuals, comparison: Comparison) -> Any:
    """Return the spectrum of each drive's error beside that of its noise."""
    go = plotly_objects()
    figure = go.Figure()
    for drive, name in enumerate(residuals.drives):
        noise = comparison.localisation.drives[name].noise
        if noise is None:
            continue
        found = error_spectrum(residuals, drive, noise)
        keep = found.frequency > 0
        frequency, power, background = thinned(found.frequency[keep], found.power[keep],
                                               found.background[keep])
        for label, values, colour in (('error', power, ERROR), ('noise', background, MEASURED)):
            figure.add_trace(go.Scatter(
                x=frequency, y=values, name=f'{name}: {label}', mode='lines',
                meta={'drive': name}, line={'color': colour, 'width': 1.2},
                hovertemplate=f'%{{y:.3g}} {_power(residuals.units_of(name).effort)}'))
    return _over_frequency(figure, 360, f'power [{_power(residuals.unit)}]')


def curves_of(residuals: Residuals, *values: Array) -> tuple[Array, ...]:
    """Return times and curves of all segments at the same samples, with breaks between them."""
    at = shown_samples(residuals, *values)
    is_break = at < 0
    # A screen shows no more than single precision holds.
    curves: list[Any] = [np.where(is_break, np.nan, one[at]).astype(np.float32) for one in values]
    return residuals.time[np.where(is_break, np.roll(at, 1), at)], *curves


def shown_samples(residuals: Residuals, *values: Array, points: int = POINTS,
                  ) -> np.typing.NDArray[np.int_]:
    """Return the samples that are drawn of curves, as `thinned`; -1 after each segment."""
    segments = np.unique(residuals.segment)
    parts: list[np.typing.NDArray[np.int_]] = []
    for segment in segments:
        inside = np.flatnonzero(residuals.segment == segment)
        at = extremes(*(one[inside] for one in values), points=max(50, points // len(segments)))
        parts += [inside[at], np.array([-1])]
    return np.concatenate(parts)
