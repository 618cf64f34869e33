# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Warnings that may come with every message, each kind once in a while.

rclpy throttles too, but looks up its caller first: 0.2 ms for what is not said, more than an
answer takes. A stream that is refused since the machine is busy would keep it busy.
"""

from __future__ import annotations

import time

from rclpy.node import Node


class ThrottledLog:
    """Log of a node.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._due: dict[str, float] = {}

    def warning(self, kind: str, text: str, period: float = 1.0) -> None:
        """Warn, where the last warning of a kind is longer ago than a period [s]."""
        now = time.monotonic()
        if now >= self._due.get(kind, now):
            self._due[kind] = now + period
            self._node.get_logger().warning(text)
