# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Models of every kind from files and from flat keys and values, as of a node's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import is_axis, is_mechanism
from pprs_dynamics.physics.model.mechanism_model import MechanismModel
from pprs_dynamics.physics.model.parameter_file import DEFAULT_MODEL, find_file, read_parameters

Model = DriveModel | MechanismModel


def load_model(path: str | PathLike[str] = DEFAULT_MODEL) -> Model:
    """Read a model file of any kind; see `DriveModel.load`."""
    file = find_file(path)
    return build_model(read_parameters(file), source=str(file))


def build_model(parameters: Mapping[str, Any], source: str = '') -> Model:
    """Build the model from flat keys and values, each checked.

    Parameters
    ----------
    parameters : mapping
        E.g. {'geometry.rod_length': 0.3, ...}; keys of nodes are ignored. With keys of `axis`
        it is a single axis, with keys of `robot` an arm or a robot with loops.
    source : str
        Named in errors; the path of an arm's URDF counts from its folder.

    Raises
    ------
    ModelError
        For a key that is unknown, missing, of the wrong type or impossible.
    """
    kind: type[Model] = (MechanismModel if is_mechanism(parameters) or is_axis(parameters)
                         else DriveModel)
    return kind.from_parameters(parameters, source)
