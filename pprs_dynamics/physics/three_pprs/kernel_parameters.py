# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the 3-PPRS' kernels, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, NamedTuple, TypeVar, TypeVarTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.vectors import Vector

CHAINS = 3
Ts = TypeVarTuple('Ts')
R = TypeVar('R')


def each_chain(function: Callable[[int, *Ts], R]) -> Callable[[*Ts], tuple[R, R, R]]:
    """Decorate a function of chain i, its first argument: the result gives those of all three.

    In Python as compiled. Tuples stay in registers: where a loop stores the motion of the chains
    in an array instead, the forces of a batch take 1.20 (1.18 to 1.24) times as long.
    """
    @wraps(function)
    def three(*arguments: *Ts) -> tuple[R, R, R]:
        return function(0, *arguments), function(1, *arguments), function(2, *arguments)

    return three


REVOLUTE, SPHERICAL = 'revolute', 'spherical'  # names of the joints C_i and A_i


class Chain(NamedTuple):
    """Constants of one chain.

    `cos` and `sin` of delta_i; `x`, `y` of the spherical joint in `platform` [m].
    With s_i, the speed of A_i along n_i, (v_x, v_y) = sum of (`left_x`, `left_y`) s_i. The sum
    of `balance` s_i is 0 for a platform that does not turn.
    """

    cos: Value
    sin: Value
    x: Value
    y: Value
    left_x: Value
    left_y: Value
    balance: Value


class GeometryParameters(NamedTuple):
    """R and l [m], the sign of sin u_i, and the three chains."""

    R: Value
    l: Any  # noqa: E741
    elbow: Value
    chains: tuple[Chain, Chain, Chain]


class PlatformBody(NamedTuple):
    """Mass [kg], centre [m] and inertia [kg m^2] of platform and payload, in `platform`."""

    mass: Value
    centre: Vector
    moments: Vector
    products: Vector


class ChainMasses(NamedTuple):
    """Masses in one chain [kg]."""

    slide: Value
    lift: Value
    rod: Value


class RobotParameters(NamedTuple):
    """Geometry, masses, and gravity in `base` [m/s^2]."""

    geometry: GeometryParameters
    platform: PlatformBody
    masses: tuple[ChainMasses, ChainMasses, ChainMasses]
    gravity: Vector


class Joints(NamedTuple):
    """Friction of C_i and of A_i: c [N m s/rad], M [N m] at any load, mu [1] and d [m].

    It turns over within `width` [rad/s]; `printed` is 1 for Eq. (12) to the letter, else 0.
    """

    width: Any
    printed: Any
    c_r: Value = 0.0
    M_r: Value = 0.0
    mu_r: Value = 0.0
    d_r: Value = 0.0
    c_s: Value = 0.0
    M_s: Value = 0.0
    mu_s: Value = 0.0
    d_s: Value = 0.0

    @classmethod
    def of(cls, blocks: Mapping[str, Mapping[str, float]], width: float, printed: bool) -> Joints:
        """Return the friction of blocks `revolute` and `spherical`; 0 by default.

        Parameters
        ----------
        blocks : mapping of str to mapping
            `viscous`, `torque`, `coulomb` and `radius`.
        width : float
        printed : bool
        """
        return cls(width, float(printed), *(
            factor * block.get(key, 0.0)
            for block in (blocks.get(REVOLUTE, {}), blocks.get(SPHERICAL, {}))
            for key, factor in (('viscous', 1.0), ('torque', 1.0), ('coulomb', 1.0),
                                ('radius', 2.0))))
