# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A node's model, kept in step with its parameters: what is not valid is never in force."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from pprs_dynamics.errors import ModelError, PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import DRIVES_KEY, NODE_KEYS, NODE_PREFIXES
from pprs_dynamics.ros.node.parameters import (
    NodeParameter,
    current_values,
    declare_model,
    declare_node_parameters,
    has_model,
    node_parameter,
    overrides,
    with_hint,
)
from pprs_dynamics.ros.node.provenance import Provenance, files_given

MOST_CHANGES = 100  # that are remembered
Checked = TypeVar('Checked')
DEMO = node_parameter('demo', False, 'true: without a model file this is the paper\'s robot, for '
                      'demonstrations', stays=True)
OF_OTHERS = NODE_KEYS - {'use_sim_time', 'start_type_description_service'}  # those are ROS 2's


class NoModelError(PprsError):
    """A node that speaks to a machine was given no model of it.

    Parameters
    ----------
    node : str
    """

    def __init__(self, node: str) -> None:
        super().__init__(
            f'{node} was given no model: --ros-args --params-file FILE names that of the robot '
            'which is connected; -p demo:=true takes the paper\'s robot, for demonstrations')


def watch_parameters(node: Node, validate: Callable[[list[Parameter]], Checked],
                     apply: Callable[[Checked, list[Parameter]], None]) -> Checked:
    """Check changes of a running node's parameters, bring them into force, and return the first.

    Parameters
    ----------
    node : Node
    validate : callable
        Returns what the parameters mean with some of them changed, or raises PprsError.
    apply : callable
        Called with what was checked, and nothing else, once the parameters have changed.
    """
    checked = [validate([])]

    def check(changes: list[Parameter]) -> SetParametersResult:
        if not are_of_topics(changes):
            try:
                checked[0] = validate(changes)
            except PprsError as error:
                return SetParametersResult(successful=False, reason=with_hint(error))
        return SetParametersResult(successful=True)

    def changed(changes: list[Parameter]) -> None:
        if not are_of_topics(changes):
            apply(checked[0], changes)

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(changed)
    return checked[0]


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
                Parameter(parameter.name, value=before[parameter.name])
                for parameter in changed if parameter.name in before]][-MOST_CHANGES:]

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


class ModelParameters:
    """Declares a node's own parameters and those of a model, and follows their changes.

    Parameters
    ----------
    node : Node
    arguments : sequence of str
        Its command line.
    parameters : iterable of NodeParameter
        The node's own, which are declared before the model's.
    changed : callable
        Called after every change that was accepted.
    drives : bool
        Whether the node drives a machine, so that it owns the history of the model.

    Attributes
    ----------
    model : DriveModel
        In force now; of one kind, and of the same drives, as long as the node runs.
    node_values : dict
        Values of the node's own parameters.
    history : ModelHistory or None

    Raises
    ------
    ModelError, EffectError
        Where the parameters at start are no model, or an effect of another package cannot begin.
    NoModelError
        Where there is none at all, and this is no demonstration.
    """

    def __init__(
        self, node: Node, arguments: Sequence[str], parameters: Iterable[NodeParameter],
        changed: Callable[[], None], drives: bool = False,
    ) -> None:
        self._changed, self.history = changed, ModelHistory(node) if drives else None
        parameters = (*parameters, DEMO)
        declare_node_parameters(node, parameters)
        given = overrides(node)
        declare_model(node, arguments)
        self._stays: dict[str, Any] = {}
        self._files = files_given(arguments)
        self._node, self._declared = node, parameters
        self.model, self.node_values = watch_parameters(node, self._validated, self._apply)
        # Whatever is connected would be driven by the forces of another robot.
        if not self.node_values[DEMO.name] and not has_model(given):
            raise NoModelError(node.get_name())
        self._stays = self._staying(self.model, self.node_values)
        if not has_model(given):  # another robot would get wrong forces
            node.get_logger().warning('demo: the model is that of the paper\'s robot')

    @property
    def provenance(self) -> Provenance:
        """Files and hash of the model."""
        return Provenance(self._files, self.model.fingerprint)

    def _validated(self, changes: Iterable[Parameter]) -> tuple[DriveModel, dict[str, Any]]:
        self._refuse_foreign(changes)
        values = current_values(self._node, changes)
        node_values = {parameter.name: parameter.check(values.pop(parameter.name, None))
                       for parameter in self._declared}
        model = DriveModel.from_parameters(values)
        now = self._staying(model, node_values)
        for name, before in self._stays.items():
            if now[name] != before:
                raise ModelError(name, now[name], 'stay as it was when the node started: '
                                 f'{"empty" if before == "" else before}')
        model.initial_state()  # an effect that cannot even begin is refused
        return model, node_values

    def _staying(self, model: DriveModel, node_values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values that stay as long as the node runs, as its topics depend on them."""
        names = {DRIVES_KEY: model.drives, 'joint_prefix and joint_map': model.recorded.joints}
        return {**{name: ', '.join(value) for name, value in names.items()},
                **{own.name: node_values[own.name] for own in self._declared if own.stays}}

    def _refuse_foreign(self, changes: Iterable[Parameter]) -> None:
        """Refuse new values for other nodes, which a model file may hold: nothing would come of it.

        Raises
        ------
        ModelError
        """
        names, before = {parameter.name for parameter in self._declared}, current_values(self._node)
        for change in changes:
            value = current_values(self._node, [change]).get(change.name)
            if change.name in OF_OTHERS - names and before.get(change.name) != value:
                raise ModelError(change.name, value, 'be set on the node that has it: '
                                 f'{self._node.get_name()} has no such parameter')

    def _apply(self, checked: tuple[DriveModel, dict[str, Any]],
               changes: Iterable[Parameter]) -> None:
        before, (self.model, self.node_values) = self.model, checked
        if self.history is not None and self.model.fingerprint != before.fingerprint:
            self.history.note(before.values, changes)
        self._changed()


def are_of_topics(changes: list[Parameter]) -> bool:
    """Return whether these are the QoS of topics, which rclpy declares as topics appear."""
    return all(change.name.startswith(NODE_PREFIXES) for change in changes)
