"""The model as ROS 2 parameters: declared from the table of keys, validated by the file's rules."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.keys import KEYS
from pprs_dynamics.model.model_file import build_model, default_parameters

# Names that a node has beside its model; a model is built from everything else.
ADDED_PREFIXES = ('effects.', 'tolerances.', 'history.')


def declare_model(node: Node) -> list[str]:
    """Declare every key of a model, with the paper's robot where nothing is given.

    Returns
    -------
    list of str
        Keys that were given neither in a file nor on the command line.
    """
    defaults = default_parameters()
    given = overrides(node)
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
    return [name for name in KEYS if name not in given]


def overrides(node: Node) -> dict[str, Any]:
    """Return what was given in files and on the command line, None for an empty list."""
    # rclpy offers no public way to see overrides of names that are not declared.
    return {name: parameter.value for name, parameter in node._parameter_overrides.items()}


def current_values(node: Node) -> dict[str, Any]:
    """Return all declared parameters, flat."""
    return {name: parameter.value
            for name, parameter in node.get_parameters_by_prefix('').items()
            if parameter.type_ != Parameter.Type.NOT_SET}


def model_from(values: Mapping[str, Any], changes: Iterable[Parameter] = ()) -> DriveModel:
    """Build the model from parameters with some of them changed.

    Raises
    ------
    ModelError
        Where a value, or a name, is not one of a model.
    """
    merged = dict(values)
    for change in changes:
        if change.type_ == Parameter.Type.NOT_SET:
            merged.pop(change.name, None)
        else:
            merged[change.name] = change.value
    return build_model(merged)
