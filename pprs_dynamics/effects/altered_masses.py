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

"""A robot with other masses, for the effects that change them."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

from pprs_dynamics.mechanism.arm import Arm
from pprs_dynamics.mechanism.robot import Robot


def with_masses(robot: Robot, **masses: Any) -> Robot:
    """Return the robot with some fields of `Masses` changed.

    They are not held to what a real body can have: a fit looks at one coefficient at a time, and
    an inertia about one axis alone belongs to no body. Who asks for the masses of a real robot
    makes `Masses` of them again, which checks.
    """
    altered = copy.copy(robot.masses)
    for name, value in masses.items():
        object.__setattr__(altered, name, value)
    return replace(robot, masses=altered)


def with_payload(robot: Robot | Arm, mass: float) -> Robot | Arm:
    """Return the robot with a mass more [kg]: at the platform's centre, or at the tool."""
    if isinstance(robot, Arm):
        return robot.with_payload(mass)
    return with_masses(robot, payload=robot.masses.payload + mass)
