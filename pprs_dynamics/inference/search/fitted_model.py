# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The model of a fitted set, its linear and exact forces, and linearisation around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.regression.base_columns import (
    FrictionForm,
    force_of,
    move_numbers,
    units_of,
    within,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import OperatingPoint, PlacedEffect
from pprs_dynamics.inference.search.candidates import (
    REVERSAL,
    SINCE,
    Candidates,
    CandidateSet,
    EffectCandidate,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.model.drive_model import DriveModel

LEAST_DIFFERENCE = 4.0  # whitened square by which the exact model may differ from the linear one
LEAST_CHANGE = 2.0  # of a cost, for which a set is fitted anew
NEARLY = 0.02  # scales of a shape by which it may differ from that of the columns
MOST_STEPS, MOST_HALVINGS = 6, 4


def parts_of(fits: FittedSets, fitted: CandidateSet) -> tuple[Array, tuple[PlacedEffect, ...]]:
    """Return coefficients of the base columns, 0 for nuisances, and effects with theirs."""
    base = fitted.fit.coefficients[:len(fits.design.base)].copy()
    base[[not column.in_model for column in fits.design.base]] = 0.0
    effects = []
    for component in fitted.blocks:
        every = replace(component, given=()).total(fitted.coefficients(component)).tolist()
        effects.append(PlacedEffect(
            component.effect, component.drive, component.parameters,
            {c.name: value
             for c, value in zip(component.effect.coefficients, every, strict=False)}))
    return base, tuple(effects)


def model_at(design: Design, base: Array, effects: Sequence[PlacedEffect]) -> DriveModel:
    """Return the given model with its numbers as coefficients have them, and with effects.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    values: dict[str, Any] = dict(design.given.values)
    move_numbers(values, design.given, design.base, base)
    names = list(values.get('effects.active', []))
    for effect in effects:
        kind = effect.effect
        if kind.name not in names:
            names.append(kind.name)
        drive = '' if effect.drive is None else f'{design.drives[effect.drive]}.'
        coefficients, shape = effect.coefficients, effect.shape
        if (given := design.present(kind, effect.drive)) is not None:
            # What is there already has been moved within its uncertainty.
            moved = {name: float(values.get(f'effects.{kind.name}.{drive}{name}', value))
                     for name, value in given.items()}
            coefficients = {name: value + coefficients.get(name, 0.0)
                            for name, value in kind.to_coefficients(moved).items()}
            if all(given[name] == value for name, value in shape.items()):
                shape = {name: moved[name] for name in shape}
        every = {**kind.from_coefficients(coefficients), **shape}
        for parameter in kind.parameters:
            if kind.is_of_one_place and every[parameter.name] == parameter.default:
                continue  # of all the links or joints that it is not on
            values[f'effects.{kind.name}.{drive}{parameter.name}'] = within(
                parameter, every[parameter.name], units_of(design.given, effect.drive))
    if names:
        values['effects.active'] = names
    return replace(DriveModel.from_parameters(values), source=design.given.source)


def fitted_model(fits: FittedSets, fitted: CandidateSet) -> DriveModel:
    """Return the given model with the effects of a set, and its numbers as the fit moves them.

    Of effects with a course, with those that are there at the end and stay.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    base, effects = parts_of(fits, fitted)
    return model_at(fits.design, base, [effect for effect, component in zip(
        effects, fitted.blocks, strict=True)
        if component.course is None or component.course.kind == SINCE])


def squared(fits: FittedSets, fitted: CandidateSet, forces: Array) -> float:
    """Return the whitened squares of forces (M, D) under the noise of a set."""
    total = 0.0
    for d in fits.regression.drives:
        white = fits.regression.whitened(fitted.fit, d, np.nan_to_num(forces[:, d]))
        total += float(white @ white)
    return total


def misfit(fits: FittedSets, fitted: CandidateSet, forces: Array) -> float:
    """Return the whitened squares of the residual with other forces (M, D) than the linear ones.

    What a fit explains by columns that are in no model stays explained.
    """
    more, total = np.nan_to_num(linear_prediction(fits, fitted) - forces), 0.0
    for d, series in fits.regression.series.items():
        left = fits.regression.remaining(fitted.fit, d) + series.transform(more[:, d])
        total += float(left ** 2 @ series.spread(fits.regression.weights(fitted.fit, d)))
    return total


def linear_prediction(fits: FittedSets, fitted: CandidateSet) -> Array:
    """Return the forces that the linear fit predicts, reversals as the model has them, (M, D)."""
    design = fits.design
    prediction = design.residuals.model + force_of(
        design.base, fitted.fit.coefficients, design.residuals.model.shape,
        lambda column: column.in_model)
    for candidate in fitted.effects:
        prediction += fits.components.force(fitted, candidate, prediction.shape)
    return prediction


def linear_residual(fits: FittedSets, fitted: CandidateSet) -> Array:
    """Return measured minus what the linear fit predicts, (M, D) [N]."""
    return fits.regression.residuals.measured - linear_prediction(fits, fitted)


def friction_forms(fits: FittedSets, fitted: CandidateSet,
                   kind: type[FrictionForm] = FrictionForm) -> Array:
    """Return the fitted change by another form of the model's friction, (M, D) [N].

    Of one kind, such as the width in which it reverses.
    """
    fit, design = fitted.fit, fits.design
    found = force_of(design.base, fit.coefficients, design.residuals.model.shape,
                     lambda column: isinstance(column, kind))
    for blocks in fitted.nuisance.values():
        if REVERSAL in blocks:
            for d, rows in blocks[REVERSAL].rows.items():
                series = fits.regression.series[d]
                found[series.index, d] += series.inverse(fit.of(blocks[REVERSAL]) @ rows)
    return found


def linear_error(fits: FittedSets, fitted: CandidateSet) -> float:
    """Return the rms of `linear_residual` over all drives [N]."""
    return root_mean_square(linear_residual(fits, fitted))


def linearised(fits: FittedSets, fitted: CandidateSet, most: float = np.inf,
               beside: Candidates = ()) -> tuple[FittedSets, CandidateSet]:
    """Return a set around its own fitted model, and the fitted sets that it is one of.

    Gauss-Newton steps with the effects of the set, each halved until the exact misfit falls, until
    the cost stands still, or is above `most` after one: around a delay the columns of all other
    effects are late, too. Outside the drives only these effects and those of candidates `beside`
    them get columns. The arguments are returned where nothing changes.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    fitted = fits.refined(fitted)
    effects = {c.effect for c in (*fitted.candidates, *beside) if isinstance(c, EffectCandidate)}
    change = np.inf
    for _ in range(MOST_STEPS):
        point = next_operating_point(fits, fitted, change)
        if point is None:
            break
        before, fits = fitted.total, fits.around(point, effects)
        fitted = fits.refined(fits.evaluate(fitted.candidates))
        change = abs(fitted.total - before)
        if fitted.total > most:
            break
    return fits, fitted


def next_operating_point(fits: FittedSets, fitted: CandidateSet, change: float = np.inf,
                         ) -> OperatingPoint | None:
    """Return where to expand next: towards a set's fitted model, as far as the exact misfit falls.

    None where no step lowers it, or where the exact forces of the fitted model are those of the
    linear fit and columns were computed with every nonlinear effect. Its shape must then be
    nearly the same, or the cost have stood still around the last point.
    """
    design = fits.design
    base, effects = parts_of(fits, fitted)
    before, target = design.point, model_at(design, base, effects)
    known = {(effect.effect, effect.drive): effect for effect in before.effects} if before else {}
    is_around = _has_nonlinear(before, effects)
    is_known = before is not None and all(
        (effect.effect, effect.drive) in known for effect in effects)
    if not (is_around or is_known):
        return OperatingPoint(target, base, effects)  # whatever the exact forces are
    exact = design.exact_forces(target)
    if is_around and (change < LEAST_CHANGE or _has_nonlinear(before, effects, NEARLY)) and squared(
            fits, fitted, exact - linear_prediction(fits, fitted)) < LEAST_DIFFERENCE:
        return None
    if before is not None and is_known:
        loss, reached = (misfit(fits, fitted, forces) for forces in (exact, design.forces))
        for _ in range(MOST_HALVINGS):
            if loss < reached:
                break
            base = (base + before.base) / 2
            effects = tuple(_between(known[effect.effect, effect.drive], effect)
                            for effect in effects)
            target = model_at(design, base, effects)
            loss = misfit(fits, fitted, design.exact_forces(target))
        else:
            return None
    return OperatingPoint(target, base, effects)


def is_shown(fits: FittedSets, fitted: CandidateSet) -> bool:
    """Return whether the exact forces of a set are those of the columns, within the rival margin.

    Effects that are linear by themselves change loads, which friction follows.
    """
    if not fitted.effects:
        return True
    if fitted.is_nonlinear and not has_nonlinear(fits, fitted):
        return False
    try:
        exact = fits.design.exact_forces(fitted_model(fits, fitted))
    except PprsError:
        return True
    return squared(fits, fitted, exact - linear_prediction(
        fits, fitted)) < fits.decisions.rival_margin


def has_nonlinear(fits: FittedSets, fitted: CandidateSet) -> bool:
    """Return whether the columns are around the nonlinear effects of a set."""
    return _has_nonlinear(fits.design.point, parts_of(fits, fitted)[1])


def _has_nonlinear(point: OperatingPoint | None, effects: Sequence[PlacedEffect],
                   scales: float = 1.0) -> bool:
    """Return whether a point has the nonlinear ones of some effects, nearly of the same shapes."""
    nonlinear = [effect for effect in effects if effect.effect.nonlinear]
    return not nonlinear or (point is not None and point.has(nonlinear, scales))


def _between(a: PlacedEffect, b: PlacedEffect) -> PlacedEffect:
    """Return the second effect with the means of both effects' coefficients and shapes."""
    def means(first: Mapping[str, float], second: Mapping[str, float]) -> dict[str, float]:
        return {name: (first.get(name, 0.0) + value) / 2 for name, value in second.items()}

    return replace(b, coefficients=means(a.coefficients, b.coefficients),
                   shape=means(a.shape, b.shape))
