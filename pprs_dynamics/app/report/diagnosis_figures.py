# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Plotly figures of a diagnosis: before and after, one per finding, what effects contribute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np

from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.comparison_figures import (
    along,
    axis_of,
    curves_of,
    effort_over_error,
    middles,
)
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.fit_curve import curve_variable
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.statements import UNITS, Statement
from pprs_dynamics.inference.residuals.profiles import bin_edges, bin_of, error_profile
from pprs_dynamics.inference.residuals.residuals import Residuals

POINTS = 400  # of a curve, and of the errors around it
FINE_BINS = 24
# Of the variance of an effect, what means over bins of a variable must explain to draw it along it.
LEAST_TELLING = 0.5
SPAN = 5.0  # [s], of what is drawn over time
Integers = np.typing.NDArray[np.int_]
TIME = {'title': 'time [s]', **charts.SECONDS}
AFTER, FLOOR, OTHER = '#009E73', '#1a1a1a', '#bbbbbb'


def before_and_after(before: Residuals, after: Residuals, drive: int, floor: float) -> Any:
    """Return measured effort with both models above, and both errors below."""
    time, measured, given, found = curves_of(
        before, before.measured[:, drive], before.model[:, drive], after.model[:, drive])
    figure = effort_over_error(
        before, drive, time,
        (('measured', measured, charts.MEASURED), ('input model', given, charts.ERROR),
         ('model with the reported effects', found, AFTER)),
        (('error of the input model', measured - given, charts.ERROR),
         ('error with the reported effects', measured - found, AFTER)))
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
    seen = curve_variable(after, answer.request)
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
    """Return what each effect contributes to each drive over time.

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
    """Add what each effect contributes, on the drive that is chosen."""
    size = sum(np.mean(force ** 2, axis=0) for force in forces.values())
    acting = [name for d, name in enumerate(residuals.drives) if size[d] > 0]
    page.menu('Drive', acting, residuals.drives[int(np.argmax(size))])
    page.figure(contributions(residuals, forces), caption, over_time=True)


def effect_pictures(diagnosis: Diagnosis, found: FoundEffect, remaining: Array,
                    ) -> list[tuple[Any, str]]:
    """Return what one effect has to explain and what it makes of it, with captions.

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
            charts.trace(x, _means(force, bin_of(values, profile.edges), len(profile.mean)),
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
        explained = float(np.nanvar(_means(force, place, FINE_BINS)[place]))
        if explained > most:
            best, most = name, explained
    return best


def _means(values: Array, place: Integers, count: int) -> Array:
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
    """Return the shape of what remains along what it depends on."""
    noise = diagnosis.noise.get(statement.drive)
    return None if noise is None else along(
        with_error(diagnosis.residuals, diagnosis.remaining), noise, statement, 'what remains')
