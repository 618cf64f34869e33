# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS in MuJoCo, which shares no kinematics with the package.

The mechanism is cut at its three spherical joints into four trees: the free platform, and three
chains slide-lift-hinge. MuJoCo supplies kinematics, Jacobians and inverse dynamics of the trees;
here Newton's method closes the cuts, and d'Alembert's principle projects forces onto the drives.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

UP = np.array([0.0, 0.0, 1.0])
# Positions of half a metre carry rounding errors of a few 1e-16 m.
CLOSURE_TOLERANCE = 2e-15
MAXIMUM_STEPS = 30
HINGES = np.array([2, 5, 8])
DRIVES = np.array([0, 3, 6, 1, 4, 7])  # slides, then lifts, among (slide, lift, hinge) x 3


@dataclass
class OracleForces:
    """What an engine says about N states.

    Parameters
    ----------
    force : (N, 6) array
        Frictionless drive forces [N].
    passive : (N, 6) array
        Drive forces against viscous friction of the passive joints [N].
    position, velocity, acceleration : (N, 6) arrays
        Of the drives [m, m/s, m/s^2].
    """

    force: np.ndarray
    passive: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class MujocoRobot:
    """A 3-PPRS cut at the spherical joints.

    Velocity coordinates are the platform's six, then (slide, lift, hinge) per chain. A hinge angle
    of 0 is a rod that points up, pi one that points down.
    """

    def __init__(self, robot) -> None:
        self.robot = robot
        self.model = trees(robot).compile()
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
        """Return rod tips minus platform points, (9,) [m]."""
        return (self.data.site_xpos[self.tips] - self.data.site_xpos[self.points]).ravel()

    def gap_jacobian(self) -> np.ndarray:
        """Return the derivative of `gaps` with respect to the velocities, (9, 15)."""
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
        """Return the second derivative of `gaps` at zero acceleration, (9,)."""
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
        """Return Jacobians (3, 3, 15) of rod against lift, and of rod against platform."""
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

    def solve(self, motion, c_revolute=0.0, c_spherical=0.0) -> OracleForces:
        """Return forces and drive motion for every sample of a platform motion."""
        rows = [self._solve_one(motion, sample, c_revolute, c_spherical)
                for sample in range(len(motion.position))]
        return OracleForces(*(np.array(column) for column in zip(*rows, strict=True)))

    def _solve_one(self, motion, sample, c_revolute, c_spherical):
        P, quaternion = motion.position[sample], motion.orientation[sample]
        v, omega = motion.linear_velocity[sample], motion.angular_velocity[sample]
        a, epsilon = motion.linear_acceleration[sample], motion.angular_acceleration[sample]
        chains = self._close(P, quaternion)
        gap_jacobian = self.gap_jacobian()
        of_platform, of_chains = gap_jacobian[:, :6], gap_jacobian[:, 6:]
        follow = -np.linalg.solve(of_chains, of_platform)  # chain velocities per platform velocity
        platform = self.platform_velocity(v, omega)
        velocity = np.concatenate((platform, follow @ platform))
        platform = self.platform_acceleration(v, omega, a, epsilon)
        drift = np.linalg.solve(of_chains, self.gap_drift(velocity))
        acceleration = np.concatenate((platform, follow @ platform - drift))
        # All velocities per drive velocity: the rows of the drives form the unit matrix.
        all_per_platform = np.concatenate((np.eye(6), follow))
        force = self.inverse_dynamics(velocity, acceleration)
        revolute, spherical = self.joint_rates()
        damping = (c_revolute * np.einsum('ckv,ckw->vw', revolute, revolute)
                   + c_spherical * np.einsum('ckv,ckw->vw', spherical, spherical)) @ velocity
        projected = np.linalg.solve(
            follow[DRIVES].T, all_per_platform.T @ np.stack((force, damping), axis=1))
        chain_velocity, chain_acceleration = velocity[6:], acceleration[6:]
        return (projected[:, 0], projected[:, 1], chains[DRIVES], chain_velocity[DRIVES],
                chain_acceleration[DRIVES])

    def _close(self, position, quaternion) -> np.ndarray:
        """Move the chains until their tips meet the platform, and leave the engine there."""
        geometry = self.robot.geometry
        up = geometry.elbow == 'up'
        chains = np.zeros(9)
        chains[1::3] = position[2] - (1 if up else -1) * geometry.rod_length
        chains[HINGES] = 0.0 if up else np.pi
        best, best_chains = np.inf, chains
        for _ in range(MAXIMUM_STEPS):
            self.place(position, quaternion, chains)
            gaps = self.gaps()
            size = np.abs(gaps).max()
            if size >= best and best < CLOSURE_TOLERANCE:
                break  # only rounding is left
            if size < best:
                best, best_chains = size, chains.copy()
            chains = chains - np.linalg.solve(self.gap_jacobian()[:, 6:], gaps)
        assert best < CLOSURE_TOLERANCE, f'the engine did not close its chains: {best} m'
        leaning = np.cos(best_chains[HINGES])
        assert np.all(leaning > 0 if up else leaning < 0), 'the engine closed the other elbow'
        self.place(position, quaternion, best_chains)
        return best_chains


def trees(robot) -> mujoco.MjSpec:
    """Return the four trees."""
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
