# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS in Pinocchio and in MuJoCo, as someone would program it who wants it fast.

Both engines know trees only: the mechanism is cut at the spherical joints into the platform and
three chains slide-lift-rod. Inverse kinematics is analytic, one call of the engine's inverse
dynamics gives the generalised forces of the trees, and one linear solve brings those of platform
and rods to the drives. There is no friction.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from random_states import masses_of

from pprs_dynamics import PlatformMotion
from pprs_dynamics.physics.three_pprs.robot import ThreePprs

SLIDES, LIFTS, RODS = slice(6, 15, 3), slice(7, 15, 3), slice(8, 15, 3)


class Peer:
    """Analytic inverse kinematics and the way from the trees' forces to the drives'."""

    def __init__(self, robot: ThreePprs) -> None:
        geometry = robot.geometry
        self.R, self.l, self.elbow = (geometry.base_radius, geometry.rod_length,
                                      geometry.elbow_sign)
        self.chains = [
            (math.cos(delta), math.sin(delta), geometry.platform_radius * math.cos(point),
             geometry.platform_radius * math.sin(point))
            for delta, point in zip(geometry.chain_angles, geometry.platform_angles, strict=True)]
        # The same for all chains at once, to broadcast over samples.
        self.cos, self.sin, self.x, self.y = np.array(self.chains).T

    def forces_of_sample(self, P: Any, quaternion: Any, v: Any, omega: Any, a: Any,
                         epsilon: Any) -> np.ndarray:
        """Return the six drive forces of one sample; every argument is an array."""
        x, y, z, w = quaternion.tolist()
        rotation = (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))
        R11, R12, _, R21, R22, _, R31, R32, _ = rotation
        P1, P2, P3 = P.tolist()
        v1, v2, v3 = v.tolist()
        w1, w2, w3 = omega.tolist()
        a1, a2, a3 = a.tolist()
        e1, e2, e3 = epsilon.tolist()
        l, sqrt, atan2 = self.l, math.sqrt, math.atan2  # noqa: E741
        q, q_dot, q_ddot, slides, lifts, rods = [], [], [], [], [], []
        for c, s, px, py in self.chains:
            r1, r2, r3 = R11 * px + R12 * py, R21 * px + R22 * py, R31 * px + R32 * py
            A1, A2, A3 = P1 + r1, P2 + r2, P3 + r3
            s1, s2, s3 = w2 * r3 - w3 * r2, w3 * r1 - w1 * r3, w1 * r2 - w2 * r1
            V1, V2, V3 = v1 + s1, v2 + s2, v3 + s3
            X1 = a1 + e2 * r3 - e3 * r2 + w2 * s3 - w3 * s2
            X2 = a2 + e3 * r1 - e1 * r3 + w3 * s1 - w1 * s3
            X3 = a3 + e1 * r2 - e2 * r1 + w1 * s2 - w2 * s1
            cu = (self.R - A1 * c - A2 * s) / l
            su = self.elbow * sqrt(1 - cu * cu)
            u_dot = (V1 * c + V2 * s) / (l * su)
            u_ddot = ((X1 * c + X2 * s) / l - cu * u_dot * u_dot) / su
            q += (A2 * c - A1 * s, A3 - l * su, atan2(-cu, su))
            q_dot += (V2 * c - V1 * s, V3 - l * cu * u_dot, u_dot)
            q_ddot += (X2 * c - X1 * s, X3 - l * (cu * u_ddot - su * u_dot * u_dot), u_ddot)
            # Rows of velocities per twist of the platform: n . v_A, then e . v_A / (l sin u).
            slides.append((-s, c, 0.0, -r3 * c, -r3 * s, r1 * c + r2 * s))
            share = 1 / (l * su)
            row = (c * share, s * share, 0.0, -r3 * s * share, r3 * c * share,
                   (r1 * s - r2 * c) * share)
            rods.append(row)
            k = -l * cu
            lifts.append((k * row[0], k * row[1], 1.0, r2 + k * row[3], k * row[4] - r1,
                          k * row[5]))
        forces = self.trees(P, quaternion, rotation, (v1, v2, v3), (w1, w2, w3), (a1, a2, a3),
                            (e1, e2, e3), q, q_dot, q_ddot)
        follow = np.array(slides + lifts)
        on_platform = self.in_base(rotation, forces) + forces[RODS] @ np.array(rods)
        drives = np.linalg.solve(follow.T, on_platform)
        drives[:3] += forces[SLIDES]
        drives[3:] += forces[LIFTS]
        return drives

    def kinematics(self, motion: PlatformMotion) -> tuple[np.ndarray, ...]:
        """Return chain coordinates and rates (N, 3, 3), and rows of the drives and rods."""
        c, s, l = self.cos, self.sin, self.l  # noqa: E741
        rotation = motion.rotation
        rho = rotation[..., :2] @ np.stack((self.x, self.y))  # (N, 3 components, 3 chains)
        r1, r2, r3 = rho[:, 0], rho[:, 1], rho[:, 2]
        w1, w2, w3 = (column[:, None] for column in motion.angular_velocity.T)
        e1, e2, e3 = (column[:, None] for column in motion.angular_acceleration.T)
        A = motion.position[:, :, None] + rho
        s1, s2, s3 = w2 * r3 - w3 * r2, w3 * r1 - w1 * r3, w1 * r2 - w2 * r1
        V1, V2, V3 = (motion.linear_velocity[:, k, None] + part for k, part in
                      enumerate((s1, s2, s3)))
        X1, X2, X3 = (motion.linear_acceleration[:, k, None] + part for k, part in enumerate((
            e2 * r3 - e3 * r2 + w2 * s3 - w3 * s2, e3 * r1 - e1 * r3 + w3 * s1 - w1 * s3,
            e1 * r2 - e2 * r1 + w1 * s2 - w2 * s1)))
        cu = (self.R - A[:, 0] * c - A[:, 1] * s) / l
        su = self.elbow * np.sqrt(1 - cu * cu)
        u_dot = (V1 * c + V2 * s) / (l * su)
        u_ddot = ((X1 * c + X2 * s) / l - cu * u_dot * u_dot) / su
        q = np.stack((A[:, 1] * c - A[:, 0] * s, A[:, 2] - l * su, np.arctan2(-cu, su)), axis=-1)
        q_dot = np.stack((V2 * c - V1 * s, V3 - l * cu * u_dot, u_dot), axis=-1)
        q_ddot = np.stack((X2 * c - X1 * s, X3 - l * (cu * u_ddot - su * u_dot * u_dot), u_ddot),
                          axis=-1)
        follow, rods = np.zeros((len(cu), 6, 6)), np.zeros((len(cu), 3, 6))
        follow[:, :3, 0], follow[:, :3, 1] = -s, c
        follow[:, :3, 3], follow[:, :3, 4] = -r3 * c, -r3 * s
        follow[:, :3, 5] = r1 * c + r2 * s
        share = 1 / (l * su)
        rods[:, :, 0], rods[:, :, 1] = c * share, s * share
        rods[:, :, 3], rods[:, :, 4] = -r3 * s * share, r3 * c * share
        rods[:, :, 5] = (r1 * s - r2 * c) * share
        follow[:, 3:] = (-l * cu)[..., None] * rods
        follow[:, 3:, 2] += 1.0
        follow[:, 3:, 3] += r2
        follow[:, 3:, 4] -= r1
        return rotation, q, q_dot, q_ddot, follow, rods

    def many(self, motion: PlatformMotion) -> np.ndarray:
        """Return the drive forces of many samples, (N, 6)."""
        rotation, q, q_dot, q_ddot, follow, rods = self.kinematics(motion)
        forces = self.all_trees(motion, rotation, q, q_dot, q_ddot)
        on_platform = self.all_in_base(rotation, forces) + np.einsum(
            'ni,nij->nj', forces[:, RODS], rods)
        drives = np.linalg.solve(np.swapaxes(follow, 1, 2), on_platform[..., None])[..., 0]
        drives[:, :3] += forces[:, SLIDES]
        drives[:, 3:] += forces[:, LIFTS]
        return drives


def pinocchio_trees(robot: ThreePprs) -> Any:
    """Return the platform and three chains slide-lift-rod, each with its bodies."""
    geometry, masses = robot.geometry, masses_of(robot)
    model, up = pin.Model(), np.array([0.0, 0.0, 1.0])
    model.gravity.linear = np.array(robot.gravity)

    def add(joint: int, mass: float, centre: np.ndarray, inertia: np.ndarray) -> None:
        model.appendBodyToJoint(joint, pin.Inertia(mass, centre, inertia), pin.SE3.Identity())

    xx, yy, zz, xy, xz, yz = masses.inertia
    platform = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'platform')
    add(platform, masses.platform + masses.payload, np.array(masses.centre),
        np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    for i, angle in enumerate(geometry.chain_angles):
        radial = np.array([np.cos(angle), np.sin(angle), 0.0])
        along = np.array([-np.sin(angle), np.cos(angle), 0.0])
        slide = model.addJoint(0, pin.JointModelPrismaticUnaligned(along),
                               pin.SE3(np.eye(3), geometry.base_radius * radial), f'slide_{i}')
        lift = model.addJoint(slide, pin.JointModelPrismaticUnaligned(up), pin.SE3.Identity(),
                              f'lift_{i}')
        rod = model.addJoint(lift, pin.JointModelRevoluteUnaligned(along), pin.SE3.Identity(),
                             f'rod_{i}')
        length = geometry.rod_length
        add(slide, masses.slides[i], np.zeros(3), np.zeros((3, 3)))
        add(lift, masses.lifts[i], np.zeros(3), np.zeros((3, 3)))
        add(rod, masses.rods[i], length / 2 * up,
            masses.rods[i] * length ** 2 / 12 * np.diag([1.0, 1.0, 0.0]))
    return model


def mujoco_trees(robot: ThreePprs) -> Any:
    """Return the platform and three chains slide-lift-rod, for MuJoCo's compiler."""
    geometry, masses = robot.geometry, masses_of(robot)
    spec, up = mujoco.MjSpec(), np.array([0.0, 0.0, 1.0])
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
        lift.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=up)
        length = geometry.rod_length
        transverse = masses.rods[i] * length ** 2 / 12
        # The rod never turns about its own axis: a thin rod's 0 there becomes any small number.
        rod = lift.add_body(
            name=f'rod_{i}', mass=masses.rods[i], ipos=length / 2 * up,
            inertia=(transverse, transverse, 1e-3 * transverse), explicitinertial=True)
        rod.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=tangential)
        rod.add_site(name=f'tip_{i}', pos=length * up)
    return spec


class PinocchioPeer(Peer):
    """One `rnea` per sample; in batches one call for all."""

    name = 'Pinocchio'

    def __init__(self, robot: ThreePprs) -> None:
        super().__init__(robot)
        self.model = pinocchio_trees(robot)
        self.data = self.model.createData()
        self.pool = pin.ModelPool(self.model, 1) if hasattr(pin, 'ModelPool') else None

    def trees(self, P, quaternion, R, v, omega, a, epsilon, q, q_dot, q_ddot) -> np.ndarray:
        (v1, v2, v3), (w1, w2, w3), (a1, a2, a3), (e1, e2, e3) = v, omega, a, epsilon
        R11, R12, R13, R21, R22, R23, R31, R32, R33 = R
        # Spatial acceleration, and everything in the platform's frame.
        a1, a2, a3 = a1 - w2 * v3 + w3 * v2, a2 - w3 * v1 + w1 * v3, a3 - w1 * v2 + w2 * v1
        velocity = np.array([
            R11 * v1 + R21 * v2 + R31 * v3, R12 * v1 + R22 * v2 + R32 * v3,
            R13 * v1 + R23 * v2 + R33 * v3, R11 * w1 + R21 * w2 + R31 * w3,
            R12 * w1 + R22 * w2 + R32 * w3, R13 * w1 + R23 * w2 + R33 * w3, *q_dot])
        acceleration = np.array([
            R11 * a1 + R21 * a2 + R31 * a3, R12 * a1 + R22 * a2 + R32 * a3,
            R13 * a1 + R23 * a2 + R33 * a3, R11 * e1 + R21 * e2 + R31 * e3,
            R12 * e1 + R22 * e2 + R32 * e3, R13 * e1 + R23 * e2 + R33 * e3, *q_ddot])
        forces: np.ndarray = pin.rnea(
            self.model, self.data, np.concatenate((P, quaternion, q)), velocity, acceleration)
        return forces

    def in_base(self, R, forces) -> np.ndarray:
        f1, f2, f3, m1, m2, m3 = forces[:6].tolist()
        R11, R12, R13, R21, R22, R23, R31, R32, R33 = R
        return np.array([
            R11 * f1 + R12 * f2 + R13 * f3, R21 * f1 + R22 * f2 + R23 * f3,
            R31 * f1 + R32 * f2 + R33 * f3, R11 * m1 + R12 * m2 + R13 * m3,
            R21 * m1 + R22 * m2 + R23 * m3, R31 * m1 + R32 * m2 + R33 * m3])

    def all_trees(self, motion, rotation, q, q_dot, q_ddot) -> np.ndarray:
        n, back = len(q), np.swapaxes(rotation, 1, 2)
        v, omega, a, epsilon = (
            motion.linear_velocity, motion.angular_velocity, motion.linear_acceleration,
            motion.angular_acceleration)
        spatial = a - np.cross(omega, v)
        platform = back @ np.stack((v, omega, spatial, epsilon), axis=-1)
        # Columns are samples, in memory one after another.
        configuration, velocity, acceleration = (
            np.asfortranarray(np.concatenate(parts, axis=1).T) for parts in (
                (motion.position, motion.orientation, q.reshape(n, 9)),
                (platform[:, :, 0], platform[:, :, 1], q_dot.reshape(n, 9)),
                (platform[:, :, 2], platform[:, :, 3], q_ddot.reshape(n, 9))))
        if self.pool is not None:
            forces = np.empty((15, n), order='F')
            pin.rneaInParallel(1, self.pool, configuration, velocity, acceleration, forces)
            return forces.T
        rnea, model, data = pin.rnea, self.model, self.data
        return np.array([rnea(model, data, *row) for row in zip(
            configuration.T, velocity.T, acceleration.T, strict=True)])

    def all_in_base(self, rotation, forces) -> np.ndarray:
        both = rotation @ np.swapaxes(forces[:, :6].reshape(-1, 2, 3), 1, 2)
        turned: np.ndarray = np.swapaxes(both, 1, 2).reshape(-1, 6)
        return turned


class MujocoPeer(Peer):
    """One `mj_inverse` per sample; MuJoCo has no call for many."""

    name = 'MuJoCo'

    def __init__(self, robot: ThreePprs) -> None:
        super().__init__(robot)
        spec = mujoco_trees(robot)
        # Nothing here but the bodies: no contacts, no limits, no sensors to look for.
        spec.option.disableflags |= (mujoco.mjtDisableBit.mjDSBL_CONTACT
                                     | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.qpos, self.qvel, self.qacc = self.data.qpos, self.data.qvel, self.data.qacc
        self.result = self.data.qfrc_inverse

    def trees(self, P, quaternion, R, v, omega, a, epsilon, q, q_dot, q_ddot) -> np.ndarray:
        (w1, w2, w3), (e1, e2, e3) = omega, epsilon
        R11, R12, R13, R21, R22, R23, R31, R32, R33 = R
        x, y, z, w = quaternion.tolist()
        self.qpos[:] = [*P.tolist(), w, x, y, z, *q]
        # Angular rates of a free body are in its own frame, linear ones in the world's.
        self.qvel[:] = [*v, R11 * w1 + R21 * w2 + R31 * w3, R12 * w1 + R22 * w2 + R32 * w3,
                        R13 * w1 + R23 * w2 + R33 * w3, *q_dot]
        self.qacc[:] = [*a, R11 * e1 + R21 * e2 + R31 * e3, R12 * e1 + R22 * e2 + R32 * e3,
                        R13 * e1 + R23 * e2 + R33 * e3, *q_ddot]
        mujoco.mj_inverse(self.model, self.data)
        return self.result

    def in_base(self, R, forces) -> np.ndarray:
        f1, f2, f3, m1, m2, m3 = forces[:6].tolist()
        R11, R12, R13, R21, R22, R23, R31, R32, R33 = R
        return np.array([f1, f2, f3, R11 * m1 + R12 * m2 + R13 * m3,
                         R21 * m1 + R22 * m2 + R23 * m3, R31 * m1 + R32 * m2 + R33 * m3])

    def all_trees(self, motion, rotation, q, q_dot, q_ddot) -> np.ndarray:
        n, back = len(q), np.swapaxes(rotation, 1, 2)
        turned = back @ np.stack((motion.angular_velocity, motion.angular_acceleration), axis=-1)
        x, y, z, w = motion.orientation.T
        configuration = np.concatenate((
            motion.position, np.stack((w, x, y, z), axis=1), q.reshape(n, 9)), axis=1)
        velocity = np.concatenate((
            motion.linear_velocity, turned[..., 0], q_dot.reshape(n, 9)), axis=1)
        acceleration = np.concatenate((
            motion.linear_acceleration, turned[..., 1], q_ddot.reshape(n, 9)), axis=1)
        forces = np.empty((n, 15))
        qpos, qvel, qacc, result = self.qpos, self.qvel, self.qacc, self.result
        inverse, model, data = mujoco.mj_inverse, self.model, self.data
        for row in range(n):
            qpos[:], qvel[:], qacc[:] = configuration[row], velocity[row], acceleration[row]
            inverse(model, data)
            forces[row] = result
        return forces

    def all_in_base(self, rotation, forces) -> np.ndarray:
        moment = (rotation @ forces[:, 3:6, None])[..., 0]
        return np.concatenate((forces[:, :3], moment), axis=1)
