# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One picture of what an added effect did: the error of every drive, and one drive in detail."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from pprs_dynamics.app.report.pictures import BLUE, GREY, RED, new_figure, save
from pprs_dynamics.inference.residuals.residuals import Residuals

SHOWN = 5.0  # [s] of the drive in detail
Curves = list[tuple[Residuals, str, str]]


def rms_of(error: np.ndarray) -> np.ndarray:
    """Return the rms of each drive's error [N], over samples that were measured."""
    return np.sqrt(np.nanmean(error ** 2, axis=0))


def draw_before_after(
    path: str | PathLike[str], before: Residuals, after: Residuals | None, noise: float,
    sentence: str,
) -> Path:
    """Draw the errors of all drives, and efforts of the drive whose error fell the most.

    Parameters
    ----------
    path : path
        PNG file to write.
    before, after : Residuals
        On one recording. The latter is None where no effect was added.
    noise : float
        rms of what neither model can know, over all drives [N].
    sentence : str
        Heading; it may have several lines.
    """
    figure = new_figure(12, 6)
    axes = figure.subplot_mosaic([['bars', 'effort'], ['bars', 'error']], width_ratios=(2, 3),
                                 height_ratios=(3, 2))
    curves: Curves = [(before, 'input model', RED)]
    if after is not None:
        curves.append((after, 'with the added effect', BLUE))
    _draw_bars(axes['bars'], curves, noise)
    fall = rms_of(before.error) - (0.0 if after is None else rms_of(after.error))
    _draw_drive(axes['effort'], axes['error'], curves, int(np.nanargmax(fall)))
    for axis in axes.values():
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    figure.suptitle('\n'.join(fill(line, 135) for line in sentence.splitlines()), fontsize=11)
    return save(figure, path)


def _draw_bars(axis: Any, curves: Curves, noise: float) -> None:
    drives = curves[0][0].drives
    rows, width = np.arange(len(drives)), 0.8 / len(curves)
    for number, (residuals, label, colour) in enumerate(curves):
        axis.barh(rows + (number - (len(curves) - 1) / 2) * width, rms_of(residuals.error), width,
                  color=colour, label=label)
    axis.axvline(noise, color=GREY, ls='--', lw=1.2, label='noise')
    axis.set_yticks(rows, drives)
    axis.invert_yaxis()
    axis.set(xlabel='measured minus model, rms [N]')
    axis.set_title('error of every drive', loc='left', fontsize=10, fontweight='bold')
    axis.legend(frameon=False, loc='upper center', bbox_to_anchor=(0.5, -0.12), ncols=3,
                fontsize=9)


def _draw_drive(upper: Any, lower: Any, curves: Curves, drive: int) -> None:
    before = curves[0][0]
    shown = _worst(before, drive)
    time = before.time[shown]
    upper.plot(time, before.measured[shown, drive], color='black', lw=0.9, alpha=0.45,
               label='measured')
    for residuals, label, colour in curves:
        upper.plot(time, residuals.model[shown, drive], color=colour, lw=1.4, label=label)
        lower.plot(time, residuals.error[shown, drive], color=colour, lw=0.9)
    lower.axhline(0.0, color=GREY, lw=0.8)
    upper.set(ylabel='effort [N]')
    upper.set_title(f'{before.drives[drive]}, the worst {SHOWN:g} s', loc='left', fontsize=10,
                    fontweight='bold')
    upper.tick_params(labelbottom=False)
    upper.sharex(lower)
    lower.set(xlabel='time [s]', ylabel='measured\nminus model [N]')
    upper.legend(frameon=False, fontsize=8, handlelength=1.2, columnspacing=1.0,
                 loc='lower right', bbox_to_anchor=(1.0, 0.98), ncols=3)


def _worst(residuals: Residuals, drive: int) -> slice:
    """Return the stretch in which the squared error of a drive is largest."""
    count = min(round(SHOWN / residuals.period), len(residuals.time))
    total = np.concatenate(([0.0], np.cumsum(np.nan_to_num(residuals.error[:, drive]) ** 2)))
    start = int(np.argmax(total[count:] - total[:-count]))
    return slice(start, start + count)
