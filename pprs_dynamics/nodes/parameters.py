"""The model as ROS 2 parameters: declared from the table of keys, validated by the file's rules."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.errors import MISSING, ModelError
from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.keys import KEYS
from pprs_dynamics.model.model_file import build_model, default_parameters, is_known


@dataclass(frozen=True)
class NodeParameter:
    """A parameter that only a node has.

    Parameters
    ----------
    name : str
        Listed in `pprs_dynamics.model.keys.NODE_KEYS` too, so that model files may hold it.
    default : bool, int, float, str or list of str
        Gives the type; a whole number is right where a decimal one is asked for.
    description : str
    lower, upper : float
        Bounds of a number, both allowed.
    choices : tuple of str
        Words that are allowed; () for any.
    """

    name: str
    default: Any
    description: str
    lower: float = -math.inf
    upper: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def rule(self) -> str:
        """What a value must be, completing "it must ..."."""
        if self.choices:
            return f'be one of {", ".join(self.choices)} ({self.description})'
        kinds = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a word',
                 list: 'a list of words'}
        bounds = [f'at {side} {bound:g}' for side, bound in (
            ('least', self.lower), ('most', self.upper)) if math.isfinite(bound)]
        return (f'be {kinds[type(self.default)]}{", " if bounds else ""}{" and ".join(bounds)} '
                f'({self.description})')

    def check(self, value: Any) -> Any:
        """Return the value in the default's type, or raise ModelError."""
        kind = type(self.default)
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


def declare_own(node: Node, parameters: Iterable[NodeParameter]) -> dict[str, Any]:
    """Declare parameters of the node's own and return their checked values.

    Raises
    ------
    ModelError
        For a value that breaks its rule.
    """
    values = {}
    for parameter in parameters:
        node.declare_parameter(parameter.name, parameter.default, ParameterDescriptor(
            description=parameter.description, additional_constraints=f'must {parameter.rule}',
            dynamic_typing=True))
        values[parameter.name] = parameter.check(node.get_parameter(parameter.name).value)
    return values


def declare_model(node: Node) -> list[str]:
    """Declare every key of a model, with the paper's robot where nothing is given.

    Returns
    -------
    list of str
        Keys that were given neither in a file nor on the command line.
    """
    defaults = default_parameters()
    given = overrides(node)
    if any(name.startswith('geometry.') for name in given):
        # Somebody's own robot: what is missing must not become the paper's in silence.
        defaults = {}
        for name, key in KEYS.items():
            if name not in given and key.default is None:
                raise ModelError(name, MISSING, key.rule)
    for name, key in KEYS.items():
        descriptor = ParameterDescriptor(
            description=key.description, additional_constraints=f'must {key.rule}',
            # `0` for `0.0` is right in a file and must not be a type error here.
            dynamic_typing=True)
        default = defaults.get(name, key.default)
        node.declare_parameter(
            name, list(default) if isinstance(default, tuple) else default, descriptor)
    for name, value in given.items():
        if not node.has_parameter(name) and value is not None:
            node.declare_parameter(name, value, ParameterDescriptor(dynamic_typing=True))
    return [name for name, key in KEYS.items() if name not in given and name in defaults]


def refuse_unknown(node: Node) -> None:
    """Raise ModelError where a parameter was given that neither node nor model has."""
    for name, value in overrides(node).items():
        if not node.has_parameter(name) and not is_known(name):
            raise ModelError(name, value, 'not be there: no such parameter')


def overrides(node: Node) -> dict[str, Any]:
    """Return what was given in files and on the command line, None for an empty list."""
    # rclpy offers no public way to see overrides of names that are not declared.
    return {name: parameter.value for name, parameter in node._parameter_overrides.items()}


def current_values(node: Node, changes: Iterable[Parameter] = ()) -> dict[str, Any]:
    """Return all declared parameters with some of them changed, flat; those not set left out."""
    merged = {**node.get_parameters_by_prefix(''), **{change.name: change for change in changes}}
    return {name: parameter.value for name, parameter in merged.items()
            if parameter.type_ != Parameter.Type.NOT_SET}


def model_from(values: Mapping[str, Any]) -> DriveModel:
    """Build the model from a node's parameters, those of the node itself left out.

    Raises
    ------
    ModelError
        Where a value, or a name, is not one of a model.
    """
    return build_model(values)
