# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden bodies: masses, inertias and gravity that are not what the model says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.closed_chains import DRIVE_DOFS, ClosedChains
from pprs_dynamics.simulation.injected_effect import BodyChange, DriveBound, Range

PICK_UP_TIME = 0.2  # [s], in which the weight of a payload goes over to the platform


Body = tuple[float, Array, Array]
"""Mass [kg], centre of mass from o [m] and inertia tensor about it [kg m^2], in `platform`."""


def join(first: Body, second: Body) -> Body:
    """Return two bodies fixed to each other, as one."""
    total = first[0] + second[0]
    centre: Array = (first[0] * first[1] + second[0] * second[1]) / total
    tensor: Array = (first[2] + _steiner(first[0], first[1] - centre)
                     + second[2] + _steiner(second[0], second[1] - centre))
    return total, centre, tensor


def ball(mass: float, place: Array, radius: float) -> Body:
    """Return a uniform ball."""
    return mass, place, 0.4 * mass * radius ** 2 * np.eye(3)


def _platform(chains: ClosedChains) -> Body:
    return chains.platform_mass, chains.platform_centre, chains.platform_inertia


def _steiner(mass: float, arm: Array) -> Array:
    tensor: Array = mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return tensor


@BodyChange.by_law('a ball of mass m and radius 2 cm at the centre of mass',
                   mass=Range('kg', 0.1, 0.4, 'signed', scales=True))
def payload_mass(chains: ClosedChains, values: Mapping[str, Any], mass: float) -> None:
    """A payload heavier or lighter than the model's, in the same place."""
    chains.set_platform(*join(_platform(chains), ball(mass, chains.platform_centre, 0.02)))


@BodyChange.by_law('the centre of mass moved by (x, y, z), the tensor about it as it was',
                   x=Range('m', 0.003, 0.01, 'signed', scales=True),
                   y=Range('m', 0.003, 0.01, 'signed', scales=True),
                   z=Range('m', 0.003, 0.02, 'signed', scales=True))
def payload_offset(chains: ClosedChains, values: Mapping[str, Any], x: float, y: float, z: float,
                   ) -> None:
    """The centre of mass of platform and payload lies elsewhere."""
    mass, centre, inertia = _platform(chains)
    chains.set_platform(mass, centre + np.array([x, y, z]), inertia)


@BodyChange.by_law('I (E - a a^T), a = (cos beta, sin beta, 0)',
                   inertia=Range('kg m^2', 0.01, 0.04, 'log', scales=True),
                   angle=Range('rad', 0.0, np.pi))
def platform_inertia(chains: ClosedChains, values: Mapping[str, Any], inertia: float, angle: float,
                     ) -> None:
    """A beam across the platform: more inertia, of which one axis in the plane feels nothing."""
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    mass, centre, own = _platform(chains)
    chains.set_platform(mass, centre, own + inertia * (np.eye(3) - np.outer(along, along)))


@BodyChange.by_law('a uniform collar of mass m over the middle 60 % of every rod',
                   mass=Range('kg', 0.05, 0.2, 'log', scales=True))
def link_mass(chains: ClosedChains, values: Mapping[str, Any], mass: float) -> None:
    """Guiding rods heavier than the model's: a collar in the middle of each."""
    l = values['geometry.rod_length']  # noqa: E741
    for i, own in enumerate(values['masses.rods']):
        across = own * l ** 2 / 12 + mass * (0.6 * l) ** 2 / 12
        chains.set_mass(f'rod_{i + 1}', own + mass, np.array([-l / 2, 0.0, 0.0]),
                        np.diag([0.0, across, across]))


@BodyChange.by_law('gravity turned by x about x, then by y about y',
                   x=Range('rad', 0.01, 0.05, 'signed', scales=True),
                   y=Range('rad', 0.01, 0.05, 'signed', scales=True))
def base_tilt(chains: ClosedChains, values: Mapping[str, Any], x: float, y: float) -> None:
    """The base does not stand level: gravity leans in it."""
    (c_x, s_x), (c_y, s_y) = ((np.cos(angle), np.sin(angle)) for angle in (x, y))
    about_x = np.array([[1, 0, 0], [0, c_x, -s_x], [0, s_x, c_x]])
    about_y = np.array([[c_y, 0, s_y], [0, 1, 0], [-s_y, 0, c_y]])
    chains.model.opt.gravity[:] = about_y @ about_x @ np.array(values['gravity'])


class DriveInertia(DriveBound, BodyChange):
    """Rotor and screw, reflected: inertia along the drive, without weight."""

    name: ClassVar[str] = 'drive_inertia'
    form: ClassVar[str] = "m dv/dt, as the armature of the engine's joint"
    ranges: ClassVar[dict[str, Range]] = {'mass': Range('kg', 0.2, 1.0, 'log', scales=True)}

    def apply(self, chains: ClosedChains, values: Mapping[str, Any]) -> None:
        """Add the armature."""
        chains.model.dof_armature[DRIVE_DOFS] += self.values['mass']


class PayloadPickUp(BodyChange):
    """A payload taken up while the robot moves. Not in the catalogue."""

    name: ClassVar[str] = 'payload_pick_up'
    form: ClassVar[str] = 'a ball of mass m, radius 3 cm, at (x, y, z) from the given time on'
    ranges: ClassVar[dict[str, Range]] = {
        'mass': Range('kg', 0.15, 0.5, 'log', scales=True), 'time': Range('s', 4.0, 15.0),
        'x': Range('m', -0.02, 0.02), 'y': Range('m', -0.02, 0.02), 'z': Range('m', 0.02, 0.06)}

    def apply(self, chains: ClosedChains, values: Mapping[str, Any]) -> None:
        """Wait."""
        self._share = 0.0
        self._empty: Body | None = None

    def advance(self, chains: ClosedChains, time: float) -> None:
        """Take it up within `PICK_UP_TIME`."""
        p = self.parameters
        share = float(np.clip((time - p['time']) / PICK_UP_TIME, 0.0, 1.0))
        if share != self._share:
            self._share = share
            if self._empty is None:
                self._empty = _platform(chains)
            more = ball(share * p['mass'], np.array([p['x'], p['y'], p['z']]), 0.03)
            chains.set_platform(*join(self._empty, more))
