# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""All hidden effects by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.errors import suggestion
from pprs_dynamics.simulation import hidden_bodies, hidden_forces, sensors
from pprs_dynamics.simulation.hidden_effect import (
    DriveBound,
    HiddenEffect,
    HiddenEffectError,
    HiddenJointFriction,
)

IN_CATALOGUE: dict[str, type[HiddenEffect]] = {effect.name: effect for effect in (
    hidden_forces.viscous_friction, hidden_forces.coulomb_friction,
    hidden_forces.asymmetric_friction, hidden_forces.stribeck_friction,
    hidden_forces.quadratic_friction, hidden_forces.load_friction,
    hidden_forces.gear_efficiency,
    hidden_forces.Hysteresis, hidden_forces.FrictionDrift, hidden_forces.FrictionTemperature,
    hidden_forces.effort_offset, sensors.EffortGain, sensors.HomingError,
    sensors.LostMotion,
    hidden_forces.drive_spring, hidden_forces.stop_contact, hidden_forces.force_ripple,
    hidden_bodies.DriveInertia,
    sensors.TimeDelay, sensors.EffortFilter, hidden_forces.JointFriction,
    hidden_forces.joint_spring,
    hidden_bodies.payload_mass, hidden_bodies.payload_offset, hidden_bodies.platform_inertia,
    hidden_forces.external_wrench, hidden_bodies.base_tilt, hidden_forces.tool_drag,
    hidden_bodies.link_mass)}
"""Effects that the catalogue has under the same name, in the interface's order."""

NOT_IN_CATALOGUE: dict[str, type[HiddenEffect]] = {effect.name: effect for effect in (
    hidden_forces.local_bump, hidden_forces.vibration, hidden_forces.DriveCoupling,
    hidden_bodies.PayloadPickUp)}
"""Effects that no catalogue effect explains."""

HIDDEN_EFFECTS = {**IN_CATALOGUE, **NOT_IN_CATALOGUE}
RANDOM = 'random'


def draw_effects(
    names: Sequence[str], rng: np.random.Generator, scale: float = 1.0,
) -> list[HiddenEffect]:
    """Return a hidden effect per name.

    The name `random` is one drawn at random; drives may follow, as in
    `coulomb_friction:lift_1,lift_2`.

    Raises
    ------
    HiddenEffectError
        For a name that no effect has, and for drives that are none or that it does not act in.
    """
    drawn = [str(rng.choice(sorted(HIDDEN_EFFECTS))) if name == RANDOM else name
             for name in names]
    return [draw_effect(name, rng, scale) for name in drawn]


def draw_effect(name: str, rng: np.random.Generator, scale: float = 1.0) -> HiddenEffect:
    """Return a hidden effect with random parameters.

    Parameters
    ----------
    name : str
        One of `HIDDEN_EFFECTS`, drives may follow after a colon, of `joint_friction` revolute
        or spherical.
    rng : numpy.random.Generator
    scale : float
        Multiplies its strength.

    Raises
    ------
    HiddenEffectError
        For another name.
    """
    name, _, drives = name.partition(':')
    if name not in HIDDEN_EFFECTS:
        raise HiddenEffectError(f'no hidden effect is called {name!r}'
                                f'{suggestion(name, HIDDEN_EFFECTS)}; there are '
                                f'{", ".join(HIDDEN_EFFECTS)}')
    effect = HIDDEN_EFFECTS[name]
    if not drives:
        return effect.draw(rng, scale)
    if issubclass(effect, (DriveBound, HiddenJointFriction)):
        return effect.draw_on(drives.split(','), rng, scale)
    raise HiddenEffectError(f'{name} acts in no drive of its own, so that {drives!r} must not '
                            'follow')
