"""The page that shows what a model gained by an effect, and what remains."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.adoption.adopt import Adoption
from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.error_steps import ErrorStep
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.report.adoption_tables import error_rows, headline, parameter_rows
from pprs_dynamics.report.comparison_figures import LINES, curve
from pprs_dynamics.report.diagnosis_figures import before_and_after, waterfall
from pprs_dynamics.report.page import Page, plotly_objects
from pprs_dynamics.residuals.paired_errors import rms_by_drive
from pprs_dynamics.residuals.residuals import Residuals


def adoption_page(answer: Adoption, recordings: Sequence[Recording],
                  validation: Sequence[Recording]) -> Page:
    """Return the page of one adoption, or refusal, most important first."""
    before, after = answer.residuals_before, answer.residuals_after
    page = Page(f'{answer.effect}: ' + ('added to the model' if answer.adopted else 'refused'))
    page.text(headline(answer), 'lead')
    held = (f' Held out: {", ".join(one.name for one in validation)}.' if validation else '')
    page.text(f'Model: {Path(answer.before.source).name or "built in memory"}. Recordings: '
              f'{", ".join(one.name for one in recordings)}.{held}', 'note')
    page.table(('error on', 'before [N]', 'after [N]', 'change'), error_rows(answer))
    page.bullets(answer.remarks)
    page.heading('The error falls')
    page.text('Root of the mean square; dashed is the noise.', 'note')
    page.figure(waterfall([_step('model as given', before), _step(answer.effect, after)],
                          before.drives, answer.noise_floor, answer.noise_floors))
    if answer.parameters:
        page.heading('What it is')
        page.table(('parameter', 'value', '± 2 standard deviations', 'unit'),
                   parameter_rows(answer))
    parts = _contributions(answer, after)
    if parts is not None:
        page.heading('What each added effect contributes')
        page.figure(parts)
    page.heading('Before and after')
    for drive, name in enumerate(before.drives):
        if name in answer.noise_floors:
            page.figure(before_and_after(before, after, drive, answer.noise_floors[name]))
    if answer.calibrated:
        page.heading('Numbers of the model that move within their tolerances')
        page.table(('number', 'before', 'after', 'unit'),
                   [(one.label, f'{one.before:.6g}', f'{one.after:.6g} ± {2 * one.std:.2g}',
                     one.unit) for one in answer.calibrated])
    return page


def _step(label: str, residuals: Residuals) -> ErrorStep:
    return ErrorStep(label, float(np.sqrt(np.nanmean(residuals.error ** 2))), _by_drive(residuals))


def _by_drive(residuals: Residuals) -> Array:
    found = rms_by_drive(residuals)
    return np.array([found.get(drive, np.nan) for drive in residuals.drives])


def _contributions(answer: Adoption, residuals: Residuals) -> Any | None:
    """Return the forces of added effects over time, a menu of drives; None for none."""
    go = plotly_objects()
    names = [effect.name for effect in answer.after.effects
             if isinstance(effect, CatalogueEffect) and effect.name in residuals.parts]
    figure, owners = go.Figure(), list[int]()
    for drive in range(len(residuals.drives)):
        for number, name in enumerate(names):
            force = residuals.parts[name][:, drive]
            if np.any(force):
                time, shown = curve(residuals, force)
                figure.add_trace(go.Scatter(
                    x=time, y=shown, name=name, mode='lines', showlegend=True,
                    visible=not owners or owners[0] == drive,
                    line={'color': LINES[number % len(LINES)], 'width': 1.3}))
                owners.append(drive)
    if not owners:
        return None
    figure.update_layout(
        template='plotly_white', height=340, xaxis_title='time [s]', yaxis_title='force [N]',
        margin={'l': 60, 'r': 20, 't': 50, 'b': 45}, updatemenus=[{
            'x': 0.0, 'y': 1.02, 'xanchor': 'left', 'yanchor': 'bottom', 'buttons': [
                {'label': residuals.drives[drive], 'method': 'update',
                 'args': [{'visible': [owner == drive for owner in owners]}]}
                for drive in sorted(set(owners))]}])
    return figure
