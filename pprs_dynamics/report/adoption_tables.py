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

"""The answer to a requested effect in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich import box
from rich.console import Group
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from pprs_dynamics.adoption.adopt import VALIDATION, Adoption
from pprs_dynamics.diagnosis.quantities import counted, newtons, plain, with_uncertainty

MOST_SHOWN = 6  # values without --details
MOST_REMARKS = 2


def adoption_view(answer: Adoption, details: bool = False) -> Group:
    """Return what the terminal shows, most important first; all there is with `details`."""
    return Group(*(_parts if details else _brief)(answer))


def _brief(answer: Adoption) -> Iterator[Any]:
    """Yield the answer, the fall of the error and the first values, in at most 20 lines."""
    yield _verdict(answer)
    held = 'held-out recordings' if answer.held_out_on == VALIDATION else 'held-out blocks'
    for label, before, after in (('recordings', answer.error_before, answer.error_after),
                                 (held, answer.held_out_before, answer.held_out_after)):
        yield f'  error on {label}: {plain(before)} → {plain(after)} N'
    yield f'  noise: {newtons(answer.noise_floor)}'
    rows = parameter_rows(answer)
    for key, text in rows[:MOST_SHOWN]:
        yield f'  {escape(key)} = {escape(text)}'
    if len(rows) > MOST_SHOWN:
        yield f'  … and {len(rows) - MOST_SHOWN} more, with --details'
    for remark in answer.remarks[:MOST_REMARKS]:
        yield f'[yellow]![/] {escape(remark)}'


def _verdict(answer: Adoption) -> Panel:
    word, colour = (('refused', 'red') if not answer.adopted else
                    ('forced', 'yellow') if answer.forced else ('adopted', 'green'))
    return Panel(escape(headline(answer)), title=f'[bold {colour}]{word}[/]', border_style=colour,
                 title_align='left')


def headline(answer: Adoption) -> str:
    """Return the answer in a sentence."""
    on = f' on {", ".join(answer.drives)}' if answer.drives else ''
    if not answer.adopted:
        return f'{answer.effect}{on} is refused: {answer.reason}.'
    if answer.forced:
        return f'{answer.effect}{on} is adopted by force, in spite of this: {answer.reason}.'
    return f'{answer.effect}{on} is adopted: {answer.reason}.'


def parameter_rows(answer: Adoption) -> list[tuple[str, str]]:
    """Return each parameter that is not 0, and its value ± two standard deviations."""
    return [(key, with_uncertainty(one.value, one.std, one.unit))
            for key, one in answer.parameters.items() if one.value != 0.0]


def error_rows(answer: Adoption) -> list[tuple[str, str, str, str]]:
    """Return what was measured on, errors before and after [N], and their change."""
    held = ('validation recordings' if answer.held_out_on == VALIDATION
            else 'held-out blocks of the recordings')
    return [(label, f'{before:.3f}', f'{after:.3f}',
             f'{after / before - 1:+.1%}' if before else '') for label, before, after in (
                 ('recordings', answer.error_before, answer.error_after),
                 (held, answer.held_out_before, answer.held_out_after))]


def _parts(answer: Adoption) -> Iterator[Any]:
    yield _verdict(answer)
    yield _table('Error, rms over samples and drives',
                 ('on', 'before [N]', 'after [N]', 'change'), error_rows(answer),
                 f'the noise is {newtons(answer.noise_floor)}')
    rows = parameter_rows(answer)
    if rows:
        yield _table(f'{answer.effect}, ± two standard deviations', ('parameter', 'value'), rows)
    if answer.adopted and answer.calibrated:
        clear = [one for one in answer.calibrated if abs(one.after - one.before) > 2 * one.std]
        told = f', clearly {", ".join(one.label for one in clear)}' if clear else ''
        yield escape(f'{counted(len(answer.calibrated), "number of the model")} moved within '
                     f'tolerance{told}')
    for remark in answer.remarks:
        yield f'[yellow]![/] {escape(remark)}'


def _table(title: str, headings: tuple[str, ...], rows: list[tuple[str, ...]] | Any,
           caption: str | None = None) -> Table:
    table = Table(title=escape(title), title_justify='left', title_style='bold',
                  box=box.SIMPLE_HEAD, caption=caption and escape(caption), caption_justify='left')
    for number, heading in enumerate(headings):
        table.add_column(escape(heading), justify='left' if number == 0 else 'right')
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table
