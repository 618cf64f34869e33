# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pictures, drawn with matplotlib into PNG files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pprs_dynamics.errors import MissingLibraryError
from pprs_dynamics.physics.model.reproduction import Reproduction
from pprs_dynamics.system.output_files import new_file

# Colours that stay apart in grey print and for colour-blind readers (Okabe and Ito).
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = (
    '#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '#56B4E9', '#666666')


def pyplot_module() -> Any:
    """Return matplotlib.pyplot, drawing into files, or raise MissingLibraryError."""
    try:
        import matplotlib
    except ImportError:
        raise MissingLibraryError('matplotlib', 'drawing', 'report') from None
    matplotlib.use('Agg')
    from matplotlib import pyplot

    return pyplot


def draw_figure_8(path: str | PathLike[str], result: Reproduction) -> Path:
    """Draw the paper's figure 8: the force of motor 1 without and with friction."""
    pyplot = pyplot_module()
    figure, axis = pyplot.subplots(figsize=(10.5, 4.5), layout='constrained')
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
    return save(pyplot, figure, path)


def draw_figure_9(path: str | PathLike[str], result: Reproduction) -> Path:
    """Draw the paper's figure 9: the additional force of motor 1 and its two parts."""
    pyplot = pyplot_module()
    figure, (upper, lower) = pyplot.subplots(
        2, 1, figsize=(10.5, 6.5), sharex=True, layout='constrained', height_ratios=(3, 2))
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
    lower.plot(result.time, np.degrees(result.rod_angle),
               label=['$u_1$', '$u_2$', '$u_3$'])
    lower.axhline(90, color=GREY, lw=0.8)
    lower.set(xlabel='time [s]', ylabel='rod angle [degrees]',
              title='At 90 degrees the second approach is not defined: gaps in its curve')
    for axis in (upper, lower):
        finish(axis)
    return save(pyplot, figure, path)


def _words(approach: str) -> str:
    return {'whole_mechanism': 'first approach', 'independent_chains': 'second approach'}[approach]


def finish(axis: Any) -> None:
    """Give an axis its grid and its legend at the side."""
    axis.grid(alpha=0.25)
    axis.spines[['top', 'right']].set_visible(False)
    axis.legend(frameon=False, fontsize=9, loc='upper left', bbox_to_anchor=(1.0, 1.0))


def save(pyplot: Any, figure: Any, path: str | PathLike[str]) -> Path:
    """Write a picture and close it."""
    file = Path(path)
    with new_file(file) as content:
        figure.savefig(content, dpi=110, format='png')
    pyplot.close(figure)
    return file
