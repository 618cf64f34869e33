# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pictures of results for notebooks, drawn with matplotlib."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.app.report.figures import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, SKY
from pprs_dynamics.errors import MissingLibraryError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What noise explains is in the background; the rest in colours that stay apart in grey print.
COLOURS = {'noise': '#BBBBBB', 'error': BLUE, 'before': BLUE, 'held out': RED}
OTHERS = (ORANGE, GREEN, PURPLE, SKY)
LINES = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY)
MOST_POINTS = 4000  # of a line; more than a picture has columns
WIDTH, HEIGHT = 8.0, 3.0  # of a row [in]
RESOLUTION = 100  # dots per inch


def new_figure(rows: int) -> Figure:
    """Return a figure with one axis in each row, which notebooks show whatever is set up.

    It belongs to no window: the backend that a notebook or program has chosen stays.
    """
    try:
        from matplotlib.figure import Figure as AnyFigure
    except ImportError:
        raise MissingLibraryError('matplotlib', 'drawing', 'notebook') from None

    class NotebookFigure(AnyFigure):
        def _repr_png_(self) -> bytes:
            content = io.BytesIO()
            self.savefig(content, format='png', dpi=RESOLUTION)
            return content.getvalue()

    figure = NotebookFigure(figsize=(WIDTH, rows * HEIGHT), layout='constrained')
    for axis in np.atleast_1d(figure.subplots(rows, 1)):
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    return figure


def plot_errors(errors: Mapping[str, Mapping[str, float]], unit: str, rows: int = 1) -> Figure:
    """Return a figure with a group of bars for every drive in its first row.

    Parameters
    ----------
    errors : mapping of str to mapping of str to float
        By what the bar is ('before', 'noise', …) and drive, rms.
    unit : str
    rows : int
        Of the figure; the others stay empty.
    """
    figure = new_figure(rows)
    axis = figure.axes[0]
    drives = list(next(iter(errors.values())))
    width = 0.8 / len(errors)
    others = iter(OTHERS)
    for k, (name, values) in enumerate(errors.items()):
        places = np.arange(len(drives)) + (k - (len(errors) - 1) / 2) * width
        axis.bar(places, [values.get(drive, np.nan) for drive in drives], 0.92 * width,
                 label=name, color=COLOURS.get(name) or next(others))
    axis.set_xticks(range(len(drives)), drives)
    axis.set_ylabel(f'rms [{unit}]')
    axis.legend(frameon=False, loc='upper left', bbox_to_anchor=(1.0, 1.0))
    return figure


def plot_series(axis: Any, time: ArrayLike, lines: Mapping[str, ArrayLike], label: str) -> None:
    """Draw lines over time [s]."""
    step = max(1, len(np.asarray(time)) // MOST_POINTS)
    for colour, (name, values) in zip(LINES * (1 + len(lines) // len(LINES)), lines.items(),
                                      strict=False):
        axis.plot(np.asarray(time)[::step], np.asarray(values)[::step], lw=0.9, color=colour,
                  label=name)
    axis.set(xlabel='time [s]', ylabel=label)
    axis.legend(frameon=False, loc='upper left', bbox_to_anchor=(1.0, 1.0))


def plot_over_time(time: ArrayLike, rows: Mapping[str, Mapping[str, ArrayLike]]) -> Figure:
    """Return a figure with a row of lines over time for each quantity."""
    figure = new_figure(len(rows))
    for axis, (label, lines) in zip(figure.axes, rows.items(), strict=True):
        plot_series(axis, time, lines, label)
    return figure
