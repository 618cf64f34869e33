# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The part of a page on which effects are ticked, and errors follow at once."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict
from typing import Any

import numpy as np

from pprs_dynamics.app.report.comparison_figures import shown_samples
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.what_if import OptionalForces, WhatIf
from pprs_dynamics.inference.regression.normal_equations import BEYOND_TOLERANCE
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS
from pprs_dynamics.inference.residuals.residuals import Residuals

POINTS = 400  # pairs of extremes that are shown of a drive: a third of a screen is no wider
LARGEST = 32767  # of 16 bits; the least stands for a sample that was not measured
GAP = -LARGEST - 1
MODULES = ('dom.mjs', 'format.mjs', 'errors.mjs', 'effects.mjs', 'curves.mjs', 'ridge.mjs',
           'what_if.mjs')
_ELEMENTS = '''
<div id="what-if">
<p class="note">Tick an effect, choose the drives it is to be on, and see what would be left. All
that is ticked is fitted together, beside the model's own numbers within their tolerances, at the
noise of this diagnosis. It is a what-if, not a finding: shapes stay as they are, and evidence at
this noise is larger than with the noise fitted anew, as it is where sets are compared. ≈: the
effect changes how others show; with it added or taken away, the figures are only nearly right.</p>
<p><button type="button">As found</button> <span role="status"></span></p>
<div class="error-tiles"></div>
<div class="sides"><ul class="effect-list"></ul>
<div><p class="note">Error over time, as given (grey) and now (blue); dotted: two standard
deviations of the noise. Drag to zoom, on all drives at once; double-click to return.</p>
<div class="curves"></div></div></div></div>
'''


def add_what_if(page: Page, system: WhatIf, residuals: Residuals) -> None:
    """Add the part, folded.

    Parameters
    ----------
    page : Page
    system : WhatIf
    residuals : Residuals
        Of the model as given.
    """
    with page.fold('What if: tick effects, and see what would be left'):
        page.interactive(_ELEMENTS, 'what-if-data', json.dumps({
            'effects': [asdict(one) for one in system.effects],
            'always': system.always, 'limited': system.limited,
            'gram': _letters(system.gram, 'f8'), 'side': _letters(system.side, 'f8'),
            'name_prior_cost': system.name_prior_cost, 'wrong_sign_odds': system.wrong_sign_odds,
            'drive_prior_costs': system.drive_prior_costs,
            'units': {one.name: {'effort': residuals.units_of(one.name).effort}
                      for one in system.drives},
            'unit': residuals.unit, 'gap': GAP,
            'deviations': DEVIATIONS, 'steepness': BEYOND_TOLERANCE,
            'drives': [_drive(one, residuals) for one in system.drives],
        }, allow_nan=False, separators=(',', ':')), MODULES, with_board=True)


def _drive(one: OptionalForces, residuals: Residuals) -> dict[str, Any]:
    """Return a drive with its columns at the samples that a screen shows, in 16 bits."""
    at = shown_samples(residuals, one.given, points=POINTS)
    rows = np.concatenate((one.rows, one.error[None], one.given[None]))[:, at]
    rows[:, at < 0] = np.nan
    rows[-1, ~np.isfinite(rows[-2])] = np.nan  # both curves end where the fit does
    size = np.fmax(np.nanmax(np.abs(rows), axis=1, keepdims=True), 1e-12)
    steps = np.where(np.isfinite(rows), np.round(LARGEST / size * np.nan_to_num(rows)), GAP)
    time = residuals.time[np.where(at < 0, np.roll(at, 1), at)]
    return {'name': one.name, 'noise': one.noise, 'samples': one.samples,
            'given': root_mean_square(one.given),
            'columns': one.columns.tolist(), 'products': _letters(one.products, 'f8'),
            'time': _letters(time, 'f4'), 'rows': _letters(steps, 'i2'),
            'scales': _letters(size / LARGEST, 'f8')}


def _letters(values: Any, kind: str) -> str:
    """Return numbers, little-endian, in the letters of base64."""
    return base64.b64encode(np.asarray(values).astype(f'<{kind}').tobytes()).decode()
