# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Services by which a person adopts what a diagnosis claims on running nodes, and takes it back.

`std_srvs` comes with a ROS 2 installation and as a wheel; without it there are no services.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import String

from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.model_transaction import ModelSteps, NodeAnswer, running
from pprs_dynamics.ros.node.qos import LATCHED, subscription

try:
    from std_srvs.srv import Trigger
except ImportError:
    Trigger = None

Values = Mapping[str, Any]


class NotAdoptedError(PprsError):
    """Nothing is set on running nodes, and why.

    Parameters
    ----------
    reason : str
    """

    def __init__(self, reason: str) -> None:
        super().__init__(f'nothing was set: {reason}')


class ModelServices:
    """`~/adopt_confirmed` and `~/restore` of a node: on it and on another, all or none.

    Parameters
    ----------
    node : Node
        With parameters of a model.
    other : str
        The node that drives the machine, absolute or in the namespace of this one.
    model : callable
        Returns fingerprint and values of the model in force on `node`.
    adoptable : callable
        Returns the values that are to be set, or raises PprsError.
    adopted : callable
        Called when a model was set or set back.
    """

    def __init__(self, node: Node, other: str, model: Callable[[], tuple[str, Values]],
                 adoptable: Callable[[], Values], adopted: Callable[[], None]) -> None:
        self._node, self._other = node, other
        self._model, self._adoptable, self._adopted = model, adoptable, adopted
        self._in_force = ''  # fingerprint of the other node's model
        self._is_busy = False
        self._steps: ModelSteps | None = None
        subscription(node, String, f'{other}/status', self._on_status, profile=LATCHED)
        if Trigger is None:
            return
        # The one that drives a machine is set last: it is not touched where this one refuses.
        clients = {name: AsyncParameterClient(node, name)
                   for name in (node.get_fully_qualified_name(), other)}
        self._steps = ModelSteps(clients)
        # In a group of their own: while they wait, this node's parameters are set.
        group = ReentrantCallbackGroup()
        for name, work in (('~/adopt_confirmed', self._adopt), ('~/restore', self._restore)):
            node.create_service(Trigger, name, self._answering(work), callback_group=group)

    def difference(self) -> str:
        """Return that the other node has another model in force; '' where it has not, or is gone.

        What is being set is on one of them first.
        """
        found = '' if self._is_busy or not self._in_force else self._different()
        # Asked only then: it is looked at with every sample that is compared.
        return found if found and self._node.count_publishers(f'{self._other}/status') else ''

    def _different(self) -> str:
        here = self._model()[0]
        return '' if self._in_force == here else (
            f'{self._other} has another model in force than {self._node.get_name()} '
            f'(sha256 {self._in_force[:12] or "unknown"}, not {here[:12]})')

    def _on_status(self, message: String) -> None:
        with suppress(ValueError, AttributeError):
            self._in_force = json.loads(message.data).get('model', {}).get('sha256', '')

    def _answering(self, work: Callable[[ModelSteps, Sequence[str]], NodeAnswer],
                   ) -> Callable[[Any, Any], Any]:
        """Return a service's callback; nodes answer while it waits in a thread of its own."""
        async def answer(request: Any, response: Any) -> Any:
            try:
                done = await self._begun(work)
            except PprsError as error:
                response.success, response.message = False, str(error)
                return response
            response.success = done.is_done
            response.message = '; '.join(f'{name}: {said or "set"}'
                                         for name, said in done.said.items())
            self._node.get_logger().warning(f'model: {response.message}')
            if done.is_done:
                self._adopted()
            return response

        return answer

    def _begun(self, work: Callable[[ModelSteps, Sequence[str]], NodeAnswer]) -> Future[NodeAnswer]:
        if self._is_busy or self._steps is None:
            raise NotAdoptedError('another model is being set')
        steps, names = self._steps, running(self._steps.clients)
        self._is_busy, future = True, Future[NodeAnswer](executor=self._node.executor)

        def run() -> None:
            try:
                future.set_result(work(steps, names))
            except Exception as error:  # raised where the service waits
                future.set_exception(error)
            finally:
                self._is_busy = False

        threading.Thread(target=run, daemon=True).start()
        return future

    def _adopt(self, steps: ModelSteps, names: Sequence[str]) -> NodeAnswer:
        values = self._adoptable()
        if self._other in names and (different := self._different()):
            raise NotAdoptedError(different)
        return steps.set_model(values, self._model()[1], names)

    def _restore(self, steps: ModelSteps, names: Sequence[str]) -> NodeAnswer:
        return steps.restore(names)
