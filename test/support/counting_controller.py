# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Process with an action server on `/controller/count`: it counts up to a goal's order.

Twenty numbers a second, each told as feedback unless the argument `mute` is given. What it is
asked for may be negative: such a goal is rejected.
"""

from __future__ import annotations

import sys
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from test_msgs.action import Fibonacci

PERIOD = 0.05  # [s]


def main() -> None:
    """Serve until a signal."""
    rclpy.init()
    node = Node('controller')

    async def execute(goal: Any) -> Any:
        count = 0
        while count < goal.request.order:
            if goal.is_cancel_requested:
                goal.canceled()
                return Fibonacci.Result(sequence=[count])
            waited: Future[None] = Future()
            timer = node.create_timer(PERIOD, lambda waited=waited: waited.set_result(None))
            await waited
            node.destroy_timer(timer)
            count += 1
            if 'mute' not in sys.argv:
                goal.publish_feedback(Fibonacci.Feedback(sequence=[count]))
        goal.succeed()
        return Fibonacci.Result(sequence=[count])

    server = ActionServer(
        node, Fibonacci, '/controller/count', execute,
        goal_callback=lambda goal: GoalResponse.ACCEPT if goal.order >= 0 else GoalResponse.REJECT,
        cancel_callback=lambda _: CancelResponse.ACCEPT)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        server.destroy()


if __name__ == '__main__':
    main()
