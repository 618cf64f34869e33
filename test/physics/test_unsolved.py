# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces beyond what the physics engine can follow: the simulated robot stops."""

from __future__ import annotations

import numpy as np

from pprs_dynamics import DriveModel
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.simulated_robot import SimulatedRobot


def test_a_robot_that_the_engine_does_not_solve_stops_and_says_so() -> None:
    robot = SimulatedRobot(Plant(DriveModel.load(), ['effort_offset'], scale=1e4))
    for _ in range(50):
        measurement = robot.tick()
        # What is published stays what a robot can say.
        assert np.abs(measurement.position).max() < 1.0
    assert [note.code for note in robot.notes].count('STOPPED') == 1
