# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A managed node that knows its state and refuses impossible transitions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from pprs_dynamics.ros.node.rclpy_internals import destroy_state_machine

CHANGE_STATE = '/change_state'


class ManagedNode(LifecycleNode):
    """A managed node.

    Attributes
    ----------
    state : str
        Label of the state that the last transition led to, which rclpy shows in no public way;
        to be set in every transition.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.state = 'unconfigured'
        for service in self.services:
            if service.srv_name.endswith(CHANGE_STATE):
                service.callback = self._refusing(service.callback)

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
