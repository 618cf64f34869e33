# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A curve over one variable, fitted to a drive's residual.

The curve is a B-spline with a prior on its roughness (Eilers & Marx, Flexible smoothing with
B-splines and penalties, Statistical Science 11, 1996). The smoothness maximises the restricted
likelihood. The same number, against that without a curve, is the evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.physics.effects.laws.measured_curve import Curve, MeasuredCurve, spline_basis
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_values import UNCERTAINTIES

INTERVALS = 96  # between knots; the prior on the roughness decides how fine the curve is
# Prior standard deviations of the second difference of coefficients, as a share of the error's rms.
ROUGHNESS = np.geomspace(1e-4, 1.0, 13)
WIDEST = 10.0  # prior standard deviation of the curve itself, as a multiple of the error's rms
LEAST_SHARE = 0.002  # of the samples at each end of the variable, beyond which nothing is fitted
TURN = 2 * pi
BLOCKS = 10
FLEXIBLE = 0.1  # roughness of the curve with which the noise is estimated
ACTIVE = 'effects.active'


class FittedCurve:
    """The curve of a drive's error that has the largest evidence, with its band.

    Parameters
    ----------
    residuals : Residuals
        Of the model that the curve joins.
    request : EffectRequest

    Attributes
    ----------
    curve : Curve
    covariance : (p, p) array
        Of its values [N^2].
    evidence : float
        Twice the gain in log restricted likelihood, the curve's coefficients integrated out.
    freedom : float
        Effective number of coefficients.
    held_out : (M,) array
        Its force in each tenth of the recordings by a fit to the others [N].

    Raises
    ------
    EffectRequestError
        Where the variable is not known of this robot or does not vary, or the drive was not
        measured.
    """

    def __init__(self, residuals: Residuals, request: EffectRequest) -> None:
        drive = residuals.drives.index(request.drive)
        x = residuals.variable(request.variable, drive)
        if x is None:
            raise EffectRequestError(
                f'{request.name}: {request.variable} is not known of this robot')
        try:
            regression = Regression(residuals, drives=(drive,))
        except ResidualsError:
            raise EffectRequestError(f'{request.name}: {request.drive} was not measured, or at few '
                                     'samples only') from None
        seen = x[np.isfinite(residuals.measured[:, drive])]
        start, end = np.quantile(seen, (LEAST_SHARE, 1 - LEAST_SHARE))
        if not end - start > 1e-9 * max(1.0, abs(start), abs(end)):
            raise EffectRequestError(
                f'{request.name}: {request.variable} hardly varies in the recordings')
        turns = bool(request.variable.startswith('position') and seen.max() - seen.min() >= TURN
                     and residuals.units_of(request.drive).position == 'rad')
        if turns:
            start, end = -pi, pi
        scale = root_mean_square(residuals.error[np.isfinite(residuals.measured[:, drive]), drive])

        columns = spline_basis(x, start, end, INTERVALS, turns).toarray().T
        unit = np.eye(len(columns))
        second = (unit - 2 * np.roll(unit, 1, 1) + np.roll(unit, 2, 1) if turns
                  else np.diff(unit, 2, axis=0))
        rows = {drive: regression.series[drive].transform(columns)}

        def block(share: float) -> Block:
            """Return the columns of a curve with the precision of its roughness and of its size."""
            return regression.transformed_block(rows, second.T @ second / (share * scale) ** 2
                                                + unit / (WIDEST * scale) ** 2)

        # The noise is that of a flexible curve, the same for all.
        noise = regression.fit((block(FLEXIBLE),))
        best = min((regression.at((block(share),), noise) for share in ROUGHNESS),
                   key=lambda fit: fit.deviance)
        parts = residuals.blocks(BLOCKS)
        others = np.stack([fit.coefficients for fit in regression.from_others(best, parts)])
        precision = best.blocks[0].precision
        self.curve = Curve(request.variable, float(start), float(end),
                           tuple(best.coefficients.tolist()), turns)
        self.covariance = best.covariance
        self.evidence = regression.at((), noise).deviance - best.deviance
        self.freedom = len(best.coefficients) - float(np.trace(best.covariance @ precision))
        self.held_out: Array = np.sum(others[parts].T * columns, axis=0)

    def parameters(self, drive: str, unit: str) -> dict[str, Estimate]:
        """Return the curve's values with their standard deviations, by key of the model file."""
        spread = np.sqrt(np.diag(self.covariance))
        return {f'{drive}.values[{k}]': Estimate(value, float(std), unit)
                for k, (value, std) in enumerate(zip(self.curve.values, spread, strict=True))}

    def band(self, x: Array) -> Array:
        """Return the standard deviation of the curve at values of its variable, (N,)."""
        basis = self.curve.basis(x)
        band: Array = np.sqrt(np.asarray(basis.multiply(basis @ self.covariance).sum(axis=1)))
        return band


def with_curve(model: DriveModel, drive: str, fitted: FittedCurve) -> DriveModel:
    """Return a model with a curve on a drive."""
    curve, prefix = fitted.curve, f'effects.{MeasuredCurve.name}.{drive}'
    active = [name for name in model.values.get(ACTIVE, ()) if name != MeasuredCurve.name]
    return DriveModel.from_parameters({
        **model.values, ACTIVE: [*active, MeasuredCurve.name],
        f'{prefix}.variable': curve.variable, f'{prefix}.from': curve.start,
        f'{prefix}.to': curve.end, f'{prefix}.periodic': curve.periodic,
        f'{prefix}.values': list(curve.values)}, model.source)


def without_curve(model: DriveModel, drive: str) -> DriveModel:
    """Return a model without a drive's curve: itself, where there is none."""
    if not any(key.startswith(f'effects.{MeasuredCurve.name}.{drive}.') for key in model.values):
        return model
    return DriveModel.from_parameters(
        without_effect(model.values, MeasuredCurve.name, [f'{drive}.']), model.source)


def without_effect(values: Mapping[str, Any], name: str, places: Sequence[str]) -> dict[str, Any]:
    """Return the values of a model without an effect in some places, as the beginnings of keys."""
    removed = tuple(f'{block}.{name}.{place}' for block in ('effects', UNCERTAINTIES)
                    for place in places)
    found = {key: value for key, value in values.items() if not key.startswith(removed)}
    if not any(key.startswith(f'effects.{name}.') for key in found):
        found[ACTIVE] = [other for other in found[ACTIVE] if other != name]
    return found
