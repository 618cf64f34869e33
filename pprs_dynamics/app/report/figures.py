# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Plotly figures of models against measurements: over time and variables, spectra, effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np

from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.diagnosis.comparison import Comparison
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.statements import UNITS, Statement, in_words, read_in
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.profiles import (
    Profile,
    bin_edges,
    bin_of,
    error_profile,
    error_spectrum,
)
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording

FINE_BINS = 24
POINTS = 400  # of a curve, and of the errors around it
# Of the variance of an effect, what means over bins of a variable must explain to draw it along it.
LEAST_TELLING = 0.5
SPAN = 5.0  # [s], of what is drawn over time
Integers = np.typing.NDArray[np.int_]
TIME = {'title': 'time [s]', **charts.SECONDS}
AFTER, FLOOR, OTHER = '#009E73', '#1a1a1a', '#bbbbbb'


def recording_page(recording: Recording, units: Sequence[DriveUnits]) -> Page:
    """Return a page with positions and efforts of every drive over time."""
    page = Page(recording.name)
    page.figure(charts.stacked(recording.time, charts.recording_rows(recording, units), 300),
                'Position and effort of every drive.', over_time=True)
    return page


def before_and_after(before: Residuals, after: Residuals, drive: int, floor: float) -> Any:
    """Return measured effort with both models above, and both errors below."""
    time, measured, given, found = curves_of(
        before, before.measured[:, drive], before.model[:, drive], after.model[:, drive])
    figure = effort_over_error(
        before, drive, time,
        (('measured', measured, charts.MEASURED), ('input model', given, charts.ERROR),
         ('model with the effects', found, AFTER)),
        (('error of the input model', measured - given, charts.ERROR),
         ('error with the effects', measured - found, AFTER)))
    for level in (-2 * floor, 2 * floor):
        figure.add_hline(y=level, row=2, col=1, line={'color': FLOOR, 'width': 1, 'dash': 'dot'})
    return figure


def add_every_drive(page: Page, before: Residuals, after: Residuals,
                    floors: Mapping[str, float], models: str) -> None:
    """Add both errors of every drive that has a noise floor, folded."""
    with page.fold('Every drive over time, before and after'):
        page.text('Dotted: two standard deviations of the noise. Drag to zoom, on all drives at '
                  'once; double-click to return.', 'note')
        for drive, name in enumerate(before.drives):
            if name in floors:
                page.figure(before_and_after(before, after, drive, floors[name]),
                            f'{name}: effort and error, {models}.', over_time=True)


def curve_with_band(answer: Adoption) -> Any:
    """Return a measured curve over its variable, its band, and the errors without it."""
    assert answer.curve is not None
    after, curve = answer.residuals_after, answer.curve.curve
    drive = after.drives.index(answer.request.drive)
    seen = after.variable(curve.variable, drive)
    assert seen is not None
    factor, label = axis_of(curve.variable, after, answer.request.drive)
    left = after.error[:, drive] + curve.force(seen)
    shown = np.linspace(0, len(seen) - 1, min(len(seen), POINTS)).astype(int)
    x = np.linspace(curve.start, curve.end, POINTS)
    y, band = curve.force(x), 2 * answer.curve.band(x)
    units = after.units_of(answer.request.drive)
    return charts.figure([
        charts.trace(factor * seen[shown], left[shown], 'without it', OTHER, mode='markers',
                     marker={'size': 3, 'color': OTHER}, hoverinfo='skip'),
        charts.trace(factor * np.concatenate((x, x[::-1])),
                     np.concatenate((y + band, (y - band)[::-1])), 'two standard deviations',
                     AFTER, 0, fill='toself', fillcolor='rgba(0, 158, 115, 0.25)',
                     hoverinfo='skip'),
        charts.trace(factor * x, y, 'measured curve', AFTER, 1.5,
                     hovertemplate=charts.hover(units))],
        300, xaxis_title=label, yaxis_title=f'{answer.request.drive} [{units.effort}]')


def contributions(residuals: Residuals, forces: dict[str, Any]) -> Any:
    """Return a figure of each effect's contribution to each drive over time.

    Parameters
    ----------
    residuals : Residuals
    forces : mapping of str to (M, D) array
        By name [N].
    """
    traces = []
    for drive, drive_name in enumerate(residuals.drives):
        acting = {name: force[:, drive] for name, force in forces.items()
                  if np.any(force[:, drive])}
        if not acting:
            continue
        time, *curves = curves_of(residuals, *acting.values())
        for name, values, colour in zip(acting, curves, cycle(charts.LINES), strict=False):
            traces.append(charts.trace(
                time, values, name, colour, showlegend=True, meta={'drive': drive_name},
                hovertemplate=charts.hover(residuals.units_of(drive_name))))
    return charts.figure(traces, 320, hovermode='x unified', xaxis=TIME,
                         yaxis_title=f'force [{residuals.unit}]')


def add_contributions(page: Page, residuals: Residuals, forces: dict[str, Any], caption: str,
                      ) -> None:
    """Add the contributions of effects on the drive that is chosen in a menu."""
    size = sum(np.mean(force ** 2, axis=0) for force in forces.values())
    acting = [name for d, name in enumerate(residuals.drives) if size[d] > 0]
    page.menu('Drive', acting, residuals.drives[int(np.argmax(size))])
    page.figure(contributions(residuals, forces), caption, over_time=True)


def effect_pictures(diagnosis: Diagnosis, found: FoundEffect, remaining: Array,
                    ) -> list[tuple[Any, str]]:
    """Return pictures of an effect: the error without it and its force, with captions.

    The first is over the variable that the effect depends on; the last is over time. `remaining` is
    the residual of the row of the effect, (M, D) [N].
    """
    d = int(np.argmax(np.sum(found.force ** 2, axis=0)))
    force, drive = found.force[:, d], diagnosis.residuals.drives[d]
    residuals = with_error(diagnosis.residuals, remaining + found.force)
    units = residuals.units_of(drive)
    without, hover = 'measured minus the other effects', charts.hover(units)
    layout = {'hovermode': 'x unified', 'yaxis': {
        'title': f'force on {drive} [{units.effort}]', 'rangemode': 'tozero'}}
    figures = []
    variable, noise = _most_telling(residuals, d, force), diagnosis.noise.get(drive)
    profile = error_profile(residuals, d, variable, noise, FINE_BINS) if (
        variable and noise is not None) else None
    if profile is not None:
        values = residuals.variable(variable, d)
        assert values is not None
        factor, label = axis_of(variable, residuals, drive)
        x = factor * middles(profile)
        figures.append((charts.figure([
            charts.trace(x, profile.mean, without, charts.MEASURED, mode='markers',
                         marker={'color': charts.MEASURED, 'size': 6}, hovertemplate=hover,
                         error_y=charts.deviations(profile.uncertainty)),
            charts.trace(x, _bin_means(force, bin_of(values, profile.edges), len(profile.mean)),
                         found.name, charts.MODEL, 2, hovertemplate=hover)],
            320, xaxis_title=label, **layout),
            f'{found.name} on {drive}: means over bins with two standard deviations, and the '
            'fitted effect.'))
    span = _largest_span(residuals, force)
    figures.append((charts.figure([
        charts.trace(residuals.time[span], values[span].astype(np.float32), name, colour, width,
                     hovertemplate=hover)
        for name, values, colour, width in (
            (without, residuals.error[:, d], charts.MEASURED, 1.0),
            (found.name, force, charts.MODEL, 2.0))],
        320, xaxis=TIME, **layout), f'{found.name} on {drive}, where it changes most.'))
    return figures


def with_error(residuals: Residuals, error: Array) -> Residuals:
    """Return residuals with another error (M, D) [N] of the same model."""
    return replace(residuals, measured=residuals.model + error, parts={})


def _most_telling(residuals: Residuals, drive: int, force: Array) -> str:
    """Return the variable whose bins explain most of a force's variance; '' for less than half."""
    best, most = '', LEAST_TELLING * float(np.var(force))
    for name in UNITS:
        values = residuals.variable(name, drive)
        if values is None or name == 'time' or np.ptp(values) == 0:
            continue
        place = bin_of(values, bin_edges(values, FINE_BINS))
        explained = float(np.nanvar(_bin_means(force, place, FINE_BINS)[place]))
        if explained > most:
            best, most = name, explained
    return best


def _bin_means(values: Array, place: Integers, count: int) -> Array:
    """Return the means of values in bins; NaN for an empty bin."""
    samples = np.bincount(place, minlength=count)
    total = np.bincount(place, values, minlength=count)
    means: Array = np.divide(total, samples, out=np.full(len(samples), np.nan), where=samples > 0)
    return means


def _largest_span(residuals: Residuals, force: Array) -> slice:
    """Return the samples of `SPAN` in which a force changes most."""
    length = min(len(force), max(2, round(SPAN / residuals.period)))
    energy = np.concatenate(([0.0], np.cumsum((force - force.mean()) ** 2)))
    start = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(start, start + length)


def unknown_picture(diagnosis: Diagnosis, statement: Statement) -> Any | None:
    """Return a picture of the unexplained error over its variable."""
    noise = diagnosis.noise.get(statement.drive)
    return None if noise is None else along(
        with_error(diagnosis.residuals, diagnosis.remaining), noise, statement, 'residual')


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
    for name in UNITS:
        if residuals.variable(name, 0) is None:
            continue
        traces = []
        for drive, drive_name in enumerate(residuals.drives):
            noise = comparison.noise.get(drive_name)
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
           meta: Any = None, name: str = 'mean', colour: str = charts.ERROR) -> Any:
    factor, unit = read_in(variable, residuals.units_of(variable.partition(' of ')[2] or drive))
    effort = charts.hover(residuals.units_of(drive))
    return charts.trace(
        factor * middles(profile), profile.mean, name, colour, 2, mode='lines+markers',
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
    parts = {'mean': residuals}
    if statement.is_directed:
        direction = residuals.variable('direction', drive)
        assert direction is not None
        parts = {name: replace(residuals, measured=np.where(
            (sign * direction > 0)[:, None], residuals.measured, np.nan))
            for name, sign in (('forward', 1), ('backward', -1))}
    traces = [_means(profile, variable, residuals, statement.drive, None, name, colour)
              for (name, part), colour in zip(parts.items(), (charts.ERROR, charts.MODEL),
                                              strict=False)
              if (profile := error_profile(part, drive, variable, noise, FINE_BINS)) is not None]
    if not traces:
        return None
    units = residuals.units_of(statement.drive)
    factor, label = axis_of(variable, residuals, statement.drive)
    figure = charts.figure(traces, 300, showlegend=len(traces) > 1, xaxis_title=label, yaxis={
        'title': f'mean {what}<br>on {statement.drive} [{units.effort}]', 'automargin': True})
    if statement.range is not None and statement.variable == variable:
        for sign in (1, -1) if statement.is_of_speed else (1,):
            low, high = sorted(sign * factor * end for end in statement.range)
            figure.add_vrect(x0=low, x1=high, fillcolor=charts.MARK, opacity=0.15, line_width=0)
    figure.add_hline(y=0, line={'color': charts.MEASURED, 'width': 0.8})
    return figure


def _line(residuals: Residuals, noise: NoiseSpectrum, statement: Statement, what: str) -> Any:
    unit = _power(residuals.units_of(statement.drive).effort)
    # Drawn whichever drive the page's menu shows.
    spectra = [trace.update(meta=None) for trace in _spectra(residuals, statement.drive, noise)]
    figure = _over_frequency(spectra, 300, f'{what}<br>on {statement.drive} [{unit}]')
    if statement.range is not None:
        figure.add_vrect(x0=0.98 * statement.range[0], x1=1.02 * statement.range[1],
                         fillcolor=charts.MARK, opacity=0.3, line_width=0)
    return figure


def _spectra(residuals: Residuals, drive: str, noise: NoiseSpectrum) -> list[Any]:
    """Return the spectra of the error and of the noise of a drive."""
    found = error_spectrum(residuals, residuals.drives.index(drive), noise)
    frequency, power, background = charts.thinned(*(values[found[0] > 0] for values in found))
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
        yaxis={'type': 'log', 'title': title, 'exponentformat': 'e', 'dtick': 1,
               'automargin': True})


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
    noises = {name: comparison.noise.get(name) for name in residuals.drives}
    return _over_frequency([trace for name, noise in noises.items() if noise is not None
                            for trace in _spectra(residuals, name, noise)], 360,
                           f'power [{_power(residuals.unit)}]')


def curves_of(residuals: Residuals, *values: Array) -> tuple[Array, ...]:
    """Return times and curves of all segments at the same samples, with breaks between them."""
    at = shown_samples(residuals, *values)
    is_break = at < 0
    # Single precision is enough for a screen.
    curves: list[Any] = [np.where(is_break, np.nan, value[at]).astype(np.float32)
                         for value in values]
    return residuals.time[np.where(is_break, np.roll(at, 1), at)], *curves


def shown_samples(residuals: Residuals, *values: Array) -> np.typing.NDArray[np.int_]:
    """Return the samples that are drawn of curves, as `thinned`; -1 after each segment."""
    segments = np.unique(residuals.segment)
    parts: list[np.typing.NDArray[np.int_]] = []
    for segment in segments:
        inside = np.flatnonzero(residuals.segment == segment)
        at = charts.extremes(*(value[inside] for value in values),
                             points=max(50, charts.POINTS // len(segments)))
        parts += [inside[at], np.array([-1])]
    return np.concatenate(parts)
