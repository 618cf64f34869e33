# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Goals sent on to a controller that is a process of its own, and may die or hang.

The action is one of test_msgs: control_msgs has no wheel.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from node_bench import Bench, bench
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.node import Node
from ros_processes import node_process

from pprs_dynamics.ros.node.goal_relay import ControllerError, GoalRelay

fibonacci = pytest.importorskip('test_msgs.action').Fibonacci
pytestmark = pytest.mark.nodes

SERVER = Path(__file__).parents[1] / 'support' / 'counting_controller.py'
PATIENCE = 2.0  # [s]; a process that goes on after a stop takes up to one on a busy machine
PER_SECOND = 20  # counts of the controller
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class RelayingNode(Node):
    """Sends goals on as `trajectory_proxy` does; `said` has the reasons of those aborted."""

    def __init__(self, **options: Any) -> None:
        super().__init__('relaying', **options)
        self.patience, self.duration = PATIENCE, 0.0
        self.said: list[str] = []
        self.relay = GoalRelay(self, fibonacci, '/controller/count', lambda: self.patience)
        self.server = ActionServer(self, fibonacci, '~/count', self._execute,
                                   cancel_callback=self._cancel)

    def _cancel(self, handle: Any) -> Any:
        self.relay.cancel(handle)
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        try:
            watched = await self.relay.accepted(handle, handle.request, self.duration)
            answer = await self.relay.finished(watched)
        except ControllerError as error:
            self.said.append(str(error))
            handle.abort()
            return fibonacci.Result()
        {SUCCEEDED: handle.succeed, CANCELED: handle.canceled}.get(answer.status, handle.abort)()
        return answer.result


class Relayed:
    """The relaying node, a client of it, and controllers that are started and ended."""

    def __init__(self, running: Bench, domain: int, log: Path, processes: ExitStack) -> None:
        self._running, self._domain, self._log, self._processes = running, domain, log, processes
        self.node: Any = running.add(RelayingNode)
        self.client = ActionClient(running.probe, fibonacci, '/relaying/count')
        self.feedback: list[int] = []
        assert running.spin_until(self.client.server_is_ready)

    def controller(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a controller and wait until it is there."""
        before = self._servers()  # one that was killed is among them for as long as its lease
        process = self._processes.enter_context(node_process(
            [sys.executable, str(SERVER), *arguments], self._domain, self._log))
        assert self._running.spin_until(lambda: self._servers() > before)
        assert self._running.spin_until(self.node.relay.server_is_there)
        self._running.spin_for(1.0)  # discovery is one-sided, and slow on a busy machine
        return process

    def _servers(self) -> int:
        return int(self.node.count_services('/controller/count/_action/send_goal'))

    def goal(self, order: int) -> Any:
        """Send a goal; return what its status and result will be."""
        def count(message: Any) -> None:
            self.feedback.append(message.feedback.sequence[-1])

        sent = self.client.send_goal_async(fibonacci.Goal(order=order), feedback_callback=count)
        assert self._running.spin_until(sent.done)
        self.sent = sent.result()
        return self.sent.get_result_async()

    def answer(self, result: Any) -> tuple[int, list[int]]:
        """Return status and sequence of an answer."""
        assert self._running.spin_until(result.done)
        return result.result().status, list(result.result().result.sequence)

    def counted_to(self, last: int) -> bool:
        """Return whether feedback came in order; the result may overtake the last of it."""
        return self.feedback in (list(range(1, last)), list(range(1, last + 1)))

    def spin_until(self, predicate: Callable[[], Any]) -> None:
        assert self._running.spin_until(predicate)

    def spin_for(self, duration: float) -> None:
        self._running.spin_for(duration)


@pytest.fixture
def relayed(ros_domain: int, tmp_path: Path) -> Iterator[Relayed]:
    with bench() as running, ExitStack() as processes:
        yield Relayed(running, ros_domain, tmp_path / 'controller.log', processes)


def test_feedback_result_and_refusal_pass_through(relayed: Relayed) -> None:
    relayed.controller()
    assert relayed.answer(relayed.goal(5)) == (SUCCEEDED, [5])
    assert relayed.counted_to(5)
    assert relayed.answer(relayed.goal(-1)) == (ABORTED, [])
    assert relayed.node.said == ['the controller rejected the goal; its log has the reason']


def test_a_goal_is_cancelled_at_the_controller(relayed: Relayed) -> None:
    relayed.controller()
    result = relayed.goal(1000)
    relayed.spin_until(lambda: len(relayed.feedback) > 2)
    relayed.sent.cancel_goal_async()
    status, sequence = relayed.answer(result)
    assert status == CANCELED
    assert 2 < sequence[0] < 1000


@pytest.mark.parametrize('how', [
    signal.SIGSTOP, pytest.param(signal.SIGKILL, marks=pytest.mark.slow),
    pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_a_controller_that_goes_in_the_middle_ends_the_goal(
    relayed: Relayed, how: signal.Signals,
) -> None:
    process = relayed.controller()
    result = relayed.goal(1000)
    relayed.spin_until(lambda: len(relayed.feedback) > 2)
    process.send_signal(how)
    began = time.monotonic()
    assert relayed.answer(result)[0] == ABORTED
    assert time.monotonic() - began > PATIENCE / 2 or how == signal.SIGINT
    [said] = relayed.node.said
    assert 'in the middle of a goal' in said
    # The next one, to nobody or to one that hangs, ends as soon; and then it is back.
    assert relayed.answer(relayed.goal(2))[0] == ABORTED
    if how == signal.SIGSTOP:
        process.send_signal(signal.SIGCONT)
        relayed.spin_for(1.0)  # it finds the first goal, and that it is to be cancelled
    else:
        process.wait(60)
        relayed.controller()
    relayed.feedback.clear()
    assert relayed.answer(relayed.goal(3)) == (SUCCEEDED, [3]), relayed.node.said
    assert relayed.counted_to(3)


def test_without_feedback_the_end_of_the_motion_is_waited_for(relayed: Relayed) -> None:
    relayed.controller('mute')
    relayed.node.duration = 2.0
    assert relayed.answer(relayed.goal(2 * PER_SECOND))[0] == SUCCEEDED
    # One that should be there at once, and is not.
    relayed.node.duration = 0.0
    began = time.monotonic()
    assert relayed.answer(relayed.goal(1000))[0] == ABORTED
    assert time.monotonic() - began > PATIENCE
    assert relayed.node.said[-1] == (
        f'the server of /controller/count has been silent for {PATIENCE:g} s in the middle of a '
        'goal; what the drives do now is not known')
