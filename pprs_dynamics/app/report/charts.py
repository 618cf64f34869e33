# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Common parts of Plotly figures: colours, layout, lines, rows, thinned samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits, common_unit
from pprs_dynamics.errors import optional_library
from pprs_dynamics.measurement.files.recording import Recording

MEASURED, MODEL, ERROR, MARK = '#666666', '#0072B2', '#D55E00', '#E69F00'
LINES = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9')
POINTS = 1500  # pairs of extremes shown per curve; a screen has fewer columns
MARGIN = {'l': 70, 'r': 15, 't': 30, 'b': 40}
LEGEND = {'orientation': 'h', 'y': 1.02, 'x': 0.0, 'yanchor': 'bottom', 'xanchor': 'left'}
# The unit is at the last tick and in the cursor's text.
SECONDS = {'ticksuffix': ' s', 'showticksuffix': 'last', 'hoverformat': '.3f'}


def plotly_objects() -> Any:
    """Return plotly.graph_objects, or raise MissingLibraryError."""
    return optional_library('plotly.graph_objects', 'plotly', 'the report', 'report')


def figure(traces: Iterable[Any], height: int, **layout: Any) -> Any:
    """Return a figure with the margins and the legend of all, where the layout says no other."""
    figure = plotly_objects().Figure(list(traces))
    figure.update_layout(height=height, **{'margin': MARGIN, 'legend': LEGEND, **layout})
    return figure


def rows_over_time(count: int, height: int, heights: Sequence[float] | None = None,
                   titles: Sequence[str] = (), **layout: Any) -> Any:
    """Return a figure of so many rows over one time axis [s]; `heights`: shares of its height."""
    plotly_objects()
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=count, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=heights, subplot_titles=titles or None)
    figure.update_xaxes(**SECONDS)
    figure.update_xaxes(title_text='time [s]', row=count, col=1)
    figure.update_layout(height=height, **{'margin': MARGIN, 'legend': LEGEND, **layout})
    return figure


def recording_rows(recording: Recording, units: Sequence[DriveUnits],
                   ) -> dict[str, dict[str, Array]]:
    """Return positions and efforts of every drive, by quantity."""
    return {f'{what} [{common_unit(units, unit)}]': dict(
        zip(recording.drives, values.T, strict=True)) for what, unit, values in (
            ('position', 'm', recording.position), ('effort', 'N', recording.effort))}


def stacked(time: Array, rows: Mapping[str, Mapping[str, Array]], height: int = 200) -> Any:
    """Return a figure with a row of named curves over time [s] for each quantity."""
    figure = rows_over_time(len(rows), height * len(rows) + 80, margin={**MARGIN, 't': 40})
    colours: dict[str, str] = {}
    for row, (label, curves) in enumerate(rows.items(), start=1):
        for name, values in curves.items():
            times, shown = thinned(time, values)
            is_new = name not in colours
            colour = colours.setdefault(name, LINES[len(colours) % len(LINES)])
            figure.add_trace(trace(times, shown, name, colour, legendgroup=name,
                                   showlegend=is_new), row=row, col=1)
        figure.update_yaxes(title_text=label, row=row, col=1)
    return figure


def trace(x: Any, y: Any, name: str, colour: str, width: float = 1.3, **options: Any) -> Any:
    """Return a trace of a figure: a line, or what options of Plotly's Scatter make of it."""
    return plotly_objects().Scatter(**{
        'x': x, 'y': y, 'name': name, 'mode': 'lines', 'line': {'color': colour, 'width': width},
        **options})


def deviations(values: Array) -> dict[str, Any]:
    """Return error bars of two standard deviations."""
    return {'type': 'data', 'array': 2 * values, 'width': 0, 'thickness': 1}


def hover(units: DriveUnits) -> str:
    """Return the template of the cursor's text for an effort."""
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
