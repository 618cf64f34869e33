# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer to a requested effect in the terminal, drawn with rich."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Group
from rich.markup import escape
from rich.panel import Panel

from pprs_dynamics.app.report.terminal import text_table
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.loop import AdoptionRun
from pprs_dynamics.inference.diagnosis.quantities import in_unit, plain, with_uncertainty
from pprs_dynamics.system.plain_text import counted

MOST_SHOWN = 6  # values without --details
MOST_REMARKS = 2


def adoption_view(answer: Adoption, details: bool = False) -> Group:
    """Return what the terminal shows, most important first; all there is with `details`."""
    return Group(*(_parts if details else _brief)(answer))


def run_view(run: AdoptionRun, details: bool = False) -> Group:
    """Return what was adopted and refused, a line each, or all of each, and why it ended."""
    steps = [adoption_view(step, True) if details else escape(headline(step))
             for step in run.steps]
    return Group(*steps, f'[bold]{run.ended}[/]: {escape(run.reason)}')


def _brief(answer: Adoption) -> Iterator[Any]:
    """Yield the answer, the fall of the error and the first values, in at most 20 lines."""
    yield _verdict(answer)
    held = 'held-out recordings' if answer.held_out_on == VALIDATION else 'held-out blocks'
    for label, before, after in (('recordings', answer.error_before, answer.error_after),
                                 (held, answer.held_out_before, answer.held_out_after)):
        yield f'  error on {label}: {plain(before)} → {plain(after)} {answer.unit}'
    yield f'  noise: {in_unit(answer.noise_floor, answer.unit)}'
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
    """Return what was measured on, errors before and after, and their change."""
    held = ('validation recordings' if answer.held_out_on == VALIDATION
            else 'held-out blocks of the recordings')
    return [(label, f'{before:.3f}', f'{after:.3f}',
             f'{after / before - 1:+.1%}' if before else '') for label, before, after in (
                 ('recordings', answer.error_before, answer.error_after),
                 (held, answer.held_out_before, answer.held_out_after))]


def _parts(answer: Adoption) -> Iterator[Any]:
    yield _verdict(answer)
    yield _table('Error, rms over samples and drives',
                 ('on', f'before [{answer.unit}]', f'after [{answer.unit}]', 'change'),
                 error_rows(answer),
                 f'the noise is {in_unit(answer.noise_floor, answer.unit)}')
    rows = parameter_rows(answer)
    if rows:
        yield _table(f'{answer.effect}, ± two standard deviations', ('parameter', 'value'), rows)
    if answer.adopted and answer.calibrated:
        clear = [one for one in answer.calibrated if abs(one.after - one.before) > 2 * one.std]
        told = f', clearly {", ".join(one.label for one in clear)}' if clear else ''
        yield escape(f'{counted(len(answer.calibrated), "number of the model")} moved as well'
                     f'{told}')
    for remark in answer.remarks:
        yield f'[yellow]![/] {escape(remark)}'


def _table(title: str, headings: tuple[str, ...], rows: Sequence[tuple[str, ...]],
           caption: str | None = None) -> Any:
    return text_table(headings, [tuple(map(escape, row)) for row in rows], frame='head',
                      title=escape(title), caption=caption and escape(caption),
                      caption_justify='left')
