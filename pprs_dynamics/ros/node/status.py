# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Status of a node: JSON on `~/status`, `/diagnostics` where that package is, and the log."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import String

from pprs_dynamics.ros.messages.status_codes import LEVELS, Code, Level
from pprs_dynamics.ros.node.clocks import MISSING_CLOCK, clock_is_missing, steady_timer
from pprs_dynamics.ros.node.qos import LATCHED, publisher
from pprs_dynamics.ros.node.senders import namesakes, publishers_of

try:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
except ImportError:
    DiagnosticArray = None

WINDOW = 1000  # durations that are summed up
LOG_PERIOD = 1.0  # [s] between lines of one code
# On /diagnostics STALE is the word of an aggregator that hears nothing: a stream that broke off is
# an error that the node tells.
TOLD_AS = {'STALE': 'ERROR'}


class StatusReporter:
    """Publishes level, code, message and counters on change and at 1 Hz.

    Errors go to the log as well, each code once a second, and warnings when they begin. rclpy's own
    throttling looks up its caller first, which takes longer than an answer to a message.

    Parameters
    ----------
    node : Node
    facts : dict
        Constant entries of the JSON, e.g. the model's file.
    counters : dict of int
        Shared with the node, which counts up in place.
    hardware : str
        Name of the robot on `/diagnostics`.
    refresh : callable, optional
        Called once a second before the status goes out, to bring `facts` up to date.
    commanded : sequence of str, optional
        Topics on which no other node may publish.
    """

    def __init__(
        self, node: Node, facts: dict[str, Any], counters: dict[str, int],
        hardware: str, refresh: Callable[[], None] | None = None, commanded: Sequence[str] = (),
    ) -> None:
        self._node, self._counters, self._commanded = node, counters, commanded
        self.facts = {'robot': hardware, **facts}
        self._hardware, self._refresh = hardware, refresh
        self._publisher = publisher(node, String, '~/status', LATCHED)
        self._diagnostics = None
        if DiagnosticArray is not None:
            self._diagnostics = publisher(node, DiagnosticArray, '/diagnostics')
        self._current: tuple[Level, Code, str] = ('OK', 'OK', 'waiting for the first message')
        self._log_due: dict[Code, float] = {}
        steady_timer(node, 1.0, self._tick)
        self._publish()

    @property
    def code(self) -> str:
        """Code of the present condition."""
        return self._current[1]

    def report(self, level: Level, code: Code, message: str) -> None:
        """Take over a new condition; it goes out at once where the code changed."""
        changed = (level, code) != self._current[:2]
        self._current = (level, code, message)
        if level == 'ERROR' or (changed and level != 'OK'):
            now = time.monotonic()
            if now >= self._log_due.get(code, now):
                self._log_due[code] = now + LOG_PERIOD
                self._node.get_logger().warning(f'{code}: {message}')
        if changed:
            self._publish()

    def _tick(self) -> None:
        if self._refresh is not None:
            self._refresh()
        self._publish()

    def _publish(self) -> None:
        level, code, message = self._current
        if level == 'OK' and clock_is_missing(self._node):
            level, code, message = 'WARN', 'CLOCK', MISSING_CLOCK
        elif level == 'OK' and (others := namesakes(self._node)):
            level, code, message = 'WARN', 'CONFLICT', (
                f'{others + 1} nodes are called {self._node.get_fully_qualified_name()}, and each '
                'answers on the same topics; one that was killed is among them for 20 s')
        elif level == 'OK':
            for topic in self._commanded:
                if rivals := publishers_of(self._node, topic, others=True):
                    level, code, message = 'WARN', 'CONFLICT', (
                        f'{rivals} publishes on {self._node.resolve_topic_name(topic)} as well: '
                        'the drives follow both in turn')
        content = {'level': level, 'code': code, 'message': message,
                   'counters': self._counters, **self.facts}
        self._publisher.publish(String(data=json.dumps(content)))
        if self._diagnostics is not None:
            status = DiagnosticStatus(
                level=bytes([LEVELS.index(TOLD_AS.get(level, level))]),
                name=self._node.get_fully_qualified_name(),
                message=f'{code}: {message}', hardware_id=self._hardware,
                values=[KeyValue(key=key, value=str(value))
                        for key, value in {**self._counters, **self.facts}.items()
                        if isinstance(value, (int, float, str))])
            array = DiagnosticArray(status=[status])
            array.header.stamp = self._node.get_clock().now().to_msg()
            self._diagnostics.publish(array)


class Durations(deque[float]):
    """The last thousand durations [s]."""

    def __init__(self) -> None:
        super().__init__(maxlen=WINDOW)

    def summary(self) -> dict[str, float | None]:
        """Return p50, p99 and max [s], None where there was no duration."""
        found = np.percentile(self, (50, 99, 100)).tolist() if self else (None,) * 3
        return dict(zip(('p50', 'p99', 'max'), found, strict=True))
