"""Rates in the passive joints, and how their friction turns over."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.mechanism.arithmetic import sqrt
from pprs_dynamics.mechanism.evaluation import evaluate
from pprs_dynamics.mechanism.inverse_kinematics import read_chain
from pprs_dynamics.mechanism.reversal import sign_over_speed
from pprs_dynamics.mechanism.vectors import ChainVector


class Turnover(NamedTuple):
    """sgn(s) / s in C_i and in A_i [s/rad]."""

    revolute: Any
    spherical: Any


def relative_rate(u_dot: Any, omega: ChainVector) -> ChainVector:
    """Return omega_n = u_dot_i n_i - omega, of the rod relative to the platform [rad/s]."""
    return ChainVector(-omega.e, u_dot - omega.n, -omega.k)                    # Eq. (9)


def length(v: ChainVector) -> Any:
    """Return |v|."""
    return sqrt(v.e * v.e + v.n * v.n + v.k * v.k)


def turnover(u_dot: Any, omega: ChainVector, width: Any) -> Turnover:
    """Return how friction turns over in the joints of a chain, within `width` [rad/s]."""
    return Turnover(sign_over_speed(abs(u_dot), width),
                    sign_over_speed(length(relative_rate(u_dot, omega)), width))


def turnover_table(chains: Array, width: float) -> Array:
    """Return `turnover` for a table of chains: C_i, then A_i, (N, 6)."""
    table = np.empty((len(chains), 6))
    evaluate(turnover_kernel, np.array([width]), chains, table)
    return table


def turnover_kernel(p: Any, s: Any, chains: Any, table: Any) -> Any:
    """Fill a table of `turnover`; p is the width."""
    for i in range(3):
        c = read_chain(chains, s, i)
        table[s, i], table[s, 3 + i] = turnover(c.u_dot, c.omega, p[0])
    return True
