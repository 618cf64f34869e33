# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The criterion, against a brute-force evaluation of the likelihood that it stands for."""

from __future__ import annotations

import doctest
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

import pprs_dynamics.inference.regression.fit as fit_module
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import BaseColumn, ModelNumber, ReversalShape
from pprs_dynamics.inference.regression.fit import Prior as NamedPrior
from pprs_dynamics.inference.regression.fit import fit
from pprs_dynamics.inference.regression.joint_fit import CERTAIN, JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block, Prior
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.score_test import Entry, ScoreTest

SAMPLES, DRIVES, PERIOD = 240, 2, 0.01


def made_up(seed: int = 0) -> tuple[Regression, list[Block]]:
    """Return two drives with a shared base column and blocks on one and on both of them."""
    rng = np.random.default_rng(seed)
    error = np.cumsum(rng.normal(size=(SAMPLES, DRIVES)), axis=0) * 0.05 + rng.normal(
        size=(SAMPLES, DRIVES))
    residuals = Residuals(('a', 'b'), PERIOD * np.arange(SAMPLES), np.zeros(SAMPLES, dtype=int),
                          error, np.zeros_like(error), {}, {}, PERIOD)
    base = [BaseColumn({d: rng.normal(size=SAMPLES) for d in range(DRIVES)}, 1.0),
            BaseColumn({1: rng.normal(size=SAMPLES)}, 4.0)]
    regression = Regression(residuals, base)
    blocks = [regression.block({0: rng.normal(size=(2, SAMPLES))}),
              regression.block({d: rng.normal(size=(1, SAMPLES)) for d in (0, 1)}),
              regression.block({1: rng.normal(size=(1, SAMPLES))}, CERTAIN * np.eye(1),
                               np.ones(1)),
              regression.block({0: rng.normal(size=(1, SAMPLES))}, 9 * np.eye(1),
                               np.array([0.4]))]
    return regression, blocks


def brute_force(regression: Regression, fit: JointFit) -> float:
    """Return -2 ln of the marginal likelihood, from the covariance of all samples at once."""
    columns = regression.columns
    width = len(columns) + sum(block.size for block in fit.blocks)
    X, y, S = [], [], []
    mean = np.zeros(width)
    for block in fit.blocks:
        if block.mean is not None:
            mean[fit.places[block]] = block.mean
    for d, series in regression.series.items():
        part = np.zeros((len(series), width))
        for k, column in enumerate(columns):
            if d in column.rows:
                part[:, k] = series.transform(column.rows[d])
        rest = series.transform(series.error)
        for block in fit.blocks:
            if d in block.rows:
                part[:, fit.places[block]] = block.rows[d].T
        X.append(part)
        y.append(rest - part @ mean)
        S.append(series.spread(1 / regression.weights(fit, d)))
    prior = block_diag(np.diag([1 / column.precision for column in columns]),
                       *(np.linalg.inv(block.precision) for block in fit.blocks))
    X, y = np.concatenate(X), np.concatenate(y)
    covariance = np.diag(np.concatenate(S)) + X @ prior @ X.T
    sign, log_det = np.linalg.slogdet(covariance)
    assert sign > 0
    return float(log_det + y @ np.linalg.solve(covariance, y))


def test_the_deviance_is_the_likelihood_with_the_coefficients_integrated_out() -> None:
    regression, blocks = made_up()
    for chosen in ([], blocks[:1], blocks[:2], blocks):
        fit = regression.fit(chosen)
        assert fit.deviance == pytest.approx(brute_force(regression, fit), abs=1e-5)
        for block in fit.blocks:
            if block.precision[0, 0] == CERTAIN:
                assert fit.of(block) == pytest.approx(1.0, abs=1e-9)


def limited(column: type[BaseColumn], count: int, *place: Any) -> Prior:
    return Prior.of([column({}, 1.0, *place) for _ in range(count)], ())


@pytest.mark.parametrize('prior', [limited(ModelNumber, 1, None), limited(ReversalShape, 1, 0, 0)])
@pytest.mark.parametrize('information', [0.5, 2.0, 20.0, 200.0])
def test_the_cost_of_a_number_near_its_limit_is_its_integral(
    prior: Prior, information: float,
) -> None:
    x = 1e-5 * np.sinh(np.linspace(-15, 15, 40_001))  # fine at 0, where what is beyond is narrow
    beyond = x - np.clip(x, *prior.limits[:, 0])
    found = []
    for measured in np.linspace(-1, 3 * DEVIATIONS * (1 + 1 / information), 60):
        posterior = prior.posterior(np.array([[information]]), np.array([information * measured]))
        away = posterior.coefficients[0]
        found.append(information * (away - measured) ** 2 + posterior.penalty + posterior.log_det)
        density = np.exp(-0.5 * (information * (x - measured) ** 2 + x ** 2
                                 + prior.beyond * beyond ** 2))
        # But for what lies beyond the other limit.
        assert found[-1] == pytest.approx(
            -2 * np.log(trapezoid(density, x) / np.sqrt(2 * np.pi)), abs=5e-3)


@pytest.mark.parametrize('seed', [1, 16])
def test_the_cost_has_no_step_where_numbers_that_lean_on_each_other_pass_tolerances(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    prior = limited(ModelNumber, 4, None)
    rows = rng.normal(size=(4, 6)) + rng.normal(size=6)
    gram, way = rows @ rows.T, rows @ rng.normal(size=6)
    costs = []
    for size in np.linspace(0, 8, 4001):
        posterior = prior.posterior(gram, size * way)
        c = posterior.coefficients
        costs.append(c @ gram @ c - 2 * size * way @ c + posterior.penalty + posterior.log_det)
    # With the determinant of one side alone it steps by 2.
    assert np.abs(np.diff(costs, 2)).max() < 0.25


def test_the_gain_of_a_block_is_the_fall_of_the_deviance_at_the_same_noise() -> None:
    regression, blocks = made_up(1)
    fit = regression.fit(blocks[:1])
    for block in blocks[1:]:
        after = regression.at((*blocks[:1], block), fit)
        assert regression.gain(fit, block) == pytest.approx(fit.deviance - after.deviance,
                                                            abs=1e-4)


def test_a_constant_under_slow_noise_is_worth_little_and_under_white_noise_much() -> None:
    rng = np.random.default_rng(4)
    gains = []
    for slow in (0.0, 1.0):
        walk = np.cumsum(rng.normal(size=4000)) * 0.03 * slow
        error = (0.3 + 0.05 * rng.normal(size=4000) + walk - walk.mean())[:, None]
        residuals = Residuals(('a',), PERIOD * np.arange(4000), np.zeros(4000, dtype=int), error,
                              np.zeros_like(error), {}, {}, PERIOD)
        regression = Regression(residuals)
        fit = regression.fit(())
        gains.append(regression.gain(fit, regression.block({0: np.ones((1, 4000))})))
    assert gains[0] > 1000
    assert gains[1] < 10


def test_too_short_a_recording_is_a_sentence() -> None:
    short = np.zeros((40, 1))
    residuals = Residuals(('a',), PERIOD * np.arange(40), np.zeros(40, dtype=int), short, short,
                          {}, {}, PERIOD)
    with pytest.raises(ResidualsError, match=r'at most 40 samples .* must contain at least 100'):
        Regression(residuals)


def test_gains_of_a_scan_are_those_of_single_blocks() -> None:
    regression, (*blocks, beside) = made_up(2)
    entries: list[Entry] = []
    rows: dict[int, list[np.ndarray]] = {d: [] for d in range(DRIVES)}
    for block in blocks:
        size, first = block.size, sum(len(parts) for parts in rows[0])
        entries.append(Entry(block, tuple(range(first, first + size)), block.precision, block.mean))
        for d, parts in rows.items():
            parts.append(block.rows.get(d, np.zeros((size, SAMPLES))))
    scan = ScoreTest(regression, {d: np.concatenate(parts).astype(np.float32)
                                  for d, parts in rows.items()}, entries)
    for chosen in ((), (beside,)):
        fit = regression.fit(chosen)
        for labels, gains in scan.gains(fit):
            for block, gain in zip(labels, gains, strict=True):
                assert gain == pytest.approx(regression.gain(fit, block), abs=2e-3)


# Columns are fitted at a prompt as a dense generalised-least-squares solution fits them.

LONG, STEP = 600, 0.02
TIME = STEP * np.arange(LONG)
COLUMNS = {'velocity': np.cos(1.3 * TIME), 'position': np.sin(1.3 * TIME),
           'offset': np.ones(LONG)}
PRIOR = {'velocity': NamedPrior(1.0, 0.5), 'position': NamedPrior(0.0, 2.0),
         'offset': NamedPrior(0.0, 1.0)}


def dense(y: Array, covariance: Array) -> tuple[Array, Array]:
    """Return mean and standard deviations of the posterior by the textbook."""
    X = np.stack(list(COLUMNS.values()), axis=1)
    inverse = np.linalg.inv(covariance)
    precision = np.diag([prior.std ** -2 for prior in PRIOR.values()])
    mean = np.array([prior.mean for prior in PRIOR.values()])
    posterior = np.linalg.inv(X.T @ inverse @ X + precision)
    return (posterior @ (X.T @ inverse @ y + precision @ mean), np.sqrt(np.diag(posterior)))


def test_with_white_noise_that_is_known_it_is_the_textbook() -> None:
    y = (1.4 * COLUMNS['velocity'] - 0.3 * COLUMNS['position'] + 0.1
         + np.random.default_rng(2).normal(0, 0.4, LONG))
    found = fit(y, COLUMNS, {name: prior[:2] for name, prior in PRIOR.items()}, 0.4, STEP)
    mean, spread = dense(y, 0.16 * np.eye(LONG))
    np.testing.assert_allclose(list(found.values.values()), mean, atol=1e-8)
    np.testing.assert_allclose(list(found.deviations.values()), spread, rtol=1e-6)
    # And its cost is the marginal likelihood.
    X = np.stack(list(COLUMNS.values()), axis=1)
    marginal = multivariate_normal(
        X @ [prior.mean for prior in PRIOR.values()],
        0.16 * np.eye(LONG) + X @ np.diag([prior.std ** 2 for prior in PRIOR.values()]) @ X.T)
    assert found.cost == pytest.approx(
        -2 * marginal.logpdf(y) - LONG * np.log(2 * np.pi), abs=1e-4)
    np.testing.assert_allclose(found.residual[:, 0], y - X @ list(found.values.values()))


def test_a_bound_holds_and_the_others_follow() -> None:
    y = -0.5 * COLUMNS['velocity'] + 0.2 + np.random.default_rng(3).normal(0, 0.1, LONG)
    bounded = {**PRIOR, 'velocity': NamedPrior(0.0, 5.0, lower=0.0)}
    found = fit(y, COLUMNS, bounded, 0.1, STEP)
    without = fit(y, {name: COLUMNS[name] for name in ('position', 'offset')}, PRIOR, 0.1, STEP)
    assert found.values['velocity'] == pytest.approx(0, abs=1e-9)
    for name, value in without.values.items():
        assert found.values[name] == pytest.approx(value, abs=1e-6)


def test_a_column_of_another_length_is_refused() -> None:
    with pytest.raises(ResidualsError, match='short has the shape'):
        fit(np.zeros(LONG), {'short': np.ones(5)})


def test_the_example_of_the_documentation_runs() -> None:
    assert doctest.testmod(fit_module).failed == 0
