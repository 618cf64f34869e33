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

"""The page of a model's ledger."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.diagnosis.quantities import change, counted, newtons
from pprs_dynamics.model.ledger import Step
from pprs_dynamics.report.history_figures import falling_error_by_drive
from pprs_dynamics.report.history_tables import details, noise_of, step_rows
from pprs_dynamics.report.page import ErrorRow, Page

HEADINGS = ('step', 'effect', 'on', 'error before [N]', 'after [N]', 'held out before [N]',
            'after [N]', 'held out', 'date')


def history_page(name: str, steps: Sequence[Step]) -> Page:
    """Return the page of the ledger of a model file."""
    page = Page(f'How {name} came to be')
    if not steps:
        page.text('No effect was added to this model yet.', 'lead')
        return page
    first, last = steps[0], steps[-1]
    noise = noise_of(steps)
    page.text(f'{counted(len(steps), "step")}: the error '
              f'{change(first.error_before, last.error_after)}; the noise is {newtons(noise)}.',
              'lead')
    page.errors([ErrorRow('as given', first.error_before, first.held_out_before, noise),
                 *(ErrorRow(f'+ {step.effect}', step.error_after, step.held_out_after, noise)
                   for step in steps)],
                'Error, rms [N], after each step. Grey: on the recordings; blue: on held-out data; '
                'dotted: the noise.', ('recordings', 'held out'))
    page.table(HEADINGS, step_rows(steps))
    for number, step in enumerate(steps, start=1):
        page.heading(f'{number}. {step.effect}')
        page.bullets(details(step))
    if first.measured:
        with page.fold('Drive by drive'):
            page.figure(falling_error_by_drive(steps), 'Error of every drive after each step.')
    return page
