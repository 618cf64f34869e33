# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The effects that a model file may add, by name: the package's own and those of other packages.

Another package offers an effect through the entry point group `pprs_dynamics.effects`:

    [project.entry-points."pprs_dynamics.effects"]
    magnet_force = "my_package.magnet_force:MagnetForce"
"""

from __future__ import annotations

import inspect
import warnings
from functools import cache
from typing import TYPE_CHECKING, Any

from pprs_dynamics.physics.effects.effect import Card, CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.foreign_effects import guard
from pprs_dynamics.physics.effects.laws.asymmetric_friction import AsymmetricFriction
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.counterbalance import Counterbalance
from pprs_dynamics.physics.effects.laws.coupled_drives import CoupledDrives
from pprs_dynamics.physics.effects.laws.current_gain import CurrentGain
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.drive_spring import DriveSpring
from pprs_dynamics.physics.effects.laws.eccentric_encoder import EccentricEncoder
from pprs_dynamics.physics.effects.laws.effort_filter import EffortFilter
from pprs_dynamics.physics.effects.laws.effort_gain import EffortGain
from pprs_dynamics.physics.effects.laws.effort_offset import EffortOffset
from pprs_dynamics.physics.effects.laws.elastic_joint import ElasticJoint
from pprs_dynamics.physics.effects.laws.external_wrench import ExternalWrench
from pprs_dynamics.physics.effects.laws.force_ripple import ForceRipple
from pprs_dynamics.physics.effects.laws.friction_drift import FrictionDrift
from pprs_dynamics.physics.effects.laws.friction_temperature import FrictionTemperature
from pprs_dynamics.physics.effects.laws.gear_efficiency import GearEfficiency
from pprs_dynamics.physics.effects.laws.homing_error import HomingError
from pprs_dynamics.physics.effects.laws.hysteresis import Hysteresis
from pprs_dynamics.physics.effects.laws.joint_friction import JointFrictionEffect
from pprs_dynamics.physics.effects.laws.joint_spring import JointSpring
from pprs_dynamics.physics.effects.laws.link_mass import LinkMass
from pprs_dynamics.physics.effects.laws.load_friction import LoadFriction
from pprs_dynamics.physics.effects.laws.lost_motion import LostMotion
from pprs_dynamics.physics.effects.laws.measured_curve import MeasuredCurve
from pprs_dynamics.physics.effects.laws.payload_mass import PayloadMass
from pprs_dynamics.physics.effects.laws.payload_offset import PayloadOffset
from pprs_dynamics.physics.effects.laws.platform_inertia import PlatformInertia
from pprs_dynamics.physics.effects.laws.quadratic_friction import QuadraticFriction
from pprs_dynamics.physics.effects.laws.stop_contact import StopContact
from pprs_dynamics.physics.effects.laws.stribeck_friction import StribeckFriction
from pprs_dynamics.physics.effects.laws.time_delay import TimeDelay
from pprs_dynamics.physics.effects.laws.tool_drag import ToolDrag
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = 'pprs_dynamics.effects'
# Parts of the drive forces and keys of the block `effects` that have these names already.
RESERVED = ('active', 'active_friction', 'measured', 'offset', 'passive_friction', 'rigid_body')

# What a diagnosis may name.
CATALOGUE: dict[str, type[CatalogueEffect]] = {
    effect.name: effect
    for effect in (
        AsymmetricFriction,
        BaseTilt,
        CoulombFriction,
        Counterbalance,
        CoupledDrives,
        CurrentGain,
        DriveInertia,
        DriveSpring,
        EccentricEncoder,
        EffortFilter,
        EffortGain,
        EffortOffset,
        ElasticJoint,
        ExternalWrench,
        ForceRipple,
        FrictionDrift,
        FrictionTemperature,
        GearEfficiency,
        HomingError,
        Hysteresis,
        JointFrictionEffect,
        JointSpring,
        LinkMass,
        LoadFriction,
        LostMotion,
        PayloadMass,
        PayloadOffset,
        PlatformInertia,
        QuadraticFriction,
        StopContact,
        StribeckFriction,
        TimeDelay,
        ToolDrag,
        ViscousFriction,
    )
}

# A measured curve is in models like any of them, but no cause.
EFFECTS: dict[str, type[CatalogueEffect]] = {**CATALOGUE, MeasuredCurve.name: MeasuredCurve}


def find_effect(name: str) -> type[CatalogueEffect] | None:
    """Return the effect of that name, or None; other packages are asked only where need be."""
    return EFFECTS.get(name) or catalogue().get(name)


@cache
def catalogue() -> dict[str, type[CatalogueEffect]]:
    """Return all effects by name, the package's own first.

    An effect of another package that cannot be used is left out with a warning that says why:
    it must not take the others with it.
    """
    from importlib.metadata import entry_points  # takes 20 ms, which most models do without

    effects = dict(CATALOGUE)
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value)):
        try:
            effect = _load(point, effects)
        except _UnusableEffectError as error:
            warnings.warn(displayed(f'{_origin(point)} is left out: {error}'), RuntimeWarning,
                          stacklevel=2)
        else:
            effects[effect.name] = effect
    return effects


class _UnusableEffectError(Exception):
    """Another package's effect breaks a rule of the catalogue."""


def _load(point: EntryPoint, known: dict[str, type[CatalogueEffect]]) -> type[CatalogueEffect]:
    try:
        effect: Any = point.load()
    except (Exception, SystemExit) as error:  # another package's code may do anything
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        raise _UnusableEffectError(f'it cannot be imported ({reason})') from error
    if not (inspect.isclass(effect) and issubclass(effect, CatalogueEffect)):
        raise _UnusableEffectError('it must be a class derived from CatalogueEffect, e.g. a '
                                   'DriveEffect')
    if missing := sorted(effect.__abstractmethods__):
        raise _UnusableEffectError(f'{effect.__name__} does not define {", ".join(missing)}')
    for attribute, kind in (('name', str), ('card', Card)):
        if not isinstance(getattr(effect, attribute, None), kind):
            raise _UnusableEffectError(
                f'{effect.__name__} must have {attribute}, a {kind.__name__}')
    for attribute in ('linear', 'shape'):
        parameters = getattr(effect, attribute, None)
        if not (isinstance(parameters, tuple)
                and all(isinstance(parameter, Parameter) for parameter in parameters)):
            raise _UnusableEffectError(
                f'{effect.__name__} must have {attribute}, a tuple of Parameter')
    if not effect.name.isidentifier():
        raise _UnusableEffectError(
            f'its name {effect.name!r} must be one word of letters, digits and _')
    if effect.name in (*known, *EFFECTS, *RESERVED):
        raise _UnusableEffectError(f'the name {effect.name} is taken')
    guard(effect)
    return effect


def _origin(point: EntryPoint) -> str:
    package = f' of the package {point.dist.name}' if point.dist else ''
    return f'the effect {point.name} = {point.value}{package}'
