"""Plotly figures of a comparison: over time, against variables, over the workspace, spectrum."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.comparison import Comparison
from pprs_dynamics.report.page import plotly_objects
from pprs_dynamics.residuals.profiles import error_profile, error_spectrum
from pprs_dynamics.residuals.residuals import Residuals

MEASURED, MODEL, ERROR, MARK = '#666666', '#0072B2', '#D55E00', '#E69F00'
LINES = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9')
POINTS = 1500  # pairs of extremes shown per curve; a screen has fewer columns
WORST_SPANS = 3
WORST_DURATION = 1.0  # [s]
MAP_CELLS = 20
# The variables shown, with their units as axis labels.
VARIABLES = {
    'velocity': 'velocity [m/s]', 'position': 'position [m]',
    'acceleration': 'acceleration [m/s²]', 'load': 'guide load [N]',
    'rod_angle': 'rod angle [rad]', 'time': 'time [s]', 'platform_x': 'platform x [m]',
    'platform_y': 'platform y [m]', 'platform_z': 'platform z [m]',
    'platform_tilt': 'platform tilt [rad]', 'platform_turn': 'platform turn [rad]'}


def thinned(time: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Return at most 2 `points` samples that keep every peak: the extremes of equal spans.

    Samples that are not finite are left out where their span has others.
    """
    if len(time) <= 2 * points:
        return time, values
    edges = np.linspace(0, len(time), points + 1).astype(int)
    kept = []
    for start, stop in pairwise(edges.tolist()):
        part = values[start:stop]
        if np.isfinite(part).any():
            kept += sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))})
        else:
            kept.append(start)
    return time[kept], values[kept]


def over_time(residuals: Residuals, drive: int, worst: list[tuple[float, float]]) -> Any:
    """Return measured and model above, their difference below, the worst spans marked."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=[0.6, 0.4])
    curves = (('measured', residuals.measured, MEASURED, 1), ('model', residuals.model, MODEL, 1),
              ('measured minus model', residuals.error, ERROR, 2))
    for name, values, colour, row in curves:
        time, shown = curve(residuals, values[:, drive])
        figure.add_trace(go.Scatter(x=time, y=shown, name=name, mode='lines',
                                    line={'color': colour, 'width': 1.3}), row=row, col=1)
    for start, end in worst:
        figure.add_vrect(x0=start, x1=end, fillcolor=MARK, opacity=0.25, line_width=0)
    figure.update_yaxes(title_text='effort [N]', row=1, col=1)
    figure.update_yaxes(title_text='error [N]', row=2, col=1)
    figure.update_xaxes(title_text='time [s]', row=2, col=1)
    figure.update_layout(template='plotly_white', height=430, title=residuals.drives[drive],
                         hovermode='x unified', legend={'orientation': 'h', 'y': 1.12, 'x': 0.3},
                         margin={'l': 60, 'r': 20, 't': 60, 'b': 45})
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


def against_variables(residuals: Residuals, comparison: Comparison) -> Any:
    """Return mean error over bins of every variable, with its uncertainty; a menu of drives."""
    go = plotly_objects()
    from plotly.subplots import make_subplots

    names = [name for name in VARIABLES if residuals.variable(name, 0) is not None]
    columns = 3
    rows = -(-len(names) // columns)
    figure = make_subplots(rows=rows, cols=columns, vertical_spacing=0.09,
                           horizontal_spacing=0.07)
    owners = []
    for drive, drive_name in enumerate(residuals.drives):
        noise = comparison.localisation.drives[drive_name].noise
        for number, name in enumerate(names):
            profile = None if noise is None else error_profile(residuals, drive, name, noise)
            if profile is None:
                continue
            middle = (profile.edges[1:] + profile.edges[:-1]) / 2
            figure.add_trace(go.Scatter(
                x=middle, y=profile.mean, mode='lines+markers', visible=drive == 0,
                line={'color': ERROR}, marker={'size': 5}, showlegend=False,
                error_y={'type': 'data', 'array': 2 * profile.uncertainty, 'width': 0,
                         'thickness': 1},
                hovertemplate='%{x:.4g}: %{y:.4f} N<extra></extra>'),
                row=number // columns + 1, col=number % columns + 1)
            owners.append(drive)
    for number, name in enumerate(names):
        place = {'row': number // columns + 1, 'col': number % columns + 1}
        figure.update_xaxes(title_text=VARIABLES[name], title_standoff=4, **place)
        figure.add_hline(y=0, line={'color': MEASURED, 'width': 0.8}, **place)
    figure.update_yaxes(title_text='mean error [N]', col=1)
    figure.update_layout(template='plotly_white', height=260 * rows + 60,
                         margin={'l': 60, 'r': 20, 't': 50, 'b': 45},
                         updatemenus=[_menu(residuals.drives, owners)])
    return figure


def over_workspace(residuals: Residuals) -> Any | None:
    """Return the rms error over the platform's x and y, a menu of drives; None on one axis."""
    go = plotly_objects()
    x, y = residuals.variables.get('platform_x'), residuals.variables.get('platform_y')
    if x is None or y is None or np.ptp(x) == 0 or np.ptp(y) == 0:
        return None
    edges = [np.linspace(axis.min(), axis.max(), MAP_CELLS + 1) for axis in (x, y)]
    names = ('all drives', *residuals.drives)
    figure = go.Figure()
    for number in range(len(names)):
        error = residuals.error if number == 0 else residuals.error[:, number - 1:number]
        known = np.isfinite(error)
        squares, count = np.where(known, error, 0.0) ** 2, known.sum(axis=1)
        total = np.histogram2d(x, y, edges, weights=squares.sum(axis=1))[0]
        samples = np.histogram2d(x, y, edges, weights=count)[0]
        rms = np.sqrt(np.divide(total, samples, out=np.full_like(total, np.nan),
                                where=samples > 0))
        figure.add_trace(go.Heatmap(
            x=edges[0], y=edges[1], z=rms.T, visible=number == 0, colorscale='Cividis',
            colorbar={'title': 'rms [N]'}, hovertemplate='%{z:.3f} N<extra></extra>'))
    figure.update_layout(
        template='plotly_white', height=520, xaxis_title='platform x [m]',
        yaxis_title='platform y [m]', margin={'l': 60, 'r': 20, 't': 50, 'b': 45},
        updatemenus=[_menu(names, list(range(len(names))))])
    figure.update_yaxes(scaleanchor='x')
    return figure


def spectrum(residuals: Residuals, comparison: Comparison) -> Any:
    """Return the error's spectrum beside what its own noise would have; a menu of drives."""
    go = plotly_objects()
    figure, owners = go.Figure(), []
    for drive, name in enumerate(residuals.drives):
        noise = comparison.localisation.drives[name].noise
        if noise is None:
            continue
        found = error_spectrum(residuals, drive, noise)
        for label, power, colour in (('error', found.power, LINES[drive % len(LINES)]),
                                     ('its noise model', found.background, MEASURED)):
            keep = found.frequency > 0
            frequency, shown = thinned(found.frequency[keep], power[keep])
            figure.add_trace(go.Scatter(x=frequency, y=shown, name=f'{name}: {label}',
                                        mode='lines', visible=drive == 0,
                                        line={'color': colour, 'width': 1.2}))
            owners.append(drive)
    figure.update_layout(
        template='plotly_white', height=400, xaxis={'type': 'log', 'title': 'frequency [Hz]'},
        yaxis={'type': 'log', 'title': 'power [N²/Hz]', 'exponentformat': 'power'},
        margin={'l': 70, 'r': 20, 't': 50, 'b': 45},
        legend={'orientation': 'h', 'y': 1.1, 'x': 0.3},
        updatemenus=[_menu(residuals.drives, owners)])
    return figure


def curve(residuals: Residuals, values: Array) -> tuple[Array, Array]:
    """Return a thinned curve of all segments, with a break between them."""
    segments = np.unique(residuals.segment)
    times, shown = [], []
    for segment in segments:
        inside = residuals.segment == segment
        time, part = thinned(residuals.time[inside], values[inside],
                             max(50, POINTS // len(segments)))
        times += [time, time[-1:]]
        shown += [part, np.array([np.nan])]
    return np.concatenate(times), np.concatenate(shown)


def _menu(names: Any, owners: list[int]) -> dict[str, Any]:
    return {'x': 0.0, 'y': 1.0, 'xanchor': 'left', 'yanchor': 'bottom', 'buttons': [
        {'label': name, 'method': 'update',
         'args': [{'visible': [owner == number for owner in owners]}]}
        for number, name in enumerate(names)]}
