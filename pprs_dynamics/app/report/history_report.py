# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The ledger of a model, in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import Any

from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import escape, stacked, text_table
from pprs_dynamics.inference.diagnosis.quantities import change, in_unit, measured, with_uncertainty
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, Step
from pprs_dynamics.system.plain_text import counted, first_of

NOTHING = 'No effect was added to this model yet.'
MOST_LISTED = 3  # numbers of the model that a line names
BAR = 24  # characters, of the largest error


def history_view(steps: Sequence[Step], unit: str = 'N') -> Any:
    """Return the ledger: the error's fall first, then what each step was made from."""
    return stacked(*_parts(steps, unit)) if steps else NOTHING


def details(step: Step) -> list[str]:
    """Return values, recordings and remarks of a step, in sentences."""
    values = [f'{name} = {with_uncertainty(value, inf if std >= NOT_KNOWN else std, unit)}'
              for name, value, std, unit in zip(step.parameters, step.values, step.std,
                                                step.units, strict=False) if value]
    spans = [f'{name} ({last - first:.1f} s, sha256 {digest[:12]}…)'
             for name, digest, first, last in zip(
                 step.recordings, step.sha256, step.spans[::2], step.spans[1::2], strict=False)]
    held_out = (', '.join(step.validation) or 'validation' if step.held_out_on == 'validation'
                else 'blocks')
    found = [', '.join(values), f'from {", ".join(spans)}; held out: {held_out}; {step.date}, '
             f'version {step.version}']
    if step.calibrated:
        found.append(f'{counted(len(step.calibrated), "number of the model")} changed as well: '
                     f'{first_of(step.calibrated, MOST_LISTED)}')
    if step.rivals:
        found.append(f'rivals, which explain the recordings as well: {", ".join(step.rivals)}')
    if step.forced:
        found.append(f'adopted in spite of objections: {"; ".join(step.objections)}')
    return [entry for entry in found if entry]


def _parts(steps: Sequence[Step], unit: str) -> Iterator[Any]:
    largest = max(max(step.error_before, step.error_after) for step in steps)
    rows = [('', 'before', measured(steps[0].error_before), measured(steps[0].held_out_before),
             _bar(steps[0].error_before, largest, 'red'))]
    rows += [(f'{number}', escape(label), measured(step.error_after), measured(step.held_out_after),
              _bar(step.error_after, largest, 'green'))
             for number, (label, step) in enumerate(_labelled(steps), start=1)]
    noise = steps[-1].noise_floor
    rows.append(('', 'noise', measured(noise), '', _bar(noise, largest, 'white')))
    yield text_table(('', 'effect', 'error', 'held out', ''), rows, right=(2, 3),
                     whole=(0, 2, 3, 4), frame='head',
                     title=f'Error of the model, rms [{unit}], as effects were added')
    for number, step in enumerate(steps, start=1):
        yield f'[bold]{number}. {escape(step.effect)}[/]'
        for line in details(step):
            yield f'   {escape(line)}'


def _labelled(steps: Sequence[Step]) -> Iterator[tuple[str, Step]]:
    """Yield steps after what each did: + for an effect that was added or set, - for one less."""
    for before, step in zip((None, *steps), steps, strict=False):
        on = f' on {", ".join(step.drives)}' if step.drives else ''
        again = f' (before, on its own recordings: {measured(step.error_before)})' if (
            before is not None and step.sha256 != before.sha256) else ''
        yield f'{"-" if step.removed else "+"} {step.effect}{on}{again}', step


def _bar(value: float, largest: float, colour: str) -> str:
    full = BAR * value / largest if largest > 0 else 0.0
    return f'[{colour}]{"█" * round(full) or "▏"}[/]'


def history_page(name: str, steps: Sequence[Step], unit: str = 'N') -> Page:
    """Return the page of the ledger of a model file."""
    page = Page(f'History of {name}')
    if not steps:
        page.text(NOTHING, 'lead')
        return page
    first, last = steps[0], steps[-1]
    noise = last.noise_floor
    page.text(f'{counted(len(steps), "step")}: the error '
              f'{change(first.error_before, last.error_after, unit)}; the noise is '
              f'{in_unit(noise, unit)}.',
              'lead')
    page.errors([ErrorRow('as given', first.error_before, first.held_out_before, noise),
                 *(ErrorRow(label, step.error_after, step.held_out_after, noise)
                   for label, step in _labelled(steps))],
                f'Error, rms [{unit}], after each step. Grey: on the recordings; blue: on '
                'held-out data; dotted: the noise.', ('recordings', 'held out'))
    for number, step in enumerate(steps, start=1):
        page.heading(f'{number}. {step.effect}')
        page.bullets(details(step))
    return page
