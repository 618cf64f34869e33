# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Messages on the topics of a node that no node of this package sends: none ends the node."""

from __future__ import annotations

import json

import pytest
from node_bench import LATCHED, bench, overrides
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray, String

from pprs_dynamics import DriveModel
from pprs_dynamics.ros.messages.incoming_bytes import only_whole
from pprs_dynamics.ros.monitor import MonitorNode
from pprs_dynamics.ros.node.qos import subscription

pytestmark = pytest.mark.nodes

FOREIGN = [  # on the status topic of the node that drives
    'no JSON', 'null', '[]', '{}', '{"model": "x"}', '{"model": null, "changes": 1}',
    '{"model": {"sha256": 3, "files": [1]}, "robot": "r", "changes": 0}',
    '{"model": {"sha256": "a", "files": []}, "robot": "r", "changes": 1e999}',
    '{"model": {"sha256": "a", "files": []}, "robot": "r", "changes": null}']


def test_a_status_of_another_program_does_not_end_the_monitor() -> None:
    with bench() as running:
        monitor = running.add(MonitorNode, parameter_overrides=overrides())
        publisher = running.probe.create_publisher(String, '/feedforward/status', LATCHED)
        assert running.spin_until(publisher.get_subscription_count)
        for text in FOREIGN:
            publisher.publish(String(data=text))
            running.spin_for(0.02)
        assert monitor._owner.difference() == ''
        publisher.publish(bytes(serialize_message(String(data='cut off')))[:-3])
        model = {'sha256': 'another', 'files': [{'file': '/somewhere/robot.yaml'}]}
        publisher.publish(String(data=json.dumps({'robot': 'r', 'model': model, 'changes': 2})))
        assert running.spin_until(monitor._owner.difference)
        assert monitor._owner.status.files == ('robot.yaml',)
        assert monitor._owner.status.fingerprint != DriveModel.load().fingerprint


def test_bytes_that_are_no_message_are_dropped() -> None:
    with bench() as running:
        received: list[list[float]] = []
        subscription(running.probe, Float64MultiArray, '/numbers', only_whole(
            Float64MultiArray, lambda message: received.append(list(message.data))))
        publisher = running.probe.create_publisher(Float64MultiArray, '/numbers', 10)
        assert running.spin_until(publisher.get_subscription_count)
        whole = bytes(serialize_message(Float64MultiArray(data=[1.0, 2.0])))
        for data in (whole[:-8], b'\0\1\0\0', whole[:9] + b'\xff' * 4 + whole[13:], whole):
            publisher.publish(data)
        assert running.spin_until(lambda: received)
        assert received == [[1.0, 2.0]]
