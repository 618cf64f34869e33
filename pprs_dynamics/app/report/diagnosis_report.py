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
    verdict_panel,
)
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.found_effects import RivalEffect
from pprs_dynamics.inference.diagnosis.partial_errors import ErrorStep, error_steps
from pprs_dynamics.inference.diagnosis.quantities import (
    in_unit,
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
from pprs_dynamics.inference.residuals.residuals import Residuals

COLOURS = {'adequate': 'green', 'effect': 'cyan', 'ambiguous': 'yellow', 'unknown': 'magenta'}
MOST_LISTED = 2  # places of effects whose parameters the sentences give; names in one line
WIDTH = 80
LONGEST = 400  # characters of rows, values and the runner-up without --details: five lines
MOST_EFFECTS = 4  # that are shown without --details
REFIT = 'its own numbers'  # of the model, fitted beside the effects
LEAST_REFIT = 0.01  # share of the error, from which these are listed
EVERYWHERE = 'structure'  # where effects sit that are not on drives
ELSEWHERE = '[dim]Evidence, confirmation and all values: --details, or --report FILE.html[/]'
LEGEND = '[dim]Cost terms: fit = misfit; coefficients = prior; others = model choices[/]'
SEEN = 'Not seen, and from which size it would have been'
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
    yield verdict_panel(diagnosis.verdict, COLOURS[diagnosis.verdict], words.headline)
    yield from (f'[blue]i[/] {escape(text)}' for text in words.reference)
    if diagnosis.effects:
        held = ('the --validate recordings' if diagnosis.held_out_on == 'validation'
                else 'blocks of the same recordings')
        yield _table(f'Effects by error reduction; held out: {held}',
                     _headings(diagnosis),
                     _effect_rows(diagnosis), right=(2, 3, 4))
    for number, finding in enumerate((*words.effects, *words.rivals, *words.unexplained), start=1):
        yield _finding(number, finding)
    values = fitted_values(diagnosis)
    if len({(value.effect, value.drive) for value in values}) > MOST_LISTED:
        yield _table('Values, ± two standard deviations', ('effect', 'drive', 'values'),
                     [tuple(map(escape, row)) for row in _joined(values)])
    if diagnosis.sets:
        yield _table('The best sets of effects, and their costs above the best',
                     ('cost', 'set', 'of which'),
                     [(cost, escape(text), why) for text, cost, why in set_rows(diagnosis)])
        yield LEGEND
    if diagnosis.candidates:
        yield _table('Each effect alone', (
            'effect', 'on', 'evidence', f'error after [{diagnosis.residuals.unit}]'), [
            (candidate.name, sites(candidate.drives, diagnosis), f'{candidate.evidence:.0f}',
             f'{candidate.error_after:.3f}') for candidate in diagnosis.candidates], right=(2, 3))
    if rows := detectable_rows(diagnosis):
        yield _table(SEEN, ('effect', 'size'), [tuple(map(escape, row)) for row in rows])
    yield from _list('Calibrated within their tolerance', words.calibrated, 'blue')
    yield from _list('Suspects', words.suspects, 'yellow')
    yield from _list('Excluded sets', words.barred, 'blue')
    yield from _list('Warnings', words.warnings, 'yellow')


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


def _finding(number: int, finding: Finding) -> Any:
    from rich.padding import Padding
    from rich.table import Table

    grid = Table.grid(padding=(0, 1))
    grid.add_column(style='bold', width=8)
    grid.add_column(ratio=1)
    for label, text in finding_lines(finding):
        grid.add_row(label, escape(text))
    title = f'[bold]{number}. {escape(finding.title)}[/]'
    return Padding(stacked(title, Padding(grid, (0, 0, 0, 3))), (0, 0, 1, 0))


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


def _list(title: str, lines: Sequence[str], colour: str) -> Iterator[Any]:
    from rich.table import Table

    if lines:
        yield f'[bold {colour}]{title}[/]'
        for line in lines:
            grid = Table.grid(padding=(0, 1))
            grid.add_row('-', escape(line))
            yield grid
        yield ''


def _table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]],
           right: Sequence[int] = ()) -> Any:
    return text_table(headings, rows, right=right, whole=(0, *right), frame='head', title=title)


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
    steps = error_steps(diagnosis, after)
    with page.columns():
        _errors(page, diagnosis, steps)
        _first_picture(page, diagnosis)
    page.command(words.following, words.command)
    page.copy('Copy as Markdown', diagnosis_markdown(diagnosis, words))
    page.folded_list('Warnings', words.warnings, is_open=True)
    page.heading('Evidence')
    _findings(page, diagnosis, words)
    _contributions(page, diagnosis, steps)
    _parameters(page, diagnosis, words)
    figures.add_every_drive(page, diagnosis.residuals, after, diagnosis.noise_floors,
                            'with the input model and with the reported effects')
    with page.fold('Method'):
        page.text(' '.join(METHOD))
        page.bullets(diagnosis.notes)
    if words.effects:
        page.heading('Confirm it on the machine')
        page.bullets([f'{finding.title}: {finding.confirm}' for finding in words.effects])
    page.heading('Alternatives')
    _alternatives(page, diagnosis, words, rivals)
    if rows := detectable_rows(diagnosis):
        page.heading(SEEN)
        with page.fold('Smallest effects that would have been reported'):
            page.text('Each alone would have cost 10 less than the answer at the noise of these '
                      'recordings.', 'note')
            page.table(('effect', 'size'), rows)
    return page


def diagnosis_markdown(diagnosis: Diagnosis, words: Sentences) -> str:
    """Return the answer as Markdown, for an issue or a log book."""
    rows = [f'**{diagnosis.verdict}**: {words.headline}']
    if diagnosis.effects:
        heads = _headings(diagnosis)
        cells = [[re.sub(r'\[/?\w*\]', '', cell) for cell in row]
                 for row in _effect_rows(diagnosis)]
        table = (heads, ['---'] * len(heads), *cells)
        rows.append('\n'.join(f'| {" | ".join(cell.replace("|", "/") for cell in row)} |'
                              for row in table))
        rows.append('\n'.join(f'- {f"{effect} on {drive}" if drive else effect}: {text}'
                              for effect, drive, text in _joined(fitted_values(diagnosis))))
    if words.warnings:
        rows.append('\n'.join(f'- {text}' for text in words.warnings))
    rows.append(f'Next: {words.following}' + (
        f':\n\n```sh\n{words.command}\n```' if words.command else ''))
    return '\n\n'.join(rows) + '\n'


def _errors(page: Page, diagnosis: Diagnosis, steps: Sequence[ErrorStep]) -> None:
    first, last, floors = steps[0], steps[-1], diagnosis.noise_floors
    fell = len(steps) > 1
    rows = [ErrorRow('all drives', first.overall, last.overall if fell else None,
                     diagnosis.noise_floor)]
    rows += [ErrorRow(name, first.drives[d], last.drives[d] if fell else None, floors[name])
             for d, name in enumerate(diagnosis.residuals.drives) if name in floors]
    unit = diagnosis.residuals.unit
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
        page.figure(*figures.effect_pictures(diagnosis, diagnosis.effects[0])[0])


def _findings(page: Page, diagnosis: Diagnosis, words: Sentences) -> None:
    if words.effects:
        with page.fold('Reported effects'):
            for finding, effect in zip(words.effects, diagnosis.effects, strict=True):
                page.card(finding.title, _lines(finding, effect.effect.card.equation),
                          figures.effect_pictures(diagnosis, effect))
    if words.unexplained:
        with page.fold('Patterns that no effect of the catalogue explains'):
            for finding, group in zip(words.unexplained, unexplained_groups(diagnosis),
                                      strict=True):
                pictures = [(figures.unknown_picture(diagnosis, statement), f'{statement.drive}.')
                            for statement in group]
                page.card(finding.title, finding_lines(finding),
                          [(figure, text) for figure, text in pictures if figure is not None])


def _alternatives(page: Page, diagnosis: Diagnosis, words: Sentences,
                  rivals: Sequence[RivalEffect]) -> None:
    if words.rivals:
        with page.fold('Rivals, which explain the data about as well'):
            for finding, rival in zip(words.rivals, rivals, strict=True):
                equation = rival.effect.card.equation
                page.card(finding.title, _lines(finding, equation),
                          figures.effect_pictures(diagnosis, rival))
    _sets(page, diagnosis)
    page.folded_list('Suspects, which slow noise explains as well', words.suspects)
    page.folded_list('Excluded sets', words.barred)


def _lines(finding: Finding, equation: str) -> list[tuple[str, str]]:
    lines = finding_lines(finding)
    return [lines[0], ('equation', equation), ('looks like', finding.mark), *lines[1:]]


def _sets(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.sets:
        return
    with page.fold('The best sets of effects, and their costs'):
        page.text('Cost above that of the best set. 10 are odds of 150 to 1; a set that costs '
                  'less is a rival. Terms: misfit, prior of the coefficients, and penalties for '
                  'names, drives, shapes and signs.', 'note')
        page.table(('set', 'cost', 'terms'), set_rows(diagnosis))
        if diagnosis.candidates:
            page.figure(figures.evidence_bars(diagnosis),
                        'Evidence of each effect alone; 0 is the threshold. Blue: reported. '
                        'Yellow: a rival. Grey: explains less, or nothing in addition.')


def _contributions(page: Page, diagnosis: Diagnosis, steps: Sequence[ErrorStep]) -> None:
    if not diagnosis.effects:
        return
    unit = diagnosis.residuals.unit
    where = ('the recordings given with --validate' if diagnosis.held_out_on == 'validation'
             else 'blocks of the same recordings, the weaker evidence')
    with page.fold('Error reduction by each effect'):
        if len(steps) > 2:
            page.errors([ErrorRow(f'+ {step.label}' if k else step.label, step.overall)
                         for k, step in enumerate(steps)],
                        f'Error over all drives, rms [{unit}], as one after the other is added; '
                        f'the noise is '
                        f'{in_unit(diagnosis.noise_floor, unit)}.')
        page.table(('effect', 'evidence', f'error before [{unit}]', f'after [{unit}]',
                    f'held out before [{unit}]', f'after [{unit}]', 'on'), [
            (effect.name, f'{effect.evidence:.0f}', f'{effect.error_before:.3f}',
             f'{effect.error_after:.3f}', f'{effect.held_out_before:.3f}',
             f'{effect.held_out_after:.3f}',
             sites(effect.drives, diagnosis, effect.places)) for effect in diagnosis.effects],
            caption='Error before: without the force of this effect, all else as fitted. '
            f'Held out before: fitted without it. Held out: {where}.')
        figures.add_contributions(page, diagnosis.residuals, {
            effect.name: effect.force for effect in diagnosis.effects},
            'Contribution of each effect.')


def _parameters(page: Page, diagnosis: Diagnosis, words: Sentences) -> None:
    values = fitted_values(diagnosis)
    if values:
        with page.fold('Values'):
            page.table(('effect', 'drive', 'symbol', '± two standard deviations', 'parameter'),
                       [(value.effect, value.drive, value.parameter.symbol, value.text,
                         value.parameter.description) for value in values])
    page.folded_list('Numbers of the model that moved within their tolerance', words.calibrated)
