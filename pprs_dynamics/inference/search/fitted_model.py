# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The model that a fitted set stands for, and its forces: by the linear fit, and exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.regression.base_columns import (
    move_numbers,
    move_present,
    units_of,
    within,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import PlacedEffect
from pprs_dynamics.inference.residuals.reconstruction import treated_forces
from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.physics.model.drive_model import DriveModel


def parts_of(fits: FittedSets, fitted: CandidateSet) -> tuple[Array, tuple[PlacedEffect, ...]]:
    """Return coefficients of the base columns, 0 for nuisances, and effects with theirs."""
    base = fitted.fit.coefficients[:len(fits.design.base)].copy()
    base[[not column.in_model for column in fits.design.base]] = 0.0
    effects = []
    for component in fitted.blocks:
        every = component.every(fitted.coefficients(component)).tolist()
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
    move_numbers(values, design.base, base)
    move_present(values, design.given, design.base, base)
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

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    return model_at(fits.design, *parts_of(fits, fitted))


def squared(fits: FittedSets, fitted: CandidateSet, forces: Array) -> float:
    """Return the whitened squares of forces (M, D) under the noise of a set."""
    total = 0.0
    for d in fits.regression.drives:
        white = fits.regression.whitened(fitted.fit, d, np.nan_to_num(forces[:, d]))
        total += float(white @ white)
    return total


def linear_prediction(fits: FittedSets, fitted: CandidateSet) -> Array:
    """Return the forces that the linear fit predicts, reversals as the model has them, (M, D)."""
    design = fits.design
    prediction = design.residuals.model.copy()
    for column, c in zip(design.base, fitted.fit.coefficients, strict=False):
        if column.in_model:
            for d, row in column.rows.items():
                prediction[:, d] += c * row
    for candidate in fitted.effects:
        prediction += fits.components.force(fitted, candidate, prediction.shape)
    return prediction


def linear_residual(fits: FittedSets, fitted: CandidateSet) -> Array:
    """Return measured minus what the linear fit predicts, (M, D) [N]."""
    return fits.regression.residuals.measured - linear_prediction(fits, fitted)


def linear_error(fits: FittedSets, fitted: CandidateSet) -> float:
    """Return the rms of `linear_residual` over all drives [N]."""
    return root_mean_square(linear_residual(fits, fitted))


def exact_forces(design: Design, model: DriveModel) -> Array:
    """Return the treated forces of a model on the recordings of a design, (M, D) [N].

    Raises
    ------
    PprsError
        Where the model cannot follow them.
    """
    return np.concatenate([treated_forces(model, table)['total']
                           for table in design.reconstructed(model)])
