# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The gates of an adoption and of a search, each alone, on numbers whose answer is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.signal
from made_up_diagnosis import found_effect

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adopt import _Case
from pprs_dynamics.inference.diagnosis.answer import unconfirmed_effects
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import (
    COURSE_TIMES,
    DRIFT,
    DURING,
    SINCE,
    Component,
    Course,
    PriorCosts,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.held_out import BLOCKS, PredictiveGain, predictive_gain
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, find_file


def gain(*in_errors: float) -> PredictiveGain:
    """Return gains of drives over ten blocks that are so many of their standard errors."""
    spread = 10 * np.tile([-1.0, 1.0], 5)[:, None]
    return PredictiveGain(DRIVES[:len(in_errors)], spread + np.array(in_errors) * spread.std(
        ddof=1) / 10 ** 0.5, np.full((10, len(in_errors)), 1e-3))


# --- held-out errors ------------------------------------------------------------------------------


def test_the_gain_of_one_drive_is_enough_where_no_other_loses() -> None:
    assert gain(9.0, -0.5).confirms
    assert not gain(9.0, -4.0).confirms
    assert gain(9.0, -4.0).losing == ('slide_2',)
    # One of six drives gains 2.5 standard errors by chance in every 26th recording.
    assert gain(2.5).confirms
    assert not gain(2.5, -0.6, -0.6, -0.6, 0.0, 0.0).confirms


def test_a_gain_that_is_no_number_confirms_nothing() -> None:
    assert not gain(9.0, np.nan).confirms
    assert not gain(np.nan).confirms


def test_newtons_and_newton_metres_are_not_added() -> None:
    """A wrist gains 200 standard errors while the much larger error of a slide stays as it is."""
    rng = np.random.default_rng(2)
    wave = np.sin(0.01 * np.pi * np.arange(4000))
    error = np.column_stack([200 * rng.normal(size=4000), wave + 0.1 * rng.normal(size=4000)])
    after = error.copy()
    after[:, 0] += 0.02 * np.sign(error[:, 0])  # rises by 5e-5 of itself
    after[:, 1] -= wave
    assert root_mean_square(after) > root_mean_square(error)
    found = predictive_gain(residuals_of(error), residuals_of(after))
    assert found.by_drive['drive_1'] > 100
    assert found.confirms
    assert not predictive_gain(residuals_of(after), residuals_of(error)).confirms


def test_adopt_refuses_an_error_that_does_not_fall_however_sure_the_gain_is() -> None:
    """The error that is printed decides; the gain says whether its fall is more than chance."""
    case = _Case(DriveModel.load(find_file(DEFAULT_MODEL)), (), (), None, None)  # type: ignore[arg-type]
    sure, unsure = gain(9.0), gain(0.5)
    for after in (1.0, 1.2, np.nan):
        said, = case.objections(sure, (1.0, after), 'the recordings', 'N')
        assert 'does not fall' in said
    assert case.objections(sure, (1.0, 0.9), 'the recordings', 'N') == ()
    # Of a wrist that gains and a slide that hardly loses the sum in newtons or newton metres rises.
    assert case.objections(sure, (141.9, 141.91), 'the recordings', 'N or N m') == ()
    # Of several effects in joint values the error over all drives falls with the last.
    several = replace(case, is_alone=False)
    assert several.objections(sure, (1.0, 1.2), 'the recordings', 'N') == ()
    said, = several.objections(unsure, (1.0, 1.2), 'the recordings', 'N')
    assert said.endswith(
        'falls by 0.5 standard errors; it must fall by at least 2 and rise on no drive')
    assert case.objections(unsure, (1.0, 0.9), 'the recordings', 'N') == (said,)


@pytest.mark.parametrize('slow', [False, True])
def test_a_force_that_one_model_takes_for_slow_noise_is_not_forgiven(slow: bool) -> None:
    """An error that falls to a quarter is a gain, one that doubles a loss, at any frequency."""
    rng = np.random.default_rng(3)
    noise = 0.005 * rng.normal(size=(4000, 1))
    step = 0.0 if not slow else 0.995
    left = scipy.signal.lfilter([1.0], [1.0, -step], rng.normal(size=(4000, 1)), axis=0)
    force = 0.03 * left / left.std()
    cured = predictive_gain(residuals_of(noise + force), residuals_of(noise))
    assert cured.confirms
    worse = predictive_gain(residuals_of(noise), residuals_of(noise + force))
    assert worse.losing == ('drive_0',)
    assert worse.certainty == pytest.approx(-cured.certainty)


def test_of_blocks_alike_the_certainty_is_the_mean_in_its_standard_errors() -> None:
    values = np.array([1.0, 2.0, 4.0, 5.0])

    def certainty(gains: np.ndarray, sizes: float) -> float:
        return PredictiveGain(('axis',), gains[:, None], np.full((len(gains), 1), sizes)).certainty

    # Mean 3, deviation sqrt(10 / 3), four of them.
    assert certainty(values, 0.1) == pytest.approx(3 / (np.sqrt(10 / 3) / 2))
    # As far as noise alone does not make more of it.
    assert certainty(np.full(5, 2.0), 2.0) == pytest.approx(10 ** 0.5 / 2)
    assert certainty(np.full(5, -2.0), 2.0) < 0
    assert certainty(np.zeros(5), 0.0) == 0


@pytest.mark.parametrize('blocks', [1, 2, 10])
@pytest.mark.parametrize('is_there', [True, False])
def test_certainty_is_in_standard_errors_wherever_an_effect_shows(
        blocks: int, is_there: bool) -> None:
    """Of recordings with and without an effect of known force, it has a deviation of one."""
    rng = np.random.default_rng(blocks)
    force = np.zeros((10, 200))
    force[:blocks] = rng.normal(size=(blocks, 200))
    force *= 6 / np.linalg.norm(force)
    found = []
    for _ in range(400):
        error = rng.normal(size=force.shape) + is_there * force
        found.append(PredictiveGain(
            ('axis',), np.sum(error ** 2 - (error - force) ** 2, axis=1, keepdims=True),
            np.sum(force ** 2, axis=1, keepdims=True)).certainty)
    # |f|^2 over the deviation 2 |f| of 2 noise . f.
    assert np.mean(found) == pytest.approx(3 if is_there else -3, abs=0.4)
    assert 0.75 < np.std(found) < 1.1


def residuals_of(error: np.ndarray) -> Residuals:
    """Return drives with an error (N, D), 10 ms apart."""
    samples, width = error.shape
    return Residuals(tuple(f'drive_{k}' for k in range(width)), 0.01 * np.arange(samples),
                     np.zeros(samples, dtype=int), error, np.zeros_like(error), {}, {}, 0.01)


def test_a_block_gains_what_an_error_in_it_loses_over_the_noise() -> None:
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.normal(size=(2000, 3))
    error = noise.copy()
    error[400:600, 1] += 0.2 * np.sign(rng.normal(size=200))  # of no colour, in the third block
    # The last drive was measured for 99 samples: too few to count.
    for series in (error, noise):
        series[99:, 2] = np.nan
    found = predictive_gain(residuals_of(error), residuals_of(noise))
    assert found.gains.shape == found.sizes.shape == (BLOCKS, 3)
    expected = float(np.sum(error[400:600, 1] ** 2 - noise[400:600, 1] ** 2)) / 0.05 ** 2
    assert found.gains[2, 1] == pytest.approx(expected, rel=0.1)
    assert found.sizes[2, 1] == pytest.approx(200 * 0.2 ** 2 / 0.05 ** 2, rel=0.1)
    others = np.delete(found.gains, 2, axis=0)
    assert np.abs(others).max() < 0.02 * expected
    assert not np.any(found.gains[:, [0, 2]])
    assert found.by_drive['drive_0'] == found.by_drive['drive_2'] == 0


# Prior costs are -2 ln of prior probabilities: they add up to one over what a robot can have.

COSTS = PriorCosts(25, 6, 4000, DECISIONS)
SIGNED = [effect for effect in CATALOGUE.values() if effect.unphysical_below]


def test_the_penalty_of_a_sign_is_the_integral_over_its_prior() -> None:
    """By quadrature: prior density 2 (1 - e) of a wide Gaussian on one side, 2 e on the other."""
    e, std = DECISIONS.wrong_sign_odds, 0.7
    points = np.linspace(-40, 40, 800001)
    for deviations in (-4.0, -1.0, -0.001, 0.0, 0.001, 1.0, 4.0):
        posterior = np.exp(-(points / std - deviations) ** 2 / 2) / (std * np.sqrt(2 * np.pi))
        factor = np.where(points > 0, 2 * (1 - e), np.where(points < 0, 2 * e, 1.0))
        integral = np.trapezoid(posterior * factor, points)
        assert COSTS.of_sign(deviations) == pytest.approx(-2 * np.log(integral), abs=1e-6)


@pytest.mark.parametrize('effect', SIGNED, ids=lambda case: case.name)
def test_signed_parameters_are_coefficients(effect: type[CatalogueEffect]) -> None:
    names = tuple(c.name for c in effect.coefficients)
    component = Component(effect, 0 if issubclass(effect, DriveEffect) else None, names)
    assert set(component.signed) == set(effect.unphysical_below)


@pytest.mark.parametrize(('kind', 'count'), [
    (SINCE, COURSE_TIMES), (DURING, COURSE_TIMES ** 2), (DRIFT, 1)])
def test_all_changes_of_a_kind_share_the_odds_of_a_change(kind: str, count: int) -> None:
    cost = COSTS.of_course(Course(kind, 1.0, 2.0))
    assert count * np.exp(-cost / 2) == pytest.approx(DECISIONS.onset_odds)


def test_asymmetric_friction_claims_dry_and_viscous_friction_apart() -> None:
    effect = CATALOGUE['asymmetric_friction']
    dry, viscous = (effect.hypotheses((name,)) for name in ('force_forward', 'viscous_backward'))
    assert len(dry) == len(viscous) == 1
    assert effect.hypotheses(('force_forward', 'force_backward')) == dry
    assert effect.hypotheses(('force_backward', 'viscous_forward')) == dry | viscous
    # What claims one thing only claims as many as it has sets of coefficients.
    spring = CATALOGUE['hysteresis']
    assert len(spring.hypotheses(('force',)) | spring.hypotheses(('coefficient',))) == 2


@pytest.mark.parametrize(('rises', 'count'), [(0.9, 0), (1.1, 2)])
def test_effects_that_raise_the_error_together_are_not_confirmed(
    rises: float, count: int,
) -> None:
    """Two effects that cancel each other each lower the error beside the other."""
    effects = (found_effect('load_friction'), found_effect('hysteresis'))
    answer: Any = SimpleNamespace(
        effects=effects, over_noise=root_mean_square, remaining=np.full((9, 1), rises),
        given=SimpleNamespace(error=np.ones((9, 1))))
    unconfirmed = unconfirmed_effects(answer)
    assert [effect.name for effect in unconfirmed] == [effect.name for effect in effects][:count]
    assert all('with all reported effects' in effect.objection for effect in unconfirmed)
