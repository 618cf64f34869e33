# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden forces other than friction: in the drives, on the rods and on the platform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.hidden_effect import (
    DRIVES,
    DriveForce,
    DriveMoment,
    PlatformMoment,
    Range,
    StructureForce,
)

PHASE = Range('rad', -np.pi, np.pi)


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
