# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np

from oracles.closed_chain import ClosedChain

UP = np.array([0.0, 0.0, 1.0])


class MujocoRobot(ClosedChain):
    """Trees built with MjSpec; kinematics, Jacobians and inverse dynamics by MuJoCo."""

    def __init__(self, robot) -> None:
        super().__init__(robot)
        self.model = _build(robot).compile()
        self.data = mujoco.MjData(self.model)
        names = [f'{kind}_{i}' for kind in ('tip', 'point') for i in range(3)]
        ids = [mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, name) for name in names]
        self.tips, self.points = ids[:3], ids[3:]
        self.bodies = {
            name: mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, name)
            for name in ('platform', *(f'{kind}_{i}' for kind in ('lift', 'rod')
                                       for i in range(3)))}

    def place(self, position, quaternion, chains) -> None:
        x, y, z, w = quaternion
        self.data.qpos[:] = np.concatenate((position, (w, x, y, z), chains))
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def gaps(self) -> np.ndarray:
        return (self.data.site_xpos[self.tips] - self.data.site_xpos[self.points]).ravel()

    def gap_jacobian(self) -> np.ndarray:
        return np.concatenate([
            self._site_jacobian(tip) - self._site_jacobian(point)
            for tip, point in zip(self.tips, self.points, strict=True)])

    def platform_velocity(self, v, omega) -> np.ndarray:
        # A free joint's angular velocity is in the body's frame, its linear one in the world's.
        return np.concatenate((v, self._platform_rotation().T @ omega))

    def platform_acceleration(self, v, omega, a, epsilon) -> np.ndarray:
        # d/dt (R^T omega) = R^T epsilon, as omega x omega = 0.
        return np.concatenate((a, self._platform_rotation().T @ epsilon))

    def gap_drift(self, velocity) -> np.ndarray:
        self.data.qvel[:] = velocity
        mujoco.mj_comVel(self.model, self.data)
        return np.concatenate([
            (self._site_jacobian_dot(tip) - self._site_jacobian_dot(point)) @ velocity
            for tip, point in zip(self.tips, self.points, strict=True)])

    def inverse_dynamics(self, velocity, acceleration) -> np.ndarray:
        self.data.qvel[:] = velocity
        self.data.qacc[:] = acceleration
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse.copy()

    def joint_rates(self) -> tuple[np.ndarray, np.ndarray]:
        platform = self._spin_jacobian('platform')
        rods = np.array([self._spin_jacobian(f'rod_{i}') for i in range(3)])
        lifts = np.array([self._spin_jacobian(f'lift_{i}') for i in range(3)])
        return rods - lifts, rods - platform

    def _platform_rotation(self) -> np.ndarray:
        return self.data.xmat[self.bodies['platform']].reshape(3, 3)

    def _site_jacobian(self, site) -> np.ndarray:
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, site)
        return jacobian

    def _site_jacobian_dot(self, site) -> np.ndarray:
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacDot(self.model, self.data, jacobian, None, self.data.site_xpos[site],
                         int(self.model.site_bodyid[site]))
        return jacobian

    def _spin_jacobian(self, body) -> np.ndarray:
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacBody(self.model, self.data, None, jacobian, self.bodies[body])
        return jacobian


def _build(robot) -> mujoco.MjSpec:
    geometry, masses = robot.geometry, robot.masses
    spec = mujoco.MjSpec()
    spec.option.gravity = robot.gravity
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    xx, yy, zz, xy, xz, yz = masses.inertia
    platform = spec.worldbody.add_body(
        name='platform', mass=masses.platform + masses.payload, ipos=masses.centre,
        fullinertia=(xx, yy, zz, xy, xz, yz), explicitinertial=True)
    platform.add_freejoint()
    for i, angle in enumerate(geometry.platform_angles):
        point = geometry.platform_radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        platform.add_site(name=f'point_{i}', pos=point)
    for i, angle in enumerate(geometry.chain_angles):
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        tangential = np.array([-np.sin(angle), np.cos(angle), 0.0])
        # Slides and lifts only translate: their inertia is needed by the compiler alone.
        slide = spec.worldbody.add_body(
            name=f'slide_{i}', pos=geometry.base_radius * radial, mass=masses.slides[i],
            inertia=(1e-3, 1e-3, 1e-3), explicitinertial=True)
        slide.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=tangential)
        lift = slide.add_body(
            name=f'lift_{i}', mass=masses.lifts[i], inertia=(1e-3, 1e-3, 1e-3),
            explicitinertial=True)
        lift.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=UP)
        length = geometry.rod_length
        transverse = masses.rods[i] * length ** 2 / 12
        # The rod never turns about its own axis: a thin rod's 0 there becomes any small number.
        rod = lift.add_body(
            name=f'rod_{i}', mass=masses.rods[i], ipos=length / 2 * UP,
            inertia=(transverse, transverse, 1e-3 * transverse), explicitinertial=True)
        rod.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=tangential)
        rod.add_site(name=f'tip_{i}', pos=length * UP)
    return spec
