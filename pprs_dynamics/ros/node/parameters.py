# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The model as ROS 2 parameters: declared from the table of keys, validated by the file's rules.

generate_parameter_library_py makes code of a fixed list, while keys depend on the robot; and there
is no wheel of it.
"""

from __future__ import annotations

from array import array
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.errors import MISSING, ModelError, UnknownNameError
from pprs_dynamics.physics.effects.catalogue import find_parameter
from pprs_dynamics.physics.model import keys
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import default_parameters
from pprs_dynamics.physics.model.parameter_values import is_known
from pprs_dynamics.ros.node.provenance import folder_of
from pprs_dynamics.ros.node.rclpy_internals import parameter_overrides
from pprs_dynamics.system.package_files import located

ACTIVE = 'effects.active'
HISTORY = 'history.'


@dataclass(frozen=True)
class NodeParameter(keys.Key):
    """A key that only a node has; a switch or a whole number where its default is one.

    Listed in `pprs_dynamics.physics.model.keys.NODE_KEYS` too, so that model files may hold it.

    Parameters
    ----------
    stays : bool
        Read once, at the start: a running node refuses another value.
    """

    stays: bool = False

    @property
    def rule(self) -> str:
        """The requirement on a value, completing "must ..."."""
        if isinstance(self.default, bool):
            return f'be true or false ({self.description})'
        if isinstance(self.default, int):
            return super().rule.replace('a number', 'a whole number', 1)
        if self.is_text:
            return super().rule.replace('name', 'word', 1)
        if self.size is not None:
            return f'be empty, or {super().rule}'
        return super().rule

    def check(self, value: Any) -> Any:
        """Return the value in the default's type, or raise ModelError."""
        if self.size is not None and value is None:
            return ()  # ROS 2 gives None for an empty list
        if isinstance(self.default, int):
            # true is a whole number to Python.
            if (not isinstance(value, type(self.default))
                    or isinstance(value, bool) != isinstance(self.default, bool)
                    or not self.lower <= value <= self.upper):
                raise ModelError(self.name, value, self.rule)
            return value
        return super().check(value)


def node_parameter(
    name: str, default: Any, description: str, size: int | None = None,
    choices: tuple[str, ...] = (), **more: Any,
) -> NodeParameter:
    """Return a parameter of a node whose default gives its type; a list that is empty by default.

    Parameters
    ----------
    name : str
    default : bool, int, float, str or ()
        A whole number is right where a decimal one is asked for.
    description : str
    size : int, optional
        Of a list of numbers; a list without one is of words.
    choices : tuple of str
        Words that are allowed; () for any.
    more
        Of `NodeParameter`.
    """
    is_list = isinstance(default, tuple)
    if is_list and size is None:
        size = keys.ANY
    is_text = (isinstance(default, str) and not choices) or size == keys.ANY
    return NodeParameter(
        name, description, size=size, choices=choices,
        is_text=is_text, may_be_empty=is_text or is_list, default=default, **more)


def with_changed(parameters: Iterable[NodeParameter], name: str, **fields: Any,
                 ) -> tuple[NodeParameter, ...]:
    """Return parameters, one of which has other fields."""
    return tuple(replace(parameter, **fields) if parameter.name == name else parameter
                 for parameter in parameters)


def declare_node_parameters(node: Node, parameters: Sequence[NodeParameter]) -> dict[str, Any]:
    """Declare parameters of the node's own and return their checked values.

    Raises
    ------
    ModelError
        For a value that breaks its rule.
    """
    given = overrides(node)
    values = {own.name: own.check(given.get(own.name, own.default)) for own in parameters}
    for parameter in parameters:
        _declare(node, parameter, values[parameter.name])
    return values


def drive_count(node: Node) -> int:
    """Return how many drives the model has that a node was given."""
    given = overrides(node)
    joints = given.get(keys.DRIVES_KEY)
    return len(joints) if isinstance(joints, list) and joints else len(DRIVES)


def has_model(given: Mapping[str, Any]) -> bool:
    """Return whether a robot is among the parameters given, and not only changes of the paper's."""
    return keys.is_described(given) or any(name.startswith('geometry.') for name in given)


def declare_model(node: Node, arguments: Sequence[str]) -> None:
    """Declare every key of a node's model, which is the paper's 3-PPRS where nothing is given.

    A relative path of a mechanism's URDF becomes an absolute one, by the node's command line.

    Raises
    ------
    ModelError
        For a key that is missing or breaks its rule.
    """
    given = overrides(node)
    for key in keys.FILES:
        if isinstance(given.get(key), str) and given[key]:
            given[key] = str(located(given[key], folder_of(given[key], arguments)))
    # Of somebody's own robot what is missing must not become the paper's in silence.
    defaults = {} if has_model(given) else default_parameters()
    for name, entry in keys.keys_of(given).items():
        value = given.get(name, defaults.get(name, entry.default))
        if value is None and name not in given:
            raise ModelError(name, MISSING, entry.rule)
        _declare(node, entry, entry.check(() if value is None and entry.may_be_empty else value))
    added = {name: value for name, value in given.items() if value is not None}
    for name, value in {ACTIVE: [], **added}.items():
        # The ledger is for `pprs history`: a page of numbers that no node reads.
        if not node.has_parameter(name) and not name.startswith(HISTORY):
            node.declare_parameter(name, value, _added_descriptor(name), ignore_override=True)


def declared_model(node: Node, arguments: Sequence[str], own: Container[str]) -> DriveModel:
    """Declare every key of a node's model, and return the model; `own` are the node's parameters.

    Raises
    ------
    ModelError
        As `declare_model`.
    """
    declare_model(node, arguments)
    return DriveModel.from_parameters({name: value for name, value in current_values(node).items()
                                       if name not in own})


def _declare(node: Node, key: keys.Key, value: Any) -> None:
    """Declare a key with a checked value.

    Its type and range are checked by the rules of model files, which explain a refusal. rclpy's own
    check would refuse a whole number, and an empty list, which has no type.
    """
    unit = f' [{key.unit}]' if key.unit else ''
    node.declare_parameter(key.name, keys.as_list(value), ParameterDescriptor(
        description=f'{key.description}{unit}', additional_constraints=f'must {key.rule}',
        # An override would bring back a whole number, or a relative path.
        dynamic_typing=True), ignore_override=True)


def _added_descriptor(name: str) -> ParameterDescriptor:
    """Return the description of a parameter of an effect, which no table of keys has."""
    block, _, rest = name.partition('.')
    parameter = find_parameter(rest) if block == 'effects' else None
    description = (
        '' if parameter is None else f'{rest.partition(".")[0]}: {parameter.description}')
    return ParameterDescriptor(description=description, dynamic_typing=True)


def refuse_unknown(node: Node) -> None:
    """Raise UnknownNameError where a parameter was given that neither node nor model has."""
    known = [*node.get_parameters_by_prefix('')]
    for name in overrides(node):
        if not node.has_parameter(name) and not is_known(name):
            raise UnknownNameError('parameter', name, known)


def overrides(node: Node) -> dict[str, Any]:
    """Return parameters of files and command line; None for an empty list."""
    return {name: plain_value(value) for name, value in parameter_overrides(node).items()}


def current_values(node: Node, changes: Iterable[Parameter] = ()) -> dict[str, Any]:
    """Return all declared and set parameters, with some of them changed."""
    merged = {**node.get_parameters_by_prefix(''), **{change.name: change for change in changes}}
    return {name: plain_value(parameter.value) for name, parameter in merged.items()
            if parameter.type_ != Parameter.Type.NOT_SET}


def with_hint(error: Exception) -> str:
    """Return an error's sentence, and what to write where a list mixes whole and decimal numbers.

    ROS 2 takes such a list for a word, or refuses the file that it stands in.
    """
    value = error.value if isinstance(error, ModelError) else None
    if 'same type' in str(error) or (isinstance(value, str) and value.startswith('[')):
        return f'{error}; a list must not mix whole and decimal numbers: write 0.0, not 0'
    return str(error)


def plain_value(value: Any) -> Any:
    """Return a list for the arrays that rclpy keeps."""
    return value.tolist() if isinstance(value, array) else value
