"""The velocity within which each drive's friction turns over, from what a fit leaves.

Friction that turns over in another width than the model's is no effect that is missing, but it
leaves an error at every reversal. In the fits it is carried by columns that span all widths; here
it becomes one number per drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import minimize_scalar

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active, JointFit, Regression
from pprs_dynamics.effects.active_friction import ActiveFriction
from pprs_dynamics.effects.axis_friction import AxisFriction
from pprs_dynamics.effects.drive_effect import DriveEffect, DriveSamples, MeasurementEffect
from pprs_dynamics.mechanism.reversal import smooth_sign
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.keys import set_number
from pprs_dynamics.model.model_file import build_model
from pprs_dynamics.regression.design import Design

NARROWEST, WIDEST = 0.05, 20.0  # times the model's width
TRIALS = 13
# An effect on a drive, its shape and its coefficients.
_Turning: TypeAlias = tuple[type[DriveEffect], Mapping[str, float], Array]
LEAST_GAIN = 15.0  # twice the log-likelihood, for which a width is told
KEY, COMMON_KEY = 'friction.reversal_velocities', 'friction.reversal_velocity'


def place_of(design: Design, d: int) -> tuple[str, int | None]:
    """Return the key and the element under which a model file has the width of a drive."""
    return (KEY, d) if KEY in design.model.keys else (COMMON_KEY, None)


def with_widths(model: ForceModel, design: Design, widths: Mapping[int, float]) -> ForceModel:
    """Return the model with other widths of reversal [m/s] on some of a design's drives."""
    if not widths:
        return model
    values = dict(model.values)
    for d, width in widths.items():
        set_number(values, *place_of(design, d), width)
    return replace(build_model(values), source=model.source)


def estimate_widths(regression: Regression, fit: JointFit) -> dict[int, float]:
    """Return the widths [m/s] of the drives on which they differ from the model's for certain."""
    known = regression.widths.get(id(fit))
    if known is None or known[0] is not fit:
        # Kept with the fit, so that its id stays its own.
        known = regression.widths[id(fit)] = (fit, _estimate(regression, fit))
    return known[1]


def _estimate(regression: Regression, fit: JointFit) -> dict[int, float]:
    design = regression.design
    friction = next((e for e in design.model.effects
                     if isinstance(e, (ActiveFriction, AxisFriction))), None)
    if friction is None:
        return {}
    found = {}
    for d, series in regression.series.items():
        columns = [(k, row) for k, row in zip(regression.base_index[d], regression.base_rows[d],
                                              strict=True) if design.base[k].kind == 'width'
                   and design.base[k].label.startswith(design.drives[d])]
        if not columns or not design.moves(d):
            continue
        width = float(np.broadcast_to(design.model.reversal.velocity, len(design.drives))[d])
        turning = _turning(regression, fit, d)
        known = [_dry_force(one.samples(slice(None), d), friction.dry(one.guide_load)[:, d],
                            turning) for one in design.recordings]
        rest = fit.rest[d] + sum(fit.coefficients[k] * row for k, row in columns)
        white = series.whiten(fit.noises[d], rest)

        def gain(logarithm: float, d: int = d, width: float = width, white: Array = white,
                 turning: list[_Turning] = turning, known: list[Array] = known) -> float:
            column = _column(regression, d, friction, turning, known,
                             width * float(np.exp(logarithm)))
            own = regression.series[d].whiten(fit.noises[d], column)
            return float(2 * own @ white - own @ own)

        grid = np.linspace(np.log(NARROWEST), np.log(WIDEST), TRIALS)
        best = int(np.argmax([gain(trial) for trial in grid]))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, TRIALS - 1)]
        refined = minimize_scalar(lambda x, gain=gain: -gain(x), bounds=(low, high),
                                  method='bounded', options={'maxiter': 15})
        if -float(refined.fun) > LEAST_GAIN:
            found[d] = width * float(np.exp(refined.x))
    return found


def _turning(regression: Regression, fit: JointFit, d: int) -> list[_Turning]:
    """Return the effects on a drive: those of the fit, and those in the model as it has them."""
    design = regression.design
    found: list[_Turning] = []
    place = len(design.base)
    for one in fit.active:
        if isinstance(one, Active) and one.term.drive == d and _may_turn(one.term.effect):
            kind: Any = one.term.effect
            coefficients = np.zeros(len(kind.coefficients))
            coefficients[one.chosen] = fit.coefficients[place:place + one.size]
            found.append((kind, one.term.shape, coefficients))
        place += one.size
    for effect in design.model.effects:
        drives = effect.drives if isinstance(effect, DriveEffect) else {}
        if _may_turn(type(effect)) and design.drives[d] in drives:
            kind, block = type(effect), drives[design.drives[d]]
            values = kind.to_coefficients(block)
            found.append((kind, {p.name: block[p.name] for p in kind.shape},
                          np.array([values[c.name] for c in kind.coefficients])))
    return found


def _may_turn(effect: type) -> bool:
    """Return whether an effect is a force on a drive that knows no past."""
    return (issubclass(effect, DriveEffect) and not issubclass(effect, MeasurementEffect)
            and effect.drive_memory() is None)


def _dry_force(drive: DriveSamples, dry: Array, turning: list[_Turning]) -> Array:
    """Return all of a drive's force that may turn over with its direction, (N,) [N]."""
    force = dry * drive.direction
    for effect, shape, coefficients in turning:
        force += coefficients @ np.stack(effect.columns(drive, **shape))
    return force


def _column(regression: Regression, d: int, friction: ActiveFriction | AxisFriction,
            turning: list[_Turning], known: list[Array], width: float) -> Array:
    """Return what all friction on a drive changes by when it turns over in another width.

    `known` is the force in the model's own width, recording by recording.
    """
    parts = []
    for one, now in zip(regression.design.recordings, known, strict=True):
        drive = one.samples(slice(None), d)
        drive = replace(drive, direction=smooth_sign(drive.velocity, width))
        change = _dry_force(drive, friction.dry(one.guide_load)[:, d], turning) - now
        parts.append(one.treat(change[:, None])[:, 0])
    column: Array = np.concatenate(parts)[regression.series[d].index]
    return column
