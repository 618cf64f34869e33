# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Gaussian posteriors under linear inequality constraints, all of them in one solve.

.. math::

    \min_c\; (c - \hat c)^T \Sigma^{-1} (c - \hat c) \quad\text{subject to}\quad A c \ge b,

least-distance programming by non-negative least squares. A convex set that is not a polyhedron is
given by tangent planes: the solution is repeated with the planes that it violates.

References
----------
C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23.
J. E. Kelley, The cutting-plane method for solving convex programs, Journal of the SIAM 8 (1960).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array

MOST_ROUNDS = 1000  # of planes for a convex set
INFEASIBLE = 1e-9  # of the norm of the least-distance problem, below which no point exists


@dataclass(frozen=True)
class Inequalities:
    """Linear inequalities A c >= b on coefficients.

    Parameters
    ----------
    A : (n, P) array
    b : (n,) array
    """

    A: Array
    b: Array

    @classmethod
    def none(cls, size: int) -> Inequalities:
        """Return no inequality on `size` coefficients."""
        return cls(np.zeros((0, size)), np.zeros(0))

    def and_also(self, other: Inequalities) -> Inequalities:
        """Return both lists as one."""
        return Inequalities(np.concatenate((self.A, other.A)), np.concatenate((self.b, other.b)))


@dataclass(frozen=True)
class Constrained:
    """The mode of a Gaussian under constraints.

    Parameters
    ----------
    coefficients : (P,) array
    covariance : (P, P) array
        Given that the active constraints are equalities.
    rise : float
        Squared distance from the unconstrained mode, in units of its covariance.
    active : Inequalities
        Those that hold as equalities.
    """

    coefficients: Array
    covariance: Array
    rise: float
    active: Inequalities


def conditioned(mean: Array, covariance: Array, A: Array, b: Array) -> Constrained:
    """Return a Gaussian given A c = b; rows of A that depend on others count once.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    A : (n, P) array
    b : (n,) array
    """
    across = covariance @ A.T
    among = A @ across
    size = np.sqrt(np.maximum(np.diag(among), 1e-300))
    inverse = np.linalg.pinv(among / np.outer(size, size), 1e-12, hermitian=True)
    inverse /= np.outer(size, size)
    missing = b - A @ mean
    return Constrained(mean + across @ (inverse @ missing),
                       covariance - across @ inverse @ across.T,
                       float(missing @ inverse @ missing), Inequalities(A, b))


def constrained(mean: Array, covariance: Array, inequalities: Inequalities) -> Constrained | None:
    """Return the mode of a Gaussian where A c >= b; None where no point satisfies that.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    inequalities : Inequalities
    """
    A, b = inequalities.A, inequalities.b
    if np.all(A @ mean >= b):
        return Constrained(mean, covariance, 0.0, Inequalities.none(len(mean)))
    from scipy.optimize import nnls  # here: commands that fit nothing start without it

    scale, L = _root(covariance)
    G = (A * scale) @ L
    size = np.maximum(np.linalg.norm(G, axis=1), 1e-300)
    G, wanted = G / size[:, None], (b - A @ mean) / size
    # In units of the largest violation, so that the last element of the problem is of order 1.
    unit = float(np.max(wanted))
    problem = np.vstack((G.T, wanted / unit))
    target = np.append(np.zeros(len(L)), 1.0)
    weights = nnls(problem, target, maxiter=50 * (len(b) + len(L)))[0]
    if float(np.linalg.norm(problem @ weights - target)) < INFEASIBLE:
        return None
    # The active constraints hold to rounding as equalities; NNLS has them to its tolerance.
    active = weights > 0
    return conditioned(mean, covariance, A[active], b[active])


def nearest(mean: Array, covariance: Array, inequalities: Inequalities,
            planes: Callable[[Array], Inequalities]) -> Constrained | None:
    """Return the mode of a Gaussian within inequalities and a convex set; None for an empty set.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    inequalities : Inequalities
    planes : callable
        Returns, for coefficients, inequalities of the set that they violate; none within it.
    """
    found: Constrained | None = constrained(mean, covariance, inequalities)
    for _ in range(MOST_ROUNDS):
        if found is None:
            return None
        more = planes(found.coefficients)
        if not len(more.b):
            return found
        # Planes that are not active are not needed: the distance grows with every round.
        found = constrained(mean, covariance, inequalities.and_also(found.active).and_also(more))
    return None


def _root(covariance: Array) -> tuple[Array, Array]:
    """Return standard deviations, and a root L of the correlations: L L^T."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    divided = np.where(scale > 0, scale, 1.0)
    values, axes = np.linalg.eigh(covariance / divided[:, None] / divided)
    return scale, axes * np.sqrt(np.maximum(values, 0.0))
