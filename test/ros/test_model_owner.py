# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The node that drives owns the model and its history; monitor and workbench set and follow it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from node_bench import bench, overrides
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.feedforward import FeedforwardNode
from pprs_dynamics.ros.live_joint_states import LiveNodes
from pprs_dynamics.ros.monitor import MonitorNode

pytestmark = pytest.mark.nodes

MODEL = DriveModel.load()
HEAVIER = DriveModel.from_parameters({
    **MODEL.values, 'masses.payload': MODEL.values['masses.payload'] + 0.1,
    'effects.active': ['effort_offset'], 'effects.effort_offset.lift_1.force': 0.5})
GIVEN = (MODEL.values['masses.payload'], [])
SET = (HEAVIER.values['masses.payload'], ['effort_offset'])


def awaited(predicate: Callable[[], Any], timeout: float = 30.0) -> None:
    end = time.monotonic() + timeout
    while not predicate():
        assert time.monotonic() < end
        time.sleep(0.05)


class Cell:
    """Monitor and feedforward in one process, spun beside, and a workbench."""

    def __init__(self, monitor: Node, feedforward: Node, drives: Node) -> None:
        self.monitor, self.feedforward, self.drives = monitor, feedforward, drives
        self.live = LiveNodes(MODEL)

    def models(self) -> list[tuple[float, list[str]]]:
        """Return payload and effects in force on each node."""
        found = []
        for node in (self.monitor, self.feedforward):
            payload, active = node.get_parameters(['masses.payload', 'effects.active'])
            found.append((payload.value, list(active.value or ())))
        return found


@pytest.fixture
def cell(ros_domain: int) -> Iterator[Cell]:
    with bench() as running:
        monitor, feedforward = (running.add(kind, parameter_overrides=overrides())
                                for kind in (MonitorNode, FeedforwardNode))
        drives = running.add(lambda **options: Node('left_drives', **options))
        drives.create_subscription(
            Float64MultiArray, '/feedforward/commands', lambda message: None, 10)
        over = threading.Event()

        def spin() -> None:
            while not over.is_set():
                running.executor.spin_once(timeout_sec=0.05)

        thread = threading.Thread(target=spin, daemon=True)
        thread.start()
        made = Cell(monitor, feedforward, drives)
        awaited(lambda: 'robot 3-PPRS' in made.live.machine()
                and 'left_drives' in made.live.machine())
        yield made
        made.live.close()
        over.set()
        thread.join(10)


def test_a_model_is_set_followed_and_restored(cell: Cell) -> None:
    live = cell.live
    assert not live.to_dict()['can_restore']
    assert live.set_model(HEAVIER, live.machine()) == {'is_set': True, 'nodes': {'feedforward': ''}}
    awaited(lambda: cell.models() == [SET, SET])
    assert live.to_dict()['effects'] == ['effort_offset']
    awaited(lambda: live.to_dict()['can_restore'])
    # A change by any other program is followed, and is a step of the same history.
    cell.feedforward.set_parameters([Parameter('masses.payload', value=0.7)])
    awaited(lambda: cell.models() == [(0.7, SET[1])] * 2)
    for before in (SET, GIVEN):
        assert live.restore(live.machine())['is_set']
        awaited(lambda before=before: cell.models() == [before, before])
    awaited(lambda: not live.to_dict()['effects'] and not live.to_dict()['can_restore'])
    answer = live.restore(live.machine())
    assert not answer['is_set']
    assert 'nothing to restore' in answer['nodes']['feedforward']


def test_a_model_is_taken_whole_or_not_at_all(cell: Cell) -> None:
    live = cell.live
    limits = DriveModel.from_parameters(
        {**HEAVIER.values, 'effects.effort_offset.lift_1.force': 0.25})
    cell.feedforward.add_on_set_parameters_callback(lambda changes: _refused())
    answer = live.set_model(limits, live.machine())
    assert answer == {'is_set': False, 'nodes': {'feedforward': 'over the limit'}}
    assert cell.models() == [GIVEN, GIVEN]
    assert live.to_dict()['effects'] == []


def _refused() -> Any:
    from rcl_interfaces.msg import SetParametersResult

    return SetParametersResult(successful=False, reason='over the limit')


def test_another_model_than_the_one_in_force_is_not_built_upon(cell: Cell) -> None:
    other = LiveNodes(HEAVIER)
    try:
        awaited(lambda: other.machine() == cell.live.machine())
        with pytest.raises(PprsError, match='feedforward has another model in force'):
            other.set_model(MODEL, other.machine())
    finally:
        other.close()
    assert cell.models() == [GIVEN, GIVEN]


def test_only_the_machine_that_was_confirmed_is_set(cell: Cell) -> None:
    live = cell.live
    machine = live.machine()
    assert machine == 'node /feedforward; robot 3-PPRS of paper.yaml; commands go to /left_drives'
    for said in ('', 'node /left/feedforward', machine + '.'):
        with pytest.raises(PprsError, match='not confirmed: what would be set is node /feed'):
            live.set_model(HEAVIER, said)
        with pytest.raises(PprsError, match='not confirmed'):
            live.restore(said)
    assert cell.models() == [GIVEN, GIVEN]
