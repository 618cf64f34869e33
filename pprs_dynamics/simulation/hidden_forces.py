# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden forces: friction and others in the drives, in the passive joints, on the platform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.simulation.hidden_effect import (
    DriveForce,
    DriveMoment,
    HiddenJointFriction,
    PlatformMoment,
    Range,
    StructureForce,
)

PHASE = Range('rad', -np.pi, np.pi)
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


class EffortOffset(DriveForce):
    """A counterbalance or a hanging cable: the same force everywhere."""

    name: ClassVar[str] = 'effort_offset'
    form: ClassVar[str] = 'F'
    ranges: ClassVar[dict[str, Range]] = {'force': Range('N', 0.3, 1.0, 'signed', scales=True)}

    def force(self, moment: DriveMoment) -> Array:
        """Return F."""
        return self.values['force']


class DriveSpring(DriveForce):
    """A cable chain or counterbalance that stiffens as it is drawn out."""

    name: ClassVar[str] = 'drive_spring'
    form: ClassVar[str] = 'k x (1 + (x / x_h)^2), x = q - q_0'
    ranges: ClassVar[dict[str, Range]] = {
        'stiffness': Range('N/m', 8.0, 30.0, 'log', scales=True),
        'rest': Range('m', -0.05, 0.05, lifts=(0.15, 0.25)),
        'hardening': Range('m', 0.15, 0.3, 'log', neutral=1.0)}

    def force(self, moment: DriveMoment) -> Array:
        """Return k x (1 + (x / x_h)^2)."""
        x = moment.position - self.values['rest']
        hardened = 1 + (x / self.values['hardening']) ** 2
        return self.values['stiffness'] * x * hardened


class ForceRipple(DriveForce):
    """Screw or cogging of the motor: two harmonics of the pitch."""

    name: ClassVar[str] = 'force_ripple'
    form: ClassVar[str] = 'A (sin(2 pi q / p + phi) + a_2 sin(4 pi q / p + phi_2))'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.25, 0.8, 'log', scales=True),
        'pitch': Range('m', 0.003, 0.012, 'log', neutral=1.0), 'phase': PHASE,
        'second': Range('1', 0.2, 0.5), 'second_phase': PHASE}

    def force(self, moment: DriveMoment) -> Array:
        """Return A (sin(2 pi q / p + phi) + a_2 sin(4 pi q / p + phi_2))."""
        turn = 2 * np.pi * moment.position / self.values['pitch']
        first = np.sin(turn + self.values['phase'])
        second = np.sin(2 * turn + self.values['second_phase'])
        return self.values['force'] * (first + self.values['second'] * second)


class LocalBump(DriveForce):
    """A dent in a guide: a force that drives back from one place. Not in the catalogue."""

    name: ClassVar[str] = 'local_bump'
    form: ClassVar[str] = 'F / (1 + ((q - q_0) / w)^4)'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.5, 1.5, 'signed', scales=True),
        'place': Range('m', -0.03, 0.03, lifts=(0.18, 0.22)),
        'width': Range('m', 0.003, 0.01, 'log', neutral=1.0)}

    def force(self, moment: DriveMoment) -> Array:
        """Return F / (1 + ((q - q_0) / w)^4)."""
        away = (moment.position - self.values['place']) / self.values['width']
        return self.values['force'] / (1 + away ** 4)


class Vibration(DriveForce):
    """A force of one frequency, from a machine nearby. Not in the catalogue."""

    name: ClassVar[str] = 'vibration'
    form: ClassVar[str] = 'A sin(2 pi f t + phi)'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.2, 0.7, 'log', scales=True),
        'frequency': Range('Hz', 6.0, 30.0, 'log', neutral=1.0), 'phase': PHASE}

    def force(self, moment: DriveMoment) -> Array:
        """Return A sin(2 pi f t + phi)."""
        turn = 2 * np.pi * self.values['frequency'] * moment.time
        return self.values['force'] * np.sin(turn + self.values['phase'])


class DriveCoupling(DriveForce):
    """A cable chain shared by two drives: one drags at the other. Not in the catalogue.

    The parameter `source` counts drives from 0 in the interface's order.
    """

    name: ClassVar[str] = 'drive_coupling'
    form: ClassVar[str] = 'c v of drive number source'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 4.0, 12.0, 'signed', scales=True),
        'source': Range('1', 0, 5, 'whole')}

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return it on one drive, with another as its source."""
        return cls.draw_on([DRIVES[int(rng.integers(6))]], rng, scale)

    @classmethod
    def draw_on(cls, drives: Sequence[str], rng: np.random.Generator, scale: float = 1.0) -> Self:
        """Return it on given drives, each with another as its source."""
        found = {}
        for drive in drives:
            place = DRIVES.index(drive) if drive in DRIVES else 0  # refused below
            source = float((place + rng.integers(1, 6)) % 6)
            found[drive] = {'coefficient': cls.ranges['coefficient'].draw(rng, scale),
                            'source': source}
        return cls(found)

    def force(self, moment: DriveMoment) -> Array:
        """Return c times the velocity of the source."""
        sources = self.values['source'].astype(int)
        return self.values['coefficient'] * moment.velocity[..., sources]


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


class RevoluteStiffness(StructureForce):
    """Cable looms across the revolute joints C_i, stiffening as they bend."""

    name: ClassVar[str] = 'revolute_stiffness'
    form: ClassVar[str] = 'k x (1 + (x / x_h)^2), x = u_i - u_0'
    ranges: ClassVar[dict[str, Range]] = {
        'stiffness': Range('N m/rad', 0.4, 1.5, 'log', scales=True),
        'rest': Range('rad', 1.2, 1.6), 'hardening': Range('rad', 0.8, 1.5)}

    def apply(self, moment: PlatformMoment) -> tuple[Array, Array, Array]:
        """Return the torques that turn the rods back."""
        p = self.parameters
        x = moment.rod_angle - p['rest']
        return -p['stiffness'] * x * (1 + (x / p['hardening']) ** 2), np.zeros(3), np.zeros(3)


class ExternalWrench(StructureForce):
    """A cord over a far pulley pulls at a point of the platform.

    Its force hardly changes, but turns a little as the platform moves.
    """

    name: ClassVar[str] = 'external_wrench'
    form: ClassVar[str] = 'F towards a pulley 3 m away, at a point off o'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 1.0, 4.0, 'log', scales=True),
        'azimuth': Range('rad', -np.pi, np.pi), 'elevation': Range('rad', -0.6, 0.6),
        'x': Range('m', -0.05, 0.05), 'y': Range('m', -0.05, 0.05), 'z': Range('m', 0.0, 0.05)}
    distance: ClassVar[float] = 3.0

    def apply(self, moment: PlatformMoment) -> tuple[Array, Array, Array]:
        """Return the cord's pull."""
        p = self.parameters
        arm = moment.rotation @ np.array([p['x'], p['y'], p['z']])
        level = np.cos(p['elevation'])
        pulley = np.array([0.0, 0.0, 0.5]) + self.distance * np.array([
            level * np.cos(p['azimuth']), level * np.sin(p['azimuth']), np.sin(p['elevation'])])
        cord = pulley - moment.position - arm
        force = p['force'] * cord / np.sqrt(cord @ cord)
        return np.zeros(3), force, np.cross(arm, force)


class PlatformDrag(StructureForce):
    """A liquid or a curtain that the platform moves through."""

    name: ClassVar[str] = 'platform_drag'
    form: ClassVar[str] = '-c v sqrt(1 + (|v| / v_1)^2)'
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 5.0, 15.0, 'log', scales=True),
        'turbulent_velocity': Range('m/s', 0.2, 0.6, 'log')}

    def apply(self, moment: PlatformMoment) -> tuple[Array, Array, Array]:
        """Return the drag at o."""
        p, v = self.parameters, moment.velocity
        grown = np.sqrt(1 + (v @ v) / p['turbulent_velocity'] ** 2)
        return np.zeros(3), -p['coefficient'] * grown * v, np.zeros(3)
