# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects on the tool, on links and in passive joints: one set of parameters each."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Self

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.mechanism.state import MechanismState, StructureLoad


class StructureEffect(CatalogueEffect):
    """An effect that is not in the drives.

    Parameters
    ----------
    values : mapping
        By name of the parameter.
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        self.values = dict(values)

    @classmethod
    def from_file(cls, values: Mapping[str, Any], complete: bool = True,
                  turning: Collection[str] | None = None) -> Self:
        """Build the effect from `{parameter: value}`."""
        return cls(cls._checked(f'effects.{cls.name}', values, complete))

    @classmethod
    def at(cls, coefficients: Mapping[str, float]) -> Self:
        """Return the effect with these coefficients; those not given are zero."""
        every = {c.name: float(coefficients.get(c.name, 0.0)) for c in cls.coefficients}
        return cls(cls.from_coefficients(every))


class BodyEffect(StructureEffect):
    """An effect on the rigid body: masses, gravity, forces on the bodies.

    It changes the loads of the guides and joints, too, and with them the friction that follows
    loads: the model applies it before it evaluates friction.
    """

    def changed(self, robot: Any) -> Any:
        """Return the robot, a `Robot` or a `Mechanism`, with the effect; by default as it was."""
        return robot

    def load(self, state: MechanismState) -> StructureLoad | None:
        """Return a load in addition to bodies and gravity, or None (default)."""
        return None

    def apply(self, state: MechanismState) -> Any:
        """Return the state with the effect in its bodies."""
        load, shape = self.load(state), (len(state.velocity), 6)
        if load is not None and load.wrench.shape != shape:
            raise ValueError(f'the wrench has shape {load.wrench.shape}, must be {shape}')
        return state.with_load(self.changed(state.robot), load)

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the change of the rigid body's drive forces [N, N m], (N, D)."""
        added: Array = self.apply(state).rigid_force - state.rigid_force
        return added


def with_bodies(robot: Any, effects: Iterable[object]) -> Any:
    """Return a robot with what those of some effects that act on bodies make of it."""
    for effect in effects:
        if isinstance(effect, BodyEffect):
            robot = effect.changed(robot)
    return robot


class PassiveJointEffect(StructureEffect):
    """Friction in the passive joints: a force on top of the rigid body's."""

    @abstractmethod
    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the effect's drive forces [N, N m], (N, D)."""
