# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""When `play_trajectory` sends its messages: by the clock, whatever the timer misses."""

from __future__ import annotations

from pprs_dynamics.ros.play_trajectory import LONGEST_CATCH_UP, Beats

PERIOD = 10_000_000  # [ns]
START = 1_700_000_000_000_000_000  # [ns]
CATCH_UP = round(LONGEST_CATCH_UP * 1e9)


def played(ticks: list[int]) -> list[list[int]]:
    """Return the moments, from the start on, that are due at each tick [ns]."""
    beats = Beats(PERIOD)
    return [[moment - START for moment in beats.due(START + tick)] for tick in ticks]


def test_what_a_timer_leaves_out_is_caught_up_with() -> None:
    assert played([0, PERIOD, 4 * PERIOD, 5 * PERIOD]) == [
        [0], [PERIOD], [2 * PERIOD, 3 * PERIOD, 4 * PERIOD], [5 * PERIOD]]


def test_after_a_standstill_it_goes_on_from_now() -> None:
    after = CATCH_UP + 3 * PERIOD + 7
    assert played([0, after, after + PERIOD]) == [[0], [after], [after + PERIOD]]


def test_where_the_clock_is_set_back_it_goes_on_from_now() -> None:
    assert played([0, PERIOD, -50 * PERIOD, -49 * PERIOD]) == [
        [0], [PERIOD], [-50 * PERIOD], [-49 * PERIOD]]
