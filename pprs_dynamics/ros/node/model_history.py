# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Changes of the model of a running node, and the service `~/restore` that undoes the last one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

MOST_CHANGES = 100  # that are remembered


class ModelHistory:
    """Parameters of a node as they were before each change of its model.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._node, self._is_restoring = node, False
        self._before: list[list[Parameter]] = []
        node.create_service(Trigger, '~/restore', self._restore)

    def __len__(self) -> int:
        return len(self._before)

    def note(self, before: Mapping[str, Any], changed: Iterable[Parameter]) -> None:
        """Remember the values that the changed parameters had.

        A parameter that was new has no value to return to. It has no effect either, once the list
        of effects is as it was.
        """
        if not self._is_restoring:
            self._before = [*self._before, [
                Parameter(each.name, value=before[each.name])
                for each in changed if each.name in before]][-MOST_CHANGES:]

    def _restore(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._before:
            response.message = 'nothing to restore: the model was not changed since the start'
            return response
        self._is_restoring = True
        try:
            result = self._node.set_parameters_atomically(self._before[-1])
        finally:
            self._is_restoring = False
        if result.successful:
            self._before.pop()
        response.success = result.successful
        response.message = result.reason or 'the model is as it was before the last change'
        self._node.get_logger().warning(f'restore: {response.message}')
        return response
