# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robots of the benchmark."""

from __future__ import annotations

from pathlib import Path

from benchmarks import ROOT
from pprs_dynamics.simulation.arm_forms import FORMS, NAMES
from pprs_dynamics.simulation.hidden_effects import IN_CATALOGUE

ROBOTS = ('3-PPRS', 'hexapod', 'delta', 'arm', 'axis')
# Recordings of the benchmark have no temperatures, its models no maps of motors.
UNSEEN = ('friction_temperature', 'coupled_drives', 'current_gain')
MODELS = Path(__file__).parent / 'models'


def model_of(robot: str) -> Path:
    """Return the model file of a robot, its URDF beside it under the same name."""
    if robot == '3-PPRS':
        return ROOT / 'config' / 'paper.yaml'
    folder = ROOT / 'config' if robot in ('hexapod', 'delta') else MODELS
    return folder / f'{robot}.yaml'


def hidden_names(robot: str) -> tuple[str, ...]:
    """Return the effects that may be hidden in a robot, of those that any peer could see."""
    if robot == '3-PPRS':
        return tuple(name for name in IN_CATALOGUE if name not in UNSEEN)
    if robot == 'axis':
        return (*(name for name, form in FORMS.items()
                  if name not in UNSEEN and not form.needs_turn), 'effort_gain', 'time_delay')
    return tuple(name for name in NAMES if name not in UNSEEN
                 and (robot != 'arm' or name != 'joint_friction'))
