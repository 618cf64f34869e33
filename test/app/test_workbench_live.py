# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench on a running robot: effects go to the nodes, and the error falls."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest
import rclpy
from browser import chromium, needs_browser
from node_bench import LATCHED
from rclpy.context import Context
from rclpy.node import Node
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from workbench_bench import NOISE, write_hidden
from workbench_page import Page
from workbench_server import Workbench, workbench

from pprs_dynamics.measurement.files.recording import Recording, read_recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames

pytestmark = pytest.mark.nodes

START = 1_700_000_000_000_000_000  # [ns]
THINNED = 5  # of the recorded samples one is published: 100 Hz


class Replay:
    """Publishes a recording as joint states, in real time, again and again onwards."""

    def __init__(self, recording: Recording, topic: str = '/joint_states',
                 thinned: int = THINNED) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('replay', context=self.context)
        self.publisher = self.node.create_publisher(JointState, topic, 100)
        self.recording, self.thinned = recording, thinned
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        rows = np.arange(0, len(self.recording.time), self.thinned)
        stamp, began, sent = START, time.monotonic(), 0
        while True:
            stamp += 1_000_000_000  # a gap: the motion begins anew
            for row in rows:
                message = conversions.joint_state(
                    stamp, self.recording.effort[row], self.recording.position[row],
                    self.recording.position[row], RobotNames(self.recording.drives, ''))
                message.velocity = []
                self.publisher.publish(message)
                stamp += 10_000_000
                sent += 1
                if self.ends.wait(max(0.0, began + 0.01 * sent - time.monotonic())):
                    return

    def close(self) -> None:
        self.ends.set()
        self.thread.join(5)
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def bench(tmp_path: Path, ros_domain: int) -> Iterator[Workbench]:
    recorded, live = write_hidden(tmp_path / 'run.csv', 1), write_hidden(tmp_path / 'live.csv', 3)
    with ExitStack() as stack:
        for name in ('monitor', 'feedforward'):
            stack.enter_context(node_process(
                [executable(name), '--ros-args', '-p', 'demo:=true'], ros_domain,
                tmp_path / f'{name}.log'))
        replay = Replay(read_recording(live))
        stack.callback(replay.close)
        running = stack.enter_context(workbench(recorded, '--live', folder=tmp_path))
        running.enter()
        yield running


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
        replay = Replay(arm.record(more, arm.motion(20.0)), '/left/joint_states', 1)
        stack.callback(replay.close)
        bench = stack.enter_context(workbench(
            '--live', '--model', model, '--namespace', '/left', folder=tmp_path))
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


@contextmanager
def diagnosis(content: dict[str, Any]) -> Iterator[None]:
    """Say something on the topic of the monitor's live diagnosis."""
    context = Context()
    rclpy.init(context=context)
    node = Node('diagnosing', context=context)
    node.create_publisher(String, '/monitor/diagnosis', LATCHED).publish(
        String(data=json.dumps(content)))
    yield
    node.destroy_node()
    context.try_shutdown()


@pytest.mark.slow
@needs_browser
def test_ticked_effects_go_to_running_nodes_and_the_error_falls(bench: Workbench) -> None:
    with chromium() as browser:
        page = Page(browser, bench)
        page.settled()
        page.tick('payload_mass')
        page.tick('coulomb_friction')
        page.tab.locator('#live-tab').click()
        page.tab.wait_for_function('bench.live && bench.live.kept > 6')
        # Errors are of the last seconds, and grow and fall with the motion.
        for key in ('error', 'monitor_error'):
            page.tab.wait_for_function(
                f'bench.live.{key} && Math.max(...bench.live.{key}) > {6 * NOISE}')
        page.tab.locator('#live-set').click()
        page.tab.locator('#live-confirm[open]').wait_for()
        assert 'node /feedforward; robot 3-PPRS' in page.tab.locator(
            '#live-machine').inner_text()
        page.tab.locator('#live-yes').click()
        page.tab.locator('#live-nodes li').wait_for()
        assert page.tab.locator('#live-nodes').inner_text().splitlines() == [
            'feedforward: took the effects']
        for key in ('error', 'monitor_error'):
            page.tab.wait_for_function(
                f'bench.live.{key} && Math.max(...bench.live.{key}) < {3 * NOISE}')
        assert 'payload mass' in page.tab.locator('#live-state').inner_text()
        # What the monitor's live diagnosis says of the robot is told, from before as well.
        assert page.tab.locator('#live-changes').inner_text() == ''
        with diagnosis({'text': 'payload mass: mass 0.210 ± 0.004 kg, since 14:02:31',
                        'confirmed': True, 'withdrawn': [{'name': 'base_tilt'}], 'note': ''}):
            page.tab.wait_for_function(
                "document.getElementById('live-changes').textContent === 'What changed: payload "
                "mass: mass 0.210 ± 0.004 kg, since 14:02:31 Gone: base tilt.'")
        # What came in is data for the session, too.
        page.tab.locator('#live-take').click()
        page.tab.wait_for_function('bench.state.recordings.length === 2')
        assert page.settled()['recordings'][1]['now'] < 3 * NOISE
        assert page.complaints == []
        page.context.close()
