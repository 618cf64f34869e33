# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Changes in series of values, against ordinary least squares and the F test worked out here."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from pprs_dynamics.app.fleet.change_points import LEAST_VALUES, find_change_points

DAYS = np.arange(20_000.0, 20_030.0)


def alternating(count: int = 30, size: float = 1.0) -> np.ndarray:
    """Return scatter that is the same everywhere, of no trend and of mean 0 by pairs."""
    rng = np.random.default_rng(0)
    half = size * rng.uniform(0.6, 1.4, count // 2)
    return np.ravel(np.column_stack((half, -half)))


def least_squares(columns: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, float]:
    found, *_ = np.linalg.lstsq(columns, value, rcond=None)
    return found, float(np.sum((value - columns @ found) ** 2))


@pytest.mark.parametrize('size', [8.0, -8.0])
def test_a_step_is_a_difference_of_means_with_its_standard_error(size: float) -> None:
    value = 5.0 + alternating() + size * (DAYS[14] <= DAYS)
    found = find_change_points(DAYS, value, 1e-4)
    step, = found.found
    before, after = value[:14], value[14:]
    assert step.kind == 'step'
    assert step.time == DAYS[14]
    assert step.size == pytest.approx(after.mean() - before.mean())
    assert step.level == pytest.approx(before.mean())
    left = float(np.sum((before - before.mean()) ** 2) + np.sum((after - after.mean()) ** 2))
    noise = left / 28
    assert step.size_std == pytest.approx((noise * (1 / 14 + 1 / 16)) ** 0.5)
    assert found.scatter == pytest.approx(noise ** 0.5)
    assert np.array_equal(found.fitted, np.where(DAYS[14] > DAYS, before.mean(), after.mean()))
    # One place in 30, for a sum of squares that falls; scatter that alternates is not inflated.
    statistic = (float(np.sum((value - value.mean()) ** 2)) - left) / noise
    assert found.statistic == pytest.approx(statistic)
    assert found.probability == pytest.approx(
        comb(30, 1) * f_distribution.sf(statistic, 1, 28), rel=1e-6)
    # So clear a step is certain but for the time since the value before.
    assert step.time_std == pytest.approx(12 ** -0.5, rel=1e-2)


def test_the_day_of_a_small_step_is_as_uncertain_as_its_neighbours_allow() -> None:
    value = alternating() + 3.0 * (DAYS[14] <= DAYS)
    step, = find_change_points(DAYS, value, 1e-3).found
    at = int(np.searchsorted(DAYS, step.time))
    squares = np.array([np.sum((value[:k] - value[:k].mean()) ** 2)
                        + np.sum((value[k:] - value[k:].mean()) ** 2) for k in range(1, 30)])
    noise = squares[at - 1] / 28
    weight = np.exp(-0.5 * (squares - squares.min()) / noise)
    spread = np.sum(weight * (DAYS[1:] - step.time) ** 2) / weight.sum()
    assert step.time_std == pytest.approx((spread + 1 / 12) ** 0.5)
    assert step.time_std > 0.3


def test_two_steps_are_two() -> None:
    value = alternating() + 9.0 * (DAYS[10] <= DAYS) - 4.5 * (DAYS[20] <= DAYS)
    found = find_change_points(DAYS, value, 1e-4)
    first, second = found.found
    assert (first.time, second.time) == (DAYS[10], DAYS[20])
    parts = np.split(value, [10, 20])
    assert first.size == pytest.approx(parts[1].mean() - parts[0].mean())
    assert second.size == pytest.approx(parts[2].mean() - parts[1].mean())
    assert second.level == pytest.approx(parts[1].mean())
    left = sum(float(np.sum((part - part.mean()) ** 2)) for part in parts)
    assert found.statistic == pytest.approx(
        (float(np.sum((value - value.mean()) ** 2)) - left) / 2 / (left / 27))


@pytest.mark.parametrize('slope', [0.9, -0.9])
def test_a_slope_is_a_line_from_the_day_that_fits_best(slope: float) -> None:
    value = 3.0 + alternating() + slope * np.maximum(DAYS - DAYS[12], 0)
    found = find_change_points(DAYS, value, 1e-4)
    change, = found.found
    assert change.kind == 'slope'
    fits = [least_squares(np.column_stack((np.ones(30), np.maximum(DAYS - day, 0))), value)
            for day in DAYS[:27]]
    squares = np.array([left for _, left in fits])
    best = int(np.argmin(squares))
    assert np.allclose(found.fitted, fits[best][0][0] + fits[best][0][1] * np.maximum(
        DAYS - DAYS[best], 0))
    weight = (squares / squares.min()) ** (-27 / 2)
    weight /= weight.sum()
    coefficients = np.array([one for one, _ in fits])
    # Draws of 4000: to a fiftieth of their deviations.
    day_std = (np.sum(weight * (DAYS[:27] - weight @ DAYS[:27]) ** 2) + 1 / 12) ** 0.5
    assert change.time == pytest.approx(weight @ DAYS[:27], abs=0.1 * day_std)
    assert change.time_std == pytest.approx(day_std, rel=0.05)
    assert change.size == pytest.approx(weight @ coefficients[:, 1], abs=0.1 * change.size_std)
    assert change.level == pytest.approx(weight @ coefficients[:, 0], abs=0.05)
    # Within a day, the noise of the line; between days, what its slopes differ by.
    noise = squares.min() / 27
    columns = [np.column_stack((np.ones(30), np.maximum(DAYS - day, 0))) for day in DAYS[:27]]
    within = np.array([np.linalg.inv(one.T @ one)[1, 1] for one in columns]) * noise * 27 / 25
    between = (coefficients[:, 1] - weight @ coefficients[:, 1]) ** 2
    assert change.size_std == pytest.approx((weight @ (within + between)) ** 0.5, rel=0.06)
    assert found.draws.shape == (4000, 3)


def test_values_that_follow_each_other_count_less() -> None:
    """The same step beside scatter that lasts three days is less certain."""
    quick = alternating(30)
    slow = np.repeat(quick[:10], 3)
    step = 4.0 * (DAYS[15] <= DAYS)
    fast, lasting = (find_change_points(DAYS, scatter + step, 1.0) for scatter in (quick, slow))
    rest = slow + step - lasting.fitted
    follows = float(rest[1:] @ rest[:-1] / (rest @ rest))
    assert follows > 0.2
    value = slow + step
    count = len(lasting.found)
    plain = (float(np.sum((value - value.mean()) ** 2)) - float(rest @ rest)) / count / (
        float(rest @ rest) / (29 - count))
    assert lasting.statistic == pytest.approx(plain * (1 - follows) / (1 + follows))
    assert lasting.probability > 1e2 * fast.probability


def test_too_few_values_or_no_scatter_or_one_time_tell_nothing() -> None:
    value = alternating(8) * 0.1 + 9.0 * (np.arange(8) >= 4)
    assert LEAST_VALUES == 8
    assert find_change_points(DAYS[:8], value, 0.01).found
    for time, series in ((DAYS[:7], value[:7]), (np.zeros(8), value),
                         (DAYS[:8], 1e7 + value * 1e-6), (DAYS[:8], np.full(8, 3.0))):
        nothing = find_change_points(time, series, 0.01)
        assert nothing.found == ()
        assert (nothing.probability, nothing.statistic) == (1.0, 0.0)
        assert np.array_equal(nothing.fitted, np.full(len(time), np.median(series)))
        assert nothing.draws.shape == (0, 3)


def test_a_change_that_chance_gives_is_not_told_but_how_likely_it_was() -> None:
    value = alternating() + 2.0 * (DAYS[14] <= DAYS)
    told = find_change_points(DAYS, value, 1.0)
    assert told.found
    kept = find_change_points(DAYS, value, 0.5 * told.probability)
    assert kept.found == ()
    assert (kept.probability, kept.statistic) == (told.probability, told.statistic)
    assert find_change_points(DAYS, value, 1.01 * told.probability).found


def test_a_bad_day_is_drawn_in_to_its_neighbours() -> None:
    clean = alternating()
    for place in (0, 1, 13, 28, 29):
        bad = clean.copy()
        bad[place] += 60.0
        found = find_change_points(DAYS, bad, 1.0)
        # Drawn in to 3.5 deviations from the median about it; as it was, it would be 11.
        assert found.scatter < 3.0
        assert find_change_points(DAYS, bad, 1e-4).found == ()
    # Two good levels are no bad days.
    assert find_change_points(DAYS, clean + 60.0 * (DAYS[27] <= DAYS), 1e-3).found


@pytest.mark.parametrize('unit', [1e-3, 1e3])
def test_changes_do_not_depend_on_the_unit(unit: float) -> None:
    value = alternating() + 3.0 * (DAYS[14] <= DAYS)
    value[20] += 40.0
    here, there = (find_change_points(DAYS, one, 0.01) for one in (value, unit * value))
    assert there.probability == pytest.approx(here.probability, rel=1e-6)
    assert [one.time for one in there.found] == [one.time for one in here.found]
    assert [one.size for one in there.found] == pytest.approx(
        [unit * one.size for one in here.found])
