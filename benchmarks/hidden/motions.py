# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random motions: sums of sines, of the platform within the robot's limits, and of an arm."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.paths import HOME

PERIODS = (5.0, 8.0, 10.0, 20.0)  # [s]
SINES = 8  # per degree of freedom
# Peaks of the drives, and distances from singular poses, that a motion keeps.
FASTEST, STRONGEST = 0.6, 12.0  # [m/s, m/s^2]
ROD_SINE, CONDITION = 0.15, 12.0
SHRINK, SHRINKS = 0.85, 30
RAMP = 4.0  # [s], of a motion from rest to rest


@dataclass(frozen=True)
class RandomMotion:
    """Sines in x, y, z and in three angles: turn about z, then y, then x.

    Parameters
    ----------
    seed : int
        Of frequencies, phases and weights.
    duration : float
        [s]; earlier and later times are allowed.
    highest_frequency : float
        [Hz]
    reach, tilt : float
        Largest excursion [m] and angle [rad].
    period : float
        After which it repeats [s]; 0: never.
    from_rest : bool
        Start and end at rest.
    """

    seed: int
    duration: float
    highest_frequency: float
    reach: float
    tilt: float
    period: float
    from_rest: bool

    def motion(self, time: np.ndarray) -> PlatformMotion:
        """Return the motion at times [s]: exact velocities and accelerations."""
        value, rate, gain = self._coordinates(time)
        (psi, theta, phi), w, e = value[3:], rate[3:], gain[3:]
        zero, unit = np.zeros_like(psi), np.ones_like(psi)
        # Axes of the three turns in `base`, and how the earlier turns carry them along.
        z = np.stack((zero, zero, unit), axis=1)
        y = np.stack((-np.sin(psi), np.cos(psi), zero), axis=1)
        x = np.stack((np.cos(psi) * np.cos(theta), np.sin(psi) * np.cos(theta),
                      -np.sin(theta)), axis=1)
        about_z, about_y = w[0][:, None] * z, w[1][:, None] * y
        omega = about_z + about_y + w[2][:, None] * x
        epsilon = (e[0][:, None] * z + e[1][:, None] * y + e[2][:, None] * x
                   + np.cross(about_z, about_y)
                   + np.cross(about_z + about_y, w[2][:, None] * x))
        orientation = Rotation.from_euler('ZYX', np.stack((psi, theta, phi), axis=1)).as_quat()
        return PlatformMotion(value[:3].T + HOME, orientation, rate[:3].T, omega, gain[:3].T,
                              epsilon, time)

    def to_dict(self) -> dict[str, Any]:
        """Return it as data for JSON."""
        return asdict(self)

    def _coordinates(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rng = np.random.default_rng(self.seed)
        if self.period:
            harmonics = np.arange(1, max(2, int(self.highest_frequency * self.period)) + 1)
            chosen = [rng.choice(harmonics, min(SINES, len(harmonics)), replace=False)
                      for _ in range(6)]
            frequency = np.array(chosen) / self.period
        else:
            frequency = np.exp(rng.uniform(np.log(0.05), np.log(self.highest_frequency),
                                           (6, SINES)))
        weight = rng.normal(size=frequency.shape) / (1 + frequency / 0.5)
        phase = rng.uniform(0, 2 * np.pi, frequency.shape)
        omega = 2 * np.pi * frequency
        angle = omega[..., None] * t + phase[..., None]
        sine, cosine = np.sin(angle), np.cos(angle)
        parts = [np.einsum('jk,jkn->jn', weight * factor, wave) for factor, wave in
                 ((1.0, sine), (omega, cosine), (-omega ** 2, sine))]
        size = np.array([self.reach] * 3 + [self.tilt] * 3) / np.abs(weight).sum(axis=1)
        # The sum of the weights is seldom reached.
        f, v, a = (1.5 * size[:, None] * part for part in parts)
        if not self.from_rest:
            return f, v, a
        s = np.clip(np.minimum(t, self.duration - t) / RAMP, 0.0, 1.0)
        side = np.where(t < self.duration / 2, 1.0, -1.0) / RAMP
        blend = s ** 4 * (35 - 84 * s + 70 * s ** 2 - 20 * s ** 3)
        slope = 140 * s ** 3 * (1 - s) ** 3 * side
        bend = 420 * s ** 2 * (1 - s) ** 2 * (1 - 2 * s) * side ** 2
        return blend * f, blend * v + slope * f, blend * a + 2 * slope * v + bend * f


def draw_motion(model: DriveModel, seed: int, duration: float) -> RandomMotion:
    """Return a random motion that keeps the robot's limits."""
    rng = np.random.default_rng((seed, 1))
    periodic = rng.random() < 0.5
    motion = RandomMotion(
        seed, duration, float(np.exp(rng.uniform(np.log(0.6), np.log(3.0)))),
        float(rng.uniform(0.03, 0.08)), float(rng.uniform(0.08, 0.25)),
        float(rng.choice(PERIODS)) if periodic else 0.0,
        not periodic and bool(rng.random() < 0.5))
    time = np.arange(-0.2, duration + 0.2, 0.01)
    for _ in range(SHRINKS):
        if _is_allowed(model, motion.motion(time)):
            return motion
        motion = replace(motion, reach=SHRINK * motion.reach, tilt=SHRINK * motion.tilt)
    raise ValueError(f'no motion for seed {seed}')


def _is_allowed(model: DriveModel, motion: PlatformMotion) -> bool:
    try:
        mechanism = model.mechanism(motion)
        model.limits.check_strokes(mechanism.position)
    except PprsError:
        return False
    robot, links = model.robot, mechanism.links
    condition = robot.condition_number(robot.jacobian(links)).max()
    return bool(np.abs(mechanism.velocity).max() < FASTEST
                and np.abs(mechanism.acceleration).max() < STRONGEST
                and np.abs(np.sin(robot.rods(links)[0])).min() > ROD_SINE and condition < CONDITION)


def joint_motion(duration: float = 30.0, rate: float = 100.0, seed: int = 0) -> JointMotion:
    """Return Fourier series of two turning joints and a sliding one."""
    time = np.arange(0, duration, 1 / rate)
    random, base = np.random.default_rng(seed), 2 * np.pi / 10.0
    q = np.zeros((3, len(time), 3))
    for joint, size in enumerate((0.5, 0.4, 0.12)):
        for k in range(1, 6):
            a, b = random.normal(size=2) * size / k
            w = k * base
            s, c = np.sin(w * time), np.cos(w * time)
            q[:, :, joint] += (a * s + b * c, w * (a * c - b * s), -w * w * (a * s + b * c))
    return JointMotion(*q, time)
