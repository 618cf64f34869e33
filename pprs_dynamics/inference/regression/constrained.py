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
DEPENDENT = 1e-12  # singular value of rows of length 1, below which some depend on others
# Of the terms of an inequality, and of its standard deviation, by which a solution may violate it.
UNSATISFIED, ROUNDING = 1e-6, 1e-10
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


@dataclass(frozen=True, eq=False)
class Constrained:
    """The mode of a Gaussian under constraints.

    Parameters
    ----------
    coefficients : (P,) array
    rise : float
        Squared distance from the unconstrained mode, in units of its covariance.
    active : Inequalities
        Those that hold as equalities.
    root : (P, P) array
        A root R of the covariance without constraints, R R^T.
    fixed : (P, r) array
        Orthonormal directions of R^-1 c in which the active constraints fix c.
    """

    coefficients: Array
    rise: float
    active: Inequalities
    root: Array
    fixed: Array

    @property
    def covariance(self) -> Array:
        """Covariance given that the active constraints are equalities, (P, P)."""
        across = self.root @ self.fixed
        found: Array = self.root @ self.root.T - across @ across.T
        return found


def conditioned(mean: Array, covariance: Array, active: Inequalities) -> Constrained:
    """Return a Gaussian given A c = b; rows of A that depend on others count once.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    active : Inequalities
        Taken as equalities.
    """
    return _conditioned(mean, _root(covariance), active)


def constrained(mean: Array, covariance: Array, inequalities: Inequalities) -> Constrained | None:
    """Return the mode of a Gaussian where A c >= b; None where no point satisfies that.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    inequalities : Inequalities
    """
    return _constrained(mean, _root(covariance), inequalities)


def nearest(mean: Array, covariance: Array, inequalities: Inequalities,
            planes: Callable[[Array], Inequalities], below: float = np.inf) -> Constrained | None:
    """Return the mode of a Gaussian within inequalities and a convex set; None for an empty set.

    Parameters
    ----------
    mean : (P,) array
    covariance : (P, P) array
    inequalities : Inequalities
    planes : callable
        Returns, for coefficients, inequalities of the set that they violate; none within it.
    below : float
        A rise from which on None is returned.
    """
    root = _root(covariance)
    found = _constrained(mean, root, inequalities)
    for _ in range(MOST_ROUNDS):
        if found is None or found.rise >= below:
            return None
        more = planes(found.coefficients)
        if not len(more.b):
            return found
        # Planes that are not active are not needed: the distance grows with every round.
        found = _constrained(mean, root, inequalities.and_also(found.active).and_also(more))
    return None


def _conditioned(mean: Array, root: Array, active: Inequalities) -> Constrained:
    G, wanted, _ = _whitened(mean, root, active)
    # Of the rows and not of their products: bodies have moments that no motion shows, a million
    # times as uncertain as others, and their planes differ by the others alone.
    U, values, V = np.linalg.svd(G, full_matrices=False)
    kept = values > DEPENDENT
    fixed = V[kept].T
    moved = fixed @ (U[:, kept].T @ wanted / values[kept])
    return Constrained(mean + root @ moved, float(moved @ moved), active, root, fixed)


def _constrained(mean: Array, root: Array, inequalities: Inequalities) -> Constrained | None:
    A, b = inequalities.A, inequalities.b
    if np.all(A @ mean >= b):
        return _conditioned(mean, root, Inequalities.none(len(mean)))
    from scipy.optimize import nnls  # here: commands that fit nothing start without it

    G, wanted, size = _whitened(mean, root, inequalities)
    # In units of the largest violation, so that the last element of the problem is of order 1.
    problem = np.vstack((G.T, wanted / float(np.max(wanted))))
    target = np.append(np.zeros(len(mean)), 1.0)
    weights = nnls(problem, target, maxiter=50 * sum(G.shape))[0]
    if float(np.linalg.norm(problem @ weights - target)) < INFEASIBLE:
        return None
    # The active constraints hold to rounding as equalities; NNLS has them to its tolerance.
    active = weights > 0
    found = _conditioned(mean, root, Inequalities(A[active], b[active]))
    # Where rows contradict each other nearly, no point is found that satisfies them.
    terms = np.abs(A) @ np.abs(found.coefficients) + np.abs(b)
    short = b - A @ found.coefficients
    return None if np.any(short > UNSATISFIED * terms + ROUNDING * size) else found


def _root(covariance: Array) -> Array:
    """Return a root R of a covariance (P, P), R R^T."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    divided = np.where(scale > 0, scale, 1.0)
    values, axes = np.linalg.eigh(covariance / divided[:, None] / divided)
    root: Array = scale[:, None] * axes * np.sqrt(np.maximum(values, 0.0))
    return root


def _whitened(mean: Array, root: Array, inequalities: Inequalities) -> tuple[Array, Array, Array]:
    """Return rows A R of length 1, how far R^-1 (c - mean) has to move along them, and lengths."""
    G = inequalities.A @ root
    size = np.maximum(np.linalg.norm(G, axis=1), 1e-300)
    return G / size[:, None], (inequalities.b - inequalities.A @ mean) / size, size
