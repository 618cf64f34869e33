# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Forces beyond what the physics engine can follow: refused, never written as a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pprs_dynamics import DriveModel, PprsError, simulate
from pprs_dynamics.simulation.injected_effects import draw_effects
from pprs_dynamics.simulation.virtual_robot import SimulatedRobot


@pytest.mark.parametrize(('name', 'scale'), [
    ('viscous_friction', 1e6), ('effort_offset', 1e4), ('drive_spring', 1e6),
    ('payload_mass', 1e6), ('tool_drag', 1e6), ('link_mass', 1e6)])
def test_what_the_engine_does_not_solve_is_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, scale: float,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PprsError, match=r'^the simulated robot: at '):
        simulate(DriveModel.load(), name, scale=scale, duration=3.0)
    assert list(tmp_path.iterdir()) == []  # no log of the engine


def test_a_robot_that_the_engine_does_not_solve_stops_and_says_so() -> None:
    effects = draw_effects(['effort_offset'], np.random.default_rng(0), 1e4)
    robot = SimulatedRobot(DriveModel.load().values, effects, rate=500.0)
    for _ in range(50):
        measurement = robot.tick()
        # What is published stays what a robot can say.
        assert np.abs(measurement.position).max() < 1.0
    assert robot.unsolved is not None
    assert [note.code for note in robot.notes].count('STOPPED') == 1
