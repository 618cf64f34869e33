# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stick-slip is told from a block on a spring, and from what only looks like it."""

from __future__ import annotations

import numpy as np
import pytest
from single_axis import axis_values

from pprs_dynamics import DriveModel, Recording
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, next_step
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.measurement.motion.stick_slip import find_stick_slip

STEP = 0.01  # [s]
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


def strokes(position: Array, stiffness: float, width: float) -> tuple[Array, Array]:
    """Return a position, and the effort of a spring and of dry friction along it."""
    return position, stiffness * position + 0.5 * np.tanh(np.gradient(position, STEP) / width)


@pytest.mark.parametrize('moved', [
    dragged(slow(), static=0.6),
    # Steps of a quarter of a second, and rests as long: a drive at rest is not loaded further.
    strokes(0.03 * (np.floor(TIME * 2) + np.clip((TIME * 2) % 1 * 2, 0, 1)), 0.0, 0.005),
    (0.01 * np.round(slow() / 0.01), np.random.default_rng(3).normal(size=len(TIME))),
    strokes(0.5 * np.sin(np.pi * TIME), 3.0, 0.01),
], ids=['no falling friction', 'pauses', 'coarse encoder', 'to and fro'])
def test_what_only_looks_like_it_does_not(moved: tuple[Array, Array]) -> None:
    assert find_stick_slip(TIME, *moved) is None


@pytest.mark.parametrize('depth', [0.7, 1.0, 1.3])
def test_a_speed_that_goes_up_and_down_does_not(depth: float) -> None:
    # A wave on a slow way, which comes to rest once in each of its periods, or nearly, or turns.
    w = 2 * np.pi * 1.4
    position = slow() + 0.06 * depth / w * np.sin(w * TIME)
    velocity = np.gradient(position, STEP)
    effort = 0.5 * np.tanh(velocity / 0.005) + 3 * np.gradient(velocity, STEP)
    assert find_stick_slip(TIME, position, effort) is None


def test_a_diagnosis_names_it_with_its_frequency_and_claims_nothing_else() -> None:
    position, effort = dragged(slow())
    effort = effort + 0.005 * np.random.default_rng(4).normal(size=len(TIME))
    found = diagnose(DriveModel.from_parameters(axis_values(0.02, 0.4, 0.6)), [
        Recording.from_arrays('run', TIME, position[:, None], None, effort[:, None], ('axis',))])
    assert (found.verdict, found.effects) == ('unknown', ())
    assert found.to_dict()['stick_slip']['axis']['frequency'] == pytest.approx(2.3, abs=0.1)
    assert 'Stick-slip on axis at 2.3' in Sentences(found).headline
    assert 'faster' in next_step(found, PLACEHOLDERS)[0]
