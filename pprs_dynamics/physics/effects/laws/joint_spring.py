# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Springs in passive joints: k (q - q_0), q an angle, or the position of a slide."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.physics.effects.effect import Parameter, Product
from pprs_dynamics.physics.effects.laws.drive_spring import FARTHEST
from pprs_dynamics.physics.effects.structure_effect import BodyEffect, OfPlace
from pprs_dynamics.physics.mechanism.state import MechanismState, StructureLoad


class JointSpring(BodyEffect):
    """A spring between the links of a passive joint; what is fitted is k q + M with M = -k q_0.

    On a 3-PPRS in its joints C_i, between lift and rod, alike in all chains.

    Equation
    --------
    tau -> tau + T' k (q - q_0), of one passive joint; of a 3-PPRS of all C_i

    Symptom
    -------
    Errors of several drives at once, in the proportions in which they move the joint, that
    follow its position whatever the speed. They are the same at every pass through a pose, in
    both directions.

    Causes
    ------
    Flexures in place of bearings, a cable loom or hose across the joint, a seal or boot that
    is deformed.

    Confirmation
    ------------
    Free the loom or take off the boot and repeat. Move slowly: the error must stay.

    References
    ----------
    Howell, Compliant Mechanisms, 2001.
    """

    name = 'joint_spring'
    is_of_one_place = True
    linear = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.unphysical_below = {f'{joint}.stiffness': 0.0 for joint, _ in cls.places}

    @classmethod
    def bound(cls, robot: Any) -> Any:
        """Return the effect in the passive joints of a robot that have a position."""
        return cls.at_places(
            tuple((joint.name, joint.turns) for joint in robot.passive_joints
                  if joint.has_position), robot.alike_joints)

    @classmethod
    def of_place(cls, place: Any, is_alike: bool, moved: float) -> OfPlace:
        """Return the parameters of a joint; of alike joints the first is tried."""
        joint, turns = place
        units = DriveUnits(turns)
        stiffness = Parameter(f'{joint}.stiffness', 'k', units.of('N/m'), f'stiffness in {joint}',
                              -1e6, 1e6, 0.0, scale=0.1)
        moment = Parameter(f'{joint}.moment', 'M', units.effort,
                           f'what it does at position 0 of {joint}, -k q_0', -1e6, 1e6, 0.0,
                           scale=0.1)
        position = Parameter(f'{joint}.position', 'q_0', units.position,
                             f'position of {joint} at which it is slack', -FARTHEST, FARTHEST, 0.0,
                             scale=0.1, product=Product(moment, stiffness.name, sign=-1.0,
                                                        farthest=FARTHEST))
        return (stiffness, position), () if is_alike else ((stiffness.name, moment.name),)

    def load(self, state: MechanismState) -> StructureLoad:
        """Return k q + M in each joint."""
        torques = {}
        for joint, _ in self.places:
            k, moment = self.exact[f'{joint}.stiffness'], self.exact[f'{joint}.moment']
            if k or moment:
                for name in state.robot.joints_of(joint):
                    torques[name] = k * state.joint_position(name) + moment
        return StructureLoad(np.zeros((len(state.velocity), 6)), torques)
