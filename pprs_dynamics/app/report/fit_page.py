# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page of a fitted base model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.app.report.fit_tables import HELD_OUT, NUMBERS, error_rows, number_rows
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.inference.diagnosis.quantities import sentence
from pprs_dynamics.inference.fit.base_fit import BaseFit
from pprs_dynamics.physics.model.force_model import ForceModel


def fit_page(model: ForceModel, fit: BaseFit, recordings: Sequence[str],
             validate: Sequence[str]) -> Page:
    """Return the page of one fit.

    Parameters
    ----------
    model : ForceModel
        As it was.
    fit : BaseFit
    recordings, validate : sequence of str
        Names.
    """
    page = Page('Base model')
    held_out = f'; {", ".join(validate)} held out' if validate else ''
    page.text(f'Model: {Path(model.source).name or "built in memory"}. Fitted to '
              f'{", ".join(recordings)}{held_out}.', 'note')
    page.errors([ErrorRow(name, fit.before[name], after, None)
                 for name, after in fit.after.items()],
                'Error, rms, before (grey) and with the fitted numbers (blue).')
    page.table(('drive', 'unit', 'before', 'after', 'held out'), error_rows(model, fit))
    page.text(f'Held out: {HELD_OUT[fit.held_out_on]}.', 'note')
    page.bullets([sentence(one) for one in fit.told])
    with page.fold('Every number'):
        page.table(NUMBERS, number_rows(fit.numbers))
    return page
