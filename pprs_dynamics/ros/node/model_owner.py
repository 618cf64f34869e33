# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The node that drives a machine owns the model in force; other nodes set and follow it here."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import String

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.incoming_bytes import only_whole
from pprs_dynamics.ros.node.parameters import HISTORY
from pprs_dynamics.ros.node.qos import LATCHED, subscription

EFFECTS = 'effects.'

Values = Mapping[str, Any]


class NotSetError(PprsError):
    """A model that is not set on the node that drives, with the reason."""

    def __init__(self, reason: str) -> None:
        super().__init__(f'nothing was set: {reason}')


class OwnerStatus(NamedTuple):
    """Status of the node that drives.

    Parameters
    ----------
    robot : str
    files : tuple of str
        Names of its parameter files.
    fingerprint : str
        SHA-256 of its model; '' before the first status.
    changes : int
        That `restore` can undo.
    """

    robot: str = ''
    files: tuple[str, ...] = ()
    fingerprint: str = ''
    changes: int = 0

    @classmethod
    def of(cls, text: str) -> OwnerStatus:
        """Return the status in a JSON text.

        Raises
        ------
        ValueError, TypeError, LookupError, OverflowError
            Where it is no status of a node that drives: the topic belongs to nobody.
        """
        content = json.loads(text)
        model = content['model']
        return cls(str(content['robot']), tuple(Path(file['file']).name for file in model['files']),
                   str(model['sha256']), int(content['changes']))


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
        self.status = OwnerStatus()
        self._client = AsyncParameterClient(node, name)
        subscription(node, String, f'{name}/status', only_whole(String, self._on_status),
                     profile=LATCHED)

    @property
    def is_there(self) -> bool:
        """Whether the node runs."""
        return self._client.services_are_ready()

    def difference(self) -> str:
        """Return that the owner has another model in force, or '' where it has not, or is gone."""
        here, there = self._model().fingerprint, self.status.fingerprint
        if there in ('', here) or not self._node.count_publishers(
                f'{self.name}/status'):
            return ''
        return (f'{self.name} has another model in force than {self._node.get_name()} '
                f'(sha256 {there[:12]}, not {here[:12]})')

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

    def _on_status(self, message: String) -> None:
        before = self.status.fingerprint
        with suppress(ValueError, TypeError, LookupError, OverflowError):
            self.status = OwnerStatus.of(message.data)
        if before == self._model().fingerprint != self.status.fingerprint:
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
