# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The blocks of a model file that describe a 3-PPRS: geometry, masses, friction and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics.drives import COUNT, DRIVES, DriveUnits
from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.effects.effect import Effect
from pprs_dynamics.physics.effects.laws.drive_friction import DriveFriction
from pprs_dynamics.physics.effects.laws.joint_friction import ModelJointFriction
from pprs_dynamics.physics.mechanism.reversal import Reversal
from pprs_dynamics.physics.model.limits import DriveLimits
from pprs_dynamics.physics.model.recorded_names import gravity_in_efforts
from pprs_dynamics.physics.three_pprs.geometry import Geometry, Masses
from pprs_dynamics.physics.three_pprs.independent_chains import IndependentChainsFriction
from pprs_dynamics.physics.three_pprs.robot import (
    REVOLUTE,
    SPHERICAL,
    SingularityBounds,
    ThreePprs,
)

STROKES = ('limits.slide_stroke',) * 3 + ('limits.lift_stroke',) * 3  # keys, by drive


def read_platform(values: Mapping[str, Any],
                  ) -> tuple[ThreePprs, tuple[Effect, ...], Reversal, DriveLimits]:
    """Return a 3-PPRS, its own friction, its smoothing and limits, from checked values."""
    for stroke in dict.fromkeys(STROKES):
        if not values[stroke][0] < values[stroke][1]:
            raise ModelError(stroke, values[stroke], 'be a lower and a higher position [m]')
    blocks = {joint: {'viscous': values[f'friction.{joint}.viscous'],
                      'coulomb': values[f'friction.{joint}.coulomb'],
                      'radius': values[f'friction.{joint}.diameter'] / 2}
              for joint in (REVOLUTE, SPHERICAL)}
    is_independent = values['friction.approach'] == 'independent_chains'
    passive = (IndependentChainsFriction(blocks, values['limits.rod_cosine']) if is_independent
               else ModelJointFriction(blocks))
    robot = ThreePprs(
        Geometry(**_group(values, 'geometry.')), Masses(**_group(values, 'masses.')),
        gravity_in_efforts(values, 'gravity'),
        (blocks[REVOLUTE]['radius'], blocks[SPHERICAL]['radius']),
        SingularityBounds(values['limits.rod_sine'], values['limits.condition_number'],
                          values['limits.rod_cosine'] if is_independent else 0.0),
        values['equations'] == 'printed')
    drives = DriveFriction(values['friction.drives.viscous'], 0.0,
                           values['friction.drives.coulomb'])
    return (robot, (drives, passive),
            Reversal(_reversal_velocity(values), values['friction.reversal_rate']),
            platform_limits(values))


def platform_limits(values: Mapping[str, Any]) -> DriveLimits:
    """Return the strokes and efforts in the values of a 3-PPRS."""
    lower, upper = np.array([values[key] for key in STROKES]).T
    return DriveLimits(DRIVES, (DriveUnits(),) * COUNT, lower, upper,
                       np.array(values['limits.effort']), STROKES, 'limits.effort')


def _group(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the keys and values right below a prefix."""
    return {name.removeprefix(prefix): value for name, value in values.items()
            if name.startswith(prefix) and '.' not in name.removeprefix(prefix)}


def _reversal_velocity(values: Mapping[str, Any]) -> float | tuple[float, ...]:
    """Return the width that all drives share, or one for each."""
    common: float = values['friction.reversal_velocity']
    own: tuple[float, ...] = values['friction.reversal_velocities']
    return tuple(width or common for width in own) if any(own) else common
