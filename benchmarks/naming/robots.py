# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robots of the benchmark."""

from __future__ import annotations

from pathlib import Path

from benchmarks import ROOT

ROBOTS = ('3-PPRS', 'hexapod', 'delta', 'arm', 'axis')
MODELS = Path(__file__).parent / 'models'
# What may be hidden. A list of its own: with the catalogue's every new effect would change which
# problems a seed is, and with them figures that were published.
ON_DRIVES = ('viscous_friction', 'coulomb_friction', 'asymmetric_friction', 'stribeck_friction',
             'quadratic_friction', 'load_friction', 'hysteresis', 'friction_drift',
             'effort_offset', 'drive_spring', 'force_ripple', 'drive_inertia', 'effort_gain',
             'time_delay')
OF_PLATFORM = ('homing_error', 'effort_filter', 'joint_friction', 'joint_spring', 'payload_mass',
               'payload_offset', 'platform_inertia', 'external_wrench', 'base_tilt', 'tool_drag',
               'link_mass')
OF_ARM = ('gear_efficiency', 'homing_error', 'effort_filter', 'payload_mass', 'link_mass',
          'base_tilt', 'external_wrench')
# What columns are offered of: all that may be hidden, and what else a regression may take it for.
# A list of its own for the same reason: with another column a problem is another one.
OFFERED = frozenset({
    *ON_DRIVES, *OF_PLATFORM, *OF_ARM, 'counterbalance', 'coupled_drives', 'current_gain',
    'friction_temperature', 'lost_motion'})


def model_of(robot: str) -> Path:
    """Return the model file of a robot, and its URDF under the same name."""
    if robot == '3-PPRS':
        return ROOT / 'config' / 'paper.yaml'
    folder = ROOT / 'config' if robot in ('hexapod', 'delta') else MODELS
    return folder / f'{robot}.yaml'


def hidden_names(robot: str) -> tuple[str, ...]:
    """Return the effects that may be hidden in a robot."""
    if robot == '3-PPRS':
        return ON_DRIVES + OF_PLATFORM
    if robot == 'axis':
        return (*ON_DRIVES, 'gear_efficiency')
    return ON_DRIVES + OF_ARM if robot == 'arm' else (*ON_DRIVES, *OF_ARM, 'joint_friction')
