# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Linearisation of a set around its own fitted model, by Gauss-Newton steps.

Some effects change the columns of others, or are linear nearby only. Where the exact forces of
the fitted model differ from the linear prediction, columns are computed anew around the fitted
model, and the error is extrapolated back to the input model: costs around all points are
comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pprs_dynamics.inference.regression.terms import OperatingPoint, PlacedEffect
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.fitted_model import (
    exact_forces,
    linear_prediction,
    model_at,
    parts_of,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets

LEAST_DIFFERENCE = 4.0  # whitened square by which the exact model may differ from the linear one
MOST_STEPS, MOST_HALVINGS = 6, 4


def linearised(fits: FittedSets, fitted: CandidateSet) -> tuple[FittedSets, CandidateSet]:
    """Return a set around its own fitted model, and the fitted sets that it is one of.

    Gauss-Newton steps with the effects of the set, each halved until the exact error falls. The
    arguments are returned where nothing changes.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    fitted = fits.refined(fitted)
    for _ in range(MOST_STEPS):
        point = next_operating_point(fits, fitted)
        if point is None:
            break
        fits = FittedSets(fits.design.around(point, alone=True), fits.decisions,
                          fits.regression.error_scale)
        fitted = fits.refined(fits.evaluate(fitted.candidates))
    return fits, fitted


def next_operating_point(fits: FittedSets, fitted: CandidateSet) -> OperatingPoint | None:
    """Return where to expand next: towards a set's fitted model, as far as the exact error falls.

    None where no step lowers the exact error, or where the exact forces of the fitted model are
    those of the linear fit and columns were computed with every nonlinear effect.
    """
    design = fits.design
    base, effects = parts_of(fits, fitted)
    linear = linear_prediction(fits, fitted)
    measured = fits.regression.residuals.measured
    target = model_at(design, base, effects)
    exact = exact_forces(design, target)
    before = design.point
    if (squared(fits, fitted, exact - linear) < LEAST_DIFFERENCE
            and _has_nonlinear(before, effects)):
        return None
    loss = squared(fits, fitted, measured - exact)
    known = {(effect.effect, effect.drive): effect for effect in before.effects} if before else {}
    if all((effect.effect, effect.drive) in known for effect in effects) and before is not None:
        reached = squared(fits, fitted, measured - design.forces)
        for _ in range(MOST_HALVINGS):
            if loss < reached:
                break
            base = (base + before.base) / 2
            effects = tuple(_between(known[effect.effect, effect.drive], effect)
                            for effect in effects)
            target = model_at(design, base, effects)
            loss = squared(fits, fitted, measured - exact_forces(design, target))
        else:
            return None
    return OperatingPoint(target, base, effects)


def has_nonlinear(fits: FittedSets, fitted: CandidateSet) -> bool:
    """Return whether the columns are around the nonlinear effects of a set."""
    return _has_nonlinear(fits.design.point, parts_of(fits, fitted)[1])


def _has_nonlinear(point: OperatingPoint | None, effects: Sequence[PlacedEffect]) -> bool:
    """Return whether a point has the nonlinear ones of some effects, nearly of the same shapes."""
    known = {(effect.effect, effect.drive): effect for effect in point.effects} if point else {}
    return all((effect.effect, effect.drive) in known and all(
        abs(effect.shape[p.name] - known[effect.effect, effect.drive].shape[p.name]) <= p.scale
        for p in effect.effect.parameters if p.name in effect.shape)
        for effect in effects if effect.effect.nonlinear)


def _between(a: PlacedEffect, b: PlacedEffect) -> PlacedEffect:
    return replace(b, coefficients={
        name: (a.coefficients.get(name, 0.0) + value) / 2
        for name, value in b.coefficients.items()})
