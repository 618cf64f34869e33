# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Status of a node: JSON on `~/status`, `/diagnostics` where that package is, and the log."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rclpy.node import Node
from std_msgs.msg import String

from pprs_dynamics.ros.messages.status_codes import LEVELS, Code, Level
from pprs_dynamics.ros.node.clocks import MISSING_CLOCK, clock_is_missing, steady_timer
from pprs_dynamics.ros.node.provenance import Provenance
from pprs_dynamics.ros.node.qos import LATCHED, publisher
from pprs_dynamics.ros.node.senders import namesakes, publishers_of
from pprs_dynamics.system.json_records import JsonRecord

try:
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
except ImportError:
    DiagnosticArray = None

WINDOW = 1000  # durations that are summed up
LOG_PERIOD = 1.0  # [s] between lines of one code
# On /diagnostics STALE is the word of an aggregator that hears nothing: a stream that broke off is
# an error that the node reports.
REPORTED_AS = {'STALE': 'ERROR'}


@dataclass
class DurationSummary:
    """Quantiles of the last thousand durations [s]; null where there was none."""

    p50: float | None = None
    p99: float | None = None
    max: float | None = None


@dataclass
class NodeStatus(JsonRecord):
    """`~/status` of the nodes (std_msgs/String, transient local): on change, and at 1 Hz.

    Parameters
    ----------
    level : Level
        How severe the condition is.
    code : Code
        What the condition is.
    message : str
        The condition in a sentence.
    counters : dict of str to int
        Counts since the start; rejections by their code.
    robot : str
        Which robot the node's model describes.
    model : Provenance
        Files of the model in force, and its hash.
    changes : int
        Changes of the model that `~/restore` can undo.
    state : str
        State of the managed node.
    preparing : bool
        The equations are being compiled: answers take longer.
    assumed : dict of str to str
        What a start takes for granted, by effect with a memory.
    rate : float
        Accepted messages per second [Hz].
    compute_time, lag : DurationSummary
        From reading a message to its answer, and from its stamp to reading it [s].
    lagging : bool
        Messages come faster than they are answered.
    compared_share : float
        Share of the measured samples of the last second that are compared with the model.
    singularity_margin, workspace_margin : float
        Share of the way to the limit of conditioning that remains, and of half the range of the
        nearest drive.
    error : list of float or None
        Running error of each drive [N, N m].
    action : str
        Where goals are sent to.
    """

    json_optional = ('robot', 'model', 'changes', 'state', 'preparing', 'assumed', 'rate',
                     'compute_time', 'lag', 'lagging', 'compared_share', 'singularity_margin',
                     'workspace_margin', 'error', 'action')

    level: Level
    code: Code
    message: str
    counters: dict[str, int]
    robot: str = ''
    model: Provenance | None = None
    changes: int | None = None
    state: str = ''
    preparing: bool | None = None
    assumed: Mapping[str, str] | None = None
    rate: float | None = None
    compute_time: DurationSummary | None = None
    lag: DurationSummary | None = None
    lagging: bool | None = None
    compared_share: float | None = None
    singularity_margin: float | None = None
    workspace_margin: float | None = None
    error: list[float | None] | None = None
    action: str = ''


class StatusReporter:
    """Publishes level, code, message and counters on change and at 1 Hz.

    Errors go to the log as well, each code once a second, and warnings when they begin. rclpy's own
    throttling looks up its caller first, which takes longer than an answer to a message.

    Parameters
    ----------
    node : Node
    counters : dict of int
        Shared with the node, which counts up in place.
    hardware : str
        Name of the robot on `/diagnostics`.
    refresh : callable, optional
        Called once a second before the status goes out, to bring `content` up to date.
    commanded : sequence of str, optional
        Topics on which no other node may publish.
    """

    def __init__(
        self, node: Node, counters: dict[str, int], hardware: str,
        refresh: Callable[[], None] | None = None, commanded: Sequence[str] = (),
    ) -> None:
        self._node, self._commanded, self._refresh = node, commanded, refresh
        self.content = NodeStatus('OK', 'OK', 'waiting for the first message', counters, hardware)
        self._publisher = publisher(node, String, '~/status', LATCHED)
        self._diagnostics = None
        if DiagnosticArray is not None:
            self._diagnostics = publisher(node, DiagnosticArray, '/diagnostics')
        self._log_due: dict[Code, float] = {}
        steady_timer(node, 1.0, self._tick)
        self._publish()

    def report(self, level: Level, code: Code, message: str) -> None:
        """Take over a new condition; it goes out at once where the code changed."""
        content = self.content
        changed = (level, code) != (content.level, content.code)
        content.level, content.code, content.message = level, code, message
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
        level, code, message = self.content.level, self.content.code, self.content.message
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
        content = replace(self.content, level=level, code=code, message=message).to_dict()
        self._publisher.publish(String(data=json.dumps(content)))
        if self._diagnostics is not None:
            status = DiagnosticStatus(
                level=bytes([LEVELS.index(REPORTED_AS.get(level, level))]),
                name=self._node.get_fully_qualified_name(),
                message=f'{code}: {message}', hardware_id=self.content.robot,
                values=[KeyValue(key=key, value=str(value))
                        for key, value in {**content, **self.content.counters}.items()
                        if isinstance(value, (int, float, str))])
            array = DiagnosticArray(status=[status])
            array.header.stamp = self._node.get_clock().now().to_msg()
            self._diagnostics.publish(array)


class Durations(deque[float]):
    """The last thousand durations [s]."""

    def __init__(self) -> None:
        super().__init__(maxlen=WINDOW)

    def summary(self) -> DurationSummary:
        """Return p50, p99 and max [s], None where there was no duration."""
        return DurationSummary(*np.percentile(self, (50, 99, 100)).tolist() if self else ())
