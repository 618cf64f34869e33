# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A model set on several running nodes: on all of them or on none, and set back again."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from pprs_dynamics.errors import PprsError

PATIENCE = 5.0  # [s] for a running node's answer
ACTIVE = 'effects.active'
RAMP_TIME = 'ramp_time'
# [s] in which efforts of the drives go over to those of another model; a person sees it begin and
# can stop it.
RAMP = 2.0
OTHERS = 'has another model in force, changed by another program since: {}'
ABSENT, SILENT = 'does not run', f'has not answered within {PATIENCE:g} s'

Values = Mapping[str, Any]


class NothingToRestoreError(PprsError):
    """No model was set that could be taken back."""

    def __init__(self) -> None:
        super().__init__('nothing to restore: no model was set on the running nodes from here')


class NodeAnswer(NamedTuple):
    """What nodes said to a transaction.

    Parameters
    ----------
    is_done : bool
        Whether all of them took it; else none has it.
    said : dict of str to str
        By node; '' where it took everything.
    before : dict of str to dict
        What each node had, by parameter: what sets it back.
    """

    is_done: bool
    said: dict[str, str]
    before: dict[str, dict[str, Any]]


def running(clients: Mapping[str, AsyncParameterClient]) -> list[str]:
    """Return the names of the nodes that are there."""
    return [name for name, client in clients.items() if client.services_are_ready()]


def set_on_all(
    clients: Mapping[str, AsyncParameterClient], names: Sequence[str],
    changes: Mapping[str, Values], expected: Values,
) -> NodeAnswer:
    """Set parameters on nodes, one after the other; what was set is set back where one refuses.

    Parameters
    ----------
    clients : mapping
        By node.
    names : sequence of str
        Of nodes, in the order in which they are set: those that drive a machine last, so that
        they are not touched where another one refuses.
    changes : mapping
        By node, of parameters to values.
    expected : mapping
        What the nodes have in force. One that has other values was changed by another program,
        whose step must not be undone unseen.
    """
    said = dict.fromkeys(names, '')
    before: dict[str, dict[str, Any]] = {}
    for name in names:
        had = _values(clients[name], list(changes[name]))
        if had is None:
            said[name] = ABSENT if not clients[name].services_are_ready() else SILENT
        elif different := [key for key in changes[name] if key != RAMP_TIME and key in expected
                           and not _same(had[key], expected[key])]:
            said[name] = OTHERS.format(', '.join(different))
        else:
            before[name] = had
            given = dict(changes[name])
            if had.get(RAMP_TIME) is not None:
                given[RAMP_TIME] = max(RAMP, had[RAMP_TIME])
            else:
                given.pop(RAMP_TIME, None)
            said[name] = _set(clients[name], given)
        if said[name]:
            for other in reversed(before):
                if said[other] in ('', SILENT):  # one that was silent may have taken it
                    undone = _set(clients[other], _restored(before[other]))
                    if other != name:
                        said[other] = ('was set back, as another node refused' if not undone else
                                       f'COULD NOT BE SET BACK: {undone}')
            for other in names:
                if other not in before and not said[other]:
                    said[other] = 'was left as it is, as another node refused'
            return NodeAnswer(False, said, before)
    return NodeAnswer(True, said, before)


class ModelSteps:
    """Models set on running nodes one after the other, and the way back.

    Parameters
    ----------
    clients : mapping
        By node; those that drive a machine last, see `set_on_all`.
    """

    def __init__(self, clients: Mapping[str, AsyncParameterClient]) -> None:
        self.clients = clients
        # What nodes had before each step, and what was set.
        self._steps: list[tuple[Mapping[str, Values], Values]] = []

    def set_model(self, values: Values, in_force: Values, names: Sequence[str]) -> NodeAnswer:
        """Set a model's values on nodes that have another one in force, all or none."""
        changes = {key: value for key, value in values.items()
                   if key != ACTIVE and not key.startswith('history.')
                   and in_force.get(key) != value}
        changes |= {ACTIVE: list(values.get(ACTIVE, ())), RAMP_TIME: RAMP}
        answer = set_on_all(self.clients, names, dict.fromkeys(names, changes),
                            {ACTIVE: (), **in_force})
        if answer.is_done:
            self._steps.append((answer.before, changes))
        return answer

    def restore(self, names: Sequence[str]) -> NodeAnswer:
        """Set nodes back to what they had before the last model.

        Raises
        ------
        NothingToRestoreError
        """
        if not self._steps:
            raise NothingToRestoreError
        had, was_set = self._steps[-1]
        before = {name: values for name, values in had.items() if name in names}
        answer = set_on_all(self.clients, list(before), {
            name: {**_restored(values), RAMP_TIME: RAMP} for name, values in before.items()},
            was_set)
        if answer.is_done:
            self._steps.pop()
        return answer

    @property
    def can_restore(self) -> bool:
        """Whether a model was set that can be taken back."""
        return bool(self._steps)


def _restored(values: Values) -> dict[str, Any]:
    # What was not there stays, without effect: the list of effects in force is set back.
    return {name: value for name, value in values.items()
            if value is not None and name != RAMP_TIME}


def _same(value: Any, expected: Any) -> bool:
    """Return whether a parameter has a value, an empty list being none."""
    if isinstance(expected, (list, tuple)) or value is None:
        return list(value or ()) == list(expected or ())
    return bool(value == expected)


def _values(client: AsyncParameterClient, names: list[str]) -> dict[str, Any] | None:
    """Return a node's parameters, None for those that it has not; None where it does not answer."""
    answer: GetParameters.Response | None = _answered(client, 'get_parameters', names)
    if answer is None:
        return None
    if len(answer.values) != len(names):  # one that is undeclared may empty the whole answer
        return {name: _one(client, name) for name in names}
    return {name: Parameter.from_parameter_msg(_message(name, value)).value
            for name, value in zip(names, answer.values, strict=True)}


def _one(client: AsyncParameterClient, name: str) -> Any:
    answer = _answered(client, 'get_parameters', [name])
    if answer is None or not answer.values:
        return None
    return Parameter.from_parameter_msg(_message(name, answer.values[0])).value


def _message(name: str, value: Any) -> Any:
    from rcl_interfaces.msg import Parameter as ParameterMessage

    return ParameterMessage(name=name, value=value)


def _set(client: AsyncParameterClient, values: Values) -> str:
    """Set parameters of one node at once, never half an effect; return why not, or ''."""
    answer: SetParametersAtomically.Response | None = _answered(
        client, 'set_parameters_atomically', [
            Parameter(name, Parameter.Type.STRING_ARRAY, list(value)) if name == ACTIVE
            else Parameter(name, value=value) for name, value in values.items()])
    if answer is None:
        return SILENT if client.services_are_ready() else ABSENT
    return '' if answer.result.successful else str(answer.result.reason)


def _answered(client: AsyncParameterClient, call: str, argument: Any) -> Any:
    """Return what a node answers to a call, None where it does not."""
    if not client.services_are_ready():
        return None
    done = threading.Event()
    future = getattr(client, call)(argument)
    future.add_done_callback(lambda _: done.set())
    return future.result() if done.wait(PATIENCE) else None
