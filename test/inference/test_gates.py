# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The gates of an adoption and of a search, each alone, on numbers whose answer is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.signal

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.regression.joint_fit import JointFit
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.residuals import Residuals, rms, rms_by_drive
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.form_error import SHAPES, FormErrors
from pprs_dynamics.inference.search.held_out import BLOCKS, PredictiveGain, predictive_gain
from pprs_dynamics.physics.effects.catalogue import CATALOGUE

PLAIN = DriveModel.load()
FRICTION = DriveModel.from_parameters({**PLAIN.values, 'effects.active': ['coulomb_friction'],
                        'effects.coulomb_friction.lift_2.force': -1.0})


def gain(*in_errors: float) -> PredictiveGain:
    """Return gains of drives over ten blocks that are so many of their standard errors."""
    spread = 10 * np.tile([-1.0, 1.0], 5)[:, None]
    return PredictiveGain(DRIVES[:len(in_errors)], spread + np.array(in_errors) * spread.std(
        ddof=1) / 10 ** 0.5, np.full((10, len(in_errors)), 1e-3))


# --- held-out errors ------------------------------------------------------------------------------


def test_the_gain_of_one_drive_is_enough_where_no_other_loses() -> None:
    assert gain(9.0, -0.5).confirms(2.0)
    assert not gain(9.0, -4.0).confirms(2.0)
    assert gain(9.0, -4.0).losing == ('slide_2',)
    # One of six drives gains 1.5 standard errors by chance in every third recording.
    assert gain(1.5).confirms(1.0)
    assert not gain(1.5, -0.6, -0.6, 0.0, 0.0, 0.0).confirms(1.0)


def test_a_gain_that_is_no_number_confirms_nothing() -> None:
    assert not gain(9.0, np.nan).confirms(1.0)
    assert not gain(np.nan).confirms(1.0)


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
    assert found.confirms(2.0)
    assert not predictive_gain(residuals_of(after), residuals_of(error)).confirms(2.0)


@pytest.mark.parametrize('slow', [False, True])
def test_a_force_that_one_model_takes_for_slow_noise_is_not_forgiven(slow: bool) -> None:
    """An error that falls to a quarter is a gain, one that doubles a loss, at any frequency."""
    rng = np.random.default_rng(3)
    noise = 0.005 * rng.normal(size=(4000, 1))
    step = 0.0 if not slow else 0.995
    left = scipy.signal.lfilter([1.0], [1.0, -step], rng.normal(size=(4000, 1)), axis=0)
    force = 0.03 * left / left.std()
    cured = predictive_gain(residuals_of(noise + force), residuals_of(noise))
    assert cured.confirms(2.0)
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


def test_errors_are_roots_of_mean_squares_of_what_was_measured() -> None:
    error = np.array([[3.0, np.nan, np.nan], [4.0, 5.0, np.nan]])
    assert rms(residuals_of(error)) == pytest.approx((50 / 3) ** 0.5)
    by_drive = rms_by_drive(residuals_of(error))
    assert by_drive == pytest.approx({'drive_0': 12.5 ** 0.5, 'drive_1': 5.0})


def test_a_block_gains_what_an_error_in_it_loses_over_the_noise() -> None:
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.normal(size=(2000, 3))
    error = noise.copy()
    error[400:600, 1] += 0.2 * np.sign(rng.normal(size=200))  # of no colour, in the third block
    # The last drive was measured for 99 samples: too few to count.
    for one in (error, noise):
        one[99:, 2] = np.nan
    found = predictive_gain(residuals_of(error), residuals_of(noise))
    assert found.gains.shape == found.sizes.shape == (BLOCKS, 3)
    expected = float(np.sum(error[400:600, 1] ** 2 - noise[400:600, 1] ** 2)) / 0.05 ** 2
    assert found.gains[2, 1] == pytest.approx(expected, rel=0.1)
    assert found.sizes[2, 1] == pytest.approx(200 * 0.2 ** 2 / 0.05 ** 2, rel=0.1)
    others = np.delete(found.gains, 2, axis=0)
    assert np.abs(others).max() < 0.02 * expected
    assert not np.any(found.gains[:, [0, 2]])
    assert found.by_drive['drive_0'] == found.by_drive['drive_2'] == 0


@pytest.mark.parametrize('samples', [99, 100])
def test_a_drive_counts_from_a_hundred_samples_on(samples: int) -> None:
    error = np.full((2000, 1), np.nan)
    error[:samples] = np.random.default_rng(2).normal(size=(samples, 1))
    found = predictive_gain(residuals_of(error), residuals_of(0.5 * error))
    assert bool(found.gains.sum() > 0) is (samples == 100)


# --- lack of fit ----------------------------------------------------------------------------------


class Rows:
    """A regression of one drive with unit noise, whose columns are given: whitened, and known."""

    def __init__(self, parts: dict[str, np.ndarray]) -> None:
        self.residuals = SimpleNamespace(parts=parts)
        self.drives = (0,)
        self.series = {0: SimpleNamespace(transform=lambda force: force,
                                          sums=lambda values: values.sum(keepdims=True))}

    @staticmethod
    def weights(_: Any, __: int) -> np.ndarray:
        return np.ones(1)

    @staticmethod
    def products(first: Any, others: Any, d: int) -> list[np.ndarray]:
        return [(first.rows[d] @ one.rows[d].T)[None] for one in others]



def set_of(**columns: tuple[str, float, float]) -> Any:
    """Return a set: every column is 10 long, (effect, size of its force, of it its own)."""
    candidates, blocks, places, coefficients = [], [], {}, []
    for number, (effect, size, _) in enumerate(columns.values()):
        block = Block({0: np.array([[10.0]])}, np.zeros((1, 1)))
        component = Component.of(CATALOGUE[effect], 0, {}, ('size',))
        candidates.append(EffectCandidate(CATALOGUE[effect], (component,)))
        blocks.append(block)
        places[block] = slice(number, number + 1)
        coefficients.append(size / 10)
    own = [one for *_, one in columns.values()]
    # The covariance of a coefficient is 1 over the square of what is the column's own.
    covariance = np.diag([1 / (10 * share) ** 2 for share in own])
    nothing = np.zeros((1, 1))
    fitted = JointFit(tuple(blocks), np.array(coefficients), covariance, nothing, nothing, 0.0,
                      nothing, places)
    return SimpleNamespace(
        effects=tuple(candidates), candidates=tuple(candidates), fit=fitted,
        blocks_of=lambda one: [block for candidate, block in zip(candidates, blocks, strict=True)
                               if candidate is one])


DECIDED = Decisions(form_share=0.1 * SHAPES ** 0.5, exact_share=0.02)


def share(found: Any, which: int, parts: dict[str, np.ndarray] | None = None,
          model: Any = PLAIN) -> tuple[float, tuple[str, ...]]:
    """Return the force of a candidate over the form errors beside it, and whose they are."""
    design: Any = SimpleNamespace(given=model, carried=None)
    regression: Any = Rows(parts or {})
    errors, candidate = FormErrors(design, regression, DECIDED), found.candidates[which]
    allowed, names = errors.beside(found, candidate, set(found.blocks_of(candidate)[0].rows))
    own = errors._beyond_others(found, candidate)
    return float(np.sqrt(own / max(allowed, 1e-300))), names


def test_an_idealised_effect_may_leave_a_tenth_in_another_and_a_fiftieth_in_an_exact_one() -> None:
    # 20 of friction beside 100 of a spring: twice a tenth of it.
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    assert CATALOGUE['drive_spring'].idealised
    assert share(found, 1) == (pytest.approx(2.0), ('drive_spring',))
    # Half of what it is, if half its column is its own.
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 0.5))
    assert share(found, 1)[0] == pytest.approx(1.0)
    # A mass is exact: ten times a fiftieth.
    for exact in ('drive_inertia', 'payload_mass'):
        assert not CATALOGUE[exact].idealised
        found = set_of(a=('drive_spring', 100.0, 1.0), b=(exact, 20.0, 1.0))
        assert share(found, 1) == (pytest.approx(10.0), ('drive_spring',))
    # And leaves nothing itself.
    found = set_of(a=('drive_inertia', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    assert share(found, 1)[0] > 1e100


def test_lack_of_fit_stays_on_its_drives() -> None:
    found = set_of(a=('drive_spring', 100.0, 1.0), b=('coulomb_friction', 20.0, 1.0))
    (block,) = found.blocks_of(found.candidates[0])
    block.rows[1] = block.rows.pop(0)
    size, names = share(found, 1)
    assert size > 1e100
    assert names == ()


def test_lack_of_fit_adds_up_in_squares_and_counts_that_of_the_model() -> None:
    found = set_of(a=('drive_spring', 30.0, 1.0), b=('coulomb_friction', 40.0, 1.0),
                   c=('viscous_friction', 10.0, 1.0))
    size, names = share(found, 2)
    assert (size, names) == (pytest.approx(10 / 5), ('drive_spring', 'coulomb_friction'))


def test_an_adopted_effect_leaves_as_much_as_one_that_is_found() -> None:
    found = set_of(a=('viscous_friction', 10.0, 1.0))
    size, names = share(found, 0, {'coulomb_friction': np.full((4, 6), 25.0)}, FRICTION)
    # 25 in four samples are 50 in all.
    assert (size, names) == (pytest.approx(2.0), ('coulomb_friction',))
