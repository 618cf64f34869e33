# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The node that drives a machine owns the model in force; other nodes set and follow it here."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import String

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.node.parameters import HISTORY
from pprs_dynamics.ros.node.qos import LATCHED, subscription

EFFECTS = 'effects.'

Values = Mapping[str, Any]


class NotSetError(PprsError):
    """A model that is not set on the node that drives, with the reason."""

    def __init__(self, reason: str) -> None:
        super().__init__(f'nothing was set: {reason}')


class ModelOwner:
    """The node that drives, as another node sees it: its status, its parameters, its history.

    Parameters
    ----------
    node : Node
        Whose executor serves this.
    name : str
        Of the node that drives, absolute or in the namespace of `node`.
    model : callable
        Returns the model in force on `node`.
    follow : callable
        Called with parameters when the owner's model has changed, where both had the same one.
    """

    def __init__(self, node: Node, name: str, model: Callable[[], DriveModel],
                 follow: Callable[[list[Parameter]], None]) -> None:
        self.name, self._node, self._model, self._follow = name, node, model, follow
        self.status: dict[str, Any] = {}
        self._client = AsyncParameterClient(node, name)
        # Raw: bytes that are no message would end the executor.
        subscription(node, String, f'{name}/status', self._on_status, raw=True, profile=LATCHED)

    @property
    def is_there(self) -> bool:
        """Whether the node runs."""
        return self._client.services_are_ready()

    @property
    def steps(self) -> int:
        """Number of changes that `restore` can undo."""
        return int(self.status.get('changes', 0))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the model in force; '' before the first status."""
        return str(self.status.get('model', {}).get('sha256', ''))

    def difference(self) -> str:
        """Return that the owner has another model in force, or '' where it has not, or is gone."""
        here = self._model().fingerprint
        if self.fingerprint in ('', here) or not self._node.count_publishers(
                f'{self.name}/status'):
            return ''
        return (f'{self.name} has another model in force than {self._node.get_name()} '
                f'(sha256 {self.fingerprint[:12]}, not {here[:12]})')

    def set_model(self, values: Values) -> Future[Any]:
        """Set a model's values on the owner, all or none; return the future of its answer.

        Raises
        ------
        NotSetError
            Where the owner does not run, or has another model in force.
        """
        if not self.is_there:
            raise NotSetError(f'{self.name} does not run')
        if different := self.difference():
            raise NotSetError(different)
        return self._client.set_parameters_atomically(changes(self._model(), values))

    def _on_status(self, data: bytes) -> None:
        with suppress(Rejection, ValueError):
            found = json.loads(message_in(data, String).data, parse_constant=lambda _: None)
            if not isinstance(found, dict):
                return
            before, self.status = self.fingerprint, found
            here = self._model().fingerprint
            if before == here != self.fingerprint:
                self._client.list_parameters().add_done_callback(self._on_names)

    def _on_names(self, future: Future[Any]) -> None:
        known = self._model().values
        names = [name for name in future.result().result.names
                 if name in known or name.startswith(EFFECTS)]
        self._client.get_parameters(names).add_done_callback(
            lambda answer: self._follow([
                Parameter.from_parameter_msg(ParameterMessage(name=name, value=value))
                for name, value in zip(names, answer.result().values, strict=False)]))


def changes(model: DriveModel, values: Values) -> list[Parameter]:
    """Return the parameters that make a model another one, without its ledger."""
    return [Parameter(key, value=value) for key, value in values.items()
            if not key.startswith(HISTORY) and model.values.get(key) != value]
