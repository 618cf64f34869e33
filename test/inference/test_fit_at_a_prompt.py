# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns are fitted at a prompt as a dense generalised-least-squares solution fits them."""

from __future__ import annotations

import doctest

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pprs_dynamics.inference.regression.fit as fit_module
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.fit import Prior, fit
from pprs_dynamics.inference.residuals.residuals import ResidualsError

SAMPLES, PERIOD = 600, 0.02
TIME = PERIOD * np.arange(SAMPLES)
COLUMNS = {'velocity': np.cos(1.3 * TIME), 'position': np.sin(1.3 * TIME),
           'offset': np.ones(SAMPLES)}
PRIOR = {'velocity': Prior(1.0, 0.5), 'position': Prior(0.0, 2.0), 'offset': Prior(0.0, 1.0)}


def dense(y: Array, covariance: Array) -> tuple[Array, Array]:
    """Return mean and standard deviations of the posterior by the textbook."""
    X = np.stack(list(COLUMNS.values()), axis=1)
    inverse = np.linalg.inv(covariance)
    precision = np.diag([one.std ** -2 for one in PRIOR.values()])
    mean = np.array([one.mean for one in PRIOR.values()])
    posterior = np.linalg.inv(X.T @ inverse @ X + precision)
    return (posterior @ (X.T @ inverse @ y + precision @ mean), np.sqrt(np.diag(posterior)))


def test_with_white_noise_that_is_known_it_is_the_textbook() -> None:
    y = (1.4 * COLUMNS['velocity'] - 0.3 * COLUMNS['position'] + 0.1
         + np.random.default_rng(2).normal(0, 0.4, SAMPLES))
    found = fit(y, COLUMNS, PRIOR, 0.4, PERIOD)
    mean, spread = dense(y, 0.16 * np.eye(SAMPLES))
    np.testing.assert_allclose(list(found.values.values()), mean, atol=1e-8)
    np.testing.assert_allclose(list(found.deviations.values()), spread, rtol=1e-6)
    # And its cost is the marginal likelihood.
    X = np.stack(list(COLUMNS.values()), axis=1)
    marginal = multivariate_normal(
        X @ [one.mean for one in PRIOR.values()],
        0.16 * np.eye(SAMPLES) + X @ np.diag([one.std ** 2 for one in PRIOR.values()]) @ X.T)
    assert found.cost == pytest.approx(
        -2 * marginal.logpdf(y) - SAMPLES * np.log(2 * np.pi), abs=1e-4)
    np.testing.assert_allclose(found.residual[:, 0], y - X @ list(found.values.values()))


def test_a_bound_holds_and_the_others_follow() -> None:
    y = -0.5 * COLUMNS['velocity'] + 0.2 + np.random.default_rng(3).normal(0, 0.1, SAMPLES)
    bounded = {**PRIOR, 'velocity': Prior(0.0, 5.0, lower=0.0)}
    found = fit(y, COLUMNS, bounded, 0.1, PERIOD)
    without = fit(y, {name: COLUMNS[name] for name in ('position', 'offset')}, PRIOR, 0.1, PERIOD)
    assert found.values['velocity'] == pytest.approx(0, abs=1e-9)
    for name, value in without.values.items():
        assert found.values[name] == pytest.approx(value, abs=1e-6)


def test_a_column_of_another_length_is_refused() -> None:
    with pytest.raises(ResidualsError, match='short has the shape'):
        fit(np.zeros(SAMPLES), {'short': np.ones(5)})


def test_the_example_of_the_documentation_runs() -> None:
    assert doctest.testmod(fit_module).failed == 0
