# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The page of a fitted base model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.diagnosis.quantities import sentence
from pprs_dynamics.identification.base_fit import BaseFit
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.report.fit_tables import HELD_OUT, NUMBERS, error_rows, number_rows
from pprs_dynamics.report.page import ErrorRow, Page


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
