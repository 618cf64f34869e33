# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Paths of the platform: the paper's helical translation, and a smooth random excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.mechanism.motion import PlatformMotion

KNOTS_PER_PERIOD = 400
HOME = (0.0, 0.0, 0.5)  # [m]; the unturned platform in the middle of its workspace


@dataclass(frozen=True)
class HelicalPath:
    """The paper's helical translation: one turn of radius R, rising by `rise`, in 3 pi / 2 s.

    Parameters
    ----------
    radius : float
        Of the helix [m]; the paper takes the base radius R.
    height : float
        Z where it starts [m].
    rise : float
        Gain of height per turn [m].
    """

    radius: float = 0.15
    height: float = 0.5
    rise: float = 0.1

    duration = 3 * np.pi / 2

    def motion(self, time: ArrayLike) -> PlatformMotion:
        """Return the motion at times [s] within 0..duration, clipped to its ends outside."""
        times = np.atleast_1d(np.asarray(time, dtype=float))
        angle, rate, gain = _helix_angle(np.clip(times, 0.0, self.duration))
        c, s, pitch = np.cos(angle), np.sin(angle), self.rise / (2 * np.pi)
        R, zero = self.radius, np.zeros((len(times), 3))
        position = np.stack((R * c, R * s, self.height + pitch * angle), axis=1)
        velocity = np.stack((-R * s * rate, R * c * rate, pitch * rate), axis=1)
        acceleration = np.stack((
            -R * (s * gain + c * rate * rate), R * (c * gain - s * rate * rate), pitch * gain),
            axis=1)
        upright = np.tile((0.0, 0.0, 0.0, 1.0), (len(times), 1))
        return PlatformMotion(position, upright, velocity, zero, acceleration, zero, times)


def _helix_angle(t: Array) -> tuple[Array, Array, Array]:
    """Return lambda(t) of the paper with its first and second derivative."""
    half, whole = np.pi / 2, np.pi
    phases = [t < half, t < whole]
    angle = np.select(
        phases, [2 / np.pi * t ** 2, 2 * (t - half) + half],
        -2 * (t - whole) ** 2 / np.pi + 2 * (t - whole) + 3 * half)
    rate = np.select(phases, [4 / np.pi * t, np.full_like(t, 2.0)], 2 - 4 / np.pi * (t - whole))
    gain = np.select(phases, [np.full_like(t, 4 / np.pi), np.zeros_like(t)], -4 / np.pi)
    return angle, rate, gain


def sampled(path: HelicalPath | Excitation, rate: float, beyond: int = 0) -> PlatformMotion:
    """Return the motion along a path at a rate [Hz], with some samples at rest beyond its end."""
    return path.motion(np.arange(0.0, path.duration + beyond / rate, 1 / rate))


def with_lead_in(motion: PlatformMotion, duration: float, rate: float) -> PlatformMotion:
    """Return a motion that goes from the home pose to where another starts, and then plays it.

    Parameters
    ----------
    motion : PlatformMotion
    duration : float
        Of the way there, from rest to rest along a quintic blend [s]; 0: none.
    rate : float
        Samples per second [Hz], those of `motion`.
    """
    from scipy.spatial.transform import Rotation

    count = int(duration * rate)
    if count < 1:
        return motion
    t = np.arange(count) / (count / duration)
    s = t / duration
    blend = s ** 3 * (10 - 15 * s + 6 * s ** 2)
    rate_of = 30 * s ** 2 * (1 - s) ** 2 / duration
    gain = 60 * s * (1 - s) * (1 - 2 * s) / duration ** 2
    move = motion.position[0] - np.asarray(HOME)
    # A turn about a fixed axis: its rate and gain are those of the angle.
    turn = Rotation.from_quat(motion.orientation[0]).as_rotvec()
    orientation = Rotation.from_rotvec(blend[:, None] * turn).as_quat()
    way = np.hstack((HOME + blend[:, None] * move, orientation, rate_of[:, None] * move,
                     rate_of[:, None] * turn, gain[:, None] * move, gain[:, None] * turn))
    rows = np.concatenate((way, motion.rows))
    return PlatformMotion.from_rows(rows, np.arange(len(rows)) / rate)


@dataclass(frozen=True)
class Excitation:
    """A random Fourier series in all six degrees of freedom, from rest to rest.

    Parameters
    ----------
    duration : float
        Of the whole motion [s].
    seed : int
        Of the random coefficients.
    amplitude : float
        Largest excursion from `HOME` along every axis [m].
    tilt : float
        Largest component of the rotation vector [rad].
    highest_frequency : float
        Of the series [Hz].
    """

    duration: float = 20.0
    seed: int = 0
    amplitude: float = 0.06
    tilt: float = 0.15
    highest_frequency: float = 0.6

    def motion(self, time: ArrayLike) -> PlatformMotion:
        """Return the motion at times [s] within 0..duration, clipped to its ends outside."""
        from scipy.spatial.transform import Rotation

        times = np.atleast_1d(np.asarray(time, dtype=float))
        # The curve is a spline by definition, so that pose, twist and acceleration belong to one
        # motion exactly. Cubic on SO(3), its angular acceleration has kinks at the knots: this
        # many per period of the highest harmonic leave them below 1e-4 of its size.
        knots = np.linspace(0.0, self.duration,
                            max(500, int(KNOTS_PER_PERIOD * self.duration
                                         * self.highest_frequency)))
        coordinates = self._coordinates(knots)
        orientation = Rotation.from_rotvec(coordinates[:, 3:]).as_quat()
        inside = np.clip(times, 0.0, self.duration)
        motion = PlatformMotion.from_poses(knots, coordinates[:, :3] + HOME, orientation, at=inside)
        return motion.with_time(times)

    def _coordinates(self, t: Array) -> Array:
        rng = np.random.default_rng(self.seed)
        count = max(1, int(self.highest_frequency * self.duration))
        harmonics = np.arange(1, count + 1) / self.duration
        phase = rng.uniform(0, 2 * np.pi, (6, count))
        weight = rng.normal(size=(6, count))
        series = np.einsum('jk,jkn->jn', weight,
                           np.sin(2 * np.pi * harmonics[:, None] * t + phase[..., None])).T
        ramp = np.clip(np.minimum(t, self.duration - t) / (0.1 * self.duration), 0.0, 1.0)
        # A septic blend has no velocity, acceleration or jerk at its ends.
        blend = ramp ** 4 * (35 - 84 * ramp + 70 * ramp ** 2 - 20 * ramp ** 3)
        shaped = series * blend[:, None]
        reach = np.array([self.amplitude] * 3 + [self.tilt] * 3)
        scaled: Array = shaped * (reach / np.abs(shaped).max(axis=0))
        return scaled
