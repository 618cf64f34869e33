# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Models of every kind from files and from flat keys and values, as of a node's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from pprs_dynamics.model.arm_model import ArmModel
from pprs_dynamics.model.axis_model import AxisModel
from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.keys import is_arm, is_axis
from pprs_dynamics.model.parameter_file import DEFAULT_MODEL, find_file, read_parameters

Model = DriveModel | AxisModel | ArmModel


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
        it is a single axis, with keys of `arm` a serial arm.
    source : str
        Named in errors; the path of an arm's URDF counts from its folder.

    Raises
    ------
    ModelError
        For a key that is unknown, missing, of the wrong type or impossible.
    """
    kind: type[Model] = (ArmModel if is_arm(parameters) else
                         AxisModel if is_axis(parameters) else DriveModel)
    return kind.from_parameters(parameters, source)
