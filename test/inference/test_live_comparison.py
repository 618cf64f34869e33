# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measured efforts against the model sample by sample, without ROS."""

import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.residuals.live import LiveComparison
from pprs_dynamics.physics.mechanism.paths import Excitation

STEP = 0.004  # [s]
SPAN = 0.5  # [s]
OFFSET = 3.0  # [N]


def test_the_running_error_forgets_what_came_before_the_clock_was_set_back():
    model = DriveModel.load()
    time = np.arange(0, 4.0, STEP)
    forces = model.drive_forces(Excitation(4.0, seed=3).motion(time))
    comparison = LiveComparison(model, span=SPAN)
    for offset, count in ((OFFSET, len(time)), (0.0, len(time) // 2)):
        for row in range(count):
            comparison.push(time[row], forces.mechanism.position[row], forces.total[row] + offset)
            if row % 10 == 0:
                comparison.evaluate()
    assert comparison.running_error().max() < OFFSET / 20


def test_a_stream_that_slows_down_is_compared_again():
    model = DriveModel.load()
    time = np.concatenate((np.arange(0, 2.0, STEP), np.arange(2.0, 6.0, 3 * STEP)))
    forces = model.drive_forces(Excitation(6.0, seed=3).motion(time))
    comparison = LiveComparison(model, span=SPAN)
    compared = []
    for row in range(len(time)):
        comparison.push(time[row], forces.mechanism.position[row], forces.total[row] + OFFSET)
        if row % 10 == 0 and (found := comparison.evaluate()) is not None:
            compared += found.time.tolist()
    assert max(compared) > 5.5
    assert comparison.running_error() == pytest.approx(np.full(6, OFFSET), rel=0.1)
    assert comparison.gaps >= 1


def test_what_is_explained_of_late_is_told_of_drives_that_moved_long_enough():
    model = DriveModel.load()
    time = np.arange(0, 14.0, STEP)
    forces = model.drive_forces(Excitation(14.0, seed=3).motion(time))
    effort = forces.total.copy()
    effort[:, 1] = 30 * np.sin(7 * time)  # no force of this machine
    effort[:, 2] = 5 + np.random.default_rng(1).normal(size=len(time))  # nothing but noise
    comparison = LiveComparison(model, span=SPAN)
    for row in range(len(time)):
        comparison.push(time[row], forces.mechanism.position[row], effort[row])
        if row % 10 == 0:
            comparison.evaluate()
        if row == 1000:
            assert np.isnan(comparison.running_explained()).all()
    found = comparison.running_explained()
    assert found[[0, 3, 4, 5]] == pytest.approx(1.0, abs=0.01)
    assert found[1] < 0.5
    assert np.isnan(found[2])
