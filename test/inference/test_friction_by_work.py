# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction of a drive that its own work warms, without a thermometer: of a form of its own."""

from __future__ import annotations

from pathlib import Path

import made_up_arm
import numpy as np
import pytest

from pprs_dynamics import JointMotion
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording

pytestmark = pytest.mark.slow

SWING, RATE, SECONDS = 1, 100.0, 90.0
# Speeds of the same strokes, for 15 s each.
VARIED, EVEN = (1.0, 0.15, 1.0, 0.15, 1.0, 0.4), (0.6,) * 6
COOLING = 12.0  # [s]


def strokes(levels: tuple[float, ...]) -> JointMotion:
    """Return strokes of the arm, by a clock that runs fast or slowly."""
    time = np.arange(0.0, SECONDS, 1 / RATE)
    clock = np.cumsum(np.interp(time, 15.0 * np.arange(len(levels)), levels)) / RATE
    position = np.stack([0.3 * np.sin(2.1 * clock + j) + 0.1 * np.sin((4.3 + j) * clock)
                         for j in range(3)], axis=1)
    velocity = np.gradient(position, time, axis=0)
    return JointMotion(position, velocity, np.gradient(velocity, time, axis=0), time)


@pytest.mark.parametrize('is_viscous', [False, True])
@pytest.mark.parametrize('levels', [VARIED, EVEN])
def test_friction_that_its_own_heat_takes_away_is_a_drift_by_work(
    tmp_path: Path, levels: tuple[float, ...], is_viscous: bool,
) -> None:
    model, moved = made_up_arm.real_arm(tmp_path), strokes(levels)
    effort = model.drive_forces(moved).total
    v = moved.velocity[:, SWING]
    warm, work = np.zeros(len(v)), np.abs(v) / np.abs(v).mean()
    for k in range(1, len(v)):
        warm[k] = warm[k - 1] + (20.0 * work[k - 1] - warm[k - 1]) / COOLING / RATE
    # Grease thins by a factor e every 20 K.
    rubs = v / np.abs(v).max() if is_viscous else v / np.hypot(v, 0.002)
    effort[:, SWING] += 4.0 * np.exp(-warm / 20.0) * rubs
    random = np.random.default_rng(5)
    effort += 0.1 * random.normal(size=effort.shape)
    found = diagnose(model, [Recording.from_arrays(
        'run', moved.time, moved.position + 1e-5 * random.normal(size=effort.shape), None, effort,
        model.drives)])
    assert found.verdict == 'effect'
    beside = 'viscous_friction' if is_viscous else 'coulomb_friction'
    assert {one.name for one in found.effects} == {'friction_drift', beside}
    assert {one.drives for one in found.effects} == {('swing',)}
    told = {key.split('.')[1]: one.value for one in found.effects
            for key, one in one.parameters.items()}
    if levels is VARIED:
        assert told['thinned' if is_viscous else 'worked'] < 0
        assert told['time'] == pytest.approx(COOLING, rel=0.5)
