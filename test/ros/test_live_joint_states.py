# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the workbench hears of a running robot, and what it must survive."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from node_bench import LATCHED, Bench, bench
from rcl_interfaces.srv import GetParameters
from rclpy.serialization import serialize_message
from ros_processes import executable, node_process
from std_msgs.msg import Float64MultiArray, String

from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.ros.live_joint_states import SHOWN, LiveJointStates, LiveNodes
from pprs_dynamics.ros.messages import conversions

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()
STEP = 10_000_000  # [ns]


@pytest.fixture
def running() -> Iterator[tuple[Bench, Any]]:
    with bench() as made:
        yield made, made.add(lambda **options: LiveJointStates(
            MODEL, 'joint_states', 'monitor', 'feedforward', **options))


def test_what_is_no_message_of_the_monitor_is_passed_over(running: tuple[Bench, Any]) -> None:
    bench, node = running
    error, diagnosis = (bench.probe.create_publisher(kind, topic, qos) for kind, topic, qos in (
        (Float64MultiArray, '/monitor/error', 10), (String, '/monitor/diagnosis', LATCHED)))
    assert bench.spin_until(error.get_subscription_count)
    assert bench.spin_until(diagnosis.get_subscription_count)
    for data in (b'\x00\x01\x00\x00\xff\xff\xff\xff', bytes(serialize_message(
            Float64MultiArray(data=[1.0, 2.0])))[:-6]):
        error.publish(data)
    for data in (b'\x00\x01\x00\x00\x02\x00\x00\x00\xff\x00', b'\x00\x01\x00\x00\x09\x00\x00\x00a',
                 String(data='[1]'), String(data='no JSON'),
                 String(data=json.dumps({'since': float('nan'), 'effects': []}))):
        diagnosis.publish(data)
    error.publish(Float64MultiArray(data=[3.0, 4.0]))
    assert bench.spin_until(lambda: node.to_dict()['monitor_error'] == [3.0, 4.0])
    assert bench.spin_until(lambda: node.to_dict()['diagnosis'] == {'since': None, 'effects': []})


def test_numbers_that_are_taken_back_are_set_on_running_nodes_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heavier = build_model({
        **MODEL.values, 'masses.payload': MODEL.values['masses.payload'] + 0.1,
        'effects.active': ['effort_offset'], 'effects.effort_offset.lift_1.force': 0.5})
    nodes = LiveNodes(MODEL)
    sent: list[dict[str, Any]] = []
    try:
        monkeypatch.setattr(nodes, '_set', lambda name, changes, active: sent.append(
            {**changes, 'effects.active': active}) or '')
        nodes.set_model(heavier)
        nodes.set_model(MODEL)
    finally:
        nodes.close()
    assert sent[0]['masses.payload'] == heavier.values['masses.payload']
    assert sent[0]['effects.effort_offset.lift_1.force'] == 0.5
    assert sent[-1] == {'masses.payload': MODEL.values['masses.payload'], 'effects.active': []}


def test_a_node_takes_a_whole_model_or_nothing_of_it(ros_domain: int, tmp_path: Path) -> None:
    payload = MODEL.values['masses.payload'] + 0.1
    command = [executable('monitor'), '--ros-args', '-p', 'demo:=true']
    with node_process(command, ros_domain, tmp_path / 'log'), bench() as asking:
        nodes = LiveNodes(MODEL)
        client = asking.probe.create_client(GetParameters, '/monitor/get_parameters')
        try:
            services = nodes._node.clients_of['monitor'].services_are_ready
            assert asking.spin_until(lambda: services() and client.service_is_ready(), 20)

            def payload_after(active: list[str]) -> tuple[str, float]:
                said = nodes._set('monitor', {'masses.payload': payload}, active)
                asked = client.call_async(GetParameters.Request(names=['masses.payload']))
                assert asking.spin_until(asked.done)
                return said, asked.result().values[0].double_value

            said, value = payload_after(['no_such_effect'])
            assert 'no_such_effect' in said
            assert value == MODEL.values['masses.payload']
            assert payload_after([]) == ('', payload)
        finally:
            nodes.close()


def test_what_is_drawn_stays_bounded_where_a_bag_is_played_in_a_loop(
    running: tuple[Bench, Any],
) -> None:
    _, node = running
    motion = Excitation(SHOWN + 5.0, seed=3).motion(np.arange(0, SHOWN + 5.0, STEP / 1e9))
    forces = MODEL.drive_forces(motion)
    for _ in range(2):
        for row in range(len(motion)):
            node._on_state(bytes(serialize_message(conversions.joint_state(
                row * STEP, forces.total[row], forces.mechanism.position[row],
                forces.mechanism.velocity[row]))))
            if row % 50 == 0:
                node._judge()
    times = np.array([moment for moment, _ in node._residuals])
    assert 1000 < len(times) <= SHOWN * 1e9 / STEP + 1
    assert np.all(np.diff(times) > 0)
