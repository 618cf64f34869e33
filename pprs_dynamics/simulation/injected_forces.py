# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden forces: friction and others in the drives, in the passive joints, on the platform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.simulation.injected_effect import (
    DriveForce,
    DriveMoment,
    InjectedJointFriction,
    PlatformMoment,
    Range,
    SteepDriveForce,
    StructureForce,
    algebraic_sign,
    eyring,
)
from pprs_dynamics.simulation.temperatures import (
    REFERENCE,
    Climate,
    read_thermometers,
    thinner,
)

PHASE = Range('rad', -np.pi, np.pi)
PULLEY = 3.0  # [m], from the middle of the workspace
USUAL_LOAD = 5.0  # [N], of screws
TURNING = 0.005  # [W], within which a screw is driven and drives
USUAL_SPEED = 0.08  # [m/s], at which drives get as warm as their climate says
WIDTH = Range('m/s', 0.0005, 0.002, 'log', neutral=1.0)


@DriveForce.by_law('c v_1 asinh(v / v_1)',
                   coefficient=Range('N s/m', 3.0, 10.0, 'log', scales=True),
                   thinning_velocity=Range('m/s', 0.2, 0.6, 'log', neutral=1.0))
def viscous_friction(m: DriveMoment, coefficient: Array, thinning_velocity: Array) -> Array:
    """Grease that thins with the shear rate (Eyring)."""
    return coefficient * eyring(m.velocity, thinning_velocity)


@SteepDriveForce.by_law('F v / sqrt(v^2 + w^2)',
                        force=Range('N', 0.3, 1.0, 'log', scales=True), width=WIDTH)
def coulomb_friction(m: DriveMoment, force: Array, width: Array) -> Array:
    """Seals and preload: a force against the motion that no load changes."""
    return force * algebraic_sign(m.velocity, width)


@DriveForce.by_law('c v where v has the sign of side, else 0',
                   coefficient=Range('N s/m', 4.0, 12.0, 'log', scales=True),
                   side=Range('1', -1, 1, 'sign', neutral=1.0))
def asymmetric_friction(m: DriveMoment, coefficient: Array, side: Array) -> Array:
    """A wiper or a check valve: viscous friction in one direction only."""
    return coefficient * (m.velocity + side * np.abs(m.velocity)) / 2


@SteepDriveForce.by_law('F exp(-|v| / v_s) v / sqrt(v^2 + w^2)',
                        force=Range('N', 0.4, 1.2, 'log', scales=True),
                        velocity=Range('m/s', 0.008, 0.03, 'log', neutral=1.0), width=WIDTH)
def stribeck_friction(m: DriveMoment, force: Array, velocity: Array, width: Array) -> Array:
    """Boundary lubrication: friction that falls exponentially with the speed."""
    return force * np.exp(-np.abs(m.velocity) / velocity) * algebraic_sign(m.velocity, width)


@DriveForce.by_law('c v (|v| / 1 m/s)^(p - 1)',
                   coefficient=Range('N s/m', 15.0, 50.0, 'log', scales=True),
                   power=Range('1', 1.8, 2.2, neutral=2.0))
def quadratic_friction(m: DriveMoment, coefficient: Array, power: Array) -> Array:
    """Churning of lubricant or air: a power of the speed near the square."""
    return coefficient * m.velocity * np.abs(m.velocity) ** (power - 1)


@SteepDriveForce.by_law('dmu N (N / 10 N)^(-1/3) v / sqrt(v^2 + w^2)',
                        coefficient=Range('1', 0.02, 0.06, 'log', scales=True), width=WIDTH)
def load_friction(m: DriveMoment, coefficient: Array, width: Array) -> Array:
    """A guide rougher than the model's, less so under load (Hertzian contact)."""
    load = np.cbrt(m.guide_load * m.guide_load * 10.0)
    return coefficient * load * algebraic_sign(m.velocity, width)


@SteepDriveForce.by_law('share (|tau| / 5 N)^0.9 5 N v / sqrt(v^2 + w^2), driven_back in its place '
                        'by (1 - tau v / sqrt((tau v)^2 + P^2)) / 2',
                        driving=Range('1', 0.08, 0.25, 'log', scales=True),
                        driven_back=Range('1', 0.0, 0.08, scales=True), width=WIDTH)
def gear_efficiency(m: DriveMoment, driving: Array, driven_back: Array, width: Array) -> Array:
    """A dry screw: friction by what it passes on, more while the motor drives the load."""
    power = m.transmitted * m.velocity
    share = driven_back + (driving - driven_back) * (1 + power / np.hypot(power, TURNING)) / 2
    passed = np.abs(m.transmitted) ** 0.9 * USUAL_LOAD ** 0.1
    return share * passed * algebraic_sign(m.velocity, width)


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


class FrictionDrift(SteepDriveForce):
    """Cold friction that fades as dissipated heat warms the drive, and returns as it cools."""

    name: ClassVar[str] = 'friction_drift'
    form: ClassVar[str] = 'F exp(-w / w_0) v / sqrt(v^2 + w_r^2), dw/dt = F |v| - w / tau'
    ranges: ClassVar[dict[str, Range]] = {
        'force': Range('N', 0.6, 1.5, 'log', scales=True),
        'path': Range('m', 0.4, 1.2, 'log', neutral=1.0),
        'cooling_time': Range('s', 60.0, 200.0, 'log', neutral=1.0), 'width': WIDTH}

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


class FrictionTemperature(DriveForce):
    """Grease that thins as the drive warms by its own work and with the hall."""

    name: ClassVar[str] = 'friction_temperature'
    form: ClassVar[str] = ('c (eta(T) / eta(T_0) - 1) v_1 asinh(v / v_1), ln eta = B / (T + C), '
                           'tau dT/dt = T_hall(t) + R |v| / v_u - T')
    ranges: ClassVar[dict[str, Range]] = {
        'coefficient': Range('N s/m', 10.0, 30.0, 'log', scales=True),
        'thinning_velocity': Range('m/s', 0.2, 0.6, 'log', neutral=1.0),
        'reference': Range('degC', *REFERENCE), 'climate': Range('1', 0, 2 ** 31, 'whole')}

    def prepare(self, coulomb: Array, width: Array) -> None:
        """Start at the temperature of the hall, which is that of all drives."""
        self._climate = self.climate
        self.temperature = self._climate.start()

    @property
    def climate(self) -> Climate:
        """Hall and drives, whichever of these have the effect."""
        seed = int(self.values['climate'].max())
        return Climate.draw(np.random.default_rng(seed), len(DRIVES))

    def measured(self, time: Array, velocity: Array) -> dict[str, Array]:
        """Return what thermometers say along a motion, by channel, (N, 6)."""
        return {'temperature': read_thermometers(
            time, self.climate.along(time, velocity, USUAL_SPEED))}

    def force(self, moment: DriveMoment) -> Array:
        """Return c (eta(T) / eta(T_0) - 1) v_1 asinh(v / v_1)."""
        viscous = self.values['coefficient'] * thinner(self.temperature, self.values['reference'])
        return viscous * eyring(moment.velocity, self.values['thinning_velocity'])

    def advance(self, moment: DriveMoment, duration: float) -> None:
        """Warm by work, cool towards the hall."""
        slope = self._climate.slope(self.temperature, float(np.max(moment.time)),
                                    np.abs(moment.velocity) / USUAL_SPEED)
        self.temperature = self.temperature + duration * slope


@DriveForce.by_law('F',
                   force=Range('N', 0.3, 1.0, 'signed', scales=True))
def effort_offset(m: DriveMoment, force: Array) -> Array:
    """A counterbalance or a hanging cable: the same force everywhere."""
    return force


@DriveForce.by_law('k x (1 + (x / x_h)^2), x = q - q_0',
                   stiffness=Range('N/m', 8.0, 30.0, 'log', scales=True),
                   rest=Range('m', -0.05, 0.05, lifts=(0.15, 0.25)),
                   hardening=Range('m', 0.15, 0.3, 'log', neutral=1.0))
def drive_spring(m: DriveMoment, stiffness: Array, rest: Array, hardening: Array) -> Array:
    """A cable chain or counterbalance that stiffens with its length."""
    x = m.position - rest
    return stiffness * x * (1 + (x / hardening) ** 2)


@DriveForce.by_law('s k x^(3/2) (1 + c s v), x = s (q - q_m) - reach where that is above 0',
                   stiffness=Range('N/m^1.5', 180.0, 530.0, 'log', scales=True),
                   side=Range('1', -1, 1, 'sign', neutral=1.0),
                   middle=Range('m', -0.005, 0.005, lifts=(0.2, 0.21)),
                   reach=Range('m', 0.022, 0.035), damping=Range('s/m', 0.0, 3.0))
def stop_contact(m: DriveMoment, stiffness: Array, side: Array, middle: Array, reach: Array,
                 damping: Array) -> Array:
    """A rubber bumper (Hertz) with damping by its compression (Hunt and Crossley)."""
    x = np.maximum(side * (m.position - middle) - reach, 0.0)
    return side * stiffness * x ** 1.5 * (1 + damping * side * m.velocity)


@DriveForce.by_law('A (sin(2 pi q / p + phi) + a_2 sin(4 pi q / p + phi_2))',
                   force=Range('N', 0.25, 0.8, 'log', scales=True),
                   pitch=Range('m', 0.003, 0.012, 'log', neutral=1.0), phase=PHASE,
                   second=Range('1', 0.2, 0.5), second_phase=PHASE)
def force_ripple(m: DriveMoment, force: Array, pitch: Array, phase: Array, second: Array,
                 second_phase: Array) -> Array:
    """Screw or cogging of the motor: two harmonics of the pitch."""
    turn = 2 * np.pi * m.position / pitch
    return force * (np.sin(turn + phase) + second * np.sin(2 * turn + second_phase))


@DriveForce.by_law('F / (1 + ((q - q_0) / w)^4)',
                   force=Range('N', 0.5, 1.5, 'signed', scales=True),
                   place=Range('m', -0.03, 0.03, lifts=(0.18, 0.22)),
                   width=Range('m', 0.003, 0.01, 'log', neutral=1.0))
def local_bump(m: DriveMoment, force: Array, place: Array, width: Array) -> Array:
    """A dent in a guide: a force that drives back from one place. Not in the catalogue."""
    return force / (1 + ((m.position - place) / width) ** 4)


@DriveForce.by_law('A sin(2 pi f t + phi)',
                   force=Range('N', 0.2, 0.7, 'log', scales=True),
                   frequency=Range('Hz', 6.0, 30.0, 'log', neutral=1.0), phase=PHASE)
def vibration(m: DriveMoment, force: Array, frequency: Array, phase: Array) -> Array:
    """A force of one frequency, from a machine nearby. Not in the catalogue."""
    return force * np.sin(2 * np.pi * frequency * m.time + phase)


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


class JointFriction(InjectedJointFriction):
    """Dirt or preload in the revolute joints C_i, or in the spherical joints A_i."""

    name: ClassVar[str] = 'joint_friction'
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


@StructureForce.by_law('k x (1 + (x / x_h)^2), x = u_i - u_0',
                       stiffness=Range('N m/rad', 0.4, 1.5, 'log', scales=True),
                       rest=Range('rad', 1.2, 1.6), hardening=Range('rad', 0.8, 1.5))
def joint_spring(m: PlatformMoment, stiffness: float, rest: float, hardening: float,
                 ) -> tuple[Array, Array, Array]:
    """Cable looms across the revolute joints C_i, stiffening with the angle."""
    x = m.rod_angle - rest
    return -stiffness * x * (1 + (x / hardening) ** 2), np.zeros(3), np.zeros(3)


@StructureForce.by_law('F towards a pulley 3 m away, at a point off o',
                       force=Range('N', 1.0, 4.0, 'log', scales=True),
                       azimuth=Range('rad', -np.pi, np.pi), elevation=Range('rad', -0.6, 0.6),
                       x=Range('m', -0.05, 0.05), y=Range('m', -0.05, 0.05),
                       z=Range('m', 0.0, 0.05))
def external_wrench(m: PlatformMoment, force: float, azimuth: float, elevation: float, x: float,
                    y: float, z: float) -> tuple[Array, Array, Array]:
    """A cord over a far pulley pulls at a point of the platform.

    Its force hardly changes, but turns a little as the platform moves.
    """
    arm = m.rotation @ np.array([x, y, z])
    level = np.cos(elevation)
    pulley = np.array([0.0, 0.0, 0.5]) + PULLEY * np.array([
        level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    cord = pulley - m.position - arm
    pull = force * cord / np.sqrt(cord @ cord)
    return np.zeros(3), pull, np.cross(arm, pull)


@StructureForce.by_law('-c v sqrt(1 + (|v| / v_1)^2)',
                       coefficient=Range('N s/m', 5.0, 15.0, 'log', scales=True),
                       turbulent_velocity=Range('m/s', 0.2, 0.6, 'log'))
def tool_drag(m: PlatformMoment, coefficient: float, turbulent_velocity: float,
              ) -> tuple[Array, Array, Array]:
    """A liquid or a curtain that the platform moves through."""
    grown = np.sqrt(1 + (m.velocity @ m.velocity) / turbulent_velocity ** 2)
    return np.zeros(3), -coefficient * grown * m.velocity, np.zeros(3)
