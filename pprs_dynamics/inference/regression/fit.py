# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fit columns with priors to a series whose noise is coloured, at a prompt.

>>> import numpy as np
>>> from pprs_dynamics.inference.regression.fit import Prior, fit
>>> t = np.arange(0.0, 20.0, 0.01)
>>> velocity = np.cos(t)
>>> y = 2.0 * velocity + np.random.default_rng(1).normal(0.0, 0.3, len(t))
>>> found = fit(y, {'viscous': velocity, 'offset': np.ones(len(t))},
...             prior={'viscous': Prior(0.0, 10.0, lower=0.0)}, period=0.01)
>>> abs(found.values['viscous'] - 2.0) < 4 * found.deviations['viscous']
True
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.constrained import Inequalities, constrained
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError


class Prior(NamedTuple):
    """Gaussian prior of a coefficient, within bounds.

    Parameters
    ----------
    mean, std : float
        An infinite `std` means the g-prior of `Regression.block` about 0.
    lower, upper : float
    """

    mean: float = 0.0
    std: float = inf
    lower: float = -inf
    upper: float = inf


@dataclass(frozen=True)
class ColumnsFit:
    """Coefficients of columns, with their noise.

    Parameters
    ----------
    values, deviations : dict of str to float
        Posterior means and standard deviations by name.
    covariance : (k, k) array
        In the order of the names.
    cost : float
        -2 ln of the likelihood with the coefficients integrated out, without N ln(2 pi). With
        bounds it rises by the squared distance of the bounded mode.
    residual : (N, D) array
    noise_rms : (D,) array
        Root of the mean square of each series' noise.
    joint : JointFit
    """

    values: dict[str, float]
    deviations: dict[str, float]
    covariance: Array = field(repr=False)
    cost: float
    residual: Array = field(repr=False)
    noise_rms: Array
    joint: JointFit = field(repr=False)


def fit(y: Array, columns: Mapping[str, Array], prior: Mapping[str, Sequence[float]] | None = None,
        noise: float | None = None, period: float = 1.0) -> ColumnsFit:
    """Return the fit of columns to one or several series, with the noise fitted as well.

    Parameters
    ----------
    y : (N,) or (N, D) array
        Even samples; NaN where nothing was measured.
    columns : mapping of str to array
        Of the shape of y. A coefficient is shared by all series in which its column is not 0.
    prior : mapping of str to Prior, optional
        Or to mean and standard deviation.
    noise : float, optional
        Standard deviation of white noise; by default a smooth falling spectrum is fitted to each
        series by restricted maximum likelihood.
    period : float
        Between samples [s].

    Raises
    ------
    ResidualsError
        For columns of another shape than y, or fewer than 100 samples.
    """
    series = y.reshape(len(y), -1)
    for name, column in columns.items():
        if np.shape(column) != np.shape(y):
            raise ResidualsError('column', f'{name} has the shape {np.shape(column)}',
                                 f'have that of y, {np.shape(y)}')
    drives = tuple(f'series {d}' for d in range(series.shape[1]))
    time: Array = period * np.arange(len(y), dtype=float)
    residuals = Residuals(drives, time, np.zeros(len(y), dtype=int), series,
                          np.zeros_like(series), period=period)
    regression = Regression(residuals)
    priors = [Prior(*(prior or {}).get(name, ())) for name in columns]
    rows = [column.reshape(series.shape) for column in columns.values()]
    blocks = [regression.block(
        {d: row[:, d] for d in range(series.shape[1]) if np.any(row[:, d])},
        None if known.std == inf else np.array([[known.std ** -2]]),
        None if known.std == inf else np.array([known.mean]))
        for row, known in zip(rows, priors, strict=True)]
    if noise is None:
        found = regression.fit(blocks)
    else:
        amplitudes = np.zeros((len(regression.drives), len(regression.noise_shapes.at_bands)))
        amplitudes[:, 0] = noise ** 2
        found = regression.at(blocks, amplitudes)
    index = np.arange(len(blocks))
    bounds = np.array([known[2:] for known in priors]).reshape(-1, 2)
    A, b = np.concatenate((np.eye(len(blocks)), -np.eye(len(blocks)))), np.concatenate(
        (bounds[:, 0], -bounds[:, 1]))
    known = np.isfinite(b)
    within = constrained(found.coefficients, found.covariance, Inequalities(A[known], b[known]))
    if within is None:
        raise ResidualsError('prior', 'its lower bounds are above its upper ones', 'leave a value')
    if len(within.active.b):
        found = regression.conditioned(found, index, within.active)
    explained = sum((c * row for c, row in zip(found.coefficients, rows, strict=True)),
                    np.zeros_like(series))
    spread = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    return ColumnsFit(
        dict(zip(columns, found.coefficients.tolist(), strict=True)),
        dict(zip(columns, spread.tolist(), strict=True)), found.covariance, found.deviance,
        series - explained,
        np.array([drive.rms for drive in regression.noise(found).values()]), found)
