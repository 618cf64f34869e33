# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Plotly figures of a comparison: over time, against variables, over the workspace, spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.app.report import charts
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.comparison import Comparison
from pprs_dynamics.inference.diagnosis.statements import Statement, in_words, read_in
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.profiles import Profile, error_profile, error_spectrum
from pprs_dynamics.inference.residuals.residuals import Residuals

FINE_BINS = 24
VARIABLES = ('velocity', 'position', 'acceleration', 'load', 'rod_angle', 'time', 'platform_x',
             'platform_y', 'platform_z', 'platform_tilt', 'platform_turn')


def over_time(residuals: Residuals, drive: int) -> Any:
    """Return measured and model above, their difference below."""
    time, measured, model = curves_of(residuals, residuals.measured[:, drive],
                                      residuals.model[:, drive])
    return effort_over_error(
        residuals, drive, time,
        (('measured', measured, charts.MEASURED), ('model', model, charts.MODEL)),
        (('measured minus model', measured - model, charts.ERROR),))


Named = tuple[str, Array, str]
"""Name, values and colour of a curve."""


def effort_over_error(residuals: Residuals, drive: int, time: Array, efforts: Sequence[Named],
                      errors: Sequence[Named]) -> Any:
    """Return efforts of a drive above errors, over one time axis."""
    name = residuals.drives[drive]
    units = residuals.units_of(name)
    figure = charts.rows_over_time(
        2, 400, (0.6, 0.4), hovermode='x unified', margin={**charts.MARGIN, 't': 55},
        legend={**charts.LEGEND, 'title': {'text': f'<b>{name}</b>'}})
    for row, (what, curves) in enumerate((('effort', efforts), ('error', errors)), start=1):
        figure.update_yaxes(title_text=f'{what} [{units.effort}]', row=row, col=1)
        for label, values, colour in curves:
            # Errors of models that are named above need no names of their own.
            figure.add_trace(
                charts.trace(time, values, label, colour, hovertemplate=charts.hover(units),
                             showlegend=row == 1 or len(errors) == 1), row=row, col=1)
    return figure


def against_variables(residuals: Residuals, comparison: Comparison) -> list[tuple[Any, str]]:
    """Return mean error over bins of every variable with its uncertainty, and captions."""
    figures = []
    for name in VARIABLES:
        if residuals.variable(name, 0) is None:
            continue
        traces = []
        for drive, drive_name in enumerate(residuals.drives):
            noise = comparison.localisation.noise.get(drive_name)
            profile = None if noise is None else error_profile(residuals, drive, name, noise)
            if profile is not None:
                traces.append(_means(profile, name, residuals, drive_name, {'drive': drive_name}))
        figure = charts.figure(traces, 240, margin={**charts.MARGIN, 't': 10}, showlegend=False,
                               xaxis_title=axis_of(name, residuals)[1],
                               yaxis_title=f'mean error [{residuals.unit}]')
        figure.add_hline(y=0, line={'color': charts.MEASURED, 'width': 0.8})
        figures.append((figure, f'Against {in_words(name)}.'))
    return figures


def _means(profile: Profile, variable: str, residuals: Residuals, drive: str,
           meta: Any = None) -> Any:
    factor, unit = read_in(variable, residuals.units_of(variable.partition(' of ')[2] or drive))
    effort = charts.hover(residuals.units_of(drive))
    return charts.trace(
        factor * middles(profile), profile.mean, 'mean', charts.ERROR, 2, mode='lines+markers',
        meta=meta, marker={'size': 5},
        error_y=charts.deviations(profile.uncertainty),
        hovertemplate=f'%{{x:.4g}} {unit}: {effort}<extra></extra>')


def middles(profile: Profile) -> Array:
    """Return the middles of a profile's bins, in SI units."""
    return (profile.edges[1:] + profile.edges[:-1]) / 2


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
    drive = residuals.drives.index(statement.drive)
    if statement.variable == 'frequency':
        return _line(residuals, noise, statement, what)
    variable = 'velocity' if statement.variable == 'direction' else statement.variable
    profile = _profile(residuals, drive, variable, noise)
    if profile is None:
        return None
    units = residuals.units_of(statement.drive)
    factor, label = axis_of(variable, residuals, statement.drive)
    trace = _means(profile, variable, residuals, statement.drive)
    figure = charts.figure([trace], 300, margin={**charts.MARGIN, 't': 15}, showlegend=False,
                           xaxis_title=label,
                           yaxis_title=f'mean {what} on {statement.drive} [{units.effort}]')
    if statement.range is not None and statement.variable == variable:
        low, high = (factor * end for end in statement.range)
        figure.add_vrect(x0=low, x1=high, fillcolor=charts.MARK, opacity=0.15, line_width=0)
    figure.add_hline(y=0, line={'color': charts.MEASURED, 'width': 0.8})
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
    unit = _power(residuals.units_of(statement.drive).effort)
    figure = _over_frequency(_spectra(residuals, statement.drive, noise), 300,
                             f'{what} on {statement.drive} [{unit}]')
    if statement.range is not None:
        figure.add_vrect(x0=0.98 * statement.range[0], x1=1.02 * statement.range[1],
                         fillcolor=charts.MARK, opacity=0.3, line_width=0)
    return figure


def _spectra(residuals: Residuals, drive: str, noise: NoiseSpectrum) -> list[Any]:
    """Return the spectra of the error and of the noise of a drive."""
    found = error_spectrum(residuals, residuals.drives.index(drive), noise)
    keep = found.frequency > 0
    frequency, power, background = charts.thinned(found.frequency[keep], found.power[keep],
                                                  found.background[keep])
    unit = _power(residuals.units_of(drive).effort)
    return [charts.trace(frequency, values, f'{drive}: {label}', colour, 1.2,
                         meta={'drive': drive}, hovertemplate=f'%{{y:.3g}} {unit}')
            for label, values, colour in (('error', power, charts.ERROR),
                                          ('noise', background, charts.MEASURED))]


def _over_frequency(traces: list[Any], height: int, title: str) -> Any:
    return charts.figure(
        traces, height, hovermode='x unified',
        xaxis={'type': 'log', 'title': 'frequency [Hz]', 'dtick': 1, 'ticksuffix': ' Hz',
               'showticksuffix': 'last'},
        yaxis={'type': 'log', 'title': title, 'exponentformat': 'e', 'dtick': 1})


def _power(unit: str) -> str:
    return f'({unit})²/Hz' if ' ' in unit else f'{unit}²/Hz'


def axis_of(variable: str, residuals: Residuals, drive: str = '') -> tuple[float, str]:
    """Return factor from SI and label of an axis: of one drive, or of all."""
    chosen = variable.partition(' of ')[2] or drive
    found = list(dict.fromkeys(read_in(variable, residuals.units_of(entry)) for entry in (
        (chosen,) if chosen else residuals.drives)))
    unit = ' or '.join(unit for _, unit in found)
    return found[0][0], f'{in_words(variable)} [{unit}]'


def spectrum(residuals: Residuals, comparison: Comparison) -> Any:
    """Return the spectra of error and noise of each drive."""
    noises = {name: comparison.localisation.noise.get(name) for name in residuals.drives}
    return _over_frequency([trace for name, noise in noises.items() if noise is not None
                            for trace in _spectra(residuals, name, noise)], 360,
                           f'power [{_power(residuals.unit)}]')


def curves_of(residuals: Residuals, *values: Array) -> tuple[Array, ...]:
    """Return times and curves of all segments at the same samples, with breaks between them."""
    at = shown_samples(residuals, *values)
    is_break = at < 0
    # A screen shows no more than single precision holds.
    curves: list[Any] = [np.where(is_break, np.nan, value[at]).astype(np.float32)
                         for value in values]
    return residuals.time[np.where(is_break, np.roll(at, 1), at)], *curves


def shown_samples(residuals: Residuals, *values: Array, points: int = charts.POINTS,
                  ) -> np.typing.NDArray[np.int_]:
    """Return the samples that are drawn of curves, as `thinned`; -1 after each segment."""
    segments = np.unique(residuals.segment)
    parts: list[np.typing.NDArray[np.int_]] = []
    for segment in segments:
        inside = np.flatnonzero(residuals.segment == segment)
        at = charts.extremes(*(value[inside] for value in values),
                             points=max(50, points // len(segments)))
        parts += [inside[at], np.array([-1])]
    return np.concatenate(parts)
