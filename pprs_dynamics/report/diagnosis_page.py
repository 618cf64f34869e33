"""The page of a diagnosis: what is missing, why we think so, and what it does to the error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pprs_dynamics.diagnosis.diagnose import Diagnosis
from pprs_dynamics.diagnosis.error_steps import error_steps
from pprs_dynamics.diagnosis.sentences import Finding, Sentences, fitted_values
from pprs_dynamics.report import diagnosis_figures as figures
from pprs_dynamics.report.diagnosis_tables import finding_lines, sites
from pprs_dynamics.report.page import Page
from pprs_dynamics.residuals.residuals import Residuals

METHOD = (
    'Model and measured effort get the same treatment; every effect of the catalogue, in every '
    'shape tried and on every drive, is a column of one regression beside the model\'s own numbers '
    'as far as these are free.',
    'Evidence is twice the gain in log-likelihood under noise that is correlated in time, fitted '
    'anew with and without the effect, less a penalty for parameters, shapes, drives and names '
    'that were tried, and less a margin.',
    'What is adopted must also predict blocks of the recording that it was not fitted to; what '
    'then remains is searched for dependence on anything known.')
EFFECTS = ('effect', 'evidence', 'error before [N]', 'after [N]', 'held out before [N]',
           'after [N]', 'on')
PARAMETERS = ('effect', 'drive', 'symbol', '± two standard deviations', 'parameter')


def diagnosis_page(
    diagnosis: Diagnosis, words: Sentences, after: Residuals, recordings: Sequence[str],
    validation: Sequence[str] = (),
) -> Page:
    """Return the page, most important first.

    Parameters
    ----------
    diagnosis : Diagnosis
    words : Sentences
        Of it.
    after : Residuals
        Of `diagnosis.adopted` on the same recordings.
    recordings, validation : sequence of str
        Names of those fitted, and of those held out.
    """
    page = Page(f'Diagnosis: {diagnosis.verdict}')
    page.text(words.headline, 'lead')
    held = f' Held out: {", ".join(validation)}.' if validation else ''
    page.text(f'Model: {Path(diagnosis.model.source).name or "built in memory"}. Recordings: '
              f'{", ".join(recordings)}.{held}', 'note')
    page.text(f'Next: {words.following}')
    _warnings(page, words)
    _findings(page, diagnosis, words)
    _errors(page, diagnosis, after)
    _candidates(page, diagnosis)
    _parameters(page, diagnosis, words)
    page.heading('Before and after')
    page.text('Dotted: two standard deviations of the noise. Drag to zoom, double-click to return.',
              'note')
    for drive, name in enumerate(diagnosis.residuals.drives):
        if name in diagnosis.noise_floors:
            page.figure(figures.before_and_after(diagnosis.residuals, after, drive,
                                                 diagnosis.noise_floors[name]))
    page.heading('How it was found')
    page.text(' '.join(METHOD))
    if diagnosis.notes:
        page.bullets(diagnosis.notes)
    return page


def _warnings(page: Page, words: Sentences) -> None:
    if words.warnings:
        page.heading('Warnings')
        page.bullets(words.warnings)


def _findings(page: Page, diagnosis: Diagnosis, words: Sentences) -> None:
    if words.effects:
        page.heading('What is missing')
        page.text('Grey: what the recording says when all but this effect is in the model. Blue: '
                  'the effect.', 'note')
    for finding, one in zip(words.effects, diagnosis.effects, strict=True):
        page.card(finding.title, _lines(finding, one.effect.card.equation),
                  figures.effect_picture(diagnosis, one))
    if words.unexplained:
        page.heading('What no effect of the catalogue explains')
    for finding, statement in zip(words.unexplained, diagnosis.depends_on, strict=True):
        page.card(finding.title, finding_lines(finding),
                  figures.unknown_picture(diagnosis, statement))
    for title, lines in (('Suspects: effects that slow noise would explain as well',
                          words.suspects), ('Within the model error of an adopted effect',
                           words.within_model_error)):
        if lines:
            page.heading(title)
            page.bullets(lines)


def _lines(finding: Finding, equation: str) -> list[tuple[str, str]]:
    lines = finding_lines(finding)
    return [lines[0], ('equation', equation), ('looks like', finding.mark), *lines[1:]]


def _errors(page: Page, diagnosis: Diagnosis, after: Residuals) -> None:
    page.heading('How the error falls')
    steps = error_steps(diagnosis, after)
    if len(steps) > 1:
        numbered = ', '.join(f'+{k} {step.label}' for k, step in enumerate(steps) if k)
        page.text('Both ends are what a comparison with these models says; in between, parameters '
                  f'are those of the last fit. Dashed: the noise, {diagnosis.noise_floor:.3g} N over '
                  f'all drives. Steps of the small pictures: {numbered}.', 'note')
        page.figure(figures.waterfall(steps, after.drives, diagnosis.noise_floor,
                                      diagnosis.noise_floors))
    else:
        page.text(f'It does not: the model leaves {steps[0].overall:.4f} N rms, and the noise is '
                  f'{diagnosis.noise_floor:.4f} N.')
    if diagnosis.effects:
        where = ('the recordings given with --validate' if diagnosis.held_out_on == 'validation'
                 else 'blocks of the same recordings, the weaker evidence')
        page.text(f'In the order of adoption, with parameters fitted anew at every step. Held out: '
                  f'{where}.', 'note')
        page.table(EFFECTS, [
            (one.name, f'{one.evidence:.0f}', f'{one.error_before:.4f}', f'{one.error_after:.4f}',
             f'{one.held_out_before:.4f}', f'{one.held_out_after:.4f}',
             sites(one.drives, diagnosis)) for one in diagnosis.effects])
        page.heading('What each effect contributes')
        page.figure(figures.contributions(diagnosis))


def _candidates(page: Page, diagnosis: Diagnosis) -> None:
    if not diagnosis.candidates:
        return
    page.heading('Candidates for the first place')
    page.text('Evidence of each effect alone, 0 is the threshold. Blue: adopted. Yellow: this data '
              'cannot tell it from an adopted one. Grey: explains less, or nothing beside those.',
              'note')
    page.figure(figures.evidence_bars(diagnosis))


def _parameters(page: Page, diagnosis: Diagnosis, words: Sentences) -> None:
    values = fitted_values(diagnosis)
    if values:
        page.heading('Parameters')
        page.table(PARAMETERS, [(one.effect, one.drive, one.parameter.symbol, one.text,
                                 one.parameter.description) for one in values])
    if words.calibrated:
        page.heading('Numbers of the model that moved within their tolerance')
        page.bullets(words.calibrated)
