# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page of a diagnosis: what is missing, why we think so, and what it does to the error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.app.report import diagnosis_figures as figures
from pprs_dynamics.app.report.diagnosis_tables import finding_lines, sites
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.what_if_part import add_what_if
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis
from pprs_dynamics.inference.diagnosis.error_steps import ErrorStep, error_steps
from pprs_dynamics.inference.diagnosis.quantities import in_unit
from pprs_dynamics.inference.diagnosis.rivals import RivalEffect
from pprs_dynamics.inference.diagnosis.sentences import (
    Finding,
    Sentences,
    fitted_values,
    unexplained_groups,
)
from pprs_dynamics.inference.diagnosis.set_words import set_rows
from pprs_dynamics.inference.diagnosis.what_if import WhatIf
from pprs_dynamics.inference.residuals.residuals import Residuals

METHOD = (
    'Model and measured effort get the same treatment; every effect of the catalogue, in every '
    'shape tried and on every drive, is a column of one regression beside the model\'s own numbers '
    'as far as these are free.',
    'Sets of effects and of patterns of no catalogue are compared by one cost: the penalised '
    'deviance under noise that is correlated in time, whose spectrum is fitted anew for each set, '
    'and prices for effects, drives, shapes and patterns that were tried. Evidence of an effect '
    'is by how much the cost rises without it.')
PARAMETERS = ('effect', 'drive', 'symbol', '± two standard deviations', 'parameter')
SETS = ('cost', 'set')


def diagnosis_page(
    diagnosis: Diagnosis, words: Sentences, after: Residuals, recordings: Sequence[str],
    validation: Sequence[str] = (), rivals: Sequence[RivalEffect] = (),
    system: WhatIf | None = None,
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
    system : WhatIf, optional
        Of it; without it nothing can be ticked.
    """
    page = Page(f'Diagnosis: {diagnosis.verdict}')
    page.text(words.headline, 'lead')
    held = f' Held out: {", ".join(validation)}.' if validation else ''
    page.text(f'Model: {Path(diagnosis.model.source).name or "built in memory"}. Recordings: '
              f'{", ".join(recordings)}.{held}', 'note')
    steps = error_steps(diagnosis, after)
    with page.columns():
        _errors(page, diagnosis, steps)
        _first_picture(page, diagnosis)
    page.command(words.following, words.command)
    if words.warnings:
        with page.fold('Warnings', is_open=True):
            page.bullets(words.warnings)
    if system is not None:
        add_what_if(page, system, diagnosis.residuals)
    _findings(page, diagnosis, words, rivals)
    _sets(page, diagnosis)
    _contributions(page, diagnosis, steps)
    _parameters(page, diagnosis, words)
    with page.fold('Every drive over time, before and after'):
        page.text('Dotted: two standard deviations of the noise. Drag to zoom, on all drives at '
                  'once; double-click to return.', 'note')
        for drive, name in enumerate(diagnosis.residuals.drives):
            if name in diagnosis.noise_floors:
                page.figure(figures.before_and_after(
                    diagnosis.residuals, after, drive, diagnosis.noise_floors[name]),
                    f'{name}: effort and error, with the model as given and with what was found.',
                    over_time=True)
    with page.fold('How it was found'):
        page.text(' '.join(METHOD))
        if diagnosis.notes:
            page.bullets(diagnosis.notes)
    return page


def _errors(page: Page, diagnosis: Diagnosis, steps: Sequence[ErrorStep]) -> None:
    first, last, floors = steps[0], steps[-1], diagnosis.noise_floors
    fell = len(steps) > 1
    rows = [ErrorRow('all drives', first.overall, last.overall if fell else None,
                     diagnosis.noise_floor)]
    rows += [ErrorRow(name, first.drives[d], last.drives[d] if fell else None, floors[name])
             for d, name in enumerate(diagnosis.residuals.drives) if name in floors]
    unit = diagnosis.residuals.unit
    page.errors(rows, f'Error, rms [{unit}], before (grey) and with what was found (blue); dotted: '
                'the noise.' if fell else f'Error, rms [{unit}]; dotted: the noise.')


def _first_picture(page: Page, diagnosis: Diagnosis) -> None:
    """Add the one picture that shows what was found."""
    if diagnosis.depends_on:
        statement = max(diagnosis.depends_on, key=lambda one: one.mean_square)
        picture = figures.unknown_picture(diagnosis, statement)
        if picture is not None:
            page.figure(picture, f'What no effect explains, on {statement.drive}.')
            return
    if diagnosis.effects:
        page.figure(*figures.effect_pictures(diagnosis, diagnosis.effects[0])[0])


def _findings(page: Page, diagnosis: Diagnosis, words: Sentences,
              rivals: Sequence[RivalEffect]) -> None:
    kind = diagnosis.model.kind
    if words.effects:
        with page.fold('What was found, why, and how to confirm it'):
            for finding, one in zip(words.effects, diagnosis.effects, strict=True):
                page.card(finding.title, _lines(finding, one.effect.card_in(kind).equation),
                          figures.effect_pictures(diagnosis, one))
                for said, rival in zip(words.rivals, rivals, strict=True):
                    if rival.of == one.name:
                        page.card(said.title,
                                  _lines(said, rival.effect.card_in(kind).equation),
                                  figures.effect_pictures(diagnosis, rival))
    if words.unexplained:
        with page.fold('What no effect of the catalogue explains'):
            for finding, group in zip(words.unexplained, unexplained_groups(diagnosis),
                                      strict=True):
                pictures = [(figures.unknown_picture(diagnosis, one), f'{one.drive}.')
                            for one in group]
                page.card(finding.title, finding_lines(finding),
                          [(figure, text) for figure, text in pictures if figure is not None])
    for title, lines in (('Suspects: effects that slow noise would explain as well',
                          words.suspects), ('Within the model error of what was found',
                                            words.within_model_error)):
        if lines:
            with page.fold(title):
                page.bullets(lines)


def _lines(finding: Finding, equation: str) -> list[tuple[str, str]]:
    lines = finding_lines(finding)
    return [lines[0], ('equation', equation), ('looks like', finding.mark), *lines[1:]]


def _sets(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.sets:
        return
    with page.fold('The best sets of effects, and their costs'):
        page.text('Cost above that of the best set. 10 stands for odds of 150 to 1: a set that '
                  'comes nearer is told as a rival.', 'note')
        page.table(SETS, [(cost, text) for text, cost in set_rows(diagnosis)])
        if diagnosis.candidates:
            page.figure(figures.evidence_bars(diagnosis),
                        'Evidence of each effect alone; 0 is the threshold. Blue: found. Yellow: '
                        'a rival. Grey: explains less, or nothing beside what was found.')


def _effect_headings(unit: str) -> tuple[str, ...]:
    return ('effect', 'evidence', f'error before [{unit}]', f'after [{unit}]',
            f'held out before [{unit}]', f'after [{unit}]', 'on')


def _contributions(page: Page, diagnosis: Diagnosis, steps: Sequence[ErrorStep]) -> None:
    if not diagnosis.effects:
        return
    unit = diagnosis.residuals.unit
    where = ('the recordings given with --validate' if diagnosis.held_out_on == 'validation'
             else 'blocks of the same recordings, the weaker evidence')
    with page.fold('What each effect does to the error'):
        if len(steps) > 2:
            page.errors([ErrorRow(f'+ {step.label}' if k else step.label, step.overall)
                         for k, step in enumerate(steps)],
                        f'Error over all drives, rms [{unit}], as one after the other is added; '
                        f'both ends are what a comparison says, the noise is '
                        f'{in_unit(diagnosis.noise_floor, unit)}.')
        page.table(_effect_headings(unit), [
            (one.name, f'{one.evidence:.0f}', f'{one.error_before:.3f}', f'{one.error_after:.3f}',
             f'{one.held_out_before:.3f}', f'{one.held_out_after:.3f}',
             sites(one.drives, diagnosis, one.places)) for one in diagnosis.effects],
            caption='Those without which the error would be largest first, parameters fitted anew '
            f'at every step. Held out: {where}.')
        drives = diagnosis.residuals.drives
        size = sum((one.force ** 2).mean(axis=0) for one in diagnosis.effects)
        acting = [name for d, name in enumerate(drives) if size[d] > 0]
        page.menu('Drive', acting, drives[int(size.argmax())])
        page.figure(figures.contributions(diagnosis.residuals, {
            one.name: one.force for one in diagnosis.effects}),
            'What each effect contributes.', over_time=True)


def _parameters(page: Page, diagnosis: Diagnosis, words: Sentences) -> None:
    values = fitted_values(diagnosis)
    if values:
        with page.fold('Values'):
            page.table(PARAMETERS, [(one.effect, one.drive, one.parameter.symbol, one.text,
                                     one.parameter.description) for one in values])
    if words.calibrated:
        with page.fold('Numbers of the model that moved within their tolerance'):
            page.bullets(words.calibrated)
