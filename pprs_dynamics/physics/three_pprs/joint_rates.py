# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Rates in the passive joints, and the turnover of their friction."""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Value
from pprs_dynamics.physics.mechanism.arithmetic import sqrt
from pprs_dynamics.physics.mechanism.reversal import sign_over_speed
from pprs_dynamics.physics.mechanism.vectors import ChainVector


class Turnover(NamedTuple):
    """sgn(s) / s in C_i and in A_i [s/rad]."""

    revolute: Value
    spherical: Value


def relative_rate(u_dot: Value, omega: ChainVector) -> ChainVector:
    """Return omega_n = u_dot_i n_i - omega, of the rod relative to the platform [rad/s]."""
    return ChainVector(-omega.e, u_dot - omega.n, -omega.k)                    # Eq. (9)


def length(v: ChainVector) -> Any:
    """Return |v|."""
    return sqrt(v.e * v.e + v.n * v.n + v.k * v.k)


def turnover(u_dot: Value, omega: ChainVector, width: Value) -> Turnover:
    """Return the turnover of friction in the joints of a chain, within `width` [rad/s]."""
    return Turnover(sign_over_speed(abs(u_dot), width),
                    sign_over_speed(length(relative_rate(u_dot, omega)), width))
