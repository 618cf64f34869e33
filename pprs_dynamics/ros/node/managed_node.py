# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Managed nodes: their states, the topics that come and go with them, and how they start."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile

from pprs_dynamics.ros.messages.status_codes import Code
from pprs_dynamics.ros.node.parameters import node_parameter
from pprs_dynamics.ros.node.qos import EVERY_MESSAGE, publisher
from pprs_dynamics.ros.node.rclpy_internals import destroy_state_machine
from pprs_dynamics.ros.node.status import StatusReporter

CHANGE_STATE = '/change_state'
AUTOSTART = node_parameter('autostart', True, 'true: active at once; false: a supervisor '
                           'configures and activates the node', stays=True)


class ManagedNode(LifecycleNode):
    """A managed node that knows its state and refuses impossible transitions.

    A node calls `begin` at the end of its making, when `_status` is there.

    Attributes
    ----------
    state : str
        Label of the state that the last transition led to, which rclpy shows in no public way.
    """

    _status: StatusReporter

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.state = 'unconfigured'
        self._failure: Exception | None = None
        self._made: list[tuple[Callable[[Any], object], Any]] = []
        for service in self.services:
            if service.srv_name.endswith(CHANGE_STATE):
                service.callback = self._refusing(service.callback)

    @abstractmethod
    def _create_topics(self) -> None:
        """Create what there is between configuration and cleanup."""

    def destroy_topics(self) -> None:
        """Destroy all that `_create_topics` has made."""
        for destroy, entity in self._made:
            destroy(entity)
        self._made = []

    def _publisher(self, kind: type, topic: str, profile: QoSProfile = EVERY_MESSAGE) -> Any:
        """Create a publisher that lasts until cleanup."""
        return self._until_cleanup(self.destroy_publisher, publisher(self, kind, topic, profile))

    def _until_cleanup(self, destroy: Callable[[Any], object], entity: Any) -> Any:
        """Return an entity that is destroyed at cleanup."""
        self._made.append((destroy, entity))
        return entity

    def finish(self) -> None:
        """Do what must be done before the node stops answering, or its process ends."""

    def begin(self, autostart: bool) -> None:
        """Wait for a supervisor, or go through its transitions.

        Raises
        ------
        Exception
            What a transition failed of.
        """
        self._enter('unconfigured', 'UNCONFIGURED', 'waiting to be configured')
        for trigger in (self.trigger_configure, self.trigger_activate) if autostart else ():
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise self._failure or RuntimeError(f'{trigger.__name__} failed')

    def _enter(self, state: str, code: Code, message: str) -> None:
        self.state = state
        self._status.report('OK', code, message)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create topics; messages that arrive from now on are dropped until activation."""
        try:
            self._create_topics()
        except Exception as error:
            # rclpy would swallow it; a supervisor gets the transition's failure and this line.
            self._failure = error
            self.get_logger().error(f'cannot be configured: {error}')
            self.destroy_topics()
            return TransitionCallbackReturn.FAILURE
        self._enter('inactive', 'INACTIVE', 'waiting to be activated')
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer messages from now on."""
        self._enter('active', 'WAITING', 'waiting for the first message')
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer nothing any more."""
        self.finish()
        self._enter('inactive', 'INACTIVE', 'waiting to be activated')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take the topics away."""
        self.destroy_topics()
        self._enter('unconfigured', 'UNCONFIGURED', 'waiting to be configured')
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End for good; the process goes on telling so until it is stopped."""
        self.finish()
        self.destroy_topics()
        self._enter('finalized', 'FINALIZED', 'shut down')
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Go where rclpy goes after a transition that failed."""
        outcome = super().on_error(state)
        self.state = ('unconfigured' if outcome == TransitionCallbackReturn.SUCCESS
                      else 'finalized')
        return outcome

    def destroy_node(self) -> None:
        """Leave the graph."""
        super().destroy_node()
        destroy_state_machine(self)

    def _refusing(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return a service's callback that answers no instead of raising.

        Jazzy's rclpy raises at a transition that the present state does not have: a supervisor's
        mistake would end the node.
        """
        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except RuntimeError as error:
                self.get_logger().warning(f'no transition: {" ".join(str(error).split())}')
                response.success = False
                return response

        return answer
