# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The ledger of a model, in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import Any

from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import PlainTable, escape, stacked, text_table
from pprs_dynamics.inference.diagnosis.quantities import change, in_unit, with_uncertainty
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, Step
from pprs_dynamics.system.plain_text import counted

MOST_LISTED = 3  # numbers of the model that a line names
BAR = 24  # characters, of the largest error


def history_view(steps: Sequence[Step], unit: str = 'N') -> Any:
    """Return the ledger: the error's fall first, then what each step was made from."""
    return stacked(*_parts(steps, unit))


def steps_table(steps: Sequence[Step], unit: str) -> PlainTable:
    """Return every step with its errors."""
    return ('step', 'effect', 'on', f'error before [{unit}]', f'after [{unit}]',
            f'held out before [{unit}]', f'after [{unit}]', 'held out', 'date'), [
        (str(number), step.effect, ', '.join(step.drives) or 'structure',
         f'{step.error_before:.3f}', f'{step.error_after:.3f}', f'{step.held_out_before:.3f}',
         f'{step.held_out_after:.3f}', held_out(step), step.date[:10])
        for number, step in enumerate(steps, start=1)]


def held_out(step: Step) -> str:
    """Return what was held out."""
    return (', '.join(step.validation) or 'validation' if step.held_out_on == 'validation'
            else 'blocks')


def details(step: Step) -> list[str]:
    """Return what a step was made from, in sentences."""
    values = [f'{name} = {with_uncertainty(value, inf if std >= NOT_KNOWN else std, unit)}'
              for name, value, std, unit in zip(step.parameters, step.values, step.std,
                                                step.units, strict=False) if value]
    spans = [f'{name} ({last - first:.1f} s, sha256 {digest[:12]}…)'
             for name, digest, first, last in zip(
                 step.recordings, step.sha256, step.spans[::2], step.spans[1::2], strict=False)]
    found = [', '.join(values), f'from {", ".join(spans)}; {step.date}, version {step.version}']
    if step.calibrated:
        found.append(f'{counted(len(step.calibrated), "number of the model")} changed as well: '
                     f'{_first_of(step.calibrated)}')
    if step.rivals:
        found.append(f'rivals, which explain the recordings as well: {", ".join(step.rivals)}')
    if step.forced:
        found.append(f'adopted in spite of objections: {"; ".join(step.objections)}')
    return [entry for entry in found if entry]


def _first_of(labels: Sequence[str]) -> str:
    more = len(labels) - MOST_LISTED
    return ', '.join([*labels[:MOST_LISTED], f'{more} more'] if more > 0 else labels)


def _parts(steps: Sequence[Step], unit: str) -> Iterator[Any]:
    if not steps:
        yield 'No effect was added to this model yet.'
        return
    largest = max(max(step.error_before, step.error_after) for step in steps)
    rows = [('', 'before', f'{steps[0].error_before:.3f}', f'{steps[0].held_out_before:.3f}',
             _bar(steps[0].error_before, largest, 'red'))]
    for number, step in enumerate(steps, start=1):
        again = f' (before, on its own recordings: {step.error_before:.3f})' if number > 1 and (
            step.sha256 != steps[number - 2].sha256) else ''
        on = f' on {", ".join(step.drives)}' if step.drives else ''
        rows.append((f'{number}', escape(f'{_sign(step)} {step.effect}{on}{again}'),
                     f'{step.error_after:.3f}', f'{step.held_out_after:.3f}',
                     _bar(step.error_after, largest, 'green')))
    noise = steps[-1].noise_floor
    rows.append(('', 'noise', f'{noise:.3f}', '', _bar(noise, largest, 'white')))
    yield text_table(('', 'effect', 'error', 'held out', ''), rows, right=(2, 3),
                     whole=(0, 2, 3, 4), frame='head',
                     title=f'Error of the model, rms [{unit}], as effects were added')
    for number, step in enumerate(steps, start=1):
        yield f'[bold]{number}. {escape(step.effect)}[/]'
        for line in details(step):
            yield f'   {escape(line)}'


def _sign(step: Step) -> str:
    """Return what a step did to an effect: added or set it, or took it out."""
    return '-' if step.removed else '+'


def _bar(value: float, largest: float, colour: str) -> str:
    full = BAR * value / largest if largest > 0 else 0.0
    return f'[{colour}]{"█" * round(full) or "▏"}[/]'


def history_page(name: str, steps: Sequence[Step], unit: str = 'N') -> Page:
    """Return the page of the ledger of a model file."""
    page = Page(f'History of {name}')
    if not steps:
        page.text('No effect was added to this model yet.', 'lead')
        return page
    first, last = steps[0], steps[-1]
    noise = last.noise_floor
    page.text(f'{counted(len(steps), "step")}: the error '
              f'{change(first.error_before, last.error_after, unit)}; the noise is '
              f'{in_unit(noise, unit)}.',
              'lead')
    page.errors([ErrorRow('as given', first.error_before, first.held_out_before, noise),
                 *(ErrorRow(f'{_sign(step)} {step.effect}', step.error_after,
                            step.held_out_after, noise) for step in steps)],
                f'Error, rms [{unit}], after each step. Grey: on the recordings; blue: on '
                'held-out data; dotted: the noise.', ('recordings', 'held out'))
    page.table(*steps_table(steps, unit))
    for number, step in enumerate(steps, start=1):
        page.heading(f'{number}. {step.effect}')
        page.bullets(details(step))
    return page
