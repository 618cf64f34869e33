# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""An effect adopted while nodes run: the error stands high, parameters come, the error falls.

Processes over DDS, without a launch file: recorded efforts of a robot with hidden friction are
replayed as joint_states, and the monitor and the feedforward node take what `adopt` found.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from node_bench import Bench, bench
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from short_recordings import hidden_friction
from std_msgs.msg import Float64MultiArray

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import read_parameters
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

HIDDEN = 'coulomb_friction'
START = 1_700_000_000_000_000_000  # [ns]
STEP = 2_000_000  # [ns]
BURST = 20  # messages that go out at once
# Samples that may be without an answer yet: those from which the node learns its step, half its
# window, and three bursts on the way.
BEHIND = 50 + 30 + 3 * BURST
QUEUED = 3 * BURST  # less than the node's queue holds
SPAN = 0.8  # [s], of the running error
PATIENCE = 90.0  # [s], on a busy machine, where a node's first answer may take long


class Robot:
    """What was recorded, the model before and after, and the noise."""

    def __init__(self, folder: Path) -> None:
        robot = hidden_friction()
        first, self.replayed = robot.recordings
        answer = adopt(robot.model, EffectRequest.of(HIDDEN), [first])
        assert answer.adopted, answer.reason
        self.noise = robot.noise
        self.before, self.after = folder / 'before.yaml', folder / 'after.yaml'
        write_model(self.before, robot.model.values)
        write_model(self.after, answer.after.values, self.before)


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return Robot(tmp_path_factory.mktemp('live'))


class Live:
    """Both nodes as processes, and a replay of the recording."""

    def __init__(self, running: Bench, robot: Robot) -> None:
        self.bench, self.robot = running, robot
        self.error = running.listen(Float64MultiArray, '/monitor/error', 1000)
        running.follow_status('/monitor/status')
        self.judged = running.listen(JointState, '/monitor/residual', 5000)
        self.publisher = running.probe.create_publisher(JointState, '/joint_states', 1000)
        self.sent = 0

    def knock(self) -> None:
        """Publish single samples, long before the recording, until the node has got one."""
        for seconds in range(60, 0, -1):
            message = joint_state_of(self.robot.replayed, 0)
            message.header.stamp.sec -= seconds
            self.publisher.publish(message)
            if self.bench.spin_until(lambda: self.bench.status and self.bench.status[-1][
                    'counters']['received'] > 0, 1.5):
                return
        raise AssertionError('the monitor hears nothing')

    def replay(self, count: int) -> float:
        """Publish the next samples, and return the running error over all drives [N]."""
        recording: Recording = self.robot.replayed
        for row in range(self.sent, self.sent + count):
            message = joint_state_of(recording, row)
            self.publisher.publish(message)
            # No faster than the node takes them: its queue is finite.
            if row % BURST == BURST - 1:
                assert self.bench.spin_until(lambda row=row: self.taken(row), PATIENCE)
        self.sent += count
        before = -1
        while len(self.judged) > before:
            before = len(self.judged)
            self.bench.spin_for(0.3)
        return float(np.sqrt(np.mean(np.square(self.error[-1].data))))

    def taken(self, row: int) -> bool:
        """Return whether the node has taken so many samples that its queue has room."""
        if row > BEHIND:
            return len(self.judged) > row - BEHIND
        # Before the first answers only its counters tell, once a second.
        received: int = self.bench.status[-1]['counters']['received']
        return received > row - QUEUED

    def set(self, node: str, parameters: list[Parameter]) -> list[Any]:
        """Set parameters of a node, one after the other, and return its answers."""
        client = self.bench.probe.create_client(SetParameters, f'/{node}/set_parameters')
        assert self.bench.spin_until(client.service_is_ready)
        future = client.call_async(SetParameters.Request(
            parameters=[one.to_parameter_msg() for one in parameters]))
        assert self.bench.spin_until(future.done, PATIENCE)
        return list(future.result().results)

    def load(self, node: str, file: Path) -> list[Any]:
        """Set all parameters of a file in its order, as `ros2 param load` does."""
        client = AsyncParameterClient(self.bench.probe, node)
        assert self.bench.spin_until(client.services_are_ready)
        future = client.load_parameter_file(str(file), use_wildcard=True)
        assert self.bench.spin_until(future.done, PATIENCE)
        return list(future.result().results)

    def topics(self) -> set[str]:
        return {name for name, _ in self.bench.probe.get_topic_names_and_types()}


def joint_state_of(recording: Recording, row: int) -> JointState:
    """Return one recorded sample as the robot would publish it."""
    message = conversions.joint_state(START + row * STEP, recording.effort[row],
                                      recording.position[row], recording.position[row])
    message.velocity = []
    return message


@pytest.fixture
def live(robot: Robot, ros_domain: int, tmp_path: Path) -> Iterator[Live]:
    arguments = ['--ros-args', '--params-file', str(robot.before)]
    with bench() as running, ExitStack() as stack:
        live = Live(running, robot)
        for name, more in (('monitor', ['-p', f'error_span:={SPAN}']), ('feedforward', [])):
            stack.enter_context(node_process([executable(name), *arguments, *more], ros_domain,
                                             tmp_path / f'{name}.log'))
        assert running.spin_until(live.publisher.get_subscription_count, PATIENCE)
        assert running.connected()
        live.knock()
        yield live


def changes(robot: Robot) -> list[Parameter]:
    """Return what the new file changes, the list of effects last."""
    before, after = read_parameters(robot.before), read_parameters(robot.after)
    found = [Parameter(key, value=value) for key, value in after.items()
             if before.get(key) != value and not key.startswith('history.')]
    return sorted(found, key=lambda one: one.name == 'effects.active')


def test_the_error_falls_to_the_noise_when_the_effect_comes_last(live: Live) -> None:
    robot = live.robot
    before = live.replay(1200)
    assert before > 2 * robot.noise
    *parameters, active = changes(robot)
    assert active.name == 'effects.active'
    assert all(one.successful for one in live.set('monitor', parameters))
    # Its parameters alone do nothing yet: never half an effect.
    assert live.replay(800) > 2 * robot.noise
    answer, = live.set('monitor', [active])
    assert answer.successful, answer.reason
    assert live.replay(1000) == pytest.approx(robot.noise, rel=0.2)


def test_a_list_that_names_an_effect_without_its_parameters_is_refused(live: Live) -> None:
    for node in ('monitor', 'feedforward'):
        answer, = live.set(node, [changes(live.robot)[-1]])
        assert not answer.successful
        assert HIDDEN in answer.reason
    assert live.replay(900) > 2 * live.robot.noise


def test_a_whole_file_is_taken_and_the_new_part_appears(
    live: Live, ros_domain: int, tmp_path: Path,
) -> None:
    part = f'/feedforward/effort/{HIDDEN}'
    before = live.replay(1000)
    assert part not in live.topics()
    for node in ('monitor', 'feedforward'):
        answers = live.load(node, live.robot.after)
        assert [one.reason for one in answers if not one.successful] == []
    assert live.replay(1000) < before / 2
    assert live.bench.spin_until(lambda: part in live.topics(), 10)
    efforts = live.bench.listen(JointState, part, 1000)
    assert live.bench.connected()
    player = [executable('play_trajectory'), '--ros-args', '-p', 'rate:=50.0']
    with node_process(player, ros_domain, tmp_path / 'player.log'):
        assert live.bench.spin_until(lambda: len(efforts) > 50, 20)
    force = np.array([message.effort for message in efforts])
    assert tuple(efforts[0].name) == DRIVES
    added = read_parameters(live.robot.after)
    for index, drive in enumerate(DRIVES):
        # The path moves every drive: its friction is reached on both sides, or on one.
        size = added.get(f'effects.{HIDDEN}.{drive}.force', 0.0)
        assert np.abs(force[:, index]).max() == pytest.approx(abs(size), rel=0.05, abs=1e-12)
