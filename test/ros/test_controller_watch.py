# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a controller follows, by states as joint_trajectory_controller publishes them."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pprs_dynamics.ros.node.controller_watch import ControllerWatch
from pprs_dynamics.ros.node.senders import TURNS, Senders

JOINTS = ('a', 'b')
STEP = 0.01  # [s] between messages
LATENCY = 0.012  # [s]


class Cell:
    """A stream to a controller, and the controller's states, on one clock."""

    def __init__(self) -> None:
        self.now = 50.0
        self.watch = ControllerWatch(JOINTS, lambda: self.now)
        self.said: list[str] = []

    def path(self, time: float) -> np.ndarray:
        """A slow circle in one joint and a shorter way in the other."""
        return np.array([0.1 * np.sin(2 * time), 0.02 * np.cos(2 * time)])

    def run(self, seconds: float, reference: Callable[[float], Any], left: float = 0.1,
            moves_at_end: bool = False, joints: tuple[str, ...] = JOINTS, efforts: bool = True,
            sends: bool = True) -> list[str]:
        """Return what was complained of, at each state."""
        said = []
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            if sends:
                ahead = self.now + STEP * np.arange(10)
                self.watch.sent(np.stack([self.path(t) for t in ahead]), left, moves_at_end)
            if (position := reference(self.now)) is not None:
                self.watch.heard(state(position, joints, efforts), sends)
            said.append(self.watch.fault())
        return said


def state(position: Any, joints: tuple[str, ...], efforts: bool, velocity: Any = ()) -> Any:
    return SimpleNamespace(
        joint_names=list(joints),
        reference=SimpleNamespace(positions=list(position), velocities=list(velocity)),
        output=SimpleNamespace(effort=[0.0] * len(joints) if efforts else []))


def test_one_that_follows_late_and_coarsely_is_not_complained_of() -> None:
    cell = Cell()
    late = cell.run(8.0, lambda t: cell.path(t - LATENCY) * 1.002)
    assert set(late) == {''}
    assert set(cell.run(4.0, lambda t: cell.path(t - 0.08))) == {''}


def test_one_that_stands_is_told_within_two_seconds_and_recovers() -> None:
    cell = Cell()
    where = cell.path(50.0)
    said = cell.run(6.0, lambda t: where)
    assert 'does not follow' in said[200]
    assert all(said[200:])  # also where the path comes back to where it stands
    assert cell.run(2.0, cell.path)[-1] == ''


def test_one_that_strays_for_a_moment_is_not_complained_of() -> None:
    cell = Cell()
    cell.run(2.0, cell.path)
    assert set(cell.run(0.4, lambda t: [0.3, 0.3])) == {''}
    assert set(cell.run(2.0, cell.path)) == {''}


@pytest.mark.parametrize(('given', 'reason'), [
    ({'left': 0.01}, 'end 10 ms after they are sent'),
    ({'left': -0.01}, 'ended 10 ms before they are sent'),
    ({'moves_at_end': True}, 'allow_nonzero_velocity_at_trajectory_end'),
    ({'efforts': False}, 'no command interface `effort`'),
    ({'joints': ('a', 'b', 'gripper')}, 'joint gripper, too'),
    ({}, 'its log has the reason')])
def test_the_likely_reason_is_told(given: dict[str, Any], reason: str) -> None:
    cell = Cell()
    count = len(given.get('joints', JOINTS))
    assert reason in cell.run(3.0, lambda t: [0.3] * count, **given)[-1]


def test_a_controller_that_falls_silent_is_not_active() -> None:
    cell = Cell()
    assert set(cell.run(2.0, cell.path)) == {''}
    assert 'any more: is the controller active?' in cell.run(3.0, lambda t: None)[-1]
    # Nothing is sent, nothing is missed.
    assert cell.run(2.0, lambda t: None, sends=False)[-1] == ''


def hear(cell: Cell, *position: float, velocity: float = 0.0, after: float = 0.02,
         has_commanded: bool = True) -> list[float] | None:
    """Return where the controller must be held after one more state."""
    cell.now += after
    cell.watch.heard(state(position, JOINTS, True, [velocity, 0.0]), has_commanded)
    held = cell.watch.take_hold()
    return None if held is None else held.tolist()


def test_a_controller_is_held_once_where_it_becomes_active_and_stands() -> None:
    cell = Cell()
    assert hear(cell, 0.3, 0.4) is None  # one state alone says nothing of rest
    assert hear(cell, 0.3, 0.4) == [0.3, 0.4]
    assert [hear(cell, 0.3, 0.4) for _ in range(5)] == [None] * 5
    assert hear(cell, 0.3, 0.4, after=2.0) is None
    assert hear(cell, 0.3, 0.4) == [0.3, 0.4]


@pytest.mark.parametrize('after', [0.02, 1.1])
def test_nothing_holds_a_controller_that_this_node_has_never_commanded(after: float) -> None:
    """A node that starts beside a moving controller, or one that is slow or stalls."""
    cell = Cell()
    places = [*np.linspace(0.0, 0.3, 20), *[0.3] * 20]
    speeds = [*[0.283] * 20, *[0.0] * 20]
    for k, (place, speed) in enumerate(zip(places, speeds, strict=True)):
        stall = 3.0 if k in (10, 30) else 0.0
        assert hear(cell, place, 0.4, velocity=speed, after=after + stall,
                    has_commanded=False) is None


def test_a_moving_controller_is_held_where_it_comes_to_rest() -> None:
    cell = Cell()
    cell.watch.require_hold()  # a goal was cancelled
    assert hear(cell, 0.3, 0.4, velocity=0.1) is None
    assert hear(cell, 0.31, 0.4) is None
    assert hear(cell, 0.32, 0.4) is None
    assert hear(cell, 0.32, 0.4) == [0.32, 0.4]


@pytest.mark.parametrize(('scale', 'is_told'), [(1.1, False), (1.6, True)])
def test_one_that_goes_another_way_is_told_by_how_far_it_is_off_over_the_way(
    scale: float, is_told: bool,
) -> None:
    cell = Cell()
    assert bool(cell.run(3.0, lambda t: scale * cell.path(t))[-1]) == is_told


@pytest.mark.parametrize('strange', [np.nan, np.inf, -1e300])
def test_a_reference_that_is_no_position_or_velocity_is_never_held(strange: float) -> None:
    cell = Cell()
    cell.run(1.5, lambda t: cell.path(t))
    cell.watch.require_hold()
    cell.run(1.0, lambda t: (0.1, strange), sends=False)
    assert cell.watch.take_hold() is None
    for _ in range(2):
        cell.watch.heard(state((0.1, 0.2), JOINTS, efforts=True, velocity=(0.0, strange)), True)
    assert cell.watch.take_hold() is None
    for _ in range(2):
        cell.watch.heard(state((0.1, 0.2), JOINTS, efforts=True, velocity=(0.0, 0.0)), True)
    np.testing.assert_array_equal(cell.watch.take_hold(), (0.1, 0.2))


# Who sends, and what of it was passed over, by what the middleware tells of each message.

class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def info(publisher: bytes, number: int | None) -> dict[str, Any]:
    return {'publisher_gid': {'data': publisher}, 'publication_sequence_number': number}


def test_what_later_messages_replaced_is_counted_for_each_publisher() -> None:
    senders = Senders(Clock())
    sent = [(b'a', 7), (b'a', 8), (b'a', 12), (b'b', 1), (b'a', 13), (b'b', 4), (b'b', 4)]
    assert [senders.passed_over(info(*message)) for message in sent] == [0, 0, 3, 0, 0, 2, 0]


def test_a_publisher_that_is_started_again_does_not_take_turns_with_the_old_one() -> None:
    clock = Clock()
    senders = Senders(clock)
    for publisher in (b'a', b'a', b'b', b'b'):
        clock.now += 0.01
        senders.passed_over(info(publisher, 1))
        assert not senders.take_turns
    clock.now += 0.01
    senders.passed_over(info(b'a', 2))
    assert senders.take_turns
    clock.now += TURNS
    assert not senders.take_turns
