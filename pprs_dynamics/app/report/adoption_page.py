# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The page that shows what a model gained by an effect, and what remains."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pprs_dynamics.app.report.adoption_tables import error_rows, headline, parameter_rows
from pprs_dynamics.app.report.diagnosis_figures import (
    before_and_after,
    contributions,
    curve_with_band,
)
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.diagnosis.quantities import with_uncertainty
from pprs_dynamics.inference.residuals.paired_errors import rms_by_drive
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.effect import CatalogueEffect


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
    held = (f' Held out: {", ".join(one.name for one in validation)}.' if validation else '')
    page.text(f'Model: {Path(answer.before.source).name or "built in memory"}. Recordings: '
              f'{", ".join(one.name for one in recordings)}.{held}', 'note')
    errors, fallen = rms_by_drive(before), rms_by_drive(after)
    with page.columns():
        page.errors([ErrorRow('all drives', answer.error_before, answer.error_after,
                              answer.noise_floor),
                     *(ErrorRow(name, errors[name], fallen[name], answer.noise_floors.get(name))
                       for name in errors)],
                    f'Error on the recordings, rms [{answer.unit}], before (grey) and with it '
                    '(blue); dotted: the noise.')
        most = max(answer.noise_floors, key=lambda name: errors[name] - fallen[name], default='')
        if most:
            page.figure(before_and_after(before, after, before.drives.index(most),
                                         answer.noise_floors[most]),
                        f'{most}, where it changes most: effort and error, before and with it.',
                        over_time=True)
    if answer.curve is not None:
        page.figure(curve_with_band(answer), 'The measured curve with two standard deviations, '
                    'and what the model without it leaves: a table of correction, not a cause. '
                    'Beyond the measured range it goes on with its last value.')
    if command and answer.adopted:
        page.command('See what is still missing', command)
    page.table(('error on', f'before [{answer.unit}]', f'after [{answer.unit}]', 'change'),
               error_rows(answer),
               caption='What was fitted to, and what decides.')
    page.bullets(answer.remarks)
    if answer.parameters:
        page.table(('parameter', '± two standard deviations'), parameter_rows(answer),
                   caption='Its values')
    _over_time(page, answer, after)
    with page.fold('Every drive over time, before and after'):
        page.text('Dotted: two standard deviations of the noise. Drag to zoom, on all drives at '
                  'once; double-click to return.', 'note')
        for drive, name in enumerate(before.drives):
            if name in answer.noise_floors:
                page.figure(before_and_after(before, after, drive, answer.noise_floors[name]),
                            f'{name}: effort and error, before and with {answer.effect}.',
                            over_time=True)
    if answer.calibrated:
        with page.fold('Numbers of the model that move within their tolerances'):
            page.table(('number', 'before', 'after'),
                       [(one.label, with_uncertainty(one.before, 0.0, one.unit),
                         with_uncertainty(one.after, one.std, one.unit))
                        for one in answer.calibrated])
    return page


def _over_time(page: Page, answer: Adoption, after: Residuals) -> None:
    """Add the forces of added effects."""
    forces = {effect.name: after.parts[effect.name] for effect in answer.after.effects
              if isinstance(effect, CatalogueEffect) and effect.name in after.parts}
    size = sum((np.mean(force ** 2, axis=0) for force in forces.values()),
               np.zeros(len(after.drives)))
    if not np.any(size):
        return
    with page.fold('What each added effect contributes'):
        page.menu('Drive', [name for d, name in enumerate(after.drives) if size[d]],
                  after.drives[int(np.argmax(size))])
        page.figure(contributions(after, forces), 'What each added effect contributes.',
                    over_time=True)
