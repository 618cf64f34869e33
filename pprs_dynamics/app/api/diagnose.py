# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnosis: the physical effects that a model lacks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.inputs import Given, Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report import figures, terminal
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis import sentences
from pprs_dynamics.inference.diagnosis.answer import rival_effects
from pprs_dynamics.inference.diagnosis.diagnose import diagnose as diagnose_recordings
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect, RivalEffect
from pprs_dynamics.inference.diagnosis.quantities import (
    capitalised,
    fall,
    listed,
    name_drives,
    plain,
    sentence,
)
from pprs_dynamics.inference.residuals.residuals import rms, rms_by_drive
from pprs_dynamics.physics.model.drive_model import DriveModel

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure

COLOURS = {'adequate': 'green', 'effect': 'cyan', 'ambiguous': 'yellow', 'unknown': 'magenta'}
MOST_EFFECTS = 4  # rows and values in the terminal
MOST_PLACES = 2  # of an unexplained error in the terminal
HEADINGS = 'effect', 'on', 'error', 'held out [std]', 'evidence'
CAPTION = ('Effects, largest error reduction first. Error: on the drive where it falls most. '
           'Held out: standard errors by which held-out data are predicted better.')
EVERYWHERE = 'structure'  # where effects sit that are not on drives
ELSEWHERE = '[dim]Evidence, confirmation and all values: --report FILE.html[/]'
METHOD = (
    'Model and measured effort are filtered alike. Every effect of the catalogue is a column of '
    'one regression, in each shape and on each drive, together with the free numbers of the model.',
    'Sets of effects are compared by one cost: the penalised deviance under noise that is '
    'correlated in time, plus prior penalties. The spectrum of the noise is fitted for each set. '
    'The evidence of an effect is the cost of the best set without it minus the cost of the '
    'reported set.')

TitledTable = tuple[str, str, terminal.PlainTable]
"""Title, note, and headings with rows."""


def diagnosis_view(diagnosis: Diagnosis, words: sentences.Sentences, next_step: bool = True) -> Any:
    """Return the diagnosis for the terminal, most important first, in at most 25 lines.

    Parameters
    ----------
    diagnosis : Diagnosis
    words : Sentences
        The diagnosis in words.
    next_step : bool
        Whether the next command is printed.
    """
    parts = [terminal.verdict_panel(diagnosis.verdict, COLOURS[diagnosis.verdict], words.headline),
             *(f'[blue]i[/] {terminal.escape(text)}' for text in words.reference),
             *_brief(diagnosis, words)]
    if next_step:
        parts.append(
            f'[bold]Next[/] {terminal.escape(words.following)}{":" if words.command else ""}')
        parts += [terminal.shell_command(words.command)] if words.command else []
    return terminal.stacked(*parts, ELSEWHERE)


def _brief(diagnosis: Diagnosis, words: sentences.Sentences) -> Iterator[Any]:
    """Yield the first effects with their values, the runner-up and the first warning."""
    if diagnosis.effects:
        rows, values = effect_rows(diagnosis), value_rows(diagnosis)
        yield terminal.text_table(*terminal.plain_rows((HEADINGS, rows[:MOST_EFFECTS])),
                                  right=(2, 3, 4), whole=(0, 3, 4), frame='none')
        for effect, drive, text in values[:MOST_EFFECTS]:
            yield terminal.escape(f'  {f"{effect} on {drive}" if drive else effect}: {text}')
        if len(rows) > MOST_EFFECTS or len(values) > MOST_EFFECTS:
            yield f'  … all {len(rows)} rows and {len(values)} lines of values: --report FILE.html'
    for statement in diagnosis.depends_on[:MOST_PLACES]:
        yield terminal.escape(f'  {statement.text}')
    if second := sentences.runner_up(diagnosis):
        yield f'[bold]Runner-up[/] {terminal.escape(second)}'
    if diagnosis.verdict == 'adequate' and (seen := sentences.word_detectable(diagnosis)):
        yield terminal.escape(seen)
    if words.refuted:
        yield f'[blue]i[/] {terminal.escape(words.refuted[0])}'
    if diagnosis.warnings:
        yield f'[yellow]![/] {terminal.escape(diagnosis.warnings[0])}'


def _values(diagnosis: Diagnosis) -> Iterator[TitledTable]:
    if rows := value_rows(diagnosis):
        yield ('Values', 'Intervals are two standard deviations.',
               (('effect', 'drive', 'values'), rows))


def _alternatives(diagnosis: Diagnosis) -> Iterator[TitledTable]:
    if diagnosis.sets:
        yield ('The best sets of effects, and their costs above the best',
               'A cost of 10 is odds of 150 to 1. Terms: fit = misfit; coefficients = prior; '
               'others = model choices.',
               (('cost', 'set', 'terms'),
                [(cost, text, why) for text, cost, why in sentences.set_rows(diagnosis)]))
    if diagnosis.candidates:
        yield ('Each effect alone', 'An evidence of 0 is the threshold.',
               (('effect', 'evidence', f'error after [{diagnosis.residuals.unit}]', 'on'),
                [(candidate.name, f'{candidate.evidence:.0f}', plain(candidate.error_after),
                  sites(candidate.drives, diagnosis)) for candidate in diagnosis.candidates]))


def _unseen(diagnosis: Diagnosis) -> Iterator[TitledTable]:
    if rows := sentences.detectable_rows(diagnosis):
        yield ('Smallest effects that would have been reported', 'Each of them '
               'alone would have lowered the cost by 10.',
               (('effect', 'size'), rows))


def _lists(words: sentences.Sentences) -> list[tuple[str, Sequence[str]]]:
    return [('Suspects: effects that cost little more than they explain', words.suspects),
            ('Not confirmed', words.refuted),
            ('Calibrated numbers of the model', words.calibrated)]


def effect_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return a row for each reported effect."""
    return [
        (effect.name, sites(effect.drives, diagnosis, effect.places),
         _fall(diagnosis, diagnosis.remaining + effect.force, diagnosis.remaining),
         plain(effect.held_out_certainty, 2), f'{effect.evidence:.0f}')
        for effect in diagnosis.effects]


def _fall(diagnosis: Diagnosis, error: Array, less: Array) -> str:
    """Return 'slide_1 0.172 → 0.0145 N', see `largest_fall`."""
    drive, *errors = sentences.largest_fall(diagnosis, error, less)
    return f'{drive} {fall(*errors)} {diagnosis.residuals.units_of(drive).effort}'


def value_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return effect, drive and fitted values, a row for each effect and drive."""
    return [(effect.name, drive, text) for effect in diagnosis.effects
            for drive, text in sentences.word_values(
                effect.effect, effect.parameters, effect.moments,
                diagnosis.residuals.drives).items()]


def finding_lines(finding: sentences.Finding) -> list[tuple[str, str]]:
    """Return labelled lines of a finding, without the test that confirms it."""
    return [('finding', finding.what), ('why', finding.why), ('cause', finding.cause),
            *(('note', remark) for remark in finding.remarks)]


def sites(drives: tuple[str, ...] | None, diagnosis: Diagnosis,
          places: Sequence[Sequence[str]] = ()) -> str:
    """Return where an effect sits, for a table."""
    if places:
        return listed([listed(names, 'or') for names in places])
    return EVERYWHERE if drives is None else name_drives(drives, diagnosis.residuals.drives)


def diagnosis_page(
    diagnosis: Diagnosis, words: sentences.Sentences, recordings: Sequence[str],
    validation: Sequence[str] = (), rivals: Sequence[RivalEffect] = (),
) -> Page:
    """Return the page: the result on one screen, then evidence, confirmation and alternatives.

    Parameters
    ----------
    diagnosis : Diagnosis
    words : Sentences
        Of it.
    recordings, validation : sequence of str
        Names of those fitted, and of those held out.
    rivals : sequence of RivalEffect
        As they were given to `Sentences`.
    """
    page = Page(f'Diagnosis: {diagnosis.verdict}')
    page.heading('Result')
    page.text(words.headline, 'lead')
    for text in words.reference:
        page.text(sentence(text))
    page.sources(diagnosis.model.source, recordings, validation)
    with page.columns():
        _errors(page, diagnosis)
        _first_picture(page, diagnosis)
    page.command(words.following, words.command)
    page.folded_list('Warnings', diagnosis.warnings, is_open=True)
    suspects, refuted, calibrated = _lists(words)
    page.heading('Evidence')
    for finding, effect in zip(words.effects, diagnosis.effects, strict=True):
        with page.fold(finding.title):
            _card(page, diagnosis, finding, effect, diagnosis.remaining)
    _unexplained(page, diagnosis, words)
    if diagnosis.effects:
        with page.fold('Contribution of each effect'):
            page.table(HEADINGS, effect_rows(diagnosis), caption=CAPTION)
            figures.add_contributions(page, diagnosis.residuals, {
                effect.name: effect.force for effect in diagnosis.effects},
                'Contribution of each effect.')
    figures.add_every_drive(page, diagnosis.residuals, diagnosis.after, diagnosis.noise_floors,
                            'with the input model and with the reported effects')
    _add_tables(page, _values(diagnosis))
    page.folded_list(*calibrated)
    if confirmations := [f'{finding.title}: {finding.confirm}'
                         for finding in (*words.effects, *words.rivals, *words.unexplained)]:
        page.heading('Confirm it on the machine')
        page.bullets(confirmations)
    page.heading('Alternatives')
    for finding, rival in zip(words.rivals, rivals, strict=True):
        with page.fold(f'Rival: {finding.title}'):
            _card(page, diagnosis, finding, rival.found, rival.remaining)
    _add_tables(page, _alternatives(diagnosis))
    page.folded_list(*suspects)
    page.folded_list(*refuted)
    page.heading('Not seen, and from which size it would have been')
    if not diagnosis.detectable:
        page.text('Sizes are computed for the verdicts adequate and effect.', 'note')
    _add_tables(page, _unseen(diagnosis))
    with page.fold('Method'):
        page.text(' '.join(METHOD))
        page.bullets(map(sentence, diagnosis.notes))
    return page


def _add_tables(page: Page, tables: Iterator[TitledTable]) -> None:
    for title, note, table in tables:
        with page.fold(title):
            page.text(note, 'note')
            page.table(*table)


def _errors(page: Page, diagnosis: Diagnosis) -> None:
    after, floors, unit = diagnosis.after, diagnosis.noise_floors, diagnosis.residuals.unit
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


def _card(page: Page, diagnosis: Diagnosis, finding: sentences.Finding, effect: FoundEffect,
          remaining: Array) -> None:
    first, *rest = finding_lines(finding)
    page.card([first, ('equation', effect.effect.card.equation), ('looks like', finding.mark),
               *rest], figures.effect_pictures(diagnosis, effect, remaining))


def _unexplained(page: Page, diagnosis: Diagnosis, words: sentences.Sentences) -> None:
    """Add a card with pictures for each pattern that no effect explains."""
    for finding, group in zip(
            words.unexplained, sentences.unexplained_groups(diagnosis), strict=True):
        pictures = [(figures.unknown_picture(diagnosis, statement), sentence(statement.text))
                    for statement in group]
        with page.fold(capitalised(finding.title)):
            page.card(finding_lines(finding),
                      [(figure, text) for figure, text in pictures if figure is not None])


@dataclass(frozen=True, repr=False, eq=False)
class DiagnosisResult(Result):
    """Result of `pprs diagnose`.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    diagnosis : Diagnosis
        The answer with all that it was decided from.
    """

    json_of = 'diagnosis'

    inputs: Inputs
    diagnosis: Diagnosis

    @property
    def verdict(self) -> str:
        """One of 'adequate', 'effect', 'ambiguous', 'unknown'."""
        return self.diagnosis.verdict

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """Reported effects, in the order of adoption."""
        return self.diagnosis.effects

    @property
    def fitted(self) -> DriveModel:
        """The model with the reported effects, without the checks of `adopt`."""
        return self.diagnosis.adopted

    def view(self, next_step: bool = True) -> Any:
        """Return the diagnosis for the terminal, with or without the next command."""
        return diagnosis_view(self.diagnosis, self._words, next_step)

    def page(self) -> Page:
        """Return the page of `pprs diagnose --report`."""
        return diagnosis_page(self.diagnosis, self._words, *self.inputs.names, self._rivals)

    def table(self) -> DataFrame:
        """Return a row per parameter of each missing effect: its value, std, unit, evidence."""
        return data_frame([
            {'effect': effect.name, 'parameter': key, 'value': estimate.value,
             'std': estimate.std, 'unit': estimate.unit, 'evidence': effect.evidence}
            for effect in self.effects for key, estimate in effect.parameters.items()])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, with the effects, and the noise."""
        residuals, after = self.diagnosis.residuals, self.diagnosis.after
        return plot_errors(
            {'before': rms_by_drive(residuals), 'with the reported effects': rms_by_drive(after),
             'noise': self.diagnosis.noise_floors}, residuals.unit)

    @cached_property
    def _rivals(self) -> Any:
        return rival_effects(self.diagnosis, self.inputs.held_out)

    @cached_property
    def _words(self) -> Any:
        return sentences.Sentences(self.diagnosis, self.inputs.files, self._rivals)


def diagnose(model: Model, recordings: Recordings, validate: Recordings = (), *,
             topic: str | None = None, progress: Progress | None = None, as_it_is: bool = False,
             reference: Given | None = None) -> DiagnosisResult:
    """Find the physical effect that a model lacks, from recordings.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
        To fit to.
    validate : path, Recording, or a sequence of them, optional
        Of other motions, never fitted: held-out errors are taken on them, instead of on blocks.
    topic, progress, as_it_is : optional
        As in `compare`.
    reference : path, Recording, or a sequence of them, optional
        Runs from a day on which the machine was right: what has changed since then is looked for,
        not what the model lacks. An empty sequence: those that the model file names.

    Returns
    -------
    DiagnosisResult

    Raises
    ------
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(
        model, recordings, validate, topic, progress, as_it_is=as_it_is).require_recordings().since(
            reference)
    found = diagnose_recordings(
        inputs.model, inputs.fitted, inputs.held_out, stage(progress, 'diagnosing'),
        as_it_is=inputs.as_it_is, reference=inputs.reference)
    if own := inputs.fitted_to:
        found = replace(found, warnings=(
            f'the model was fitted to {listed(own)}: what was wrong with the robot then is part of '
            'the model, and cannot be found in it; diagnose another run', *found.warnings))
    return DiagnosisResult(inputs, found)
