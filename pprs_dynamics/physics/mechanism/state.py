# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The state of a robot along a motion, as effects take it, and what it asks its robot for.

Places and loads of effects are here as well, and the smoothed sign of dry friction. A hard sign
costs up to 0.9 N of spurious force at a reversal of the paper's robot, and it is undefined at rest.
The paper takes "the modulus of the relative velocity" into account without a formula; here
sgn(v) = tanh(v / v_rev), which is 0 at rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion

Motion = JointMotion | PlatformMotion
# Kinds of robots: the closed form of the 3-PPRS, one slide alone, and every other one.
PLATFORM, SLIDE, MECHANISM = 'platform', 'slide', 'mechanism'


@dataclass(frozen=True)
class Reversal:
    """Widths in which friction turns over when a motion reverses.

    Parameters
    ----------
    velocity : float or sequence of 6 floats
        Of all drives, or of each [m/s].
    rate : float
        Of the passive joints that turn [rad/s].
    slide : float
        Of passive slides [m/s].
    """

    velocity: float | tuple[float, ...] = 0.001
    rate: float = 0.001
    slide: float = 0.001

    def widths(self, drives: int) -> Array:
        """Return the width of each drive [m/s], (D,)."""
        return np.broadcast_to(np.asarray(self.velocity, dtype=float), (drives,))


def smooth_sign(velocity: Any, reversal_velocity: Any) -> Any:
    """Return sgn(v) as tanh(v / v_rev); a width per column of (N, D) velocities is allowed."""
    return np.tanh(velocity / reversal_velocity)


class PassiveJoint(NamedTuple):
    """A joint without a drive, or several joints that share their friction.

    Parameters
    ----------
    name : str
    radius : float
        At which its load rubs [m]; 0 where the model does not say.
    turns : bool
        False for a slide.
    has_position : bool
        Whether one number says where it is, as of a hinge and not of a ball.
    joints : tuple of str
        Of the tree, closures included.
    """

    name: str
    radius: float
    turns: bool = True
    has_position: bool = True
    joints: tuple[str, ...] = ()


class BodyPlace(NamedTuple):
    """A link, or several that are alike, that may be heavier than the model says.

    Parameters
    ----------
    link : str
    centre : 3 floats
        Where a body is unless its parameters say otherwise, in the link's frame [m].
    mass : float
        What the link weighs, which nothing can take off it [kg]; inf where that is left open.
    is_spread : bool
        Whether what is added is spread as the link's own mass is, so that its mass alone counts.
    links : tuple of str
        Of the tree.
    """

    link: str
    centre: tuple[float, float, float]
    mass: float
    is_spread: bool = False
    links: tuple[str, ...] = ()


class StructureLoad(NamedTuple):
    """Loads on the mechanism in addition to bodies and gravity.

    Parameters
    ----------
    wrench : (N, 6) array
        Force [N] and moment [N m] that the tool applies at its origin, in `base`.
    torques : mapping of str to (N,) array
        By joint of the tree, what resists a growing position [N m, N].
    """

    wrench: Array
    torques: Mapping[str, Array] = {}

    def __add__(self, other: StructureLoad) -> StructureLoad:  # type: ignore[override]
        torques = dict(self.torques)
        for name, torque in other.torques.items():
            torques[name] = torques[name] + torque if name in torques else torque
        return StructureLoad(self.wrench + other.wrench, torques)

    def at(self, samples: Any) -> StructureLoad:
        """Return the loads at samples that a slice, a mask or indices select."""
        return StructureLoad(self.wrench[samples], {
            name: torque[samples] for name, torque in self.torques.items()})


@dataclass(frozen=True, eq=False)
class MechanismState(JointMotion):
    """The motion of a robot's drives with the quantities that effects take, (N, D) each.

    Kinematics and loads are computed when an effect asks for them.

    Parameters
    ----------
    robot : Mechanism
    reversal : Reversal
    load : StructureLoad, optional
    known : LinkMotion, optional
        The kinematics, where they are known.
    friction : JointFriction
        The model's own, which is computed together with the efforts.
    start, nearby : (N, C) and (C,) arrays, optional
        See `Evaluation.forward_kinematics`.
    """

    robot: Any = field(kw_only=True)
    reversal: Reversal = field(default_factory=Reversal, kw_only=True)
    load: StructureLoad | None = field(default=None, kw_only=True)
    known: Any = field(default=None, kw_only=True)
    friction: Any = field(default=tree.NO_FRICTION, kw_only=True)
    start: Array | None = field(default=None, kw_only=True)
    nearby: Array | None = field(default=None, kw_only=True)

    def __getitem__(self, samples: Any) -> Self:
        """Return the samples that a slice, a mask or indices select, with their load."""
        return replace(super().__getitem__(samples), known=None, nearby=None,
                       start=None if self.start is None else self.start[samples],
                       load=None if self.load is None else self.load.at(samples))

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        drives: tuple[str, ...] = self.robot.drives
        return drives

    @cached_property
    def inverse_dynamics(self) -> tree.InverseDynamicsResult | None:
        """Closed coordinates, efforts and own friction in one pass; None where links are needed."""
        if self.known is not None or self.load is not None:
            return None
        found: tree.InverseDynamicsResult | None = self.robot.inverse_dynamics(self)
        return found

    @cached_property
    def links(self) -> Any:
        """The kinematics, a `LinkMotion`."""
        if self.known is not None:
            return self.known
        found = self.robot.kinematics(self)
        if self.kept is not None:
            self.kept[self.robot.structure] = found
        return found

    @property
    def closed(self) -> Array:
        """Closed coordinates, (N, C)."""
        found = self.inverse_dynamics
        closed: Array = self.links.motion.q if found is None else found.q
        return closed

    @cached_property
    def reactions(self) -> Any:
        """Frictionless efforts and reactions, `Loads`."""
        return self.robot.loads(self.links, self.load)

    @cached_property
    def direction(self) -> Array:
        """Sign of the velocity, sgn, turning over within the reversal velocity."""
        direction: Array = smooth_sign(self.velocity, np.asarray(self.reversal.velocity))
        return direction

    @cached_property
    def rigid_force(self) -> Array:
        """Efforts without friction [N m, N]."""
        force: Array = self.transmitted + self.robot.armature * self.acceleration
        return force

    @property
    def transmitted(self) -> Array:
        """Efforts that the drives' gears pass on, without friction [N m, N].

        The motor accelerates its rotor on its own side of the gear.
        """
        efforts: Array = (self.reactions.efforts if self.inverse_dynamics is None
                          else self.inverse_dynamics.efforts[tree.TRANSMITTED])
        return efforts

    @cached_property
    def friction_load(self) -> Array:
        """Load of a drive's guide or gear [N m, N], without a sign; 0 if it is not known."""
        load: Array = self.robot.friction_load(self)
        return load

    @property
    def tool_velocity(self) -> Array:
        """Linear velocity of the tool's origin and angular velocity, in `base`, (N, 6)."""
        velocity: Array = self.links.tool_velocity
        return velocity

    def joint_position(self, joint: str) -> Array:
        """Return the position of a passive joint of the tree [rad, m], (N,)."""
        position: Array = self.links.joint_position(joint)
        return position

    def perturbed(self, drive: int, step: float) -> MechanismState:
        """Return the state with a drive at other positions; all move as before."""
        position = self.position.copy()
        position[:, drive] += step
        return replace(self, position=position, known=None, kept=None, start=self.closed,
                       nearby=None)

    def friction_efforts(self, friction: Any) -> Array:
        """Return the drives' efforts against friction of joints, (N, D)."""
        efforts: Array = (
            self.inverse_dynamics.efforts[tree.JOINT_EFFORT]
            if friction is self.friction and self.inverse_dynamics is not None
            else self.links.friction(self.reactions, friction))
        return efforts

    def with_smoothing(self, reversal: Reversal) -> MechanismState:
        """Return the state with a sgn of other widths; all else is computed once for both."""
        state = replace(self, reversal=reversal, known=self.links)
        vars(state)['reactions'] = self.reactions
        return state

    def with_load(self, robot: Any, load: StructureLoad | None = None) -> MechanismState:
        """Return a state of this motion with other bodies, and with an additional load."""
        if load is None:
            load = self.load
        elif self.load is not None:
            load = self.load + load
        return replace(self, robot=robot, load=load, known=self.links)
