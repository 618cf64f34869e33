"""Pieces of the search: least squares, gains of patterns, and noise below what a record shows."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.noise import NoiseModel
from pprs_dynamics.selection.patterns import Family

# Periods of the lowest frequency at which a record tells how strong its noise is.
GUARD_PERIODS = 8


def solve(columns: Array, values: Array) -> Array:
    """Return least-squares coefficients; columns may be linearly dependent."""
    if not len(columns):
        return np.zeros(0)
    gram = columns @ columns.T
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram = gram / np.outer(scale, scale) + 1e-9 * np.eye(len(gram))
    result: Array = np.linalg.solve(gram, columns @ values / scale) / scale
    return result


def orthonormal(rows: Array) -> Array:
    """Return an orthonormal basis of the rows' span, (K, N)."""
    if not len(rows):
        return rows
    # By the Gram matrix: a hundred rows of thousands of samples are then a hundredth of the work
    # of their singular values. Rows are scaled first, so that small ones are not lost.
    size = np.sqrt(np.maximum(np.einsum('ij,ij->i', rows, rows), 1e-300))
    scaled = rows / size[:, None]
    weights, axes = np.linalg.eigh(scaled @ scaled.T)
    kept = weights > 1e-10 * weights[-1]
    basis: Array = (axes[:, kept] / np.sqrt(weights[kept])).T @ scaled
    return basis


def pattern_gains(family: Family, b: Array, gram: Array, plain: Array) -> Array:
    """Return twice the log-likelihood gain of every pattern, (P, R)."""
    if family.paired:
        cc, ss = gram[0::2, 0::2].diagonal()[:, None], gram[1::2, 1::2].diagonal()[:, None]
        cs = np.diagonal(gram, 1)[0::2, None]
        bc, bs = b[0::2], b[1::2]
        det = cc * ss - cs * cs
        possible = det > 1e-3 * (plain[0::2] * plain[1::2])[:, None]
        gain = (ss * bc * bc - 2 * cs * bc * bs + cc * bs * bs) / np.where(possible, det, np.inf)
        return one_degree(gain.astype(float))
    weights = family.weights.astype(np.float32)
    size = np.einsum('ij,jk,ik->i', weights, gram, weights)
    whole = (weights ** 2) @ plain
    # What the adopted columns explain already is left out, not divided by rounding.
    possible = size > 1e-3 * whole
    gains = (weights @ b) ** 2 / np.where(possible, size, np.inf)[:, None]
    result: Array = gains.astype(float)
    return result


def one_degree(gain: Array) -> Array:
    """Return the gain of one degree of freedom that is as rare as this one of two."""
    result: Array = gain - np.log(np.maximum(np.pi * gain / 2, 1.0))
    return result


def slow_noise(noise: NoiseModel, n: int) -> Array:
    """Return columns, each of prior variance 1, that carry noise slower than the record shows.

    A record of length T says little about noise below a few 1/T, and there 1/f noise looks like an
    offset or a step. So its spectrum is continued downwards by the power law that it follows just
    above, as random cosines that compete with the pattern.
    """
    size = 4 * max(n, len(noise.filter))
    power = noise.spectrum(size)
    at = np.array([1, 4]) * int(GUARD_PERIODS * size / n)
    at = np.minimum(at, len(power) - 1)
    slope = float(np.clip(np.log(power[at[0]] / power[at[1]]) / np.log(4), 0.0, 2.0))
    k = np.arange(2 * GUARD_PERIODS)
    cosines = np.cos(np.pi * np.outer(k, np.arange(n) + 0.5) / n)
    # The k-th cosine has frequency k / (2 T); the mean stands for all below 1 / (4 T).
    ratio = 2 * GUARD_PERIODS / np.maximum(k, 0.5)
    excess = power[at[0]] * ratio ** slope - power[(k * size) // (2 * n)]
    prior = np.maximum(excess, 1e-9 * power[at[0]]) * np.where(k == 0, 1.0, 2.0) / n
    columns: Array = cosines * np.sqrt(prior)[:, None]
    return columns


def trial_limits(
    limit: float, outer: tuple[float, float], edges: Array, width: float,
) -> Array:
    """Return trial limits within a share of the way to a limit's neighbouring edges."""
    grid = np.unique(np.concatenate((edges, np.abs(edges), outer)))
    below, above = grid[grid < limit - 1e-12], grid[grid > limit + 1e-12]
    low = below[-1] if len(below) else outer[0]
    high = above[0] if len(above) else outer[1]
    share = np.arange(1, 5) / 5 * width
    return np.unique(np.concatenate((limit - share * (limit - low), [limit],
                                     limit + share * (high - limit))))
