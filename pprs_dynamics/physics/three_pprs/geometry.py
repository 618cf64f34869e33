# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Geometry and masses of the 3-PPRS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError

ELBOWS = ('up', 'down')


@dataclass(frozen=True)
class Geometry:
    """Lengths and angles of the mechanism.

    Parameters
    ----------
    base_radius, platform_radius, rod_length : float
        R, r and l [m].
    chain_angles, platform_angles : 3 floats
        delta_i on the base and delta'_i on the platform [rad].
    elbow : {'up', 'down'}
        Branch of the inverse kinematics: 'up' has sin u_i > 0, the carriage below the platform.
    """

    base_radius: float
    platform_radius: float
    rod_length: float
    chain_angles: tuple[float, float, float]
    platform_angles: tuple[float, float, float]
    elbow: str = 'up'

    def __post_init__(self) -> None:
        for name in ('chain_angles', 'platform_angles'):
            angles = np.asarray(getattr(self, name), dtype=float)
            distance = np.abs(np.exp(1j * angles) - np.exp(1j * np.roll(angles, 1)))
            _require(f'geometry.{name}', getattr(self, name), bool(np.all(distance > 1e-6)),
                     'hold three different directions')
        turned = np.subtract(self.platform_angles, self.chain_angles)
        span = np.abs(self.base_radius - self.platform_radius * np.cos(turned)).max()
        _require('geometry.rod_length', self.rod_length, bool(span < self.rod_length),
                 f'be greater than {span:.6g} m, for the platform to stand unturned above the '
                 'base')

    @property
    def elbow_sign(self) -> float:
        """Sign of sin u_i."""
        return 1.0 if self.elbow == 'up' else -1.0


@dataclass(frozen=True)
class Masses:
    """Masses and the inertia of the platform with its payload.

    Parameters
    ----------
    platform, payload : float
        M and m [kg].
    slides, lifts, rods : 3 floats each
        m_1..m_3, m_4..m_6 and m_b of each chain [kg].
    centre : 3 floats
        Centre of mass of platform and payload from o, in `platform` [m].
    inertia : 6 floats
        Elements xx, yy, zz, xy, xz, yz of the inertia tensor of both about that centre, in
        `platform` [kg m^2]; products as tensor elements (-integral of x y dm), as in a URDF.
    """

    platform: float
    payload: float
    slides: tuple[float, float, float]
    lifts: tuple[float, float, float]
    rods: tuple[float, float, float]
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        _require('masses.platform', self.platform, self.total > 0,
                 'with masses.payload be greater than 0 kg')
        # A body's tensor has principal moments that satisfy the triangle inequality; a point
        # mass has none at all. Tolerance: a thin disc lies exactly on the border.
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        slack = 1e-9 * max(float(moments[2]), 1e-300)
        _require('masses.inertia', self.inertia, bool(moments[0] >= -slack),
                 'be a positive semi-definite tensor')
        triangle = bool(moments[0] + moments[1] >= moments[2] - slack)
        _require('masses.inertia', self.inertia, triangle,
                 'have principal moments of which each two sum to at least the third')

    @property
    def total(self) -> float:
        """M + m [kg]."""
        return self.platform + self.payload

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, in `platform`, (3, 3) [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _require(key: str, value: Any, condition: bool, rule: str) -> None:
    if not condition:
        raise ModelError(key, value, rule)
