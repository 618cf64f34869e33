# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Publishers of a topic by its messages: whether several alternate, and which were passed over.

Two programs that send setpoints alternate in the drives, as do two nodes of one name; discovery
alone would also list publishers that were killed, for as long as their lease.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

# Publishers that change places twice within that time [s] both send; one that follows another,
# as a path that is started again does, changes places once.
TURNS = 1.0
MOST = 32  # publishers that are remembered
PASSED_OVER = 'superseded'
GONE = '_NODE_NAME_UNKNOWN_'  # of a node that was destroyed, but not its publishers


class Senders:
    """Publishers of one topic, by the messages that come.

    Parameters
    ----------
    clock : callable, optional
        Returns a time that only goes on [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._sequence: dict[bytes, int] = {}
        self._latest = b''
        self._changes = (-TURNS, -2 * TURNS)  # the last two, the later one first

    def passed_over(self, info: Mapping[str, Any]) -> int:
        """Take note of a message, and return how many before it were replaced by later ones.

        Parameters
        ----------
        info : mapping
            Of the middleware; without publisher or number nothing is known.
        """
        publisher = (info.get('publisher_gid') or {}).get('data', b'')
        if publisher != self._latest:
            if self._latest:
                self._changes = (self._clock(), self._changes[0])
            self._latest = publisher
        number = info.get('publication_sequence_number')
        if not publisher or not number:
            return 0
        if len(self._sequence) >= MOST and publisher not in self._sequence:
            self._sequence.clear()
        before = self._sequence.get(publisher, number - 1)
        self._sequence[publisher] = number
        return max(0, number - before - 1)

    @property
    def take_turns(self) -> bool:
        """Whether messages of several publishers came in turn within the last second."""
        return self._clock() - self._changes[1] < TURNS


def publishers_of(node: Node, topic: str, others: bool = False) -> str:
    """Return the nodes that publish on a topic, or the other ones, as discovery knows them."""
    this = node.get_fully_qualified_name() if others else ''
    return ', '.join(sorted({
        f'{found.node_namespace.rstrip("/")}/{found.node_name}'
        for found in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if found.node_name != GONE} - {this}))


def namesakes(node: Node) -> int:
    """Return the number of other nodes with this node's name, by discovery."""
    this = (node.get_name(), node.get_namespace())
    return max(0, sum(found == this for found in node.get_node_names_and_namespaces()) - 1)
