# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The noise of every drive of a recording: that of the largest fit.

The noise is estimated with all columns at once, as Mallows' C_p takes the variance of the largest
model: every effect of the catalogue. The restricted likelihood counts the degrees of freedom that
they use. In a short recording that is an upper estimate. An answer takes the noise of its set
where that is lower beyond the accuracy (`noise_at_most`); `compare` has no set, and prints this.

References
----------
C. L. Mallows, Some comments on C_p, Technometrics 15 (1973) 661-675.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.long_recordings import excerpts_within_memory
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

# Of all shapes of an effect: directions of their span with less than the share of the strongest
# are left out, and all but the strongest few.
LEAST_DIRECTION, MOST_DIRECTIONS = 0.03, 6
# Shapes of an effect beyond these span no few directions: ripples of any period are any curve.
MOST_SHAPES = 60


def noise_floors(fits: FittedSets, period: float | None = None,
                 reported: JointFit | None = None) -> dict[str, float]:
    """Return the rms of the noise of each drive [N], where the recordings determine it.

    Parameters
    ----------
    fits : FittedSets
    period : float, optional
        Between the samples of the noise [s]; by default that of the design.
    reported : JointFit, optional
        Of a set of effects, whose noise the largest fit must determine as well.
    """
    regression, residuals = fits.regression, fits.design.residuals
    fit = regression.fit(catalogue_blocks(fits), fits.evaluate(()).fit)
    # Degrees of freedom that the columns leave, and the shares of both noises that lie there.
    free = np.maximum(regression.counts - regression.system(fit.blocks).leverage(
        fit.covariance, fit.spectra), 0.0)
    powers = [noise.amplitudes @ regression.noise_shapes.at_bands for noise in (
        fit, reported or fit)]
    seen = np.all([np.sum(free * power, axis=1) >= fits.decisions.noise_seen * np.sum(
        regression.counts * power, axis=1) for power in powers], axis=0)
    # Means over longer blocks have less white noise, and as much of slower noise.
    white = fit.amplitudes[:, 0] * (residuals.period / (period or residuals.period) - 1)
    return {fits.design.drives[d]: float(np.sqrt(max(
        regression.noise_floor(fit, d) ** 2 + white[k], 0.0)))
        for k, d in enumerate(regression.drives) if seen[k]}


def noise_at_most(floor: float, bound: float) -> float:
    """Return a noise level, or an upper bound of it that is lower beyond its accuracy."""
    return bound if bound * (1 + DECISIONS.noise_accuracy) < floor else floor


def measure_columns(
    model: DriveModel, recordings: Sequence[Recording],
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[FittedSets | None, Residuals, tuple[str, ...]]:
    """Return columns of the largest fit, and the results of `measure_residuals`.

    Of long recordings the former is of the stretches that a search takes. None where
    there are too few samples for any fit.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
    progress : callable, optional
        Called with the share of the work that is done.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    piece = excerpts_within_memory(model, recordings)
    whole = None
    if any(excerpt is not other for excerpt, other in zip(piece, recordings, strict=True)):
        whole = measure_residuals(model, recordings, lambda share: progress(0.5 * share))
    design = Design.of(model, piece, lambda share: progress(0.5 + 0.5 * share if whole else share))
    residuals, notes = whole or (design.residuals, design.notes)
    try:
        return FittedSets(design, DECISIONS), residuals, notes
    except ResidualsError:
        return None, residuals, notes


def catalogue_blocks(fits: FittedSets) -> list[Block]:
    """Return columns of every effect that the catalogue offers, in all its shapes.

    One block of those that all drives feel, and one of each drive: pairs of blocks take most time.
    """
    regression, components = fits.regression, fits.components
    shared = [regression.block(dict(term.rows)) for term in fits.design.structure
              if any(np.any(rows) for rows in term.rows.values())]
    shared += [components.block(component) for component in components.spanning]
    every = [shared, *([regression.transformed_block({d: rows}) for rows in (
        _directions(fits, effect, d) for effect in local.effects) if len(rows)]
        for d, local in components.local.items())]
    return [fits.regression.joined(blocks) for blocks in every if blocks]


def _directions(fits: FittedSets, effect: type[DriveEffect], d: int) -> Array:
    """Return rows (k, n) that span what an effect may do on a drive, in all its shapes nearly.

    Rows count by their form alone: coefficients of one effect have different units.
    """
    trials = effect.trials(fits.design.covered[d])
    if len(trials) > MOST_SHAPES:
        return np.zeros((0, 0))
    rows: Array = fits.components.local[d].rows_of(effect).astype(float)
    rows = np.compress(np.any(rows, axis=1), rows, axis=0)
    if len(trials) == 1 or not len(rows):
        return rows
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    values, axes = np.linalg.eigh(rows @ rows.T)
    order = np.argsort(-values)[:MOST_DIRECTIONS]
    kept = order[values[order] > LEAST_DIRECTION ** 2 * float(values[-1])]
    return axes[:, kept].T @ rows
