"""The effects that a model file may add, by name."""

from __future__ import annotations

from pprs_dynamics.effects.coulomb_friction import CoulombFriction
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.effects.effort_offset import EffortOffset
from pprs_dynamics.effects.hysteresis import Hysteresis
from pprs_dynamics.effects.quadratic_friction import QuadraticFriction
from pprs_dynamics.effects.stribeck_friction import StribeckFriction
from pprs_dynamics.effects.viscous_friction import ViscousFriction

CATALOGUE: dict[str, type[CatalogueEffect]] = {
    effect.name: effect
    for effect in (
        CoulombFriction,
        EffortOffset,
        Hysteresis,
        QuadraticFriction,
        StribeckFriction,
        ViscousFriction,
    )
}
