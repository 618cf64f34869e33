# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a diagnosis claims is set on running nodes by a service of the monitor, and taken back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from node_bench import Bench, bench, overrides
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.monitor import MonitorNode

std_srvs = pytest.importorskip(
    'std_srvs.srv', reason='services are offered where std_srvs is installed, as make test does')

pytestmark = pytest.mark.nodes

FORCE = 'effects.effort_offset.lift_1.force'
OFFSET = 1.5  # [N]


class Running:
    """Monitor and feedforward in one process, and what the monitor's services say."""

    def __init__(self, running: Bench) -> None:
        self.bench = running
        self.monitor: Any = running.add(MonitorNode, parameter_overrides=overrides())
        self.feedforward: Any = running.add(FeedforwardNode, parameter_overrides=overrides())

    def claim(self) -> None:
        """Let the monitor claim an offset, as its diagnosis does."""
        self.monitor._changed = 'an offset'
        self.monitor._adoptable = {
            **self.monitor._settings.model.values, 'effects.active': (
                *self.monitor._settings.model.values['effects.active'], 'effort_offset'),
            FORCE: OFFSET}

    def call(self, service: str) -> Any:
        client = self.bench.probe.create_client(std_srvs.Trigger, f'/monitor/{service}')
        assert self.bench.spin_until(client.service_is_ready)
        future = client.call_async(std_srvs.Trigger.Request())
        assert self.bench.spin_until(future.done, 30.0)
        return future.result()

    def forces(self) -> list[float]:
        """Return the offset that each node's model has [N]."""
        return [node._settings.model.values.get(FORCE, 0.0)
                if 'effort_offset' in node._settings.model.values['effects.active'] else 0.0
                for node in (self.monitor, self.feedforward)]


@pytest.fixture
def running(ros_domain: int) -> Iterator[Running]:
    with bench() as started:
        nodes = Running(started)
        knows = nodes.monitor._model_services
        assert started.spin_until(lambda: knows._in_force, 20.0)
        yield nodes


def test_what_is_claimed_is_set_on_both_nodes_and_restored_on_both(running: Running) -> None:
    running.claim()
    answer = running.call('adopt_confirmed')
    assert answer.success, answer.message
    assert 'feedforward: set' in answer.message
    assert running.forces() == [OFFSET, OFFSET]
    assert not running.monitor._changed  # of the model that was in force
    hashes = [each._settings.model.fingerprint for each in (running.monitor, running.feedforward)]
    assert hashes[0] == hashes[1]
    running.bench.follow_status('/monitor/status')
    assert running.bench.spin_until(
        lambda: running.bench.status and running.bench.status[-1]['model']['sha256'] == hashes[0])
    answer = running.call('restore')
    assert answer.success, answer.message
    assert running.forces() == [0.0, 0.0]
    answer = running.call('restore')
    assert not answer.success
    assert 'nothing to restore' in answer.message


def test_what_is_not_confirmed_is_not_set(running: Running) -> None:
    answer = running.call('adopt_confirmed')
    assert (answer.success, answer.message) == (
        False, 'nothing was set: no effect is confirmed')
    running.claim()
    running.monitor._adoptable = {}  # beside one that is not confirmed
    answer = running.call('adopt_confirmed')
    assert not answer.success
    assert 'the next one decides' in answer.message
    assert running.forces() == [0.0, 0.0]


def test_a_feedforward_of_another_model_is_left_alone(running: Running) -> None:
    client = running.bench.probe.create_client(SetParameters, '/feedforward/set_parameters')
    assert running.bench.spin_until(client.service_is_ready)
    before = running.monitor._model_services._in_force
    future = client.call_async(SetParameters.Request(parameters=[
        Parameter('masses.payload', value=0.4).to_parameter_msg()]))
    assert running.bench.spin_until(future.done)
    assert running.bench.spin_until(lambda: running.monitor._model_services._in_force != before)
    running.claim()
    answer = running.call('adopt_confirmed')
    assert not answer.success
    assert 'feedforward has another model in force' in answer.message
    assert running.forces() == [0.0, 0.0]


def test_a_node_that_refuses_leaves_all_as_they_were(running: Running) -> None:
    running.claim()
    running.monitor._adoptable['effects.active'] = ('no_such_effect',)
    answer = running.call('adopt_confirmed')
    assert not answer.success
    assert 'no_such_effect' in answer.message
    assert running.forces() == [0.0, 0.0]


def test_a_monitor_alone_adopts_for_itself(ros_domain: int) -> None:
    with bench() as started:
        monitor: Any = started.add(MonitorNode, parameter_overrides=overrides())
        nodes = Running.__new__(Running)
        nodes.bench, nodes.monitor = started, monitor
        nodes.claim()
        answer = nodes.call('adopt_confirmed')
        assert answer.success, answer.message
        assert monitor._settings.model.values[FORCE] == OFFSET
        assert isinstance(monitor, Node)
