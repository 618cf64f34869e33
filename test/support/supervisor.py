# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Who leads a managed node through its states."""

from __future__ import annotations

from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from node_bench import Bench


class Supervisor:
    """Calls the lifecycle services over DDS."""

    def __init__(self, running: Bench, node: str) -> None:
        self.bench = running
        self._change = running.probe.create_client(ChangeState, f'/{node}/change_state')
        self._get = running.probe.create_client(GetState, f'/{node}/get_state')

    def call(self, client: Any, request: Any) -> Any:
        """Call a service and return its response."""
        assert self.bench.spin_until(client.service_is_ready)
        future = client.call_async(request)
        assert self.bench.spin_until(future.done)
        return future.result()

    def change(self, transition: int) -> bool:
        """Return whether a transition was made."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(self.call(self._change, request).success)

    def state(self) -> str:
        """Return the state's label."""
        return str(self.call(self._get, GetState.Request()).current_state.label)
