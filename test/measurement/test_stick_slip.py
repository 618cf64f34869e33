# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip is told from a block on a spring, and from what only looks like it."""

from __future__ import annotations

import numpy as np
import pytest
from sticking_block import STEP, TIME, dragged, slow

from pprs_dynamics.measurement.motion.stick_slip import find_stick_slip


def test_a_block_on_a_spring_sticks_and_slips() -> None:
    position, effort = dragged(slow())
    found = find_stick_slip(TIME, position, effort)
    assert found is not None
    # It sticks until the spring has grown by (F_s - F_slip) / k; a slip overshoots to twice that.
    slips = np.flatnonzero(np.diff((np.abs(np.diff(position)) / STEP > 0.1).astype(int)) == 1)
    period = float(np.median(np.diff(slips))) * STEP
    assert found.frequency == pytest.approx(1 / period, rel=0.05)
    assert found.step == pytest.approx(0.06 * period, rel=0.1)
    assert 0.05 < found.speed < 0.09


def test_a_stiff_drive_without_falling_friction_does_not() -> None:
    position, effort = dragged(slow(), static=0.6)
    assert find_stick_slip(TIME, position, effort) is None


def test_a_motion_that_was_meant_to_pause_does_not() -> None:
    # Steps of a quarter of a second, and rests as long: a drive at rest is not loaded further.
    asked = 0.03 * (np.floor(TIME * 2) + np.clip((TIME * 2) % 1 * 2, 0, 1))
    velocity = np.gradient(asked, STEP)
    effort = 2.0 * velocity + 0.5 * np.tanh(velocity / 0.005)
    assert find_stick_slip(TIME, asked, effort) is None


def test_the_stairs_of_a_coarse_encoder_do_not() -> None:
    position = 0.01 * np.round(slow() / 0.01)
    rng = np.random.default_rng(3)
    assert find_stick_slip(TIME, position, rng.normal(size=len(TIME))) is None


def test_strokes_to_and_fro_do_not() -> None:
    position = 0.5 * np.sin(2 * np.pi * 0.5 * TIME)
    velocity = np.gradient(position, STEP)
    effort = 3 * position + 0.5 * np.tanh(velocity / 0.01)
    assert find_stick_slip(TIME, position, effort) is None


@pytest.mark.parametrize('depth', [0.7, 1.0, 1.3])
def test_a_speed_that_goes_up_and_down_does_not(depth: float) -> None:
    # A wave on a slow way, which comes to rest once in each of its periods, or nearly, or turns.
    w = 2 * np.pi * 1.4
    position = slow() + 0.06 * depth / w * np.sin(w * TIME)
    velocity = np.gradient(position, STEP)
    effort = 0.5 * np.tanh(velocity / 0.005) + 3 * np.gradient(velocity, STEP)
    assert find_stick_slip(TIME, position, effort) is None
