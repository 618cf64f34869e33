"""The error's fall from step to step, as a Plotly figure and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.model.ledger import Step
from pprs_dynamics.report.comparison_figures import LINES
from pprs_dynamics.report.figures import BLUE, GREY, RED, finish, pyplot_module, save
from pprs_dynamics.report.page import plotly_objects


def _levels(steps: Sequence[Step]) -> tuple[list[str], list[float], list[float], float]:
    """Return labels, errors on recordings and on held-out data, and the noise, [N].

    What a fit leaves is noise only once nothing is missing: the least of all steps is nearest.
    """
    labels = ['before', *(f'{number}. {step.effect}' for number, step in enumerate(steps, 1))]
    return (labels, [steps[0].error_before, *(step.error_after for step in steps)],
            [steps[0].held_out_before, *(step.held_out_after for step in steps)],
            min(step.noise_floor for step in steps))


def falling_error(steps: Sequence[Step]) -> Any:
    """Return the error on recordings and on held-out data after each step, with the noise."""
    go = plotly_objects()
    labels, fitted, held, noise = _levels(steps)
    figure = go.Figure([
        go.Bar(x=labels, y=fitted, name='recordings', marker={'color': BLUE}),
        go.Bar(x=labels, y=held, name='held out', marker={'color': RED})])
    figure.add_hline(y=noise, line={'color': GREY, 'dash': 'dash', 'width': 1.5},
                     annotation={'text': f'noise {noise:.3g}'})
    figure.update_layout(template='plotly_white', height=380, barmode='group',
                         yaxis={'title': 'error, rms [N]', 'rangemode': 'tozero'},
                         margin={'l': 60, 'r': 20, 't': 30, 'b': 45})
    return figure


def falling_error_by_drive(steps: Sequence[Step]) -> Any:
    """Return the same on every drive that was measured all along."""
    go = plotly_objects()
    labels = _levels(steps)[0]
    figure = go.Figure()
    for number, drive in enumerate(steps[0].measured):
        if all(drive in step.measured for step in steps):
            errors = [steps[0].drive_errors_before[number],
                      *(step.drive_errors_after[step.measured.index(drive)] for step in steps)]
            figure.add_trace(go.Scatter(x=labels, y=errors, name=drive, mode='lines+markers',
                                        line={'color': LINES[number % len(LINES)]}))
    figure.update_layout(template='plotly_white', height=380,
                         yaxis={'title': 'error, rms [N]', 'rangemode': 'tozero'},
                         margin={'l': 60, 'r': 20, 't': 30, 'b': 45})
    return figure


def draw_history(path: str | PathLike[str], steps: Sequence[Step]) -> Path:
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
    axis.set(ylabel='error, rms [N]', title='Error of the model as effects were added')
    finish(axis)
    return save(drawing, figure, path)
