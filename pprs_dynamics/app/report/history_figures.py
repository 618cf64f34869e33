# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The error's fall from step to step: drive by drive for a page, and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.app.report.comparison_figures import LEGEND, LINES, MARGIN
from pprs_dynamics.app.report.figures import BLUE, GREY, RED, finish, pyplot_module, save
from pprs_dynamics.app.report.history_tables import noise_of
from pprs_dynamics.app.report.page import plotly_objects
from pprs_dynamics.physics.model.ledger import Step


def _levels(steps: Sequence[Step]) -> tuple[list[str], list[float], list[float], float]:
    """Return labels, errors on recordings and on held-out data, and the noise."""
    labels = ['before', *(f'{number}. {step.effect}' for number, step in enumerate(steps, 1))]
    return (labels, [steps[0].error_before, *(step.error_after for step in steps)],
            [steps[0].held_out_before, *(step.held_out_after for step in steps)],
            noise_of(steps))


def falling_error_by_drive(steps: Sequence[Step], unit: str) -> Any:
    """Return the error on every drive that was measured all along, after each step."""
    go = plotly_objects()
    labels = _levels(steps)[0]
    figure = go.Figure()
    for number, drive in enumerate(steps[0].measured):
        if all(drive in step.measured for step in steps):
            errors = [steps[0].drive_errors_before[number],
                      *(step.drive_errors_after[step.measured.index(drive)] for step in steps)]
            figure.add_trace(go.Scatter(x=labels, y=errors, name=drive, mode='lines+markers',
                                        hovertemplate=f'%{{y:.3f}} {unit}',
                                        line={'color': LINES[number % len(LINES)]}))
    figure.update_layout(height=360, yaxis={'title': f'error, rms [{unit}]', 'rangemode': 'tozero'},
                         margin=MARGIN, legend=LEGEND)
    return figure


def draw_history(path: str | PathLike[str], steps: Sequence[Step], unit: str = 'N') -> Path:
    """Draw the falling error into a PNG file."""
    drawing = pyplot_module()
    figure, axis = drawing.subplots(figsize=(8, 4), layout='constrained')
    if steps:
        labels, fitted, held, noise = _levels(steps)
        places = range(len(labels))
        axis.bar([place - 0.2 for place in places], fitted, 0.4, color=BLUE, label='recordings')
        axis.bar([place + 0.2 for place in places], held, 0.4, color=RED, label='held out')
        axis.axhline(noise, ls='--', color=GREY, label=f'noise {noise:.3g}')
        axis.set_xticks(list(places), labels, rotation=20, ha='right')
    axis.set(ylabel=f'error, rms [{unit}]', title='Error of the model as effects were added')
    finish(axis)
    return save(drawing, figure, path)
