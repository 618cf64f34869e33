# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random robots, random states within the workspace and a smooth motion, for all tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.physics.mechanism import evaluation
from pprs_dynamics.physics.mechanism.description import about_centre
from pprs_dynamics.physics.three_pprs.robot import Geometry, Masses, ThreePprs

ELBOWS = ('up', 'down')
REACH, TURN = 0.1, 0.2  # of the sampled workspace around home [m, rad]
# Largest velocities and accelerations of the platform, per component.
SPEED, RATE, ACCELERATION, ANGULAR_ACCELERATION = 1.0, 3.0, 5.0, 10.0


def home_position(elbow: str = 'up') -> np.ndarray:
    """Return the centre of the sampled workspace; mirrored in z for the elbow down."""
    return np.array([0.0, 0.0, 0.5 if elbow == 'up' else -0.5])


def random_robot(
    rng: np.random.Generator, elbow: str = 'up', gravity: Any = (0.0, 0.0, -9.81),
) -> ThreePprs:
    """Return a robot like the paper's in which no two chains are equal.

    Masses differ per chain, the centre of mass lies off o, the inertia tensor is full, and the
    lengths and angles are those of the paper only to about a tenth.
    """
    third = 2 * np.pi / 3 * np.arange(3)
    geometry = Geometry(
        0.15 * rng.uniform(0.9, 1.1), 0.10 * rng.uniform(0.9, 1.1), 0.30 * rng.uniform(0.95, 1.1),
        tuple(third + rng.uniform(-0.1, 0.1, 3)), tuple(third + rng.uniform(-0.1, 0.1, 3)), elbow)
    return ThreePprs.of(geometry, random_masses(rng), tuple(np.asarray(gravity, dtype=float)))


def random_masses(rng: np.random.Generator) -> Masses:
    """Return unequal masses, a full inertia tensor and a centre of mass off o."""
    # The inertia of any real body: trace(S) 1 - S of its second moments S.
    root = rng.normal(scale=0.05, size=(3, 3))
    moments = root @ root.T
    tensor = np.trace(moments) * np.eye(3) - moments
    inertia = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    return Masses(
        rng.uniform(0.5, 2), rng.uniform(0, 2), tuple(rng.uniform(0.2, 1, 3)),
        tuple(rng.uniform(0.2, 1, 3)), tuple(rng.uniform(0.05, 0.5, 3)),
        tuple(rng.uniform(-0.05, 0.05, 3)), tuple(float(element) for element in inertia))


def inverse_kinematics(geometry: Geometry, motion: PlatformMotion) -> JointMotion:
    """Return the motion of the drives that belongs to a platform motion."""
    return any_robot(geometry).drive_motion(motion)[0]


def any_robot(geometry: Geometry) -> ThreePprs:
    """Return a robot of a geometry."""
    return ThreePprs.of(geometry, random_masses(np.random.default_rng(0)))


def masses_of(robot: ThreePprs) -> Masses:
    """Return the masses of a robot, those of its payload with those of the platform."""
    mass, centre, inertia = about_centre(robot.inertial[-1])
    slides, lifts, rods = robot.masses[:-1].reshape(3, 3).tolist()
    return Masses(mass, 0.0, tuple(slides), tuple(lifts), tuple(rods), tuple(centre.tolist()),
                  tuple(map(float, (*np.diag(inertia), *inertia[np.triu_indices(3, 1)]))))


def paper_geometry(elbow: str = 'up') -> Geometry:
    """Return the paper's geometry with either elbow."""
    third = tuple(2 * np.pi / 3 * np.arange(3))
    return Geometry(0.15, 0.10, 0.30, third, third, elbow)


def random_poses(
    rng: np.random.Generator, count: int, elbow: str = 'up',
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (count, 3) and quaternions (count, 4) within the sampled workspace."""
    position = home_position(elbow) + rng.uniform(-REACH, REACH, (count, 3))
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = axis * rng.uniform(0, TURN, (count, 1))
    return position, Rotation.from_rotvec(turn).as_quat()


def random_motion(rng: np.random.Generator, count: int, elbow: str = 'up') -> PlatformMotion:
    """Return independent states: pose, twist and acceleration drawn for each sample."""
    position, orientation = random_poses(rng, count, elbow)
    v, omega, a, epsilon = (
        rng.uniform(-size, size, (count, 3))
        for size in (SPEED, RATE, ACCELERATION, ANGULAR_ACCELERATION))
    return PlatformMotion(position, orientation, v, omega, a, epsilon)


def smooth_motion(t: Any, elbow: str = 'up') -> PlatformMotion:
    """Return one smooth motion in closed form: sinusoids, and Rot = Rz(a) Ry(b)."""
    t = np.asarray(t)
    zero = np.zeros_like(t)
    x = np.stack((0.07 * np.sin(2 * t), 0.06 * np.cos(3 * t), 0.05 * np.sin(t + 1)), axis=1)
    v = np.stack((0.14 * np.cos(2 * t), -0.18 * np.sin(3 * t), 0.05 * np.cos(t + 1)), axis=1)
    acc = np.stack((-0.28 * np.sin(2 * t), -0.54 * np.cos(3 * t), -0.05 * np.sin(t + 1)), axis=1)
    a, a_dot, a_ddot = 0.15 * np.sin(2 * t), 0.3 * np.cos(2 * t), -0.6 * np.sin(2 * t)
    b, b_dot, b_ddot = 0.1 * np.cos(3 * t), -0.3 * np.sin(3 * t), -0.9 * np.cos(3 * t)
    z = np.stack((zero, zero, zero + 1), axis=1)
    y = np.stack((-np.sin(a), np.cos(a), zero), axis=1)  # Rz(a) applied to the y axis
    omega = a_dot[:, None] * z + b_dot[:, None] * y
    epsilon = (a_ddot[:, None] * z + b_ddot[:, None] * y
               + (a_dot * b_dot)[:, None] * np.cross(z, y))
    turn = Rotation.from_rotvec(a[:, None] * [0, 0, 1]) * Rotation.from_rotvec(
        b[:, None] * [0, 1, 0])
    return PlatformMotion(home_position(elbow) + x, turn.as_quat(), v, omega, acc, epsilon, t)


def robot_keys(robot: ThreePprs) -> dict[str, Any]:
    """Return the keys of a model file that describe `robot`."""
    keys: dict[str, Any] = {'gravity': robot.gravity}
    for group, part in (('geometry', robot.geometry), ('masses', masses_of(robot))):
        keys.update({f'{group}.{field.name}': getattr(part, field.name) for field in fields(part)})
    return keys


def paper_model(changes: Mapping[str, Any] | None = None) -> DriveModel:
    """Return the paper's model with some keys changed, e.g. {'equations': 'printed'}."""
    return DriveModel.from_parameters({**DriveModel.load().values, **(changes or {})})


# Random states lie nearer to singular poses than a robot would be allowed to go.
OPEN_LIMITS = {'limits.condition_number': 1e9, 'limits.rod_sine': 1e-6}


def model_of(robot: ThreePprs, changes: Mapping[str, Any] | None = None) -> DriveModel:
    """Return the paper's friction on another robot, without limits on conditioning."""
    return paper_model({**robot_keys(robot), **OPEN_LIMITS, **(changes or {})})


def without_compiler(function: Callable[[], Any]) -> Any:
    """Return what a function gives where no equations are compiled yet."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, '_compiled', {})
        with evaluation.not_compiling_yet():
            found = function()
        assert not evaluation._compiled
    return found
