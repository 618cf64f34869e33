# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A robot with other masses, for the effects that change them."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

from pprs_dynamics.physics.three_pprs.robot import Robot


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
