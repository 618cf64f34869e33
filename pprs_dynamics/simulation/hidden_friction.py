# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden friction: in the drives and in the passive joints."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.hidden_effect import (
    DriveForce,
    DriveMoment,
    HiddenJointFriction,
    Range,
)

WIDTH = Range('m/s', 0.0005, 0.002, 'log', neutral=1.0)


def algebraic_sign(velocity: Array, width: Array) -> Array:
    """Return v / sqrt(v^2 + w^2): another way to turn over than the tanh of the model."""
    return velocity / np.sqrt(velocity * velocity + width * width)


class ViscousFriction(DriveForce):
    """Grease that thins with the shear rate (Eyring)."""

    name: ClassVar[str] = 'viscous_friction'
    form: ClassVar[str] = 'c v_1 asinh(v / v_1)'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 3.0, 10.0, 'log', scales=True),
        'thinning_velocity': Range('m/s', 0.2, 0.6, 'log', neutral=1.0)}

    def force(self, moment: DriveMoment) -> Array:
        """Return c v_1 asinh(v / v_1)."""
        v_1 = self.values['thinning_velocity']
        return self.values['coefficient'] * v_1 * np.arcsinh(moment.velocity / v_1)


class CoulombFriction(DriveForce):
    """Seals and preload: a force against the motion that no load changes."""

    name: ClassVar[str] = 'coulomb_friction'
    form: ClassVar[str] = 'F v / sqrt(v^2 + w^2)'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.3, 1.0, 'log', scales=True), 'width': WIDTH}
    steep: ClassVar[bool] = True

    def force(self, moment: DriveMoment) -> Array:
        """Return F v / sqrt(v^2 + w^2)."""
        return self.values['force'] * algebraic_sign(moment.velocity, self.values['width'])


class AsymmetricFriction(DriveForce):
    """A wiper or a check valve: viscous friction in one direction only."""

    name: ClassVar[str] = 'asymmetric_friction'
    form: ClassVar[str] = 'c v where v has the sign of side, else 0'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 4.0, 12.0, 'log', scales=True),
        'side': Range('1', -1, 1, 'sign', neutral=1.0)}

    def force(self, moment: DriveMoment) -> Array:
        """Return c (v + side |v|) / 2."""
        v = moment.velocity
        return self.values['coefficient'] * (v + self.values['side'] * np.abs(v)) / 2


class StribeckFriction(DriveForce):
    """Boundary lubrication: friction that falls exponentially with the speed."""

    name: ClassVar[str] = 'stribeck_friction'
    form: ClassVar[str] = 'F exp(-|v| / v_s) v / sqrt(v^2 + w^2)'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.4, 1.2, 'log', scales=True),
        'velocity': Range('m/s', 0.008, 0.03, 'log', neutral=1.0), 'width': WIDTH}
    steep: ClassVar[bool] = True

    def force(self, moment: DriveMoment) -> Array:
        """Return F exp(-|v| / v_s) v / sqrt(v^2 + w^2)."""
        v = moment.velocity
        fall = np.exp(-np.abs(v) / self.values['velocity'])
        return self.values['force'] * fall * algebraic_sign(v, self.values['width'])


class QuadraticFriction(DriveForce):
    """Churning of lubricant or air: a power of the speed near the square."""

    name: ClassVar[str] = 'quadratic_friction'
    form: ClassVar[str] = 'c v (|v| / 1 m/s)^(p - 1)'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 15.0, 50.0, 'log', scales=True),
        'power': Range('1', 1.8, 2.2, neutral=2.0)}

    def force(self, moment: DriveMoment) -> Array:
        """Return c v |v|^(p - 1)."""
        v = moment.velocity
        return self.values['coefficient'] * v * np.abs(v) ** (self.values['power'] - 1)


class LoadFriction(DriveForce):
    """A guide rougher than the model's, less so under load (Hertzian contact)."""

    name: ClassVar[str] = 'load_friction'
    form: ClassVar[str] = 'dmu N (N / 10 N)^(-1/3) v / sqrt(v^2 + w^2)'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('1', 0.02, 0.06, 'log', scales=True), 'width': WIDTH}
    steep: ClassVar[bool] = True

    def force(self, moment: DriveMoment) -> Array:
        """Return dmu N^(2/3) (10 N)^(1/3) v / sqrt(v^2 + w^2)."""
        load = np.cbrt(moment.guide_load * moment.guide_load * 10.0)
        sign = algebraic_sign(moment.velocity, self.values['width'])
        return self.values['coefficient'] * load * sign


class Hysteresis(DriveForce):
    """Presliding by Bouc and Wen: a share of the robot's dry friction follows displacement.

    z' = (1 - |z|^n (1 + sgn(v z)) / 2) / x_d per displacement: linear on the way back, and
    rounded towards 1 on the way out. The share takes the place of friction that turns over at
    once, so that the robot's friction stays passive.
    """

    name: ClassVar[str] = 'hysteresis'
    form: ClassVar[str] = ('share mu N (z - tanh(v / v_rev)), '
                           'dz/dx = (1 - |z|^n (1 + sgn(v z)) / 2) / x_d')
    ranges: ClassVar[dict[str, Range]] = {
        'share': Range('1', 0.7, 1.0),
        'distance': Range('m', 0.0003, 0.002, 'log', scales=True, neutral=1.0),
        'power': Range('1', 1.0, 2.5, neutral=1.0)}

    def prepare(self, coulomb: Array, width: Array) -> None:
        """Start from a relaxed contact."""
        self._coulomb, self._width = coulomb, width
        self._z = np.zeros(6)

    def force(self, moment: DriveMoment) -> Array:
        """Return share mu N (z - tanh(v / v_rev))."""
        dry = self.values['share'] * self._coulomb * moment.guide_load
        return dry * (self._z - np.tanh(moment.velocity / self._width))

    def advance(self, moment: DriveMoment, duration: float) -> None:
        """Move z along, in parts of at most a fifth of the distance."""
        move = moment.velocity * duration / self.values['distance']
        parts = max(1, int(np.ceil(5 * np.abs(move).max())))
        move, z, power = move / parts, self._z, self.values['power']
        for _ in range(parts):
            bend = (1 + np.sign(move * z)) / 2
            z = np.clip(z + move * (1 - np.abs(z) ** power * bend), -1, 1)
        self._z = z


class FrictionDrift(DriveForce):
    """Cold friction that fades as dissipated heat warms the drive, and comes back as it cools."""

    name: ClassVar[str] = 'friction_drift'
    form: ClassVar[str] = 'F exp(-w / w_0) v / sqrt(v^2 + w_r^2), dw/dt = F |v| - w / tau'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.6, 1.5, 'log', scales=True),
        'path': Range('m', 0.4, 1.2, 'log', neutral=1.0),
        'cooling_time': Range('s', 60.0, 200.0, 'log', neutral=1.0), 'width': WIDTH}
    steep: ClassVar[bool] = True

    def prepare(self, coulomb: Array, width: Array) -> None:
        """Start cold."""
        # Heat per F, so that the fading does not depend on the strength: a path [m].
        self._heat = np.zeros(6)

    def force(self, moment: DriveMoment) -> Array:
        """Return F exp(-w / w_0) v / sqrt(v^2 + w_r^2)."""
        left = np.exp(-self._heat / self.values['path'])
        sign = algebraic_sign(moment.velocity, self.values['width'])
        return self.values['force'] * left * sign

    def advance(self, moment: DriveMoment, duration: float) -> None:
        """Warm by friction, cool towards the surroundings."""
        cooling = self._heat / self.values['cooling_time']
        self._heat = self._heat + duration * (np.abs(moment.velocity) - cooling)


class _PassiveJointFriction(HiddenJointFriction):
    form: ClassVar[str] = 'c s_1 asinh(s / s_1) + M s / sqrt(s^2 + w^2)'
    ranges: ClassVar[dict[str, Range]] = {
        'viscous': Range('N m s/rad', 0.04, 0.15, 'log', scales=True),
        'thinning_rate': Range('rad/s', 0.5, 1.5, 'log'),
        'dry': Range('N m', 0.002, 0.01, 'log', scales=True),
        'width': Range('rad/s', 0.002, 0.006, 'log')}

    def resistance(self, speed: Array, load: Array) -> Array:
        """Return (c s_1 asinh(s / s_1)) / s + M / sqrt(s^2 + w^2)."""
        p = self.parameters
        share = np.maximum(speed / p['thinning_rate'], 1e-9)
        return (p['viscous'] * np.arcsinh(share) / share
                + p['dry'] / np.sqrt(speed * speed + p['width'] ** 2))


class RevoluteFriction(_PassiveJointFriction):
    """Dirt or preload in the revolute joints C_i."""

    name: ClassVar[str] = 'revolute_friction'
    joint: ClassVar[str] = 'revolute'


class SphericalFriction(_PassiveJointFriction):
    """Dirt or preload in the spherical joints A_i."""

    name: ClassVar[str] = 'spherical_friction'
    joint: ClassVar[str] = 'spherical'
