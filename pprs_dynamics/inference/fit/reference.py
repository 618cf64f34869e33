# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

r"""Prediction of the repeatable error of a recording from reference runs, with its uncertainty.

.. math::

    y_r = X_r \theta + \delta(s_r) + n_r, \qquad
    y_l = X_l \theta + \rho\,\delta(s_l) + \sqrt{1 - \rho^2}\,\delta'(s_l) + n_l

y are the errors of the model, theta the numbers of its base, and delta the repeatable error. Delta
is in each drive the sum of three Gaussian processes. Two are over the states of all drives,
s = (q / l_q, tanh(v / v_0) / l_v), and over its own. The third is over how far it has slid since a
reversal, s = (z / l_v, tanh(v / v_0) / l_v), with Dahl's state z. Waves over its own position are
added, as gears and motors have them. delta' is drawn anew for every run. Given y_r,
X_l theta + delta(s_l) is Gaussian: its mean is carried over, and the principal directions of its
covariance are columns of unit prior. Near the states of the reference the errors of the base
cancel. Far from them the prior decides.

A process is a finite sum, Phi(s) w, over states that a pivoted Cholesky factor of its kernel
chooses. States of a recording that these do not reach get features of their own. Waves are finer
than any length.

References
----------
S. Fine, K. Scheinberg, Efficient SVM training using low-rank kernel representations, J. Mach.
Learn. Res. 2 (2001) (pivoted Cholesky factor).
M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, J. R. Stat. Soc. B 63 (2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.fit.mechanism_fit import base_numbers, base_prior, reconstructed
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    CarriedOver,
    ReferenceDirection,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.residuals.bands import LEAST_OPEN, OpenForces
from pprs_dynamics.inference.residuals.reconstruction import CHUNK, Reconstruction
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.explained_effort import little_explained
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.hysteresis import presliding
from pprs_dynamics.physics.model.drive_model import DriveModel

# Over which forces are alike, in standard deviations of the positions and in turns of the
# directions: of the process over all drives, and of that over one drive's own state.
LENGTHS, OWN_LENGTHS = (0.5, 1.2), (0.8, 1.2)
FIRST_SIZE = 0.4  # of a process, over the error: from which its size is fitted
LEAST_SIZE = 1e-9  # [N, N m], of a process that does nothing
ROUNDS = 3  # of the size of the process
LEAST_COUNT = 1.0  # determined coefficients, over which the size of a process is taken
LEAST_LENGTH = 200  # samples after treatment: a few seconds
BLOCKS = 4  # of a single reference, each predicted from the others
MOST_DIRECTIONS = 24  # that become columns of all drives together
# States on which a process is conditioned, over all drives and over one, and further ones of
# another recording.
MOST_STATES, MOST_OWN, MOST_NEW = 100, 40, 50
LEAST_VARIANCE = 0.05  # of the kernel, that a further state must bring
SLOW = 0.3  # of the rms speed of a drive: within it direction turns over
# Of the spread of positions, the way after a reversal in which friction is told apart: from some
# hundredths of a millimetre to some millimetres.
SLIDING = 0.03
# Waves of a drive: at most; from and to how many over the whole stroke; and how often the variance
# of the residual sine and cosine explain: by chance one in 25 000 that are tried does.
MOST_WAVES, LONGEST_WAVE, FINEST_WAVE, LEAST_WAVE = 6, 10.0, 400.0, 20.0
WAVE_STEP, FINE_STEP = 0.5, 0.02  # of a wave over the stroke, between those that are tried


@dataclass(frozen=True)
class States:
    """Positions and directions of drives, in units of correlation lengths of the error.

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

    def at(self, q: Array, v: Array, drive: int | None = None, slides: bool = False) -> Array:
        """Return the states of all drives in a motion (M, D), or of one, (M, k).

        Or of one how far it has slid since a reversal, in the place of its position.
        """
        chosen = slice(None) if drive is None else [drive]
        direction = np.tanh(v / self.speed)[:, chosen] / self.lengths[1]
        if slides and drive is not None:
            slid = presliding(q[:, drive], SLIDING * float(self.spread[drive]))[:, None]
            return np.concatenate((slid / self.lengths[1], direction), axis=1)
        position = ((q - self.centre) / self.spread)[:, chosen] / self.lengths[0]
        return np.concatenate((position, direction), axis=1)


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
    slides : bool
        Whether over how far the drive has slid, see `States.at`.
    """

    drive: int | None
    states: States
    chosen: Array
    root: Array
    slides: bool = False

    @classmethod
    def of(cls, residuals: Residuals, states: States, drive: int | None = None,
           slides: bool = False) -> tuple[Process, Array]:
        """Return the process of a recording, and its features there, (M, R)."""
        at = states.at(*motion_of(residuals), drive, slides)
        rows, factor = factor_of(at, MOST_STATES if drive is None else MOST_OWN)
        return cls(drive, states, at[rows], factor[rows], slides), factor

    def at(self, q: Array, v: Array, _: float) -> Array:
        """Return the states in a motion, (M, k); see `Waves.at`."""
        return self.states.at(q, v, self.drive, self.slides)

    def known(self, at: Array) -> Array:
        """Return the features of the process at states, (M, R)."""
        from scipy.linalg import solve_triangular  # here: commands start without it

        known: Array = solve_triangular(self.root, kernel(self.chosen, at), lower=True).T
        return known

    def new(self, at: Array, known: Array) -> Array:
        """Return features of states that it does not know, (M, r), orthogonal to the known ones."""
        return factor_of(at, MOST_NEW, known)[1]


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

    @classmethod
    def of(cls, residuals: Residuals, drive: int, left: Array) -> Waves:
        """Return the waves in a drive's residual, (M,).

        The strongest first, each with those before it.
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
            found = cls(drive, np.append(found.numbers, at))
            features = found.known(found.at(*motion_of(residuals), residuals.period)[known])
            rest = left - features @ np.linalg.lstsq(features, left)[0]
        return found

    def at(self, q: Array, v: Array, period: float) -> Array:
        """Return positions and ways within a sample, (M, 2).

        Parameters
        ----------
        q, v : (M, D) array
        period : float
            Of a sample [s]; 0 where the force is no mean over it.
        """
        return np.stack((q[:, self.drive], v[:, self.drive] * period), axis=1)

    def known(self, at: Array) -> Array:
        """Return the features of the waves, (M, 4 K): means over a sample, in which they turn on.
        """
        numbers = np.concatenate((self.numbers, 2 * self.numbers))
        mean = np.sinc(numbers * at[:, 1:] / (2 * np.pi))
        phase = numbers * at[:, :1]
        found: Array = np.concatenate((mean * np.sin(phase), mean * np.cos(phase)), axis=1)
        return found

    def new(self, at: Array, _: Array) -> Array:
        """Return none: it knows every position."""
        return np.zeros((len(at), 0))


Processes = tuple[tuple[Process | Waves, ...], ...]
"""Of each drive the process over all, those over its own state and its sliding, and its waves."""


class ReferenceRunError(PprsError, ValueError):
    """A reference that says nothing of a model or a recording."""


@dataclass(frozen=True)
class Reference:
    """A reference run, fitted: the numbers of the base and the processes, given its errors.

    Parameters
    ----------
    model : DriveModel
    recordings : tuple of Recording
    processes : Processes
    size : (D, 4) array
        Standard deviations of a drive's processes [N].
    repeats : (D,) array
        Correlation of the processes in two runs.
    base : (N, P) array
        Directions of unit variance of the base's numbers.
    root : (Q, Q) array
        Of the covariance of the coefficients: of these directions, then of the processes of every
        drive.
    regression, fit : Regression, JointFit
    """

    model: DriveModel
    recordings: tuple[Recording, ...]
    processes: Processes
    size: Array
    repeats: Array
    base: Array
    root: Array
    regression: Regression
    fit: JointFit

    @classmethod
    def of(cls, model: DriveModel, recordings: Sequence[Recording]) -> Reference:
        """Return the fit of recordings.

        Raises
        ------
        ReferenceRunError
            Where they are too short, or of another robot.
        PprsError
            As `measure_residuals`.
        """
        found, residuals = reconstructed(model, recordings)
        names = ', '.join(recording.name for recording in recordings)
        if len(residuals) < LEAST_LENGTH:
            raise ReferenceRunError(
                f'{names}: too short for a reference, {len(residuals)} samples after treatment, '
                f'must be at least {LEAST_LENGTH}: record a longer run')
        columns, base = _base(model, found, residuals.measured)
        drives = range(len(residuals.drives))
        measured = Regression(residuals).drives
        processes = _processes(residuals, columns, measured)
        features = _features(processes, _at(processes, *motion_of(residuals), residuals.period))
        fits = {d: _sized(residuals, columns, d, features[d]) for d in measured}
        size = np.stack([fits[d][0] if d in fits else np.full(len(features[d]), LEAST_SIZE)
                         for d in drives])
        regression = Regression(residuals, (*_base_columns(columns, drives), *(
            column for d in drives for column in _columns_of(d, features[d], size[d]))))
        fit = regression.at((), np.stack([fit.amplitudes[0] for _, fit in fits.values()]))
        _require_same_robot(model, residuals, columns, fit, names)
        values, axes = np.linalg.eigh(fit.covariance)
        return cls(model, tuple(recordings), processes, size,
                   _repeats(regression, fit, base.shape[1], _parts(residuals)), base,
                   axes * np.sqrt(np.maximum(values, 0.0)), regression, fit)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(recording.name for recording in self.recordings)

    def carried_over(self, design: Design) -> CarriedOver:
        """Return the predicted forces on the recordings of a design, with their uncertainty."""
        return self._carried_over(design.residuals, design.reconstructions)

    def shown_by(self, recordings: Sequence[Recording]) -> Array:
        """Return the forces that recordings and it have beyond the model, (M, D) [N]."""
        found, residuals = reconstructed(self.model, recordings)
        return self._carried_over(residuals, found).shown(residuals)

    def _carried_over(self, residuals: Residuals, reconstructions: Sequence[Reconstruction],
                      ) -> CarriedOver:
        q, v = motion_of(residuals)
        at = _at(self.processes, q, v, residuals.period)
        known = _features(self.processes, at)
        shared = self.processes[0][0].new(at[0][0], known[0][0])
        numbers, _ = _base(self.model, reconstructions, residuals.measured, self.base)
        count = numbers.shape[2]
        of_base = numbers @ self.fit.coefficients[:count]
        together, apart = [], []
        for d, place in enumerate(self._places(known)):
            new = [shared, *(process.new(states, features) for process, states, features in zip(
                self.processes[d][1:], at[d][1:], known[d][1:], strict=True))]
            here, repeats = np.concatenate(known[d], axis=1), self.repeats[d]
            together.append(numbers[:, d] @ self.root[:count] + repeats * here @ self.root[place])
            apart.append(np.concatenate((
                np.sqrt(1 - repeats ** 2) * _sizes(self.size[d], known[d]) * here,
                *(size * features for size, features in zip(self.size[d], new, strict=True))),
                axis=1))
        rest = residuals.measured - of_base - self._repeating(q, v, residuals.period)
        return CarriedOver(
            of_base, self._repeating,
            *self._open(replace(residuals, measured=rest), together, apart),
            float(np.mean((known[0][0] ** 2).sum(axis=1) > DECISIONS.reference_known)))

    def _places(self, features: Sequence[Sequence[Array]]) -> list[slice]:
        """Return the places of the coefficients of each drive's processes."""
        ends = self.base.shape[1] + np.cumsum(
            [0, *(sum(part.shape[1] for part in of_drive) for of_drive in features)])
        return [slice(int(start), int(end)) for start, end in pairwise(ends)]

    def _repeating(self, q: Array, v: Array, period: float) -> Array:
        """Return the forces that repeat beyond those of the base, (M, D) [N]; see `Waves.at`."""
        found, at = np.zeros_like(q), _at(self.processes, q, v, period)
        for rows in (slice(start, start + CHUNK) for start in range(0, len(q), CHUNK)):
            known = _features(self.processes, [[states[rows] for states in own] for own in at])
            for d, place in enumerate(self._places(known)):
                found[rows, d] = self.repeats[d] * (
                    np.concatenate(known[d], axis=1) @ self.fit.coefficients[place])
        return found

    def _open(self, residuals: Residuals, together: Sequence[Array], apart: Sequence[Array],
              ) -> tuple[tuple[ReferenceDirection, ...], dict[int, OpenForces]]:
        """Return the largest directions of what all drives share, and what else is open in each.

        Noise is that of the reference, or of the recording where that is less.

        Parameters
        ----------
        residuals : Residuals
        together, apart : sequence of (M, k) array
            Of every drive; columns of unit variance, the first ones shared by all drives.
        """
        regression = Regression(residuals)
        spectra, white = regression.fit(()).spectra, []
        for k, d in enumerate(regression.drives):
            series = regression.series[d]
            if d in self.regression.drives:
                of_reference = np.interp(
                    regression.bands.frequency, self.regression.bands.frequency,
                    self.fit.spectra[self.regression.drives.index(d)])
                spectra[k] = np.minimum(spectra[k], of_reference)
            white.append(series.transform(together[d][series.index].T)
                         / np.sqrt(series.spread(spectra[k])))
        rows = np.concatenate(white, axis=1)
        values, axes = np.linalg.eigh(rows @ rows.T)
        axes = axes[:, ::-1][:, :int(np.sum(values > LEAST_OPEN))]
        shared, rest = axes[:, :MOST_DIRECTIONS], axes[:, MOST_DIRECTIONS:]
        return (tuple(ReferenceDirection({d: rows @ axis for d, rows in enumerate(together)}, 1.0)
                      for axis in shared.T),
                {d: OpenForces(np.concatenate((apart[d], together[d] @ rest), axis=1).T, spectra[k])
                 for k, d in enumerate(regression.drives)})


def _sizes(size: Array, features: Sequence[Array]) -> Array:
    """Return the size of each feature of a drive."""
    return np.repeat(size, [part.shape[1] for part in features])


def _require_same_robot(model: DriveModel, residuals: Residuals, columns: Array, fit: JointFit,
                        names: str) -> None:
    """Raise ReferenceRunError where a model, as far as it may be otherwise, explains little."""
    explained = residuals.model + columns @ fit.coefficients[:columns.shape[2]]
    little = little_explained(model, replace(residuals, model=explained))
    if little:
        shares = ', '.join(f'{share:.0%} of the effort of {drive}'
                           for drive, share in little.items())
        raise ReferenceRunError(
            f'{names}: the model explains {shares}, must explain half of it: a reference is a run '
            'of this robot on a day on which its model was right')


def _base(model: DriveModel, found: Sequence[Reconstruction], efforts: Array,
          prior: Array | None = None) -> tuple[Array, Array]:
    """Return columns (M, D, P) of unit variance of the base's numbers, and that prior, (N, P)."""
    if not model.has_bodies:
        return np.zeros((*efforts.shape, 0)), np.zeros((0, 0))
    numbers = base_numbers(model, found)
    prior = base_prior(model, efforts, numbers) if prior is None else prior
    return numbers @ prior, prior


def _at(processes: Processes, q: Array, v: Array, period: float) -> list[list[Array]]:
    """Return the states of each drive's processes in a motion, which may remember, (M, k) each."""
    shared = processes[0][0].at(q, v, period)
    return [[shared, *(process.at(q, v, period) for process in own)] for _, *own in processes]


def _features(processes: Processes, at: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """Return the features of each drive's processes at states, (M, k) each."""
    shared = processes[0][0].known(at[0][0])
    return [[shared, *(process.known(states) for process, states in zip(
        own, there[1:], strict=True))] for (_, *own), there in zip(processes, at, strict=True)]


def _base_columns(columns: Array, drives: Sequence[int]) -> list[BaseColumn]:
    return [BaseColumn({d: columns[:, d, p] for d in drives}, 1.0) for p in range(columns.shape[2])]


def _columns_of(d: int, features: Sequence[Array], size: Array) -> list[BaseColumn]:
    return [BaseColumn({d: column}, float(deviation) ** -2) for column, deviation in zip(
        np.concatenate(features, axis=1).T, _sizes(size, features), strict=True)]


def _sized(residuals: Residuals, columns: Array, d: int, features: Sequence[Array],
           ) -> tuple[Array, JointFit]:
    """Return the sizes of processes in a drive by the evidence, (k,) [N], and the fit with them.

    Parameters
    ----------
    residuals : Residuals
    columns : (M, D, P) array
        Of the base.
    d : int
    features : sequence of (M, R) array
        Of each process.

    References
    ----------
    D. J. C. MacKay, Bayesian interpolation, Neural Computation 4 (1992) 415-447.
    """
    count = columns.shape[2]
    size = np.full(len(features), FIRST_SIZE * np.sqrt(np.nanmean(residuals.error[:, d] ** 2)))
    edges = count + np.cumsum([0, *(part.shape[1] for part in features)])
    regression = Regression(residuals, (*_base_columns(columns, [d]),
                                        *_columns_of(d, features, size)), drives=[d])
    start = None
    for _ in range(ROUNDS):
        fit = regression.fit((), start)
        start = fit.amplitudes
        # Over the number of determined coefficients: the evidence is then stationary.
        determined = 1 - np.diag(fit.covariance) * [
            column.precision for column in regression.columns]
        size = np.array([max(np.linalg.norm(fit.coefficients[a:b]) / np.sqrt(max(
            determined[a:b].sum(), LEAST_COUNT)), LEAST_SIZE) for a, b in pairwise(edges)])
        precision = _sizes(size, features) ** -2.0
        regression.columns = (*regression.columns[:count], *(
            replace(column, precision=float(value)) for column, value in zip(
                regression.columns[count:], precision, strict=True)))
    return size, fit


def _parts(residuals: Residuals) -> Integers:
    """Return the run of each sample; for a single run the block."""
    return residuals.record if residuals.record[-1] else residuals.blocks(BLOCKS)


def _processes(residuals: Residuals, columns: Array, measured: Sequence[int]) -> Processes:
    """Return the process over all drives, and for each drive that of its state, and waves.

    Waves are those of the residual.
    """
    plain, drives = States.of(residuals), range(len(residuals.drives))
    shared, features = Process.of(residuals, replace(plain, lengths=LENGTHS))
    own = [[Process.of(residuals, replace(plain, lengths=OWN_LENGTHS), d, slides)
            for slides in (False, True)] for d in drives]
    found: list[tuple[Process | Waves, ...]] = []
    for d in drives:
        rest = residuals.error[:, d]
        if d in measured:
            known = [features, *(of_own for _, of_own in own[d])]
            fit = _sized(residuals, columns, d, known)[1]
            rest = rest - np.concatenate((columns[:, d], *known), axis=1) @ fit.coefficients
            rest = rest - np.nanmean(rest)
        found.append((shared, *(process for process, _ in own[d]),
                      Waves.of(residuals, d, rest)))
    return tuple(found)


def _repeats(regression: Regression, fit: JointFit, of_base: int, parts: Integers) -> Array:
    """Return the correlation of the process in two runs of each drive, (D,).

    Each part is predicted from the others. What its errors are from that, beyond noise and what
    the others leave unknown, is by expectation 2 (1 - correlation) of the process's square.
    """
    white = {d: (index, regression.in_time(fit, d, rows)) for d in regression.drives
             for index, rows in [regression.rows(fit, d)]}
    precision = np.array([column.precision for column in regression.columns])
    known = np.zeros((len(regression.residuals.drives), 2))  # squares of the process, and beyond
    for k, others in enumerate(regression.from_others(fit, parts)):
        for d, (index, rows) in white.items():
            part = rows[:, parts[regression.series[d].index] == k]
            left = part[-1] - others.coefficients[index] @ part[:-1]
            expected = part.shape[1] + np.sum(
                (others.covariance[np.ix_(index, index)] @ part[:-1]) * part[:-1])
            process = part[of_base:-1]
            known[d] += (np.sum(process ** 2 / precision[index[of_base:], None]),
                         left @ left - expected)
    weight = (DECISIONS.run_repeats_spread * 2) ** -2
    apart = (known[:, 1] + weight * 2 * (1 - DECISIONS.run_repeats)) / (known[:, 0] + weight)
    found = np.clip(1 - apart / 2, 0.0, 1.0)
    # Parts of a single run say nothing of another day.
    return found if regression.residuals.record[-1] else np.minimum(
        found, DECISIONS.one_run_repeats)
