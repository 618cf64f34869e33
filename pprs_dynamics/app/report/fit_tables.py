# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables of a fitted base model, for terminal and page."""

from __future__ import annotations

from math import isfinite
from typing import Any

from pprs_dynamics.app.report.terminal import text_table
from pprs_dynamics.inference.diagnosis.quantities import plain
from pprs_dynamics.inference.fit.base_fit import (
    HALVES,
    RECORDINGS,
    VALIDATION,
    BaseFit,
    FittedNumber,
)
from pprs_dynamics.physics.model.force_model import ForceModel

HELD_OUT = {RECORDINGS: 'each recording predicted from the others',
            HALVES: 'each half of the recording predicted from the other',
            VALIDATION: 'the validation recordings'}
NUMBERS = ('number', 'drive', 'before', 'after', '± two std', 'unit')


def error_rows(model: ForceModel, fit: BaseFit) -> list[tuple[str, ...]]:
    """Return rows of drive, unit, error before, after and held out."""
    return [(drive, unit.effort, plain(fit.before[drive]), plain(fit.after[drive]),
             plain(fit.held_out[drive]) if drive in fit.held_out else '')
            for drive, unit in zip(model.drives, model.units, strict=True) if drive in fit.after]


def number_rows(numbers: tuple[FittedNumber, ...]) -> list[tuple[str, ...]]:
    """Return rows of fitted numbers."""
    return [(one.key, one.drive, plain(one.before), plain(one.after),
             plain(2 * one.std) if isfinite(one.std) else '', one.unit) for one in numbers]


def fit_view(model: ForceModel, fit: BaseFit, details: bool = False) -> Any:
    """Return what the terminal shows: errors and notes; with `details` every number."""
    from rich.console import Group
    from rich.markup import escape

    errors = text_table(('drive', 'unit', 'before', 'after', 'held out'), error_rows(model, fit),
                        right=(2, 3, 4), title=f'Error, rms; held out: {HELD_OUT[fit.held_out_on]}')
    numbers = [text_table(NUMBERS, number_rows(fit.numbers), right=(2, 3, 4))] if details else []
    return Group(errors, *map(escape, fit.told), *numbers)
