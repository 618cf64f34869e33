# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a model gained by an effect, and what remains; in the terminal and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import Any

import numpy as np

from pprs_dynamics.app.report.diagnosis_figures import (
    add_contributions,
    add_every_drive,
    before_and_after,
    curve_with_band,
)
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.terminal import escape, shell_command, stacked, verdict_panel
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.loop import AMBIGUOUS, AdoptionRun
from pprs_dynamics.inference.diagnosis.quantities import (
    as_fitted,
    in_unit,
    plain,
    with_drives,
    with_uncertainty,
)
from pprs_dynamics.inference.diagnosis.sentences import sure_moments
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.effect import CatalogueEffect

MOST_SHOWN = 6  # values without --details
MOST_REMARKS = 2


def run_view(run: AdoptionRun, command: str, details: bool = False) -> Any:
    """Return adopted and refused effects, a line or all values of each, and the reason to end.

    `command` designs the motion that separates an ambiguous effect from its rivals.
    """
    steps = [adoption_view(step) if details else escape(headline(step)) for step in run.steps]
    following = [shell_command(command)] if run.ended == AMBIGUOUS else []
    return stacked(*steps, f'[bold]{run.ended}[/]: {escape(run.reason)}{":" * len(following)}',
                   *following)


def adoption_view(answer: Adoption) -> Any:
    """Return the answer for the terminal, in at most 20 lines."""
    return stacked(*_parts(answer))


def _parts(answer: Adoption) -> Iterator[Any]:
    """Yield the answer, the fall of the error and the first values."""
    word, colour = (('refused', 'red') if not answer.adopted else
                    ('forced', 'yellow') if answer.forced else ('adopted', 'green'))
    yield verdict_panel(word, colour, headline(answer))
    held = _held_out(answer)
    for label, before, after in (('recordings', answer.error_before, answer.error_after),
                                 (held, answer.held_out_before, answer.held_out_after)):
        yield f'  error on {label}: {plain(before)} → {plain(after)} {answer.unit}'
    yield f'  noise: {in_unit(answer.noise_floor, answer.unit)}'
    rows = parameter_rows(answer)
    for key, text in rows[:MOST_SHOWN]:
        yield f'  {escape(key)} = {escape(text)}'
    if len(rows) > MOST_SHOWN:
        yield f'  … and {len(rows) - MOST_SHOWN} more, with --json or --report'
    for remark in answer.remarks[:MOST_REMARKS]:
        yield f'[yellow]![/] {escape(remark)}'


def _held_out(answer: Adoption) -> str:
    return 'held-out recordings' if answer.held_out_on == VALIDATION else 'held-out blocks'


def headline(answer: Adoption) -> str:
    """Return the answer in a sentence."""
    what = with_drives(answer.effect, answer.drives, answer.before.drives)
    said = ('is refused' if not answer.adopted else
            'is adopted by force, in spite of this' if answer.forced else 'is adopted')
    return f'{what} {said}: {answer.reason}.'


def parameter_rows(answer: Adoption) -> list[tuple[str, str]]:
    """Return each parameter that is not 0, and its value ± two standard deviations.

    With first moments of bodies that are sure where the mass is not.
    """
    effect = answer.request.effect
    scales = {parameter.name: parameter.scale for parameter in effect.parameters}
    rows = [(key, as_fitted(parameter.value, parameter.std, parameter.unit,
                            scales.get(effect.place_and_parameter(key)[1], inf)))
            for key, parameter in answer.parameters.items() if parameter.value != 0.0]
    return rows + [(key, with_uncertainty(entry.value, entry.std, entry.unit)) for key, entry in (
        (told.name, answer.moments[told.name])
        for told in sure_moments(effect, answer.parameters, answer.moments))]


def adoption_page(answer: Adoption, recordings: Sequence[Recording],
                  validation: Sequence[Recording], command: str = '') -> Page:
    """Return the page of one adoption, or refusal: an answer on one screen, the rest folded.

    Parameters
    ----------
    answer : Adoption
    recordings, validation : sequence of Recording
        Those fitted, and those held out.
    command : str, optional
        That says what is still missing.
    """
    before, after = answer.residuals_before, answer.residuals_after
    page = Page(f'{answer.effect}: ' + ('added to the model' if answer.adopted else 'refused'))
    page.text(headline(answer), 'lead')
    page.sources(answer.before.source, [recording.name for recording in recordings],
                 [recording.name for recording in validation])
    errors, fallen = rms_by_drive(before), rms_by_drive(after)
    with page.columns():
        page.errors([ErrorRow('all drives', answer.error_before, answer.error_after,
                              answer.noise_floor),
                     ErrorRow(_held_out(answer), answer.held_out_before, answer.held_out_after,
                              answer.noise_floor),
                     *(ErrorRow(name, errors[name], fallen[name], answer.noise_floors.get(name))
                       for name in errors)],
                    f'Error on the recordings, rms [{answer.unit}], before (grey) and with the '
                    'effect (blue); dotted: the noise.')
        most = max(answer.noise_floors, key=lambda name: errors[name] - fallen[name], default='')
        if most:
            page.figure(before_and_after(before, after, before.drives.index(most),
                                         answer.noise_floors[most]),
                        f'{most}, where the error falls most: effort and error.',
                        over_time=True)
    if answer.curve is not None:
        page.figure(curve_with_band(answer), 'The measured curve with two standard deviations, '
                    'and the residual of the model without it. It is a correction table, not a '
                    'cause. Beyond the measured range it is constant.')
    if command and answer.adopted:
        page.command('Look for further effects', command)
    page.bullets(answer.remarks)
    if answer.parameters:
        page.table(('parameter', '± two standard deviations'), parameter_rows(answer),
                   caption='Fitted values')
    forces = {effect.name: after.parts[effect.name] for effect in answer.after.effects
              if isinstance(effect, CatalogueEffect) and effect.name in after.parts}
    if any(np.any(force) for force in forces.values()):
        with page.fold('Contribution of each added effect'):
            add_contributions(page, after, forces, 'Contribution of each added effect.')
    add_every_drive(page, before, after, answer.noise_floors, f'before and with {answer.effect}')
    if answer.calibrated:
        with page.fold('Numbers of the model that changed within their tolerances'):
            page.table(('number', 'before', 'after'),
                       [(number.label, with_uncertainty(number.before, 0.0, number.unit),
                         with_uncertainty(number.after, number.std, number.unit))
                        for number in answer.calibrated])
    return page
