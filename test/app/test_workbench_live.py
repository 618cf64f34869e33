# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench on a running robot: effects go to the nodes, and the error falls."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from workbench_server import workbench

from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames

pytestmark = pytest.mark.nodes

START, STEP = 1_700_000_000_000_000_000, 20_000_000  # [ns]


class Replay:
    """Publishes a recording as joint states, in real time, again and again onwards."""

    def __init__(self, recording: Recording, topic: str) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('replay', context=self.context)
        self.publisher = self.node.create_publisher(JointState, topic, 100)
        self.recording = recording
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        rows = range(0, len(self.recording.time), 2)  # 50 Hz
        stamp, began, sent = START, time.monotonic(), 0
        while True:
            stamp += 1_000_000_000  # a gap: the motion begins anew
            for row in rows:
                message = conversions.joint_state(
                    stamp, self.recording.effort[row], self.recording.position[row],
                    self.recording.position[row], RobotNames(self.recording.drives, ''))
                message.velocity = []
                self.publisher.publish(message)
                stamp += STEP
                sent += 1
                if self.ends.wait(max(0.0, began + 1e-9 * STEP * sent - time.monotonic())):
                    return

    def close(self) -> None:
        self.ends.set()
        self.thread.join(5)
        self.node.destroy_node()
        self.context.try_shutdown()


def test_an_arm_is_compared_and_set_in_its_own_window_names_and_units(
    tmp_path: Path, ros_domain: int,
) -> None:
    real = arm.real_arm(tmp_path)
    more = arm.real_arm(tmp_path, **{'friction.viscous': (14.0, 5.0, 20.0)})
    model = arm.write_arm(tmp_path, **{key: list(value) for key, value in arm.FRICTION.items()})
    assert DriveModel.load(model).values == real.values
    with ExitStack() as stack:
        for name in ('monitor', 'feedforward'):
            stack.enter_context(node_process(
                [executable(name), '--ros-args', '--params-file', str(model), '-r', '__ns:=/left'],
                ros_domain, tmp_path / f'{name}.log'))
        replay = Replay(arm.record(more, arm.motion(20.0)), '/left/joint_states')
        stack.callback(replay.close)
        bench = stack.enter_context(workbench(
            '--live', '--model', model, '--ros-args', '-r', '__ns:=/left', folder=tmp_path))
        bench.enter()
        assert bench.screen()['units']['turn']['effort'] == 'N m'

        def live() -> dict[str, Any]:
            found: dict[str, Any] = bench.get('/api/live').json
            return found

        def awaited(holds: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
            end = time.monotonic() + 60
            while not holds(found := live()):
                assert time.monotonic() < end, found
                time.sleep(0.2)
            return found
        found = awaited(lambda found: found['monitor_error'] and found['kept'] > 8)
        # The same comparison, in the same window.
        np.testing.assert_allclose(found['error'], found['monitor_error'], rtol=0.2)
        assert found['error'][0] > 2 * found['error'][1]
        assert bench.post('/api/live/take').status == 200
        bench.settled()
        revision = bench.screen()['revision']
        assert bench.post('/api/tick', effect='viscous_friction', drives=['turn'],
                          revision=revision).status == 200
        bench.settled()
        assert bench.post('/api/live/set', confirmed='the other arm').status != 200
        machine = bench.get('/api/live/machine').json['machine']
        assert machine.startswith('node /left/feedforward; robot serial arm made_up')
        assert bench.post('/api/live/set', confirmed=machine).json == {
            'is_set': True, 'nodes': {'feedforward': ''}}
        found = awaited(lambda found: found['error'][0] and max(
            found['error'][0], found['monitor_error'][0]) < 0.5)
        # The way back: the error is there again.
        awaited(lambda found: found['can_restore'])
        assert bench.post('/api/live/restore', confirmed=machine).json == {
            'is_set': True, 'nodes': {'feedforward': ''}}
        found = awaited(lambda found: found['monitor_error'] and min(
            found['error'][0] or 0.0, found['monitor_error'][0] or 0.0) > 0.5)
        awaited(lambda found: not found['can_restore'])
