# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the workbench hears of a running robot, and what it must survive."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from node_bench import LATCHED, Bench, bench
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_processes import executable, node_process
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.live_joint_states import SHOWN, LiveJointStates, LiveNodes
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.model_transaction import RAMP, set_on_all

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()
PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'
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


@pytest.mark.parametrize('reliability', [
    ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT], ids=lambda one: one.name)
@pytest.mark.parametrize('comes', ['before', 'after'])
def test_joint_states_are_heard_whatever_their_publisher_offers(
    reliability: ReliabilityPolicy, comes: str,
) -> None:
    """A driver over a network publishes best effort, which who asks for more never receives."""
    message = conversions.joint_state(0, np.zeros(6), np.zeros(6), np.zeros(6))
    with bench() as running:
        def publish() -> Any:
            return running.probe.create_publisher(
                JointState, '/joint_states', QoSProfile(depth=10, reliability=reliability))

        early = publish() if comes == 'before' else None
        node: Any = running.add(lambda **options: LiveJointStates(
            MODEL, 'joint_states', 'monitor', 'feedforward', **options))
        publisher = early or publish()
        assert running.spin_until(publisher.get_subscription_count)
        assert running.spin_until(lambda: publisher.publish(message) or node.to_dict()['received'])


HEAVIER = DriveModel.from_parameters({
    **MODEL.values, 'masses.payload': MODEL.values['masses.payload'] + 0.1,
    'effects.active': ['effort_offset'], 'effects.effort_offset.lift_1.force': 0.5})


class Robot:
    """Nodes with parameters, spun beside, one of which may refuse; and a workbench's side."""

    def __init__(self, **refusals: str) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.refusals, self.sets = refusals, list[tuple[str, set[str]]]()
        self.nodes = {name: self._node(name) for name in ('monitor', 'feedforward')}
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()
        self.live = LiveNodes(MODEL)
        end = time.monotonic() + 20
        while not all(word in self.live.machine() for word in self.nodes):
            assert time.monotonic() < end, self.live.machine()
            time.sleep(0.05)

    def _node(self, name: str) -> Node:
        node = Node(name, context=self.context, allow_undeclared_parameters=True)
        node.declare_parameter('masses.payload', MODEL.values['masses.payload'])
        node.declare_parameter('effects.active', rclpy.Parameter.Type.STRING_ARRAY)
        node.set_parameters([rclpy.Parameter(
            'effects.active', rclpy.Parameter.Type.STRING_ARRAY, [])])
        if name == 'feedforward':
            node.declare_parameter('ramp_time', 0.0)

        def check(changes: list[Any]) -> SetParametersResult:
            self.sets.append((name, {change.name for change in changes}))
            return SetParametersResult(successful=name not in self.refusals,
                                       reason=self.refusals.get(name, ''))
        node.add_on_set_parameters_callback(check)
        self.executor.add_node(node)
        return node

    def values(self, name: str) -> tuple[float, list[str]]:
        """Payload and effects in force of a node."""
        payload, active = self.nodes[name].get_parameters(['masses.payload', 'effects.active'])
        return payload.value, list(active.value or ())

    def close(self) -> None:
        self.live.close()
        self.executor.shutdown()
        # Else they are in the graph until they are collected, and the next test's have their names.
        for node in self.nodes.values():
            node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Iterator[Robot]:
    made = Robot(**getattr(request, 'param', {}))
    yield made
    made.close()


GIVEN = (MODEL.values['masses.payload'], [])
SET = (HEAVIER.values['masses.payload'], ['effort_offset'])


def test_a_model_is_set_on_all_nodes_and_restored_on_all(robot: Robot) -> None:
    live = robot.live
    assert not live.can_restore
    assert live.set_model(HEAVIER, live.machine()) == {
        'is_set': True, 'nodes': {'monitor': '', 'feedforward': ''}}
    assert [robot.values(name) for name in robot.nodes] == [SET, SET]
    # The drives go over to it.
    assert robot.nodes['feedforward'].get_parameter('ramp_time').value == RAMP
    assert not robot.nodes['monitor'].has_parameter('ramp_time')
    assert live.to_dict()['effects'] == ['effort_offset']
    assert live.can_restore
    assert live.restore(live.machine())['is_set']
    assert [robot.values(name) for name in robot.nodes] == [GIVEN, GIVEN]
    assert live.to_dict()['effects'] == []
    assert not live.can_restore
    with pytest.raises(PprsError, match='nothing to restore'):
        live.restore(live.machine())


def test_numbers_that_are_taken_back_are_set_on_running_nodes_again(robot: Robot) -> None:
    robot.live.set_model(HEAVIER, robot.live.machine())
    robot.live.set_model(MODEL, robot.live.machine())
    assert [robot.values(name) for name in robot.nodes] == [GIVEN, GIVEN]
    # Step by step back: to the model before, which was the heavier one.
    robot.live.restore(robot.live.machine())
    assert [robot.values(name) for name in robot.nodes] == [SET, SET]


@pytest.mark.parametrize(('robot', 'refuses', 'other'), [
    ({'feedforward': 'over the limit'}, 'feedforward', 'monitor'),
    ({'monitor': 'not of this robot'}, 'monitor', 'feedforward')], indirect=['robot'])
def test_where_one_node_refuses_none_has_the_model(
    robot: Robot, refuses: str, other: str,
) -> None:
    live = robot.live
    answer = live.set_model(HEAVIER, live.machine())
    assert answer['is_set'] is False
    assert answer['nodes'][refuses] == robot.refusals[refuses]
    assert 'as another node refused' in answer['nodes'][other]
    assert [robot.values(name) for name in robot.nodes] == [GIVEN, GIVEN]
    assert live.to_dict()['effects'] == []
    assert not live.can_restore
    # What drives a machine is the last to be touched.
    touched = [name for name, _ in robot.sets]
    assert 'feedforward' not in touched if refuses == 'monitor' else touched[0] == 'monitor'


def test_the_step_of_another_program_is_not_undone(robot: Robot) -> None:
    """Two workbenches, or a workbench and the monitor's services, on one robot."""
    live, other = robot.live, LiveNodes(MODEL)
    end = time.monotonic() + 25
    try:
        while other.machine() != live.machine():
            assert time.monotonic() < end
            time.sleep(0.1)
        assert live.set_model(HEAVIER, live.machine())['is_set']
        answer = other.set_model(DriveModel.from_parameters(
            {**MODEL.values, 'masses.payload': 0.7}),
                                 live.machine())
        assert not answer['is_set']
        assert 'changed by another program' in answer['nodes']['monitor']
        assert [robot.values(name) for name in robot.nodes] == [SET, SET]
    finally:
        other.close()
    robot.nodes['monitor'].set_parameters([Parameter('masses.payload', value=0.9)])
    answer = live.restore(live.machine())
    assert not answer['is_set']
    assert 'masses.payload' in answer['nodes']['monitor']
    assert robot.values('monitor')[0] == 0.9
    assert live.can_restore


def test_only_the_machine_that_was_confirmed_is_set(robot: Robot) -> None:
    live = robot.live
    machine = live.machine()
    assert machine.startswith('nodes /monitor, /feedforward')
    for said in ('', 'nodes /left/feedforward', machine + '.'):
        with pytest.raises(PprsError, match='not confirmed: what would be set is nodes /monitor'):
            live.set_model(HEAVIER, said)
    robot.executor.remove_node(robot.nodes['monitor'])
    robot.nodes['monitor'].destroy_node()
    end = time.monotonic() + 25
    while live.machine() == machine:
        assert time.monotonic() < end
        time.sleep(0.1)
    with pytest.raises(PprsError, match='not confirmed'):
        live.set_model(HEAVIER, machine)
    assert robot.sets == []


def test_the_machine_is_named_by_robot_file_and_who_takes_its_commands(
    ros_domain: int, tmp_path: Path,
) -> None:
    command = [executable('feedforward'), '--ros-args', '--params-file', str(PAPER)]
    with node_process(command, ros_domain, tmp_path / 'log'), bench() as running:
        drives = running.add(lambda **options: Node('left_drives', **options))
        drives.create_subscription(
            Float64MultiArray, '/feedforward/commands', lambda message: None, 10)
        nodes = LiveNodes(MODEL)
        try:
            assert running.spin_until(lambda: nodes.machine() == (
                'nodes /feedforward; robot 3-PPRS of paper.yaml; commands of feedforward go to '
                '/left_drives'), 20), nodes.machine()
            answer = nodes.set_model(DriveModel.from_parameters({
                **MODEL.values, 'masses.payload': 1.5}), nodes.machine())
            assert answer == {'is_set': True, 'nodes': {'feedforward': ''}}
        finally:
            nodes.close()


def test_a_node_takes_a_whole_model_or_nothing_of_it(ros_domain: int, tmp_path: Path) -> None:
    """A real node refuses a list that names no effect, and the number beside it."""
    command = [executable('monitor'), '--ros-args', '-p', 'demo:=true']
    with node_process(command, ros_domain, tmp_path / 'log'), bench() as asking:
        nodes = LiveNodes(MODEL)
        client = asking.probe.create_client(GetParameters, '/monitor/get_parameters')
        try:
            assert asking.spin_until(lambda: nodes.machine() and client.service_is_ready(), 20)

            def payload_after(active: list[str]) -> tuple[str, float]:
                answer = set_on_all(nodes._node.clients_of, ['monitor'], {'monitor': {
                    'masses.payload': SET[0], 'effects.active': active}}, {})
                asked = client.call_async(GetParameters.Request(names=['masses.payload']))
                assert asking.spin_until(asked.done)
                return answer.said['monitor'], asked.result().values[0].double_value

            said, value = payload_after(['no_such_effect'])
            assert 'no_such_effect' in said
            assert value == GIVEN[0]
            assert payload_after([]) == ('', SET[0])
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
            node.stream._on_state(bytes(serialize_message(conversions.joint_state(
                row * STEP, forces.total[row], forces.mechanism.position[row],
                forces.mechanism.velocity[row]))))
            if row % 50 == 0:
                node._compare()
    times = np.array([moment for moment, _ in node._residuals])
    assert 1000 < len(times) <= SHOWN * 1e9 / STEP + 1
    assert np.all(np.diff(times) > 0)
