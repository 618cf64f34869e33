# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A model's ledger in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import Any

from rich.console import Group
from rich.markup import escape

from pprs_dynamics.app.report.terminal import text_table
from pprs_dynamics.inference.diagnosis.quantities import with_uncertainty
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, Step
from pprs_dynamics.system.plain_text import counted

MOST_LISTED = 3  # numbers of the model that a line names
BAR = 24  # characters, of the largest error


def history_view(steps: Sequence[Step], unit: str = 'N') -> Group:
    """Return the ledger: the error's fall first, then what each step was made from."""
    return Group(*_parts(steps, unit))


def step_rows(steps: Sequence[Step]) -> list[tuple[str, ...]]:
    """Return one row of text per step; the page and the terminal show them."""
    return [(str(number), step.effect, ', '.join(step.drives) or 'structure',
             f'{step.error_before:.3f}', f'{step.error_after:.3f}', f'{step.held_out_before:.3f}',
             f'{step.held_out_after:.3f}', held_out(step), step.date[:10])
            for number, step in enumerate(steps, start=1)]


def noise_of(steps: Sequence[Step]) -> float:
    """Return the noise as the last diagnosis had it."""
    return steps[-1].noise_floor


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
        found.append(f'{counted(len(step.calibrated), "number of the model")} moved as well: '
                     f'{_first_of(step.calibrated)}')
    if step.rivals:
        found.append(f'{", ".join(step.rivals)} would explain the recordings as well')
    if step.forced:
        found.append(f'forced, in spite of this: {"; ".join(step.objections)}')
    return [one for one in found if one]


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
        again = f' (on other recordings {step.error_before:.3f} before)' if number > 1 and (
            step.sha256 != steps[number - 2].sha256) else ''
        on = f' on {", ".join(step.drives)}' if step.drives else ''
        rows.append((f'{number}', escape(f'+ {step.effect}{on}{again}'),
                     f'{step.error_after:.3f}', f'{step.held_out_after:.3f}',
                     _bar(step.error_after, largest, 'green')))
    noise = noise_of(steps)
    rows.append(('', 'noise', f'{noise:.3f}', '', _bar(noise, largest, 'white')))
    yield text_table(('', 'effect', 'error', 'held out', ''), rows, right=(2, 3),
                     whole=(0, 2, 3, 4), frame='head',
                     title=f'Error of the model, rms [{unit}], as effects were added')
    for number, step in enumerate(steps, start=1):
        yield f'[bold]{number}. {escape(step.effect)}[/]'
        for line in details(step):
            yield f'   {escape(line)}'


def _bar(value: float, largest: float, colour: str) -> str:
    full = BAR * value / largest if largest > 0 else 0.0
    return f'[{colour}]{"█" * round(full) or "▏"}[/]'
