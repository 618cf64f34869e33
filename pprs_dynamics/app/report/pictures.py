# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pictures drawn with matplotlib: of results for notebooks, and into PNG files."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import cycle
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.app.report import charts
from pprs_dynamics.errors import MissingLibraryError
from pprs_dynamics.physics.model.reproduction import Reproduction
from pprs_dynamics.system.files import new_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours that stay apart in grey print and for colour-blind readers (Okabe and Ito).
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = (
    '#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '#56B4E9', '#666666')
# What noise explains is in the background; the rest in colours that stay apart in grey print.
COLOURS = {'noise': '#BBBBBB', 'error': BLUE, 'before': BLUE, 'held out': RED}
OTHERS = (ORANGE, GREEN, PURPLE, SKY)
MOST_POINTS = 4000  # of a line; more than a picture has columns
WIDTH, HEIGHT = 8.0, 3.0  # of a notebook's row [in]
RESOLUTION, FILE_RESOLUTION = 100, 110  # dots per inch, in notebooks and in files


def new_figure(width: float, height: float, extra: str = 'report') -> Figure:
    """Return an empty figure [in], which notebooks show whatever is set up.

    It belongs to no window: the backend that a notebook or program has chosen stays. Where
    matplotlib is missing, MissingLibraryError names the extra that brings it.
    """
    try:
        from matplotlib.figure import Figure as AnyFigure
    except ImportError:
        raise MissingLibraryError('matplotlib', 'drawing', extra) from None

    class NotebookFigure(AnyFigure):
        def _repr_png_(self) -> bytes:
            content = io.BytesIO()
            self.savefig(content, format='png', dpi=RESOLUTION)
            return content.getvalue()

    return NotebookFigure(figsize=(width, height), layout='constrained')


def finish(axis: Any) -> None:
    """Give an axis its grid and its legend at the side."""
    axis.grid(alpha=0.25)
    axis.spines[['top', 'right']].set_visible(False)
    axis.legend(frameon=False, fontsize=9, loc='upper left', bbox_to_anchor=(1.0, 1.0))


def save(figure: Figure, path: str | PathLike[str]) -> Path:
    """Write a picture into a PNG file."""
    file = Path(path)
    with new_file(file) as content:
        figure.savefig(content, dpi=FILE_RESOLUTION, format='png')
    return file


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
    figure = new_figure(WIDTH, rows * HEIGHT, 'notebook')
    axis = np.atleast_1d(figure.subplots(rows, 1))[0]
    drives = list(next(iter(errors.values())))
    width = 0.8 / len(errors)
    others = iter(OTHERS)
    for k, (name, values) in enumerate(errors.items()):
        places = np.arange(len(drives)) + (k - (len(errors) - 1) / 2) * width
        axis.bar(places, [values.get(drive, np.nan) for drive in drives], 0.92 * width,
                 label=name, color=COLOURS.get(name) or next(others))
    axis.set_xticks(range(len(drives)), drives)
    axis.set_ylabel(f'rms [{unit}]')
    finish(axis)
    return figure


def plot_series(axis: Any, time: ArrayLike, lines: Mapping[str, ArrayLike], label: str) -> None:
    """Draw lines over time [s]."""
    step = max(1, len(np.asarray(time)) // MOST_POINTS)
    for colour, (name, values) in zip(cycle(charts.LINES), lines.items(), strict=False):
        axis.plot(np.asarray(time)[::step], np.asarray(values)[::step], lw=0.9, color=colour,
                  label=name)
    axis.set(xlabel='time [s]', ylabel=label)
    finish(axis)


def plot_over_time(time: ArrayLike, rows: Mapping[str, Mapping[str, ArrayLike]]) -> Figure:
    """Return a figure with a row of lines over time for each quantity."""
    figure = new_figure(WIDTH, len(rows) * HEIGHT, 'notebook')
    axes = np.atleast_1d(figure.subplots(len(rows), 1))
    for axis, (label, lines) in zip(axes, rows.items(), strict=True):
        plot_series(axis, time, lines, label)
    return figure


def draw_figure_8(path: str | PathLike[str], result: Reproduction) -> Path:
    """Draw the paper's figure 8: the force of motor 1 without and with friction."""
    figure = new_figure(10.5, 4.5)
    axis = figure.subplots()
    rigid = result.rigid_body[:, 0]
    axis.plot(result.time, rigid, color=SKY, label='$Q_1$: without friction')
    for (approach, passive), colour, style in zip(
            result.passive.items(), (BLUE, RED), ('-', '--'), strict=True):
        total = rigid + result.active[:, 0] + passive[:, 0]
        axis.plot(result.time, total, style, color=colour,
                  label=f'$Q_1^m$: with friction, {_words(approach)}')
    axis.set(xlabel='time [s]', ylabel='force of motor 1 [N]',
             title='Drive force of motor 1 on the helical path (the paper\'s figure 8)')
    finish(axis)
    return save(figure, path)


def draw_figure_9(path: str | PathLike[str], result: Reproduction) -> Path:
    """Draw the paper's figure 9: the additional force of motor 1 and its two parts."""
    figure = new_figure(10.5, 6.5)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    active = result.active[:, 0]
    first, second = result.passive.values()
    upper.plot(result.time, active + first[:, 0], color=BLUE, label=r'$\Delta Q_1$: all friction')
    upper.plot(result.time, active, color=ORANGE, label=r'$\Delta Q_1^m$: active joints')
    upper.plot(result.time, first[:, 0], color=GREEN,
               label=r'$\Delta Q_1^p$: passive joints, first approach')
    upper.plot(result.time, second[:, 0], '--', color=RED,
               label=r'$\Delta Q_1^p$: passive joints, second approach')
    upper.set(ylabel='additional force [N]',
              title='Additional force of motor 1 (the paper\'s figure 9)')
    lower.plot(result.time, np.degrees(result.rod_angle), label=['$u_1$', '$u_2$', '$u_3$'])
    lower.axhline(90, color=GREY, lw=0.8)
    lower.set(xlabel='time [s]', ylabel='rod angle [degrees]',
              title='At 90 degrees the second approach is not defined: gaps in its curve')
    for axis in (upper, lower):
        finish(axis)
    return save(figure, path)


def _words(approach: str) -> str:
    return {'whole_mechanism': 'first approach', 'independent_chains': 'second approach'}[approach]
