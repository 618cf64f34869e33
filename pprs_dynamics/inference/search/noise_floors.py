# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The noise of every drive, beside all that the catalogue could explain: that of the largest fit.

What is left beside a few columns is noise and whatever they lack. The variance of the noise is
estimated beside all columns at once, as Mallows' C_p takes it of the largest model: what they
spend of the degrees of freedom is counted by the restricted likelihood. Nothing is chosen, so that
the noise does not depend on what a search finds.

References
----------
C. L. Mallows, Some comments on C_p, Technometrics 15 (1973) 661-675.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.regression.normal_equations import Block, NormalEquations
from pprs_dynamics.inference.residuals.long_recordings import excerpts_within_memory
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

# Of all shapes of an effect: directions of their span with less than the share of the strongest
# are left out, and all but the strongest few.
LEAST_DIRECTION, MOST_DIRECTIONS = 0.03, 6
# Shapes of an effect beyond these span no few directions: ripples of any period are any curve.
MOST_SHAPES = 60


def noise_floors(fits: FittedSets, patterns: Mapping[str, Sequence[Array]] = MappingProxyType({}),
                 best: JointFit | None = None, period: float | None = None,
                 ) -> dict[str, float]:
    """Return the rms of the noise of the drives where it can be told [N].

    Parameters
    ----------
    fits : FittedSets
    patterns : mapping of str to sequence of (k, M) arrays, optional
        Further columns by drive: what stands out, and is no noise. Those of as many samples as
        the design has take part.
    best : JointFit, optional
        Of what was found. Its columns take part, and where its noise is, in frequency, columns have
        to leave degrees of freedom, too: slow noise that all columns swallow leaves a fast one.
    period : float, optional
        Between the samples whose noise is told [s]; by default that of the design.
    """
    regression, drives = fits.regression, fits.design.drives
    found = [regression.block({drives.index(name): rows}) for name, every in patterns.items()
             for rows in every if rows.shape[-1] == len(fits.design.residuals)
             and drives.index(name) in regression.drives]
    every = tuple(dict.fromkeys((*catalogue_blocks(fits), *(best.blocks if best else ()), *found)))
    fit = regression.fit(every, fits.evaluate(()).fit.amplitudes)
    told = np.all([_shares_seen(fits, fit, one.amplitudes) >= fits.decisions.noise_seen
                   for one in (fit, best) if one is not None], axis=0)
    # Means over longer blocks have less white noise, and as much of slower noise.
    white = fit.amplitudes[:, 0] * (
        fits.design.residuals.period / (period or fits.design.residuals.period) - 1)
    return {drives[d]: float(np.sqrt(max(regression.noise_floor(fit, d) ** 2 + white[k], 0.0)))
            for k, d in enumerate(regression.drives) if told[k]}


def measure_columns(
    model: DriveModel, recordings: Sequence[Recording],
    progress: Callable[[float], None] = lambda share: None, decisions: Decisions = DECISIONS,
) -> tuple[FittedSets | None, Residuals, tuple[str, ...]]:
    """Return what a largest fit needs, and what `measure_residuals` returns.

    Of long recordings the former is of the stretches that a search takes. None where
    there are too few samples for any fit.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
    progress : callable, optional
        Called with the share of the work that is done.
    decisions : Decisions, optional

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    piece = excerpts_within_memory(model, recordings)
    whole = None
    if any(excerpt is not other for excerpt, other in zip(piece, recordings, strict=True)):
        whole = measure_residuals(model, recordings, lambda done, total: progress(
            0.5 * done / total if total else 0.0))
    design = Design.of(model, piece, lambda share: progress(0.5 + 0.5 * share if whole else share))
    residuals, notes = whole or (design.residuals, design.notes)
    try:
        return FittedSets(design, decisions), residuals, notes
    except ResidualsError:
        return None, residuals, notes


def catalogue_blocks(fits: FittedSets) -> list[Block]:
    """Return columns of every effect that the catalogue offers, in all its shapes."""
    regression, components = fits.regression, fits.components
    blocks = [regression.block(dict(term.rows)) for term in fits.design.structure
              if any(np.any(rows) for rows in term.rows.values())]
    blocks += [components.block(component) for component in components.spanning]
    for d, local in components.local.items():
        blocks += [regression.transformed_block({d: rows})
                   for rows in (_directions(fits, effect, d) for effect in local.effects)
                   if len(rows)]
    return blocks


def _directions(fits: FittedSets, effect: type[DriveEffect], d: int) -> Array:
    """Return rows (k, n) that span what an effect may do on a drive, in all its shapes nearly."""
    trials = effect.trials(fits.design.covered[d])
    if len(trials) > MOST_SHAPES:
        return np.zeros((0, 0))
    rows: Array = fits.components.local[d].rows_of(effect).astype(float)
    if len(trials) == 1:
        return np.compress(np.any(rows, axis=1), rows, axis=0)
    values, axes = np.linalg.eigh(rows @ rows.T)
    order = np.argsort(-values)[:MOST_DIRECTIONS]
    kept = order[values[order] > LEAST_DIRECTION ** 2 * max(float(values[-1]), 1e-300)]
    return axes[:, kept].T @ rows


def _shares_seen(fits: FittedSets, fit: JointFit, amplitudes: Array) -> Array:
    """Return the share of a noise where a fit's columns leave degrees of freedom, (D,)."""
    regression = fits.regression
    leverage = NormalEquations(regression, fit.blocks).solve(fit.spectra,
                                                             regression.counts).leverage
    power = amplitudes @ regression.noise_shapes.at_bands
    free = np.maximum(regression.counts - leverage, 0.0)
    shares: Array = np.sum(free * power, axis=1) / np.sum(regression.counts * power, axis=1)
    return shares
