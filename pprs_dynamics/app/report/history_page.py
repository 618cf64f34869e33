# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page of a model's ledger."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.app.report.history_figures import falling_error_by_drive
from pprs_dynamics.app.report.history_tables import details, noise_of, step_rows
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.inference.diagnosis.quantities import change, in_unit
from pprs_dynamics.physics.model.ledger import Step
from pprs_dynamics.system.plain_text import counted


def _headings(unit: str) -> tuple[str, ...]:
    return ('step', 'effect', 'on', f'error before [{unit}]', f'after [{unit}]',
            f'held out before [{unit}]', f'after [{unit}]', 'held out', 'date')


def history_page(name: str, steps: Sequence[Step], unit: str = 'N') -> Page:
    """Return the page of the ledger of a model file."""
    page = Page(f'How {name} came to be')
    if not steps:
        page.text('No effect was added to this model yet.', 'lead')
        return page
    first, last = steps[0], steps[-1]
    noise = noise_of(steps)
    page.text(f'{counted(len(steps), "step")}: the error '
              f'{change(first.error_before, last.error_after, unit)}; the noise is '
              f'{in_unit(noise, unit)}.',
              'lead')
    page.errors([ErrorRow('as given', first.error_before, first.held_out_before, noise),
                 *(ErrorRow(f'+ {step.effect}', step.error_after, step.held_out_after, noise)
                   for step in steps)],
                f'Error, rms [{unit}], after each step. Grey: on the recordings; blue: on '
                'held-out data; dotted: the noise.', ('recordings', 'held out'))
    page.table(_headings(unit), step_rows(steps))
    for number, step in enumerate(steps, start=1):
        page.heading(f'{number}. {step.effect}')
        page.bullets(details(step))
    if first.measured:
        with page.fold('Drive by drive'):
            page.figure(falling_error_by_drive(steps, unit),
                        'Error of every drive after each step.')
    return page
