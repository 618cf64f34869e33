# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How strong a hidden effect is: what it adds beyond the refitted model, over the noise.

Both are treated as a comparison treats them and whitened with the true covariance of the noise.
The refitted model may change its numbers within the tolerances of the model file. With a tolerance
of 5 %, a payload that is 4 % too heavy is no effect; one that is 20 % too heavy is an effect of
15 %.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.optimize import brentq, lsq_linear
from scipy.signal import lfilter

from benchmarks.hidden.effort_noise import EffortNoise, NoiseSettings
from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.measurement.motion.treatment import Treatment

WHITENING_ORDER = 64
# Numbers that are known to a tolerance only. Not the inertia: the paper's disc is as thin as a
# body can be, and a little more or less of one moment would be no body.
TOLERATED = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods',
             'friction.drives.viscous', 'friction.drives.coulomb',
             'friction.revolute.viscous', 'friction.revolute.coulomb',
             'friction.spherical.viscous', 'friction.spherical.coulomb')
WIDEST_SCALE = 1e3  # between an effect and the same effect at the wanted strength


def tolerated_numbers(values: Mapping[str, Any]) -> Iterator[tuple[str, int | None]]:
    """Yield key and index of every number that may be off; relatively, so that 0 is not."""
    for key in TOLERATED:
        if isinstance(values[key], tuple):
            yield from ((key, i) for i, value in enumerate(values[key]) if value)
        elif values[key]:
            yield key, None


def changed_values(values: Mapping[str, Any], key: str, index: int | None,
                   factor: float) -> dict[str, Any]:
    """Return the values with one number multiplied by a factor."""
    old = values[key]
    if index is None:
        new: Any = old * factor
    else:
        new = tuple(v * factor if i == index else v for i, v in enumerate(old))
    return {**values, key: new}


def sensitivities(model: DriveModel, motion: PlatformMotion, treat: Treatment,
                  tolerance: float) -> np.ndarray:
    """Return what each tolerated number, off by its tolerance, adds to the treated forces.

    Returns
    -------
    (K, M, 6) array
        [N]
    """
    values = model.values
    nominal = model.drive_forces(motion).total
    return np.array([
        treat(DriveModel.from_parameters(
            changed_values(values, key, i, 1 + tolerance)).drive_forces(motion).total
              - nominal)
        for key, i in tolerated_numbers(values)])


class Whitening:
    """Makes treated noise of one effort white and of unit variance.

    A prediction-error filter of `WHITENING_ORDER` from the exact autocovariance of the block
    means; the first samples, for which it has no past, are left out.

    Parameters
    ----------
    settings : NoiseSettings
    block : int
        Samples per block.
    """

    def __init__(self, settings: NoiseSettings, block: int) -> None:
        noise = EffortNoise(settings, np.random.default_rng(0))
        offsets = np.subtract.outer(np.arange(block), np.arange(block))
        lags = block * np.arange(WHITENING_ORDER + 1)[:, None, None] + offsets
        r = noise.autocovariance(lags.ravel()).reshape(lags.shape).mean(axis=(1, 2))
        past = solve_toeplitz(r[:-1], r[1:])
        self.deviation = float(np.sqrt(r[0]))
        self._filter = np.concatenate(([1.0], -past)) / np.sqrt(r[0] - past @ r[1:])

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return values (M, ...) whitened, (M - WHITENING_ORDER, ...)."""
        return lfilter(self._filter, 1.0, values, axis=0)[WHITENING_ORDER:]


class Refit:
    """The model refitted within its tolerances.

    Parameters
    ----------
    columns : (K, M, 6) array
        See `sensitivities`.
    off : (K,) array
        How much the robot's numbers are off already, in tolerances, -1 to 1: the rest is for
        the refit to move is -1 - off to 1 - off.
    whitening : Whitening
    """

    def __init__(self, columns: np.ndarray, off: np.ndarray, whitening: Whitening) -> None:
        self._whitening = whitening
        white = np.stack([whitening(column).ravel() for column in columns], axis=1)
        self._q, self._r = np.linalg.qr(white)
        # Platform and payload, for one, weigh alike: a hint of a ridge makes the fit unique.
        self._ridge = 1e-6 * np.linalg.norm(self._r) * np.eye(len(columns))
        self._bounds = (-1 - off - 1e-9, 1 - off + 1e-9)

    def beyond(self, contribution: np.ndarray) -> Ray:
        """Return the treated contribution (M, 6) [N] of an effect, ready to be scaled."""
        white = self._whitening(contribution).ravel()
        return Ray(self, white, self._q.T @ white)

    def left(self, inside: np.ndarray) -> np.ndarray:
        """Return the residual, after the refit, of a contribution within its columns' span."""
        rows = np.vstack((self._r, self._ridge))
        wanted = np.concatenate((-inside, np.zeros(len(inside))))
        found = lsq_linear(rows, wanted, self._bounds, method='bvls').x
        return self._r @ found + inside

    def spread(self, inside: np.ndarray) -> np.ndarray:
        """Return such a contribution at the whitened samples."""
        return self._q @ inside


class Ray:
    """An effect's whitened contribution, times any factor."""

    def __init__(self, refit: Refit, white: np.ndarray, inside: np.ndarray) -> None:
        self._refit, self._white, self._inside = refit, white, inside
        self._outside = max(float(white @ white - inside @ inside), 0.0)

    def strength(self, factor: float = 1.0) -> float:
        """Return the rms beyond the refitted model over that of the noise, all drives pooled."""
        left = self._refit.left(factor * self._inside)
        return float(np.sqrt((factor ** 2 * self._outside + left @ left) / len(self._white)))

    def by_drive(self) -> np.ndarray:
        """Return the same for each drive, (6,)."""
        left = self._refit.left(self._inside)
        beyond = self._white + self._refit.spread(left - self._inside)
        return np.sqrt(np.mean(beyond.reshape(-1, 6) ** 2, axis=0))

    def factor(self, wanted: float) -> float:
        """Return the factor that gives a wanted strength; at its limits where none does."""
        def excess(logarithm: float) -> float:
            return self.strength(float(np.exp(logarithm))) - wanted

        ends = np.log((1 / WIDEST_SCALE, WIDEST_SCALE))
        if excess(ends[0]) >= 0:
            return 1 / WIDEST_SCALE
        if excess(ends[1]) <= 0:
            return WIDEST_SCALE
        return float(np.exp(brentq(excess, *ends, xtol=1e-3)))
