# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What is missing, why we think so, and what it does to the error; in the terminal and as a page.

The terminal is readable from 80 columns on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Any

from pprs_dynamics.app.report import diagnosis_figures as figures
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import (
    escape,
    shell_command,
    stacked,
    text_table,
    titled_table,
    verdict_panel,
)
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, RivalEffect
from pprs_dynamics.inference.diagnosis.quantities import (
    listed,
    name_drives,
    plain,
)
from pprs_dynamics.inference.diagnosis.sentences import (
    Finding,
    FittedValue,
    Sentences,
    detectable_rows,
    fitted_values,
    runner_up,
    set_rows,
    unexplained_groups,
    word_detectable,
)
from pprs_dynamics.inference.residuals.residuals import Residuals, rms, rms_by_drive

COLOURS = {'adequate': 'green', 'effect': 'cyan', 'ambiguous': 'yellow', 'unknown': 'magenta'}
WIDTH = 80
LONGEST = 400  # characters of rows, values and the runner-up without --details: five lines
MOST_EFFECTS = 4  # that are shown without --details
REFIT = 'its own numbers'  # of the model, fitted beside the effects
LEAST_REFIT = 0.01  # share of the error, from which these are listed
EVERYWHERE = 'structure'  # where effects sit that are not on drives
ELSEWHERE = '[dim]Evidence, confirmation and all values: --details, or --report FILE.html[/]'
LEGEND = '[dim]Cost terms: fit = misfit; coefficients = prior; others = model choices[/]'
METHOD = (
    'Model and measured effort are filtered alike. Every effect of the catalogue is a column of '
    'one regression, in each shape and on each drive, together with the free numbers of the model.',
    'Sets of effects are compared by one cost: the penalised deviance under noise that is '
    'correlated in time, plus prior penalties. The spectrum of the noise is fitted for each set. '
    'The evidence of an effect is the cost of the best set without it minus the cost of the '
    'reported set.')


def diagnosis_view(diagnosis: Diagnosis, words: Sentences, details: bool = False,
                   next_step: bool = True) -> Any:
    """Return what the terminal shows, most important first.

    Parameters
    ----------
    diagnosis : Diagnosis
    words : Sentences
        The diagnosis in words.
    details : bool
        Whether all is shown that there is.
    next_step : bool
        Whether the next command is shown.
    """
    return stacked(*(_parts if details else _brief)(diagnosis, words),
                   *(_following(words) if next_step else ()),
                   *(() if details else (ELSEWHERE,)))


def _brief(diagnosis: Diagnosis, words: Sentences) -> Iterator[Any]:
    """Yield verdict, fall and next step, in at most 25 lines of 80 columns."""
    yield verdict_panel(diagnosis.verdict, COLOURS[diagnosis.verdict], words.headline)
    yield from (f'[blue]i[/] {escape(text)}' for text in words.reference)
    second = runner_up(diagnosis)
    room = max(LONGEST - _room(f'Runner-up {second}') - WIDTH * len(diagnosis.effects), WIDTH)
    if diagnosis.effects:
        yield text_table(_headings(diagnosis), _effect_rows(diagnosis)[:MOST_EFFECTS],
                         right=(2, 3, 4), whole=(0, 2, 3, 4), frame='none')
        lines = [f'  {f"{effect} on {drive}" if drive else effect}: {text}'
                 for effect, drive, text in _joined(fitted_values(diagnosis))]
        shown = [line for line, total in zip(lines, accumulate(map(_room, lines)), strict=True)
                 if total <= room]
        yield from map(escape, shown)
        if len(lines) > len(shown):
            yield f'  … values of {len(lines) - len(shown)} more: --details'
    if second:
        yield f'[bold]Runner-up[/] {escape(second)}'
        yield LEGEND
    if diagnosis.verdict == 'adequate' and (seen := word_detectable(diagnosis)):
        yield escape(seen)
    if words.barred:
        yield f'[blue]i[/] {escape(words.barred[0])}'
    if words.warnings:
        yield f'[yellow]![/] {escape(words.warnings[0])}'


def _room(line: str) -> int:
    """Return how many characters a line takes, whole lines of the screen."""
    return -(-len(line) // WIDTH) * WIDTH


def _following(words: Sentences) -> Iterator[Any]:
    """Yield what to do next, and the command for it."""
    yield f'[bold]Next[/] {escape(words.following)}{":" if words.command else ""}'
    if words.command:
        yield shell_command(words.command)


def _parts(diagnosis: Diagnosis, words: Sentences) -> Iterator[Any]:
    """Yield everything that there is."""
    yield verdict_panel(diagnosis.verdict, COLOURS[diagnosis.verdict], words.headline)
    yield from (f'[blue]i[/] {escape(text)}' for text in words.reference)
    if diagnosis.effects:
        yield text_table(_headings(diagnosis), _effect_rows(diagnosis), right=(2, 3, 4),
                         whole=(0, 2, 3, 4), frame='head', title=_held_out(diagnosis))
    for number, finding in enumerate((*words.effects, *words.rivals, *words.unexplained), start=1):
        yield from _finding(number, finding)
    for title, note, headings, rows in _tables(diagnosis):
        yield titled_table(title, (headings, rows), right=())
        yield f'[dim]{escape(note)}[/]'
    for title, lines, colour in _lists(words):
        yield f'[bold {colour}]{title}[/]'
        yield from (_labelled([('-', line)], 1) for line in lines)
        yield ''


def _tables(diagnosis: Diagnosis) -> Iterator[tuple[str, str, Sequence[str],
                                                    Sequence[Sequence[str]]]]:
    """Yield tables with title, note, headings and rows, for the terminal and the page."""
    if values := _joined(fitted_values(diagnosis)):
        yield 'Values', 'Intervals are two standard deviations.', ('effect', 'drive', 'values'), (
            values)
    if diagnosis.sets:
        yield ('The best sets of effects, and their costs above the best',
               'A cost of 10 is odds of 150 to 1. Terms: fit = misfit; coefficients = prior; '
               'others = model choices.', ('cost', 'set', 'terms'),
               [(cost, text, why) for text, cost, why in set_rows(diagnosis)])
    if diagnosis.candidates:
        yield ('Each effect alone', 'An evidence of 0 is the threshold.',
               ('effect', 'evidence', f'error after [{diagnosis.residuals.unit}]', 'on'),
               [(candidate.name, f'{-candidate.cost:.0f}', f'{candidate.error_after:.3f}',
                 sites(candidate.names[0][1], diagnosis)) for candidate in diagnosis.candidates])
    if rows := detectable_rows(diagnosis):
        yield ('Smallest effects that would have been reported', 'Each alone would have cost 10 '
               'less than the answer at the noise of these recordings.', ('effect', 'size'), rows)


def _lists(words: Sentences) -> list[tuple[str, Sequence[str], str]]:
    """Return lists with title, lines and colour, for the terminal and the page."""
    return [(title, lines, colour) for title, lines, colour in (
        ('Calibrated within their tolerance', words.calibrated, 'blue'),
        ('Suspects, which slow noise explains as well', words.suspects, 'yellow'),
        ('Excluded sets', words.barred, 'blue'), ('Warnings', words.warnings, 'yellow')) if lines]


def _held_out(diagnosis: Diagnosis) -> str:
    return 'Effects by error reduction; held out: ' + (
        'the --validate recordings' if diagnosis.held_out_on == 'validation'
        else 'blocks of the same recordings')


def _headings(diagnosis: Diagnosis) -> tuple[str, ...]:
    unit = diagnosis.residuals.unit
    return ('effect', 'on', f'error [{unit}]', f'held out [{unit}]', 'evidence')


def _effect_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (effect.name, sites(effect.drives, diagnosis, effect.places),
         _fall(effect.error_before, effect.error_after),
         _fall(effect.held_out_before, effect.held_out_after), f'{effect.evidence:.0f}')
        for effect in diagnosis.effects]
    given = root_mean_square(diagnosis.residuals.error)
    if abs(diagnosis.refit - given) > LEAST_REFIT * given:
        rows.append((REFIT, '', _fall(given, diagnosis.refit), '', ''))
    return rows


def _joined(values: Sequence[FittedValue]) -> list[tuple[str, str, str]]:
    """Return one row per effect and drive."""
    rows: dict[tuple[str, str], list[str]] = {}
    for value in values:
        rows.setdefault((value.effect, value.drive), []).append(
            f'{value.parameter.symbol} {value.text}')
    return [(effect, drive, ', '.join(texts)) for (effect, drive), texts in rows.items()]


def _finding(number: int, finding: Finding) -> Iterator[Any]:
    yield f'[bold]{number}. {escape(finding.title)}[/]'
    yield _labelled(finding_lines(finding), 8)
    yield ''


def _labelled(lines: Sequence[tuple[str, str]], width: int) -> Any:
    """Return lines of text, each after its label."""
    from rich.table import Table

    grid = Table.grid(padding=(0, 1))
    grid.add_column(style='bold', width=width)
    grid.add_column(ratio=1)
    for label, text in lines:
        grid.add_row(label, escape(text))
    return grid


def finding_lines(finding: Finding) -> list[tuple[str, str]]:
    """Return what a finding says, line by line, with labels."""
    return [('missing', finding.what), ('why', finding.why), ('cause', finding.cause),
            ('confirm', finding.confirm), *(('note', remark) for remark in finding.remarks)]


def sites(drives: tuple[str, ...] | None, diagnosis: Diagnosis,
          places: Sequence[Sequence[str]] = ()) -> str:
    """Return where an effect sits, for a table."""
    if places:
        return listed([listed(names, 'or') for names in places])
    return EVERYWHERE if drives is None else name_drives(drives, diagnosis.residuals.drives)


def _fall(before: float, after: float) -> str:
    colour = 'green' if after < before else 'red'
    return f'{plain(before)} → [{colour}]{plain(after)}[/]'


def diagnosis_page(
    diagnosis: Diagnosis, words: Sentences, after: Residuals, recordings: Sequence[str],
    validation: Sequence[str] = (), rivals: Sequence[RivalEffect] = (),
) -> Page:
    """Return the page: an answer that fits one screen, the rest to be unfolded.

    Parameters
    ----------
    diagnosis : Diagnosis
    words : Sentences
        Of it.
    after : Residuals
        Of `diagnosis.adopted` on the same recordings.
    recordings, validation : sequence of str
        Names of those fitted, and of those held out.
    rivals : sequence of RivalEffect
        As they were given to `word_diagnosis`.
    """
    page = Page(f'Diagnosis: {diagnosis.verdict}')
    page.heading('Result')
    page.text(words.headline, 'lead')
    for text in words.reference:
        page.text(f'{text[:1].upper()}{text[1:]}.')
    page.sources(diagnosis.model.source, recordings, validation)
    with page.columns():
        _errors(page, diagnosis, after)
        _first_picture(page, diagnosis)
    page.command(words.following, words.command)
    page.copy('Copy as Markdown', diagnosis_markdown(diagnosis, words))
    page.folded_list('Warnings', words.warnings, is_open=True)
    page.heading('Evidence')
    _findings(page, diagnosis, words, rivals)
    if diagnosis.effects:
        with page.fold('Contribution of each effect'):
            page.table(_headings(diagnosis), _plain(_effect_rows(diagnosis)),
                       caption=f'{_held_out(diagnosis)}.')
            figures.add_contributions(page, diagnosis.residuals, {
                effect.name: effect.force for effect in diagnosis.effects},
                'Contribution of each effect.')
    figures.add_every_drive(page, diagnosis.residuals, after, diagnosis.noise_floors,
                            'with the input model and with the reported effects')
    for title, note, headings, rows in _tables(diagnosis):
        with page.fold(title):
            page.text(note, 'note')
            page.table(headings, rows)
    for title, lines, _ in _lists(words):
        if lines is not words.warnings:
            page.folded_list(title, lines)
    with page.fold('Method'):
        page.text(' '.join(METHOD))
        page.bullets(diagnosis.notes)
    return page


def diagnosis_markdown(diagnosis: Diagnosis, words: Sentences) -> str:
    """Return the answer as Markdown, for an issue or a log book."""
    rows = [f'**{diagnosis.verdict}**: {words.headline}']
    if diagnosis.effects:
        heads = _headings(diagnosis)
        table = (heads, ['---'] * len(heads), *_plain(_effect_rows(diagnosis)))
        rows.append('\n'.join(f'| {" | ".join(cell.replace("|", "/") for cell in row)} |'
                              for row in table))
        rows.append('\n'.join(f'- {f"{effect} on {drive}" if drive else effect}: {text}'
                              for effect, drive, text in _joined(fitted_values(diagnosis))))
    if words.warnings:
        rows.append('\n'.join(f'- {text}' for text in words.warnings))
    rows.append(f'Next: {words.following}' + (
        f':\n\n```sh\n{words.command}\n```' if words.command else ''))
    return '\n\n'.join(rows) + '\n'


def _plain(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return rows without the colours of the terminal."""
    return [[re.sub(r'\[/?\w*\]', '', cell) for cell in row] for row in rows]


def _errors(page: Page, diagnosis: Diagnosis, after: Residuals) -> None:
    floors, unit = diagnosis.noise_floors, diagnosis.residuals.unit
    fell = bool(diagnosis.effects)
    before, now = rms_by_drive(diagnosis.residuals), rms_by_drive(after)
    rows = [ErrorRow('all drives', rms(diagnosis.residuals), rms(after) if fell else None,
                     diagnosis.noise_floor)]
    rows += [ErrorRow(name, before[name], now[name] if fell else None, floor)
             for name, floor in floors.items() if name in before]
    page.errors(rows, f'Error, rms [{unit}], before (grey) and with the reported effects (blue); '
                'dotted: the noise.' if fell else f'Error, rms [{unit}]; dotted: the noise.')


def _first_picture(page: Page, diagnosis: Diagnosis) -> None:
    """Add the first picture: the unexplained pattern, or the first effect."""
    if diagnosis.depends_on:
        statement = max(diagnosis.depends_on, key=lambda statement: statement.mean_square)
        picture = figures.unknown_picture(diagnosis, statement)
        if picture is not None:
            page.figure(picture, f'What no effect explains, on {statement.drive}.')
            return
    if diagnosis.effects:
        page.figure(*figures.effect_pictures(
            diagnosis, diagnosis.effects[0], diagnosis.remaining)[0])


def _findings(page: Page, diagnosis: Diagnosis, words: Sentences,
              rivals: Sequence[RivalEffect]) -> None:
    """Add a card with pictures for each effect, rival and unexplained pattern."""
    cards = [(finding, effect, diagnosis.remaining) for finding, effect in zip(
        words.effects, diagnosis.effects, strict=True)]
    others = [(finding, rival.found, rival.remaining) for finding, rival in zip(
        words.rivals, rivals, strict=True)]
    for title, some in (('Reported effects', cards),
                        ('Rivals, which explain the data about as well', others)):
        if some:
            with page.fold(title):
                for finding, effect, remaining in some:
                    first, *rest = finding_lines(finding)
                    page.card(finding.title, [
                        first, ('equation', effect.effect.card.equation),
                        ('looks like', finding.mark), *rest],
                        figures.effect_pictures(diagnosis, effect, remaining))
    if words.unexplained:
        with page.fold('Patterns that no effect of the catalogue explains'):
            for finding, group in zip(words.unexplained, unexplained_groups(diagnosis),
                                      strict=True):
                pictures = [(figures.unknown_picture(diagnosis, statement), f'{statement.drive}.')
                            for statement in group]
                page.card(finding.title, finding_lines(finding),
                          [(figure, text) for figure, text in pictures if figure is not None])
