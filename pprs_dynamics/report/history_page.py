"""The page of a model's ledger."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.model.ledger import Step
from pprs_dynamics.report.history_figures import falling_error, falling_error_by_drive
from pprs_dynamics.report.history_tables import details, step_rows
from pprs_dynamics.report.page import Page

HEADINGS = ('step', 'effect', 'on', 'error before [N]', 'after [N]', 'held out before [N]',
            'after [N]', 'held out', 'date')


def history_page(name: str, steps: Sequence[Step]) -> Page:
    """Return the page of the ledger of a model file."""
    page = Page(f'How {name} came to be')
    if not steps:
        page.text('No effect was added to this model yet.', 'lead')
        return page
    first, last = steps[0], steps[-1]
    page.text(f'{len(steps)} step{"s" * (len(steps) > 1)}: the error fell from '
              f'{first.error_before:.4g} to {last.error_after:.4g} N; noise leaves '
              f'{min(step.noise_floor for step in steps):.4g} N.', 'lead')
    page.table(HEADINGS, step_rows(steps))
    page.heading('The error falls')
    page.figure(falling_error(steps))
    if first.measured:
        page.heading('Drive by drive')
        page.figure(falling_error_by_drive(steps))
    for number, step in enumerate(steps, start=1):
        page.heading(f'{number}. {step.effect}')
        page.bullets(details(step))
    return page
