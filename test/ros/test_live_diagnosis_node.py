# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The monitor says what changed on the running robot, over topics, and it is adopted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from node_bench import LATCHED, bench, checked, overrides
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.monitor import MonitorNode

pytestmark = pytest.mark.nodes

RATE, SPAN = 100, 10.0  # [Hz, s]
START = 1_700_000_000_000_000_000  # [ns]
OFFSET, NOISE = 1.0, 0.05  # [N]
PATIENCE = 180.0  # [s] for a diagnosis on a busy machine


@pytest.mark.slow
def test_a_change_is_told_within_two_windows() -> None:
    model = DriveModel.load()
    motion = Excitation(5 * SPAN, seed=4).motion(np.arange(0, 5 * SPAN, 1 / RATE))
    forces = model.drive_forces(motion)
    position, effort = forces.mechanism.position, forces.total
    effort = effort + NOISE * np.random.default_rng(0).standard_normal(effort.shape)
    effort[round(1.05 * SPAN * RATE):, 3] += OFFSET  # with the second window
    with bench() as running:
        node = running.add(MonitorNode, parameter_overrides=overrides(
            diagnose_every=SPAN, diagnose_span=SPAN))
        feedforward = running.add(FeedforwardNode, parameter_overrides=overrides())
        told = running.listen(String, '/monitor/diagnosis', LATCHED)
        running.follow_status('/monitor/status')
        states = running.probe.create_publisher(JointState, '/joint_states', 1000)
        assert running.spin_until(states.get_subscription_count)
        assert running.connected()
        sent = 0

        def send(rows: int) -> None:
            nonlocal sent
            for row in range(sent, sent + rows):
                states.publish(conversions.joint_state(
                    START + row * 10**9 // RATE, effort[row], position[row], np.zeros(6)))
                running.executor.spin_once(timeout_sec=0.0)
            sent += rows

        for number in range(1, 5):
            send(round(SPAN * RATE) + 5)
            assert running.spin_until(lambda n=number: len(told) >= n, PATIENCE), number
        first, second, _, fourth = (checked(message.data, 'diagnosis') for message in told[:4])
        assert first['effects'] == []
        assert first['confirmed'] is False
        assert second['confirmed'] is False  # one window alone is a hypothesis
        assert fourth['confirmed'] is True, fourth
        assert fourth['effects'][0]['drives'] == ['lift_1']
        assert fourth['since'] == pytest.approx(START / 1e9 + 1.05 * SPAN, abs=1.5)
        assert 'lift_1' in fourth['text']
        send(200)
        assert running.spin_until(lambda: running.status[-1]['code'] == 'CHANGED', 20.0)
        assert running.status[-1]['level'] == 'WARN'
        # A person adopts it: the node that drives takes it, and the monitor follows.
        adopting = running.probe.create_client(Trigger, '/monitor/adopt_confirmed')
        assert running.spin_until(adopting.service_is_ready)
        future = adopting.call_async(Trigger.Request())
        assert running.spin_until(future.done, 20.0)
        assert future.result().success, future.result().message

        def offset(each: Any) -> float:
            name = 'effects.effort_offset.lift_1.force'
            return float(each.get_parameter(name).value) if each.has_parameter(name) else 0.0
        assert running.spin_until(lambda: abs(offset(node) - OFFSET) < 0.2, 20.0)
        assert offset(feedforward) == offset(node)
