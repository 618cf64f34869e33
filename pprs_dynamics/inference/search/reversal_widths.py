# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The velocity within which each drive's friction turns over, from the residual of a set.

Friction that turns over in another width than the model's is no missing effect, but it makes an
error at every reversal. In the fits it is carried by columns that span all widths; here
it becomes one number per drive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import ReversalShape, present_values, rounded
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.search.candidates import REVERSAL, CandidateSet
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples, MeasurementEffect
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import set_number

NARROWEST, WIDEST = 0.05, 20.0  # times the model's width
TRIALS = 13
KEY, COMMON_KEY = 'friction.reversal_velocities', 'friction.reversal_velocity'
# An effect on a drive, its shape and its coefficients.
Turning = tuple[type[DriveEffect], Mapping[str, float], Array]


def place_of(design: Design, d: int) -> tuple[str, int | None]:
    """Return the key and the element under which a model file has the width of a drive."""
    return (KEY, d) if KEY in design.given.keys else (COMMON_KEY, None)


def with_widths(model: DriveModel, design: Design, widths: Mapping[int, float]) -> DriveModel:
    """Return a model with other widths of reversal [m/s] on some of a design's drives."""
    if not widths:
        return model
    values = dict(model.values)
    for d, width in widths.items():
        set_number(values, *place_of(design, d), width)
    return replace(DriveModel.from_parameters(values), source=model.source)


def estimate_widths(fits: FittedSets, fitted: CandidateSet) -> dict[int, float]:
    """Return the widths [m/s] of the drives on which they differ from the model's for certain."""
    design, regression = fits.design, fits.regression
    friction = design.friction()
    if friction is None:
        return {}
    widths = {}
    for d in regression.drives:
        columns = [k for k, column in enumerate(design.base)
                   if isinstance(column, ReversalShape) and column.drive == d]
        if not columns or not design.moves(d):
            continue
        width = float(design.model.reversal.widths(len(design.drives))[d])
        series = regression.series[d]
        rest = regression.remaining(fitted.fit, d)
        for k in columns:
            rest = rest + fitted.fit.coefficients[k] * series.transform(design.base[k].rows[d])
        for blocks in fitted.nuisance.values():
            if REVERSAL in blocks and set(blocks[REVERSAL].rows) == {d}:
                rest = rest + fitted.fit.of(blocks[REVERSAL]) @ blocks[REVERSAL].rows[d]
        root = np.sqrt(series.spread(regression.weights(fitted.fit, d)))
        turning = _turning(design, fitted, d)

        def column(trial: float, d: int = d, turning: list[Turning] = turning) -> Array:
            def change(recording: FullRate) -> Array:
                drive = recording.samples(slice(None), d)
                dry = friction.dry(recording.friction_load)[:, d]
                other = replace(drive, direction=smooth_sign(drive.velocity, trial))
                changed: Array = _dry_force(other, dry, turning) - _dry_force(drive, dry, turning)
                return changed[None]

            (row,) = design.shown(d, change)
            return np.asarray(row)

        def loss(logarithm: float, d: int = d, width: float = width, rest: Array = rest,
                 root: Array = root, column: Callable[[float], Array] = column) -> float:
            moved = regression.series[d].transform(column(width * float(np.exp(logarithm)))) * root
            return -float(2 * moved @ (rest * root) - moved @ moved)

        grid = np.linspace(np.log(NARROWEST), np.log(WIDEST), TRIALS)
        best = int(np.argmin([loss(trial) for trial in grid]))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, TRIALS - 1)]
        from scipy.optimize import minimize_scalar  # takes half a second, and few need it

        refined = minimize_scalar(loss, bounds=(low, high), method='bounded',
                                  options={'maxiter': 15})
        if -float(refined.fun) > fits.prior_costs.of_width(TRIALS):
            widths[d] = rounded(width * float(np.exp(refined.x)))
    return widths


def _turning(design: Design, fitted: CandidateSet, d: int) -> list[Turning]:
    """Return the friction on a drive: of the set's effects, and of the given model's."""
    turning: list[Turning] = []
    for component in fitted.blocks:
        kind = component.effect
        if component.drive == d and issubclass(kind, DriveEffect) and _may_turn(kind):
            turning.append((kind, component.parameters,
                            component.every(fitted.coefficients(component))))
    for effect in design.given.effects:
        if (isinstance(effect, DriveEffect) and _may_turn(type(effect))
                and design.drives[d] in effect.drives):
            block = present_values(effect, design.drives[d])
            values = effect.to_coefficients(block)
            turning.append((type(effect), {p.name: block[p.name] for p in effect.shape},
                            np.array([values[c.name] for c in effect.coefficients])))
    return turning


def _may_turn(effect: type[DriveEffect]) -> bool:
    """Return whether an effect is a force on a drive that knows no past."""
    return not issubclass(effect, MeasurementEffect) and effect.drive_memory() is None


def _dry_force(drive: DriveSamples, dry: Array, turning: list[Turning]) -> Array:
    """Return all of a drive's force that may turn over with its direction, (N,) [N]."""
    force = dry * drive.direction
    for effect, shape, coefficients in turning:
        force = force + coefficients @ np.stack(effect.columns(drive, **shape))
    return force
