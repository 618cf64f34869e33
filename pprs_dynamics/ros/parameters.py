# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The model as ROS 2 parameters: declared from the table of keys, validated by the file's rules."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import (
    ARM_JOINTS,
    ARM_URDF,
    KEYS,
    LARGEST,
    NAMES,
    NODE_KEYS,
    Key,
    as_list,
    is_arm,
    is_axis,
    keys_of,
)
from pprs_dynamics.physics.model.parameter_file import default_parameters
from pprs_dynamics.physics.model.parameter_values import is_known
from pprs_dynamics.physics.three_pprs.robot import DRIVES
from pprs_dynamics.ros.provenance import folder_of, names_given
from pprs_dynamics.ros.rclpy_internals import parameter_overrides

ACTIVE = 'effects.active'
LARGEST_INTEGER = 2**63 - 1


@dataclass(frozen=True)
class NodeParameter:
    """A parameter that only a node has.

    Parameters
    ----------
    name : str
        Listed in `pprs_dynamics.physics.model.keys.NODE_KEYS` too, so that model files may hold it.
    default : bool, int, float, str or list of str
        Gives the type; a whole number is right where a decimal one is asked for.
    description : str
    lower, upper : float
        Bounds of a number, both allowed.
    choices : tuple of str
        Words that are allowed; () for any.
    size : int
        Of a list of numbers that may also be empty; its default is ().
    """

    name: str
    default: Any
    description: str
    lower: float = -math.inf
    upper: float = math.inf
    choices: tuple[str, ...] = ()
    size: int = 0

    @property
    def rule(self) -> str:
        """What a value must be, completing "it must ..."."""
        if self.choices:
            return f'be one of {", ".join(self.choices)} ({self.description})'
        if self.size:
            return f'be empty, or {self._list.rule}'
        kinds = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a word',
                 list: 'a list of words'}
        bounds = [f'at {side} {bound:g}' for side, bound in (
            ('least', self.lower), ('most', self.upper)) if math.isfinite(bound)]
        return (f'be {kinds[type(self.default)]}{", " if bounds else ""}{" and ".join(bounds)} '
                f'({self.description})')

    def check(self, value: Any) -> Any:
        """Return the value in the default's type, or raise ModelError."""
        kind = type(self.default)
        if self.size:
            empty = value is None or (hasattr(value, '__len__') and not len(value))
            try:
                return () if empty else self._list.check(value)
            except ModelError:
                raise ModelError(self.name, value, self.rule) from None
        if kind is list:
            # ROS 2 tells an empty list as a parameter that is not set.
            words = [] if value is None else value
            if isinstance(words, str) or not all(isinstance(word, str) for word in words):
                raise ModelError(self.name, value, self.rule)
            return list(words)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind or (self.choices and value not in self.choices):
            raise ModelError(self.name, value, self.rule)
        if kind in (int, float) and not self.lower <= value <= self.upper:
            raise ModelError(self.name, value, self.rule)
        return value

    @property
    def descriptor(self) -> ParameterDescriptor:
        """How the parameter is declared."""
        return _descriptor(self.description, self.rule, type(self.default), self.lower, self.upper)

    @property
    def _list(self) -> Key:
        return Key(self.name, self.description, size=self.size, positive=True)


def declare_own(node: Node, parameters: Iterable[NodeParameter]) -> dict[str, Any]:
    """Declare parameters of the node's own and return their checked values.

    Raises
    ------
    ModelError
        For a value that breaks its rule.
    """
    values, given = {}, overrides(node)
    for parameter in parameters:
        if parameter.name in given:
            # Before ROS 2 looks at the range, whose sentence says less.
            parameter.check(given[parameter.name])
        default = None if parameter.size else parameter.default
        node.declare_parameter(parameter.name, default, parameter.descriptor)
        values[parameter.name] = parameter.check(node.get_parameter(parameter.name).value)
    return values


def drive_count(node: Node) -> int:
    """Return how many drives the model has that a node was given."""
    given = overrides(node)
    joints = given.get(ARM_JOINTS)
    return len(joints) if is_arm(given) and isinstance(joints, list) and joints else len(DRIVES)


def declare_arm(node: Node) -> None:
    """Declare every key of an arm's model; a relative path of its URDF becomes an absolute one.

    Raises
    ------
    ModelError
        For a key that is missing or breaks its rule.
    """
    given = {name: _plain(value) for name, value in overrides(node).items()}
    keys = keys_of(given)
    for name, key in keys.items():
        value = given.get(name)
        if value is None and name in given and key.may_be_empty:
            value = []
        if value is not None:
            key.check(value)
        elif key.default is None:
            raise ModelError(name, MISSING, key.rule)
        else:
            value = as_list(key.default)
        if name == ARM_URDF:
            value = str(folder_of(name) / value)
        # An override would bring the relative path back.
        node.declare_parameter(name, value, _of_key(key), ignore_override=True)
    _declare_added(node, given)


def _declare_added(node: Node, given: Mapping[str, Any]) -> None:
    """Declare what was given beside the keys of a model, as of effects."""
    for name, value in given.items():
        if not node.has_parameter(name) and value is not None:
            node.declare_parameter(name, value, added_descriptor(name))
    if not node.has_parameter(ACTIVE):
        node.declare_parameter(ACTIVE, [], added_descriptor(ACTIVE))


def declare_model(node: Node) -> list[str]:
    """Declare every key of a 3-PPRS's model, with the paper's robot where nothing is given.

    Returns
    -------
    list of str
        Keys that were given neither in a file nor on the command line.
    """
    defaults = default_parameters()
    given = overrides(node)
    if is_axis(given) or is_arm(given):
        DriveModel.from_parameters(given)  # refuses it
    if any(name.startswith('geometry.') for name in given):
        # Somebody's own robot: what is missing must not become the paper's in silence.
        defaults = {}
        for name, key in KEYS.items():
            if name not in given and key.default is None:
                raise ModelError(name, MISSING, key.rule)
    for name, key in KEYS.items():
        if name in given:
            key.check(_plain(given[name]))
        default = defaults.get(name, key.default)
        node.declare_parameter(
            name, list(default) if isinstance(default, tuple) else default, _of_key(key))
    _declare_added(node, given)
    return [name for name, key in KEYS.items() if name not in given and name in defaults]


def refuse_unknown(node: Node) -> None:
    """Raise ModelError where a parameter was given that neither node nor model has."""
    for name, value in overrides(node).items():
        if not node.has_parameter(name) and not is_known(name):
            raise ModelError(name, value, 'not be there: no such parameter')


def overrides(node: Node) -> dict[str, Any]:
    """Return what was given in files and on the command line, None for an empty list."""
    return parameter_overrides(node, lambda: {*NAMES, *NODE_KEYS, *names_given()})


def current_values(node: Node, changes: Iterable[Parameter] = ()) -> dict[str, Any]:
    """Return all declared parameters with some of them changed, flat; those not set left out."""
    merged = {**node.get_parameters_by_prefix(''), **{change.name: change for change in changes}}
    return {name: _plain(parameter.value) for name, parameter in merged.items()
            if parameter.type_ != Parameter.Type.NOT_SET}


def added_descriptor(name: str) -> ParameterDescriptor:
    """Return how a parameter is declared that is not in the table of keys, as of an effect."""
    if name == ACTIVE:
        return _descriptor('effects beside the paper\'s friction, in force',
                           'be a list of names of effects', list)
    block, _, rest = name.partition('.')
    effect, _, place = rest.partition('.')
    if block == 'effects' and effect in CATALOGUE:
        for parameter in CATALOGUE[effect].parameters:
            if place.rpartition('.')[2] == parameter.name:
                unit = f' [{parameter.unit}]' if parameter.unit else ''
                return _descriptor(
                    f'{effect}: {parameter.description}{unit}',
                    f'lie in [{parameter.lower:g}, {parameter.upper:g}]{unit}',
                    float, parameter.lower, parameter.upper)
    return ParameterDescriptor(dynamic_typing=True)


def _of_key(key: Key) -> ParameterDescriptor:
    unit = f' [{key.unit}]' if key.unit else ''
    is_word = bool(key.choices) or key.is_text
    kind = list if key.size is not None else str if is_word else float
    return _descriptor(f'{key.description}{unit}', key.rule, kind, key.lower if not key.positive
                       else max(key.lower, 0.0), key.upper)


def _descriptor(
    description: str, rule: str, kind: type, lower: float = -math.inf, upper: float = math.inf,
) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=description, additional_constraints=f'must {rule}',
        # `0` for `0.0` is right in a file and must not be a type error here.
        dynamic_typing=True)
    if kind is float and (math.isfinite(lower) or math.isfinite(upper)):
        descriptor.floating_point_range = [FloatingPointRange(
            # Message fields of that type turn whole numbers into nonsense without a word.
            from_value=float(max(lower, -LARGEST)), to_value=float(min(upper, LARGEST)))]
    if kind is int and (math.isfinite(lower) or math.isfinite(upper)):
        descriptor.integer_range = [IntegerRange(
            from_value=round(max(lower, -LARGEST_INTEGER)),
            to_value=round(min(upper, LARGEST_INTEGER)), step=0)]
    return descriptor


def _plain(value: Any) -> Any:
    """Return a list for the arrays that rclpy keeps."""
    return value.tolist() if isinstance(value, array) else value
