# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How a trajectory ends: done at rest, or broken off; and a simulation whose clock never comes."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import (
    EQUAL,
    FeedforwardBench,
    feedforward_bench,
    held,
    message_of,
    random_motion,
)
from lifecycle_msgs.msg import Transition
from node_bench import bench, overrides
from ros_processes import executable, node_process
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from supervisor import Supervisor
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

TIMEOUT = 0.15  # [s]
POSE = PlatformMotion.at_rest([[0.02, 0.0, 0.5]], [[0.0, 0.0, 0.0, 1.0]])


def test_a_single_pose_by_hand_is_done_and_not_stale() -> None:
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        node.answer(message_of(POSE))
        status = node.wait_for_status(code='DONE')
        assert status['level'] == 'OK'
        assert 'held at rest' in status['message']
        assert node.counters['stale'] == 0
        assert node.bench.spin_until(lambda: len(node.commands) == 2)
        np.testing.assert_allclose(node.commands[-1].data, held(POSE), rtol=0, atol=EQUAL)
        node.bench.spin_for(3 * TIMEOUT)
        assert len(node.commands) == 2


@pytest.mark.parametrize('action', ['zero', 'silent'])
def test_the_end_of_a_path_does_the_timeouts_action(action: str) -> None:
    path = HelicalPath()
    motion = path.motion(np.linspace(path.duration - 0.1, path.duration, 11))
    with feedforward_bench(command_timeout=TIMEOUT, timeout_action=action) as node:
        node.answer(message_of(motion))
        assert node.wait_for_status(code='DONE')['level'] == 'OK'
        assert node.bench.spin_until(lambda: len(node.commands) == (1 if action == 'silent' else 2))
        if action == 'zero':
            assert list(node.commands[-1].data) == [0.0] * 6
        # A stream that follows and breaks off is another matter.
        node.answer(message_of(random_motion(np.random.default_rng(1), 1)))
        assert node.wait_for_status(code='STALE')['level'] == 'STALE'


def test_a_stop_after_a_slow_answer_holds_the_pose_of_the_present_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As the first answer of a node that still compiles its equations."""
    times = np.arange(1.0, 4.0, 0.01)
    motion = HelicalPath().motion(times)
    model = DriveModel.load()
    efforts = model.drive_forces(PlatformMotion.at_rest(motion.position, motion.orientation)).total

    def slow(model: DriveModel, *arguments: object) -> object:
        time.sleep(0.6)
        return answer(model, *arguments)

    answer = DriveModel.drive_forces
    with feedforward_bench(command_timeout=TIMEOUT) as node:
        monkeypatch.setattr(DriveModel, 'drive_forces', slow)
        node.answer(message_of(motion))
        monkeypatch.undo()
        node.node.trigger_deactivate()
        assert node.bench.spin_until(lambda: len(node.commands) == 2)
        held = np.array(node.commands[-1].data)
        assert times[np.abs(efforts - held).max(axis=1).argmin()] > 1.55


def test_a_path_that_ended_long_ago_sends_no_controller_to_its_end() -> None:
    motion = HelicalPath().motion(np.arange(1.0, 2.0, 0.01))
    with feedforward_bench(command_timeout=TIMEOUT, max_age=0.0) as node:
        past = conversions.time(node.node.get_clock().now().nanoseconds - 60 * 10 ** 9)
        node.answer(message_of(motion, past))
        assert node.bench.spin_until(lambda: len(node.commands) == 2)  # stale at once
        node.bench.spin_for(0.3)
        assert len(node.joint_trajectory) == 1  # which a controller discards
        first, last = node.joint_command
        np.testing.assert_allclose(last.position, first.position, rtol=0, atol=EQUAL)


@pytest.mark.parametrize('stamped', [False, True], ids=['no stamp', 'stamp of this day'])
def test_without_the_clock_of_a_simulation_commands_go_stale_and_the_status_warns(
    stamped: bool,
) -> None:
    moving = random_motion(np.random.default_rng(4), 3)
    stamp = conversions.time(1_800_000_000_000_000_000) if stamped else None
    with feedforward_bench(command_timeout=TIMEOUT, use_sim_time=True) as node:
        warned = node.wait_for_status(code='CLOCK')
        assert warned['level'] == 'WARN'
        assert '/clock' in warned['message']
        node.answer(message_of(moving, stamp))
        assert node.wait_for_status(code='STALE')['counters']['stale'] == 1
        assert node.bench.spin_until(lambda: len(node.commands) == 2)
        # No time has passed: whoever follows is where the trajectory begins.
        np.testing.assert_allclose(node.commands[-1].data, held(moving[:1]), rtol=0, atol=1e-8)


@pytest.mark.parametrize('effect', [{}, {
    'effects__active': ['hysteresis'], 'effects__hysteresis__slide_1__force': 2.0,
    'effects__hysteresis__slide_1__distance': 0.01}], ids=['no memory', 'memory'])
def test_a_simulation_that_starts_over_leaves_no_command_without_a_watchdog(
    effect: dict[str, object],
) -> None:
    with feedforward_bench(command_timeout=TIMEOUT, use_sim_time=True, max_age=0.5, max_ahead=0.5,
                           **effect) as node:
        clock = node.bench.probe.create_publisher(Clock, '/clock', 10)
        assert node.bench.spin_until(clock.get_subscription_count)

        def set_clock(seconds: int) -> None:
            clock.publish(Clock(clock=conversions.time(seconds * 1_000_000_000)))
            assert node.bench.spin_until(
                lambda: node.node.get_clock().now().nanoseconds == seconds * 1_000_000_000)

        def stamped(seconds: int) -> object:
            return message_of(POSE, conversions.time(seconds * 1_000_000_000))

        for now, before in ((100, 5), (5, 100)):
            set_clock(now)
            node.answer(stamped(now))
            # What belongs to the time before is executed no more, nor does it keep the command.
            rejected, commands = node.counters['TIME'], len(node.commands)
            node.send(stamped(before))
            assert node.counters['TIME'] == rejected + 1
            assert node.bench.spin_until(lambda commands=commands: len(node.commands) > commands)
            np.testing.assert_allclose(node.commands[-1].data, held(POSE), atol=EQUAL)


# The feedforward node under a supervisor, and how it ends.

MOTION = random_motion(np.random.default_rng(3), 1)
MESSAGE = message_of(MOTION)
DEMO = [executable('feedforward'), '--ros-args', '-p', 'demo:=true']


@pytest.fixture
def supervised() -> Iterator[tuple[FeedforwardBench, Supervisor]]:
    """Give a node that waits for its supervisor."""
    given = overrides(autostart=False, command_timeout=0.0)
    with bench() as running:
        node = FeedforwardBench(running, parameter_overrides=given)
        yield node, Supervisor(running, 'feedforward')


def test_a_supervisor_leads_it_through_its_states(
    supervised: tuple[FeedforwardBench, Supervisor],
) -> None:
    node, supervisor = supervised
    assert supervisor.state() == 'unconfigured'
    assert not supervisor.change(Transition.TRANSITION_ACTIVATE)
    for _ in range(2):
        assert supervisor.change(Transition.TRANSITION_CONFIGURE)
        assert supervisor.state() == 'inactive'
        node.connect()
        # An inactive node drops what it gets, and does not answer it later.
        silent = len(node.commands)
        for _ in range(3):
            node.publisher.publish(MESSAGE)
        node.bench.spin_for(0.2)
        assert len(node.commands) == silent
        assert supervisor.change(Transition.TRANSITION_ACTIVATE)
        node.bench.spin_for(0.2)
        assert len(node.commands) == silent
        expected = DriveModel.load().drive_forces(MOTION).total[0]
        np.testing.assert_allclose(node.answer(MESSAGE), expected, rtol=0, atol=EQUAL)
        # The last word of an active node holds the pose.
        assert supervisor.change(Transition.TRANSITION_DEACTIVATE)
        assert node.bench.spin_until(lambda silent=silent: len(node.commands) == silent + 2)
        np.testing.assert_allclose(node.commands[-1].data, held(MOTION), rtol=0, atol=EQUAL)
        assert supervisor.change(Transition.TRANSITION_CLEANUP)
        assert supervisor.state() == 'unconfigured'
        assert node.bench.spin_until(lambda: not node.publisher.get_subscription_count())
    assert supervisor.change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert supervisor.state() == 'finalized'
    assert node.wait_for_status(code='FINALIZED')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_the_timeouts_action_as_its_last_word(
    ros_domain: int, tmp_path: Path, number: signal.Signals,
) -> None:
    command = [*DEMO, '-p', 'command_timeout:=0.0', '-p', 'max_age:=0.0']
    with bench() as running, node_process(command, ros_domain, tmp_path / 'log') as process:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 10)
        assert running.spin_until(publisher.get_subscription_count)
        assert running.connected()
        publisher.publish(MESSAGE)
        assert running.spin_until(lambda: commands)
        process.send_signal(number)
        assert running.spin_until(lambda: process.poll() is not None)
        assert process.returncode == 0
        assert running.spin_until(lambda: len(commands) == 2)
        np.testing.assert_allclose(commands[-1].data, held(MOTION), rtol=0, atol=EQUAL)
    assert 'Traceback' not in (tmp_path / 'log').read_text()


def test_a_signal_during_the_start_ends_it_too(ros_domain: int, tmp_path: Path) -> None:
    for delay in (0.0, 0.2, 0.4, 0.6):
        with node_process(DEMO, ros_domain, tmp_path / 'log') as process:
            time.sleep(delay)
            process.send_signal(signal.SIGTERM)
            process.wait(60)
        assert 'Traceback' not in (tmp_path / 'log').read_text()
