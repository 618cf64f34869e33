# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A fitted base model, in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import PlainTable, escape, plain_rows, stacked, text_table
from pprs_dynamics.inference.diagnosis.quantities import plain, sentence, word_little
from pprs_dynamics.inference.fit.base_fit import HALVES, RECORDINGS, VALIDATION, BaseFit
from pprs_dynamics.physics.model.drive_model import DriveModel

HELD_OUT = {RECORDINGS: 'each recording predicted from the others',
            HALVES: 'each half of the recording predicted from the other',
            VALIDATION: 'the validation recordings'}


def errors_table(model: DriveModel, fit: BaseFit) -> PlainTable:
    """Return drives, units, errors before, after and held out."""
    return ('drive', 'unit', 'before', 'after', 'held out'), [
        (drive, unit.effort, plain(fit.before[drive]), plain(fit.after[drive]),
         plain(fit.held_out[drive]) if drive in fit.held_out else '')
        for drive, unit in zip(model.drives, model.units, strict=True) if drive in fit.after]


def numbers_table(fit: BaseFit) -> PlainTable:
    """Return the fitted numbers."""
    return ('number', 'drive', 'before', 'after', '± two std', 'unit'), [
        (number.key, number.drive, plain(number.before), plain(number.after),
         plain(2 * number.std) if isfinite(number.std) else '', number.unit)
        for number in fit.numbers]


def fit_view(model: DriveModel, fit: BaseFit, details: bool = False) -> Any:
    """Return what the terminal shows: errors and notes; with `details` every number."""
    errors = text_table(*plain_rows(errors_table(model, fit)), right=(2, 3, 4),
                        title=f'Error, rms; held out: {HELD_OUT[fit.held_out_on]}')
    numbers = [text_table(*plain_rows(numbers_table(fit)), right=(2, 3, 4))] if details else []
    headline = [escape(f'{word_little(fit.little)}, fitted nevertheless')] if fit.little else []
    return stacked(*headline, errors, *map(escape, fit.notes), *numbers)


def fit_page(model: DriveModel, fit: BaseFit, recordings: Sequence[str],
             validate: Sequence[str]) -> Page:
    """Return the page of one fit.

    Parameters
    ----------
    model : DriveModel
        As it was.
    fit : BaseFit
    recordings, validate : sequence of str
        Names.
    """
    page = Page('Base model')
    if fit.little:
        page.text(sentence(f'{word_little(fit.little)}, fitted nevertheless'), 'lead')
    page.sources(model.source, recordings, validate)
    page.errors([ErrorRow(name, fit.before[name], after, None)
                 for name, after in fit.after.items()],
                'Error, rms, before (grey) and with the fitted numbers (blue).')
    page.table(*errors_table(model, fit))
    page.text(f'Held out: {HELD_OUT[fit.held_out_on]}.', 'note')
    page.bullets([sentence(entry) for entry in fit.notes])
    with page.fold('Every number'):
        page.table(*numbers_table(fit))
    return page
