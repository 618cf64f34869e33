# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The feedforward node under a supervisor, and how it ends."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from feedforward_bench import EQUAL, FeedforwardBench, message_of, random_motion
from lifecycle_msgs.msg import Transition
from node_bench import bench, overrides
from ros_processes import executable, node_process
from std_msgs.msg import Float64MultiArray
from supervisor import Supervisor
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics import DriveModel, PlatformMotion

pytestmark = pytest.mark.nodes

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


def held(motion: PlatformMotion) -> np.ndarray:
    """Return the forces that hold the last pose."""
    rest = PlatformMotion.at_rest(motion.position[-1:], motion.orientation[-1:])
    return DriveModel.load().drive_forces(rest).parts['rigid_body'][0]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_the_timeouts_action_as_its_last_word(
    ros_domain: int, tmp_path: Path, number: signal.Signals,
) -> None:
    command = [*DEMO, '-p', 'command_timeout:=0.0', '-p', 'max_age:=0.0']
    with bench() as running, node_process(command, ros_domain, tmp_path / 'log') as process:
        commands = running.listen(Float64MultiArray, '/feedforward/commands')
        publisher = running.probe.create_publisher(
            MultiDOFJointTrajectory, '/feedforward/trajectory', 10)
        assert running.spin_until(publisher.get_subscription_count, 20)
        assert running.connected()
        publisher.publish(MESSAGE)
        assert running.spin_until(lambda: commands)
        process.send_signal(number)
        began = time.monotonic()
        assert running.spin_until(lambda: process.poll() is not None, 10)
        # A second on a machine that has one to spare; a busy one is given five.
        assert time.monotonic() - began < 5
        assert process.returncode == 0
        assert running.spin_until(lambda: len(commands) == 2, 2)
        np.testing.assert_allclose(commands[-1].data, held(MOTION), rtol=0, atol=EQUAL)
    assert 'Traceback' not in (tmp_path / 'log').read_text()


def test_a_signal_during_the_start_ends_it_too(ros_domain: int, tmp_path: Path) -> None:
    for delay in (0.0, 0.2, 0.4, 0.6):
        with node_process(DEMO, ros_domain, tmp_path / 'log') as process:
            time.sleep(delay)
            process.send_signal(signal.SIGTERM)
            process.wait(10)
        assert 'Traceback' not in (tmp_path / 'log').read_text()
