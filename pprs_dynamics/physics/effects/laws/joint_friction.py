# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in the passive joints and loops of a mechanism.

Torque against the relative rate: c w + (T + mu r N) sgn(w), with N the force that the joint
transmits across its axis, of a ball all of it; by virtual work T' tau at the drives.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import SingularityError
from pprs_dynamics.physics.effects.effect import Effect, Parameter
from pprs_dynamics.physics.effects.structure_effect import OfPlace, PassiveJointEffect
from pprs_dynamics.physics.mechanism.state import MechanismState, Reversal

RADIUS = 0.01  # [m] at which a load rubs where the model does not say


class JointFrictionEffect(PassiveJointEffect):
    """Friction of passive joints beyond the model's.

    On a 3-PPRS that of its revolute joints C_i, or of its ball joints A_i, alike in all chains. It
    goes to the drives by virtual power of the whole mechanism, whatever friction.approach is.

    Equation
    --------
    tau -> tau + T' (c w + (T + mu r N) sgn(w)), of one passive joint; of a 3-PPRS of all C_i
    or A_i

    Symptom
    -------
    Errors of several drives at once, in the proportions in which they move the joint, with the
    sign of its rate or growing with it. On a 3-PPRS they change sign where a rod reverses its
    swing (C_i), or the platform turns against a rod (A_i), not where a drive reverses.

    Causes
    ------
    A bearing or ball joint that runs dry, is dirty, overtightened, preloaded or worn. A stiff
    seal or boot, cold grease, a cable loom over the joint.

    Confirmation
    ------------
    Take the load off, move the joint by hand and compare it with its like. Lubricate it and
    repeat, run the robot warm and compare: the error must fall.

    References
    ----------
    Itul, Pisla, 2007, Eq. (9) and (12).
    """

    name = 'joint_friction'
    is_friction = True
    is_of_one_place = True
    linear = ()

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect in the passive joints of a robot, with the radii of their loads."""
        return cls.at_places(
            tuple((joint.name, joint.radius or RADIUS) for joint in robot.passive_joints),
            robot.alike_joints)

    @classmethod
    def of_place(cls, place: Any, is_alike: bool, moved: float) -> OfPlace:
        """Return the parameters of a joint and what is tried of them.

        Of joints that are alike the first represents all, whatever the load; a drive for friction
        of its own.
        """
        joint, _ = place
        names = viscous, torque, coulomb = (
            f'{joint}.viscous', f'{joint}.torque', f'{joint}.coulomb')
        linear = (
            Parameter(viscous, 'c', 'N m s/rad', f'viscous friction of {joint}', -1e4, 1e4, 0.0,
                      scale=0.1),
            Parameter(torque, 'T', 'N m', f'dry friction of {joint}, whatever its load', -1e4,
                      1e4, 0.0, scale=0.1),
            Parameter(coulomb, 'mu', '1', f'dry friction of {joint} over its load', -100.0,
                      100.0, 0.0, scale=0.1))
        first = () if is_alike else ((viscous,), (torque,), names[:2])
        return linear, (*first, (coulomb,))

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        radii = dict(self.places)
        blocks: dict[str, dict[str, float]] = {}
        for key, value in self.values.items():
            joint, _, name = key.rpartition('.')
            if value:
                blocks.setdefault(joint, {'radius': radii[joint]})[name] = value
        return state.friction_efforts(state.robot.friction_table(blocks, state.reversal))


class ModelJointFriction(Effect):
    """The friction that a mechanism has in passive joints by its model file.

    Parameters
    ----------
    blocks : mapping of str to mapping
        `viscous`, `torque`, `coulomb` and `radius` by joint.
    """

    name = 'passive_friction'

    def __init__(self, blocks: Mapping[str, Mapping[str, float]]) -> None:
        self.blocks = {name: dict(block) for name, block in blocks.items()}
        self._tables: dict[Reversal, Any] = {}

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the drives' efforts [N m, N], (N, D)."""
        return state.friction_efforts(self.table(state.robot, state.reversal))

    def table(self, robot: Any, reversal: Reversal) -> Any:
        """Return the friction of joints as states take it, for each law of reversal."""
        if reversal not in self._tables:
            self._tables[reversal] = robot.friction_table(self.blocks, reversal)
        return self._tables[reversal]


class PrintedFriction(ModelJointFriction):
    """Friction in passive joints of a 3-PPRS by Eq. (12) to the letter.

    The same total power as by `ModelJointFriction`, and another share per drive.
    """

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N]."""
        robot, links = state.robot, state.links
        k_r, k_s = robot.resistances(state, self.table(robot, state.reversal))
        n, _ = robot.rod_rates(state)
        omega = state.tool_velocity[:, 3:]
        _, u_dot, _ = robot.rods(links)
        about_u = (k_r + k_s) * u_dot - 2 * k_s * (n @ omega[..., None])[..., 0]
        jacobians, _ = links.link_jacobians
        *rods, platform = (robot.structure.links[name][0] for name in (
            'rod_1', 'rod_2', 'rod_3', 'platform'))
        found: Array = (np.einsum('nij,nijd,ni->nd', n, jacobians[:, rods], about_u)  # Eq. (12)
                        + np.einsum('n,nj,njd->nd', k_s.sum(axis=1), omega,
                                    jacobians[:, platform]))
        return found


class IndependentChainsFriction(ModelJointFriction):
    """Friction in passive joints, every chain for itself, Eq. (13).

    Parameters
    ----------
    blocks : mapping of str to mapping
        See `ModelJointFriction`.
    minimum_cosine : float
        Smallest allowed abs(cos u_i).

    Notes
    -----
    An approximation in either form: it is unbounded where cos u_i = 0, where it refuses, and
    even with the signs corrected its friction power can be negative. Use it to reproduce the
    paper, not to drive a robot.

    References
    ----------
    T. Itul, D. Pisla, 2007. `ModelJointFriction` is the first approach, Eq. (12).
    """

    def __init__(self, blocks: Mapping[str, Mapping[str, float]], minimum_cosine: float) -> None:
        super().__init__(blocks)
        self.minimum_cosine = minimum_cosine

    def singular(self, state: MechanismState) -> np.ndarray:
        """Return the samples at which this approach is not defined, (N,) bool."""
        u, *_ = state.robot.rods(state.links)
        mask: np.ndarray = np.any(np.abs(np.cos(u)) < self.minimum_cosine, axis=1)
        return mask

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return Delta Q^p, (N, 6) [N].

        Raises
        ------
        SingularityError
            Where abs(cos u_i) is below `minimum_cosine`.
        """
        singular = self.singular(state)
        if np.any(singular):
            sample = int(np.argmax(singular))
            smallest = np.abs(np.cos(state.robot.rods(state.links)[0, sample]))
            raise SingularityError(
                sample, f'|cos u| of chain {int(np.argmin(smallest)) + 1} is '
                f'{smallest.min():.3g}, where friction.approach independent_chains is unbounded',
                f'limits.rod_cosine is {self.minimum_cosine:g}')
        robot = state.robot
        k_r, k_s = robot.resistances(state, self.table(robot, state.reversal))
        (u, u_dot, _), (n, turning) = robot.rods(state.links), robot.rod_rates(state)
        lever = robot.geometry.rod_length * np.cos(u)
        sign = -1.0 if robot.printed else 1.0
        M_s_up = k_s * state.tool_velocity[:, 5:]                              # Eq. (9)
        M_s_n, M_r_n = -k_s * np.sum(turning * n, axis=2), -k_r * u_dot        # Eq. (9)
        slides = sign * M_s_up / lever                                         # Eq. (13)
        lifts = sign * (M_s_n + M_r_n) / lever                                 # Eq. (13)
        return np.concatenate((slides, lifts), axis=1)
