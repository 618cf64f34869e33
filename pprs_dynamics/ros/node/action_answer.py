# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Waiting for what an action's server answers, for as long as there is a server."""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

# [s] between looks whether somebody serves the action; a process that is killed is in the graph
# for as long as the middleware's lease on its participant, 20 s by default.
PERIOD = 0.5


async def is_answered(node: Node, client: ActionClient, answer: Future[Any]) -> bool:
    """Wait for an answer, and return whether it came before the server went.

    Parameters
    ----------
    node : Node
        That is spun.
    client : ActionClient
        Whose server was there.
    answer : Future
        Of a goal that was sent, or of its result.
    """
    over: Future[None] = Future()

    def look(_: Any = None) -> None:
        if not over.done() and (answer.done() or not client.server_is_ready()):
            over.set_result(None)

    # The clock of the machine: a simulated one may stand.
    timer = node.create_timer(PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME))
    answer.add_done_callback(look)
    try:
        await over
    finally:
        node.destroy_timer(timer)
    return answer.done()
