# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""All hidden effects by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pprs_dynamics.errors import suggestion
from pprs_dynamics.simulation import injected_bodies, injected_forces, sensors
from pprs_dynamics.simulation.injected_effect import (
    DriveBound,
    InjectedEffect,
    InjectedEffectError,
    InjectedJointFriction,
)

IN_CATALOGUE: dict[str, type[InjectedEffect]] = {effect.name: effect for effect in (
    injected_forces.viscous_friction, injected_forces.coulomb_friction,
    injected_forces.asymmetric_friction, injected_forces.stribeck_friction,
    injected_forces.quadratic_friction, injected_forces.load_friction,
    injected_forces.gear_efficiency,
    injected_forces.Hysteresis, injected_forces.FrictionDrift, injected_forces.FrictionTemperature,
    injected_forces.effort_offset, sensors.EffortGain, sensors.HomingError,
    sensors.LostMotion,
    injected_forces.drive_spring, injected_forces.stop_contact, injected_forces.force_ripple,
    injected_bodies.DriveInertia,
    sensors.TimeDelay, sensors.EffortFilter, injected_forces.JointFriction,
    injected_forces.joint_spring,
    injected_bodies.payload_mass, injected_bodies.payload_offset, injected_bodies.platform_inertia,
    injected_forces.external_wrench, injected_bodies.base_tilt, injected_forces.tool_drag,
    injected_bodies.link_mass)}
"""Effects that the catalogue has under the same name, in the interface's order."""

NOT_IN_CATALOGUE: dict[str, type[InjectedEffect]] = {effect.name: effect for effect in (
    injected_forces.local_bump, injected_forces.vibration, injected_forces.DriveCoupling,
    injected_bodies.PayloadPickUp)}
"""Effects that no catalogue effect explains."""

INJECTED_EFFECTS = {**IN_CATALOGUE, **NOT_IN_CATALOGUE}
RANDOM = 'random'


def draw_effects(
    names: Sequence[str], rng: np.random.Generator, scale: float = 1.0,
) -> list[InjectedEffect]:
    """Return a hidden effect per name.

    The name `random` is one drawn at random; drives may follow, as in
    `coulomb_friction:lift_1,lift_2`.

    Raises
    ------
    InjectedEffectError
        For a name that no effect has, and for drives that are none or that it does not act in.
    """
    drawn = [str(rng.choice(sorted(INJECTED_EFFECTS))) if name == RANDOM else name
             for name in names]
    return [draw_effect(name, rng, scale) for name in drawn]


def draw_effect(name: str, rng: np.random.Generator, scale: float = 1.0) -> InjectedEffect:
    """Return a hidden effect with random parameters.

    Parameters
    ----------
    name : str
        One of `INJECTED_EFFECTS`, drives may follow after a colon, of `joint_friction` revolute
        or spherical.
    rng : numpy.random.Generator
    scale : float
        Multiplies its strength.

    Raises
    ------
    InjectedEffectError
        For another name.
    """
    name, _, drives = name.partition(':')
    if name not in INJECTED_EFFECTS:
        raise InjectedEffectError(f'no hidden effect is called {name!r}'
                                f'{suggestion(name, INJECTED_EFFECTS)}; there are '
                                f'{", ".join(INJECTED_EFFECTS)}')
    effect = INJECTED_EFFECTS[name]
    if not drives:
        return effect.draw(rng, scale)
    if issubclass(effect, (DriveBound, InjectedJointFriction)):
        return effect.draw_on(drives.split(','), rng, scale)
    raise InjectedEffectError(f'{name} acts in no drive of its own, so that {drives!r} must not '
                            'follow')
