# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joint states of all drives, out of messages that hold some of them each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.measured_states import PATIENCE, MeasuredState, MeasuredStates
from pprs_dynamics.ros.messages.status_codes import Rejection

JOINTS = ('a', 'b', 'c')
PERIOD = 2_000_000  # [ns]
START = 1_700_000_000_000_000_000  # [ns]


class Robot:
    """Publishes straight lines over time, and has what is read of them."""

    def __init__(self) -> None:
        self.now = 100.0
        self.states = MeasuredStates(JOINTS, lambda: self.now)
        self.read: list[MeasuredState] = []
        self.said: list[str] = []

    def send(self, names: Sequence[str], after: int, **changes: object) -> None:
        """Send a message with a stamp so long after the start [ns]."""
        values = [line(name, after) for name in names]
        message = JointState(name=names, position=values, effort=[10 * value for value in values])
        for field, value in changes.items():
            setattr(message, field, value)
        message.header.stamp = conversions.time(START + after)
        try:
            self.read += self.states.read(serialize_message(message))
        except Rejection as rejection:
            self.said.append(str(rejection))

    def check(self, stamps: Sequence[int]) -> None:
        """Assert that samples at these times, and no others, were read, and are on the lines."""
        assert [sample.stamp - START for sample in self.read] == list(stamps)
        for sample in self.read:
            expected = [line(name, sample.stamp - START) for name in JOINTS]
            np.testing.assert_allclose(sample.position, expected, rtol=1e-12)
            np.testing.assert_allclose(sample.effort, np.multiply(10, expected), rtol=1e-12)


def line(name: str, after: int) -> float:
    return 1.0 + ord(name[0]) - ord('a') + after / 1e9


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_a_message_with_all_drives_is_a_sample_at_once_in_any_order(robot: Robot) -> None:
    robot.send(['c', 'gripper', 'a', 'b'], 0)
    robot.check([0])


def test_parts_beside_whole_messages_are_no_samples(robot: Robot) -> None:
    robot.send(JOINTS, 0)
    for k in range(1, 5):
        robot.send(['a', 'b'], k * PERIOD)
        robot.send(['c'], k * PERIOD)
    robot.check([0])


@pytest.mark.parametrize('late', [0, 700_000, -700_000])
def test_of_messages_with_some_drives_samples_are_at_the_stamps_of_the_first(
    robot: Robot, late: int,
) -> None:
    for k in range(20):
        robot.send(['b', 'a'], k * PERIOD)
        robot.send(['c'], k * PERIOD + late)
    assert len(robot.said) == 1  # before c was there
    robot.check([k * PERIOD for k in range(late > 0, 20 - (late < 0))])


def test_other_rates_are_interpolated_and_gaps_are_not(robot: Robot) -> None:
    for k in range(60):
        robot.send(['a'], k * PERIOD)
        if k % 3 == 0:
            robot.send(['b'], k * PERIOD)
        if not 30 < k < 40:
            robot.send(['c'], k * PERIOD)
    robot.check([k * PERIOD for k in range(1, 58) if not 30 < k < 40])


def test_messages_without_drives_are_passed_over_while_drives_come(robot: Robot) -> None:
    robot.send(['gripper'], 0)
    assert len(robot.said) == 1
    assert 'must contain a, or another message' in robot.said[0]
    robot.send(JOINTS, 0)
    robot.send(['gripper'], 0)
    robot.send(['gripper'], 0, effort=[])
    assert len(robot.said) == 1
    robot.now += 5 * PATIENCE  # nobody read
    robot.send(['gripper'], 0)
    assert len(robot.said) == 1
    for _ in range(3):
        robot.now += 0.4 * PATIENCE
        robot.send(['gripper'], 0)
    assert len(robot.said) == 2


def test_drives_that_stop_coming_are_told(robot: Robot) -> None:
    for k in range(2000):
        robot.now += PERIOD / 1e9
        robot.send(['a', 'b'], k * PERIOD)
        if k < 1000:
            robot.send(['c'], k * PERIOD)
    assert 400 < len(robot.said) < 600
    assert 'must contain c' in robot.said[-1]
    robot.check([k * PERIOD for k in range(1000)])


def test_stamps_of_different_clocks_are_told(robot: Robot) -> None:
    for k in range(10):
        robot.send(['a', 'b'], k * PERIOD)
        robot.send(['c'], k * PERIOD + 3600 * 10**9)
    assert not robot.read
    assert 'stamps of c are 3600 s from those of a, must be within 1 s' in robot.said[-1]


def test_stamps_that_go_back_begin_anew(robot: Robot) -> None:
    for start in (50, 0):
        for k in range(start, start + 10):
            robot.send(['a', 'b'], k * PERIOD)
            robot.send(['c'], k * PERIOD)
    robot.check([k * PERIOD for k in (*range(50, 60), *range(10))])


def test_what_breaks_a_rule_in_a_part_is_refused_and_the_rest_goes_on(robot: Robot) -> None:
    for k in range(6):
        robot.send(['a', 'b'], k * PERIOD)
        robot.send(['c'], k * PERIOD, **({'position': [float('nan')]} if k == 3 else {}))
    assert len(robot.said) == 2
    assert robot.said[1].startswith('NON_FINITE')
    robot.send(['a', 'b', 'a'], 6 * PERIOD)  # which value is that of the drive is not known
    assert robot.said[-1].startswith('NAMES')
    robot.check([k * PERIOD for k in range(6) if k != 3])
