# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A serial arm: torques of its joints without friction, by Pinocchio.

References
----------
J. Carpentier et al., The Pinocchio C++ library, IEEE/SICE SII, 2019.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.reversal import Reversal, smooth_sign
from pprs_dynamics.physics.mechanism.urdf import ArmTree, pinocchio
from pprs_dynamics.physics.three_pprs.rigid_body import StructureLoad


@dataclass(frozen=True, eq=False)
class Arm:
    """The bodies of an arm.

    Parameters
    ----------
    tree : ArmTree
    inertial : (n, 10) array
        Inertial parameters of the links in the order of Pinocchio: m, m c, and the inertia xx xy
        yy xz yz zz about the joint's origin, in the joint's frame [kg, kg m, kg m^2].
    armature : (n,) array
        Inertia of the rotors, seen at the joints [kg m^2, kg].
    gravity : (3,) sequence
        In the base's frame [m/s^2].
    """

    tree: ArmTree
    inertial: Array
    armature: Array
    gravity: tuple[float, float, float]

    @property
    def masses(self) -> Array:
        """Of the links [kg], (n,)."""
        masses: Array = self.inertial[:, 0]
        return masses

    def with_payload(self, mass: float = 0.0, moment: tuple[float, ...] = (0.0,) * 3,
                     inertia: tuple[float, ...] = (0.0,) * 6) -> Arm:
        """Return the arm with more at the tool.

        Parameters
        ----------
        mass : float
            A point at the tool's origin [kg].
        moment : (3,)
            First moment about the tool's origin, in the tool's axes [kg m].
        inertia : (6,)
            xx yy zz xy xz yz about the tool's origin, in its axes [kg m^2].
        """
        xx, yy, zz, xy, xz, yz = inertia
        library, tree = pinocchio(), self.tree
        added = np.array([mass, *moment, xx, xy, yy, xz, yz, zz])
        frame = tree.model.frames[tree.tool]
        at_tool = library.PseudoInertia.FromDynamicParameters(added).toMatrix()
        T = frame.placement.homogeneous
        at_joint = library.PseudoInertia.FromMatrix(T @ at_tool @ T.T).toDynamicParameters()
        inertial = self.inertial.copy()
        inertial[tree.carrier] += at_joint
        return replace(self, inertial=inertial)

    @cached_property
    def model(self) -> Any:
        """Pinocchio's model of these bodies."""
        library, tree = pinocchio(), self.tree
        model = tree.model.copy()
        for name, parameters in zip(tree.joints, self.inertial, strict=True):
            model.inertias[model.getJointId(name)] = (
                library.Inertia.FromDynamicParameters(parameters))
        armature = np.zeros(len(tree.joints))
        armature[tree.order] = self.armature
        model.armature = armature
        rotation = model.frames[tree.base].placement.rotation
        model.gravity.linear = rotation @ np.asarray(self.gravity)
        return model

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the torques that move the bodies, (N, n) [N m, N]; all (N, n)."""
        library, model, order = pinocchio(), self.model, self.tree.order
        data, rnea = model.createData(), library.rnea
        back = np.argsort(order)
        q, v, a = (np.ascontiguousarray(values[:, back])
                   for values in (position, velocity, acceleration))
        found = np.empty_like(q)
        for k in range(len(q)):
            found[k] = rnea(model, data, q[k], v[k], a[k])
        return found[:, order]

    def regressor(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Return the derivatives of the torques by `inertial`, (N, n, 10 n)."""
        library, model, order = pinocchio(), self.model, self.tree.order
        data, back = model.createData(), np.argsort(order)
        count = len(order)
        found = np.empty((len(position), count, 10 * count))
        for k, (q, v, a) in enumerate(zip(position[:, back], velocity[:, back],
                                          acceleration[:, back], strict=True)):
            found[k] = library.computeJointTorqueRegressor(model, data, q, v, a)
        blocks = found.reshape(len(position), count, count, 10)
        # Bodies of Pinocchio stand in the order of its joints.
        bodies = np.array([model.getJointId(name) for name in self.tree.joints]) - 1
        return blocks[:, order][:, :, bodies].reshape(len(position), count, 10 * count)

    def tool_positions(self, position: Array) -> Array:
        """Return where the tool is in the base's frame, (N, 3) [m]."""
        library, model, tree = pinocchio(), self.model, self.tree
        data, back = model.createData(), np.argsort(tree.order)
        base = model.frames[tree.base].placement
        found = np.empty((len(position), 3))
        for k, q in enumerate(position[:, back]):
            library.forwardKinematics(model, data, q)
            found[k] = library.updateFramePlacement(model, data, tree.tool).translation
        placed: Array = (found - base.translation) @ base.rotation
        return placed

    def wrench_torques(self, position: Array, wrench: Array) -> Array:
        """Return the torques of wrenches that the tool applies, (N, n) [N m, N].

        Parameters
        ----------
        position : (N, n) array
        wrench : (N, 6) array
            Force [N] and moment about the tool's origin [N m], in the base's axes.
        """
        library, model, tree = pinocchio(), self.model, self.tree
        data, back = model.createData(), np.argsort(tree.order)
        turn = model.frames[tree.base].placement.rotation
        found = np.empty_like(position)
        for k, q in enumerate(position[:, back]):
            J = library.computeFrameJacobian(model, data, q, tree.tool,
                                             library.LOCAL_WORLD_ALIGNED)
            found[k] = (J.T @ np.concatenate((turn @ wrench[k, :3], turn @ wrench[k, 3:])))[
                tree.order]
        return found


@dataclass(frozen=True, eq=False)
class ArmState(JointMotion):
    """A motion of an arm with the quantities that effects take, (N, n) each."""

    robot: Arm = field(kw_only=True)
    reversal: Reversal = field(default_factory=Reversal, kw_only=True)
    load: StructureLoad | None = field(default=None, kw_only=True)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.robot.tree.joints

    @cached_property
    def direction(self) -> Array:
        """Sign of the velocity, sgn, turning over within the reversal velocity."""
        direction: Array = smooth_sign(self.velocity, np.asarray(self.reversal.velocity))
        return direction

    @cached_property
    def rigid_force(self) -> Array:
        """Torques without friction [N m, N]."""
        torques = self.robot.torques(self.position, self.velocity, self.acceleration)
        if self.load is not None:
            torques = torques + self.robot.wrench_torques(self.position, self.load.wrench)
        return torques

    @cached_property
    def guide_load(self) -> Array:
        """What a joint's gear carries: the size of its torque without friction [N m, N]."""
        return np.abs(self.rigid_force)

    def loaded(self, robot: Arm, load: StructureLoad | None = None) -> ArmState:
        """Return a state of this motion with other bodies, and with an additional load."""
        if load is None:
            load = self.load
        elif self.load is not None:
            load = self.load + load
        return replace(self, robot=robot, load=load)
