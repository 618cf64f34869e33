# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One joint fit of the model's numbers, within tolerances, and of effects that are named.

No search: every named effect is fitted on every drive that is asked for, whether it pays or not, so
that its values can be followed from recording to recording. Rows hold the coefficients that the
forces are linear in, whose errors are Gaussian even where the effect is not there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.app.fleet.store import MODEL
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.regression.base_columns import ModelNumber, PresentCoefficient
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.model.drive_model import DriveModel


def fit_named_effects(model: DriveModel, recording: Recording,
                      requests: Sequence[EffectRequest],
                      ) -> tuple[list[dict[str, Any]], Residuals, dict[str, float]]:
    """Return the values of named effects and of the model's numbers.

    Of an effect that the model has, what the recording says that it is, not what it changes. One
    that cannot act on a drive gives no row there.

    Returns
    -------
    rows : list of dict
        drive, effect, parameter, value, std, unit, evidence.
    residuals : Residuals
        Of the model as given.
    noise : dict of str to float
        Noise of the fit, by drive [N].

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    design = Design.of(model, [recording])
    regression = Regression(design.residuals, design.base)
    terms = [term for request in requests
             for term in _terms(design, regression, request)]
    blocks = [_block(regression, term) for term in terms]
    fit = regression.fit(blocks)
    rows = [row for term, block in zip(terms, blocks, strict=True)
            for row in _rows(design, regression, fit, term, block)]
    rows += _own_numbers(design, fit)
    return rows, design.residuals, {design.drives[d]: regression.noise_floor(fit, d)
                                    for d in regression.drives}


def _terms(design: Design, regression: Regression, request: EffectRequest) -> Iterator[Term]:
    effect = request.effect
    if not issubclass(effect, DriveEffect):
        yield from (term for term in design.structure if term.effect.name == effect.name
                    and any(np.any(rows) for rows in term.rows.values()))
        return
    for d in regression.drives:
        if request.drives is not None and design.drives[d] not in request.drives:
            continue
        if not design.acts_on(effect, d):
            continue
        there = design.present(effect, d)
        shapes: list[Mapping[str, float]] = [{}]
        if effect.shape:
            shapes = (list(effect.trials(design.covered[d])) if there is None
                      else [{p.name: there[p.name] for p in effect.shape}])
        terms = [design.term(effect, d, shape) for shape in shapes]
        if len(terms) == 1:
            yield terms[0]
        else:
            # The best of the shapes tried, beside the model alone.
            alone = regression.fit(())
            yield max(terms, key=lambda term: regression.gain(alone, _block(regression, term)))


def _block(regression: Regression, term: Term) -> Block:
    return regression.term_block(term, term.names)


def _rows(design: Design, regression: Regression, fit: JointFit, term: Term, block: Block,
          ) -> Iterator[dict[str, Any]]:
    drive = None if term.drive is None else design.drives[term.drive]
    place = {'drive': drive, 'effect': term.effect.name}
    if term.names:
        at = fit.places[block]
        values, covariance = fit.coefficients[at], fit.covariance[at, at]
        # What the deviance rises by without the effect, at the noise of the fit.
        evidence = float(values @ np.linalg.solve(covariance, values))
        there = design.present(term.effect, term.drive)
        given = {} if there is None else term.effect.to_coefficients(there)
        for k, coefficient in enumerate(term.effect.coefficients):
            value, variance = _with_present(design, fit, term, coefficient, at.start + k)
            yield {**place, 'parameter': coefficient.name,
                   'value': given.get(coefficient.name, 0.0) + value,
                   'std': float(np.sqrt(variance)), 'unit': coefficient.unit,
                   'evidence': evidence}
    for parameter in term.effect.shape:
        yield {**place, 'parameter': parameter.name, 'value': float(term.shape[parameter.name]),
               'unit': parameter.unit}


def _with_present(design: Design, fit: JointFit, term: Term, coefficient: Parameter, place: int,
                  ) -> tuple[float, float]:
    """Return a coefficient with its variance, what moves that of the model among it."""
    drive = None if term.drive is None else design.drives[term.drive]
    weights = np.zeros(len(fit.coefficients))
    weights[place] = 1.0
    for k, column in enumerate(design.base):
        if isinstance(column, PresentCoefficient) and (
                column.effect, column.drive, column.coefficient) == (
                term.effect, drive, coefficient):
            weights[k] = coefficient.scale
    return float(weights @ fit.coefficients), float(weights @ fit.covariance @ weights)


def _own_numbers(design: Design, fit: JointFit) -> Iterator[dict[str, Any]]:
    for k, column in enumerate(design.base):
        if isinstance(column, ModelNumber):
            number = column.number
            label = number.key if number.element is None else f'{number.key}[{number.element + 1}]'
            yield {'effect': MODEL, 'parameter': label,
                   'value': column.value(float(fit.coefficients[k])),
                   'std': float(np.sqrt(fit.covariance[k, k])) * number.deviation,
                   'unit': number.unit}
