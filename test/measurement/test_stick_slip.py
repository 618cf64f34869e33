# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip is told from a block on a spring, and from what only looks like it."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.motion.stick_slip import find_stick_slip

STEP = 0.01
TIME = np.arange(0, 30, STEP)


def dragged(asked: Array, stiffness: float = 40.0, static: float = 1.2, sliding: float = 0.6,
            mass: float = 0.02) -> tuple[Array, Array]:
    """Return position and effort of a block dragged by a spring over friction that falls.

    Integrated in steps of 0.1 ms: it stands while the spring pulls less than `static`.
    """
    h, substeps = STEP / 100, 100
    q, v, found = asked[0], 0.0, np.empty((len(asked), 2))
    target = np.interp(np.arange(len(asked) * substeps) / substeps, np.arange(len(asked)), asked)
    for k in range(len(asked)):
        for goal in target[k * substeps:(k + 1) * substeps]:
            pull = stiffness * (goal - q) - 0.4 * v
            if v == 0.0 and abs(pull) <= static:
                continue
            way = np.sign(v) if v else np.sign(pull)
            after = v + h * (pull - sliding * way) / mass
            v = 0.0 if v * after < 0 else after
            q += h * v
        found[k] = q, stiffness * (asked[k] - q)
    return found[:, 0], found[:, 1]


def slow(speed: float = 0.06) -> Array:
    """Return a slow way there and back."""
    return np.where(TIME < 15, speed * TIME, speed * (30 - TIME))


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
