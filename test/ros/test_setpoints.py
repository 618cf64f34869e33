# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Setpoints on their way to the simulated robot's drives."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.ros.setpoints import SetpointQueue
from pprs_dynamics.simulation.drive_control import Setpoint


class Drives:
    """Notes what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[float, Setpoint, Any]] = []
        self.taken: list[float | None] = []

    def command(self, now: float, setpoint: Setpoint, following: Any = None,
                after: float = 0.0, taken: float | None = None) -> bool:
        self.taken.append(taken)
        self.told.append((now, setpoint, following))
        return True


def at(position: float) -> Setpoint:
    return Setpoint(np.full(6, position), np.zeros(6), np.zeros(6))


def test_of_two_setpoints_with_one_stamp_the_later_holds_whenever_it_comes() -> None:
    drives: Any = Drives()
    queue, first, second = SetpointQueue(drives), at(0.1), at(0.2)
    queue.add(1.0, first)
    assert queue.advance(2.0)
    queue.add(1.0, second)
    assert queue.advance(2.1)
    assert queue.advance(2.2)  # nothing new to tell
    assert [setpoint for _, setpoint, _ in drives.told] == [first, second]


def test_a_setpoint_is_told_at_its_time_with_the_one_after_it() -> None:
    drives: Any = Drives()
    queue, first, second = SetpointQueue(drives), at(0.1), at(0.2)
    queue.add(1.0, first)
    queue.add(1.5, second)
    assert queue.advance(0.9)
    assert not drives.told
    assert queue.advance(1.1, lag=0.25)
    assert queue.advance(1.6, lag=0.25)
    assert drives.told == [(0.75, first, second), (1.25, second, None)]
    assert drives.taken == [1.1 - 0.25, 1.6 - 0.25]  # late by 0.1 s each


def test_an_earlier_setpoint_takes_the_place_of_what_waits_for_later_and_of_nothing_else() -> None:
    drives: Any = Drives()
    queue, first, second, third = SetpointQueue(drives), at(0.1), at(0.2), at(0.3)
    queue.add(1.0, first)
    queue.add(2.0, second)
    queue.add(1.5, third)
    for now in (1.0, 1.5, 2.0, 2.5):
        assert queue.advance(now)
    assert drives.told == [(1.0, first, third), (1.5, third, None)]
