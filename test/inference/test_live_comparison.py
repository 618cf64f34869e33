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
