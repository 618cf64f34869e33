# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Repeatable forces that no number of a model explains: Gaussian processes and waves.

A Gaussian process over states, s = (q / l_q, tanh(v / v_0) / l_v), is a finite sum, Phi(s) w, over
states that a pivoted Cholesky factor of its kernel chooses. States of a recording that these do not
reach get features of their own. Waves depend on the position of a drive, finer than any length.

References
----------
S. Fine, K. Scheinberg, Efficient SVM training using low-rank kernel representations, J. Mach.
Learn. Res. 2 (2001) (pivoted Cholesky factor).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.residuals.residuals import Residuals

# States on which a process is conditioned, over all drives and over one, and further ones of
# another recording.
MOST_STATES, MOST_OWN, MOST_NEW = 100, 40, 50
LEAST_VARIANCE = 0.05  # of the kernel, that a further state must bring
SLOW = 0.3  # of the rms speed of a drive: within it direction turns over
# Waves of a drive: at most; from and to how many over the whole stroke; and how often the variance
# of the residual sine and cosine explain: by chance one in 25 000 that are tried does.
MOST_WAVES, LONGEST_WAVE, FINEST_WAVE, LEAST_WAVE = 6, 10.0, 400.0, 20.0
WAVE_STEP, FINE_STEP = 0.5, 0.02  # of a wave over the stroke, between those that are tried
FEW_WHOLE = 10.0  # waves over the stroke between whole numbers for a turn, for one to be meant


@dataclass(frozen=True)
class States:
    """Where drives are and which way they move, in lengths over which forces are alike.

    Parameters
    ----------
    centre, spread, speed : (D,) array
        [rad, m], [rad/s, m/s].
    lengths : tuple of float
        Of positions in spreads, and of directions.
    """

    centre: Array
    spread: Array
    speed: Array
    lengths: tuple[float, float] = (1.0, 1.0)

    @classmethod
    def of(cls, residuals: Residuals) -> States:
        """Return the scales of a recording."""
        q, v = motion_of(residuals)
        return cls(q.mean(axis=0), np.maximum(q.std(axis=0), 1e-9),
                   np.maximum(SLOW * np.sqrt((v ** 2).mean(axis=0)), 1e-9))

    def path(self, residuals: Residuals) -> Array:
        """Return positions and velocities of a recording in standard deviations, (M, 2 D)."""
        q, v = motion_of(residuals)
        return np.concatenate(((q - self.centre) / self.spread, v / self.speed * SLOW), axis=1)

    def at(self, q: Array, v: Array, drive: int | None = None) -> Array:
        """Return the states of all drives in a motion (M, D), or of one, (M, k)."""
        position, direction = (q - self.centre) / self.spread, np.tanh(v / self.speed)
        chosen = slice(None) if drive is None else [drive]
        return np.concatenate((position[:, chosen] / self.lengths[0],
                               direction[:, chosen] / self.lengths[1]), axis=1)


def motion_of(residuals: Residuals) -> tuple[Array, Array]:
    """Return positions and velocities of the drives, (M, D) each."""
    return residuals.variables['position'], residuals.variables['velocity']


def kernel(a: Array, b: Array) -> Array:
    """Return the correlation of forces at states (n, k) and (m, k), (n, m).

    Matern's of order 3/2: continuous forces with kinks that are no steps.
    """
    squares = (a ** 2).sum(axis=1)[:, None] + (b ** 2).sum(axis=1) - 2 * a @ b.T
    r = np.sqrt(3 * np.maximum(squares, 0.0))
    correlation: Array = (1 + r) * np.exp(-r)
    return correlation


def factor_of(states: Array, most: int, known: Array | None = None) -> tuple[Integers, Array]:
    """Return rows and factor (M, R) of a pivoted Cholesky factorisation of the kernel.

    Parameters
    ----------
    states : (M, k) array
    most : int
    known : (M, r) array, optional
        Factor of what is known of it already.
    """
    before = np.zeros((len(states), 0)) if known is None else known
    left = 1 - (before ** 2).sum(axis=1)
    factor = np.zeros((len(states), most))
    chosen: list[int] = []
    while len(chosen) < most and left.max() > LEAST_VARIANCE:
        k, row = len(chosen), int(np.argmax(left))
        column = (kernel(states, states[row:row + 1])[:, 0] - before @ before[row]
                  - factor[:, :k] @ factor[row, :k])
        factor[:, k] = column / np.sqrt(column[row])
        left = left - factor[:, k] ** 2
        chosen.append(row)
    return np.array(chosen, dtype=int), factor[:, :len(chosen)]


@dataclass(frozen=True)
class Process:
    """A process of unit size, conditioned on some states.

    Parameters
    ----------
    drive : int or None
        Over whose state; None: over those of all.
    states : States
    chosen : (R, k) array
        States that it is conditioned on.
    root : (R, R) array
        Lower factor of their kernel.
    """

    drive: int | None
    states: States
    chosen: Array
    root: Array

    def __len__(self) -> int:
        return len(self.chosen)

    @classmethod
    def of(cls, residuals: Residuals, states: States, drive: int | None = None,
           ) -> tuple[Process, Array]:
        """Return that of a recording, and its features there, (M, R)."""
        at = states.at(*motion_of(residuals), drive)
        rows, factor = factor_of(at, MOST_STATES if drive is None else MOST_OWN)
        return cls(drive, states, at[rows], factor[rows]), factor

    def known(self, q: Array, v: Array, _: float) -> Array:
        """Return its features in a motion, (M, R); see `Waves.known`."""
        from scipy.linalg import solve_triangular  # here: commands start without it

        at = self.states.at(q, v, self.drive)
        known: Array = solve_triangular(self.root, kernel(self.chosen, at), lower=True).T
        return known

    def new(self, q: Array, v: Array, known: Array) -> Array:
        """Return features of states that it does not know, (M, r), orthogonal to the known ones."""
        return factor_of(self.states.at(q, v, self.drive), MOST_NEW, known)[1]


@dataclass(frozen=True)
class Waves:
    """Waves of a drive's force over its own position and their first overtones, of unit size.

    Parameters
    ----------
    drive : int
    numbers : (K,) array
        Radians of a wave for each unit of the position [1, rad/m].
    """

    drive: int
    numbers: Array

    def __len__(self) -> int:
        return 4 * len(self.numbers)

    @classmethod
    def of(cls, residuals: Residuals, drive: int, left: Array, gear: float) -> Waves:
        """Return those that a drive's residual, (M,), shows.

        The strongest first, each with those before it. One stroke determines a number to less than
        a wave, and where another path goes that is out of phase: what may be a whole number for
        each turn of the motor, `gear` times the drive's, is.
        """
        q, known = motion_of(residuals)[0][:, drive], np.isfinite(left)
        found, stroke = cls(drive, np.empty(0)), float(np.ptp(q))
        finest = max(float(np.median(np.abs(np.diff(q)))), stroke / FINEST_WAVE)
        if not stroke or not np.any(left[known]):
            return found
        tried = 2 * np.pi / stroke * np.arange(LONGEST_WAVE, stroke / finest, WAVE_STEP)
        turns = np.exp(1j * np.outer(tried, q[known]))
        left = rest = left[known]
        while len(found.numbers) < MOST_WAVES:
            power = 2 * np.abs(turns @ rest) ** 2 / (rest @ rest)
            if power.max(initial=0.0) < LEAST_WAVE:
                break
            near = tried[int(np.argmax(power))] + 2 * np.pi / stroke * np.arange(
                -WAVE_STEP, WAVE_STEP, FINE_STEP)
            at = near[int(np.argmax(np.abs(np.exp(1j * np.outer(near, q[known])) @ rest)))]
            apart, whole = 2 * np.pi / stroke, gear * np.round(at / gear)
            if abs(whole - at) < apart < gear / FEW_WHOLE:
                at = whole
            found = cls(drive, np.append(found.numbers, at))
            features = found.known(*motion_of(residuals), residuals.period)[known]
            rest = left - features @ np.linalg.lstsq(features, left)[0]
        return found

    def known(self, q: Array, v: Array, period: float) -> Array:
        """Return its features in a motion, (M, 4 K).

        Means over a sample, in which the wave turns on.

        Parameters
        ----------
        q, v : (M, D) array
        period : float
            Of a sample [s]; 0 where it is no mean.
        """
        q, v = q[:, self.drive, None], v[:, self.drive, None]
        numbers = np.concatenate((self.numbers, 2 * self.numbers))
        mean = np.sinc(numbers * v * period / (2 * np.pi))
        phase = numbers * q
        found: Array = np.concatenate((mean * np.sin(phase), mean * np.cos(phase)), axis=1)
        return found

    def new(self, q: Array, _: Array, __: Array) -> Array:
        """Return none: it knows every position."""
        return np.zeros((len(q), 0))
