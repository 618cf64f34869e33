# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS in Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from oracles.closed_chain import ClosedChain

UP = np.array([0.0, 0.0, 1.0])
ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioRobot(ClosedChain):
    """Trees built joint by joint; kinematics, Jacobians and Newton-Euler by Pinocchio."""

    def __init__(self, robot) -> None:
        super().__init__(robot)
        self.model = pin.Model()
        self.model.gravity.linear = np.array(robot.gravity)
        self.tips, self.points, self.lifts, self.rods = [], [], [], []
        self._add_platform()
        for i in range(3):
            self._add_chain(i)
        self.data = self.model.createData()
        self.configuration = pin.neutral(self.model)

    def _add_platform(self) -> None:
        geometry, masses = self.robot.geometry, self.robot.masses
        self.platform = self.model.addJoint(
            0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'platform')
        xx, yy, zz, xy, xz, yz = masses.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        self.model.appendBodyToJoint(self.platform, pin.Inertia(
            masses.platform + masses.payload, np.array(masses.centre), tensor),
            pin.SE3.Identity())
        for i, angle in enumerate(geometry.platform_angles):
            point = geometry.platform_radius * np.array([np.cos(angle), np.sin(angle), 0.0])
            self.points.append(self._add_point(f'point_{i}', self.platform, point))

    def _add_chain(self, i: int) -> None:
        geometry, masses = self.robot.geometry, self.robot.masses
        angle, length = geometry.chain_angles[i], geometry.rod_length
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        tangential = np.array([-np.sin(angle), np.cos(angle), 0.0])
        place = pin.SE3(np.eye(3), geometry.base_radius * radial)
        slide = self.model.addJoint(
            0, pin.JointModelPrismaticUnaligned(tangential), place, f'slide_{i}')
        lift = self.model.addJoint(
            slide, pin.JointModelPrismaticUnaligned(UP), pin.SE3.Identity(), f'lift_{i}')
        rod = self.model.addJoint(
            lift, pin.JointModelRevoluteUnaligned(tangential), pin.SE3.Identity(), f'rod_{i}')
        thin = masses.rods[i] * length ** 2 / 12 * np.diag([1.0, 1.0, 0.0])
        for joint, mass, centre, tensor in (
                (slide, masses.slides[i], np.zeros(3), np.zeros((3, 3))),
                (lift, masses.lifts[i], np.zeros(3), np.zeros((3, 3))),
                (rod, masses.rods[i], length / 2 * UP, thin)):
            self.model.appendBodyToJoint(
                joint, pin.Inertia(mass, centre, tensor), pin.SE3.Identity())
        self.lifts.append(lift)
        self.rods.append(rod)
        self.tips.append(self._add_point(f'tip_{i}', rod, length * UP))

    def _add_point(self, name, joint, position) -> int:
        return self.model.addFrame(pin.Frame(
            name, joint, 0, pin.SE3(np.eye(3), position), pin.FrameType.OP_FRAME))

    def place(self, position, quaternion, chains) -> None:
        self.configuration = np.concatenate((position, quaternion, chains))
        pin.computeJointJacobians(self.model, self.data, self.configuration)
        pin.updateFramePlacements(self.model, self.data)

    def gaps(self) -> np.ndarray:
        return np.concatenate([
            self.data.oMf[tip].translation - self.data.oMf[point].translation
            for tip, point in zip(self.tips, self.points, strict=True)])

    def gap_jacobian(self) -> np.ndarray:
        return np.concatenate([
            pin.getFrameJacobian(self.model, self.data, tip, ALIGNED)[:3]
            - pin.getFrameJacobian(self.model, self.data, point, ALIGNED)[:3]
            for tip, point in zip(self.tips, self.points, strict=True)])

    def platform_velocity(self, v, omega) -> np.ndarray:
        R = self._platform_rotation()
        return np.concatenate((R.T @ v, R.T @ omega))

    def platform_acceleration(self, v, omega, a, epsilon) -> np.ndarray:
        # A spatial acceleration: what the classical one lacks is omega x v.
        R = self._platform_rotation()
        return np.concatenate((R.T @ (a - np.cross(omega, v)), R.T @ epsilon))

    def gap_drift(self, velocity) -> np.ndarray:
        pin.forwardKinematics(
            self.model, self.data, self.configuration, velocity, np.zeros(self.model.nv))
        return np.concatenate([
            self._acceleration(tip) - self._acceleration(point)
            for tip, point in zip(self.tips, self.points, strict=True)])

    def inverse_dynamics(self, velocity, acceleration) -> np.ndarray:
        return pin.rnea(
            self.model, self.data, self.configuration, velocity, acceleration).copy()

    def joint_rates(self) -> tuple[np.ndarray, np.ndarray]:
        platform = self._spin_jacobian(self.platform)
        rods = np.array([self._spin_jacobian(rod) for rod in self.rods])
        lifts = np.array([self._spin_jacobian(lift) for lift in self.lifts])
        return rods - lifts, rods - platform

    def _platform_rotation(self) -> np.ndarray:
        return self.data.oMi[self.platform].rotation

    def _acceleration(self, frame) -> np.ndarray:
        return pin.getFrameClassicalAcceleration(self.model, self.data, frame, ALIGNED).linear

    def _spin_jacobian(self, joint) -> np.ndarray:
        return pin.getJointJacobian(self.model, self.data, joint, ALIGNED)[3:]
