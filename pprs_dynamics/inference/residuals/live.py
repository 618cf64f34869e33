# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Residuals of a live stream of joint states."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.measurement.files.samples import Mask
from pprs_dynamics.measurement.motion.differentiation import ORDER, LocalPolynomial
from pprs_dynamics.measurement.motion.live_reconstruction import LiveReconstruction, LiveSample
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

WINDOW = 0.12  # [s] of the smoothing that gives velocity and acceleration
# Robots with gears move ten times as slowly as the 3-PPRS, with ten times the inertia.
GEAR_WINDOW = 0.25  # [s]
ERROR_SPAN = 2.0  # [s] over which the running error is taken
# Stamps to see before their step is known; more than a late first message or two.
STAMPS_TO_LEARN = 16
# Samples of a window: with three more than the polynomial has coefficients, residuals tell uneven
# sampling from late stamps, and two samples may be missing.
FEWEST = ORDER + 4
# A drive's model explains nothing where its error is that share of what is larger of its effort and
# the model's, both well above the noise: below it is the size of a friction that is off.
AS_LARGE, ABOVE_NOISE = 0.9, 5.0
# Where a drive stands, static friction is any: only a model that says that share of what is
# measured says anything then.
SAYS = 0.3
FEWEST_JUDGED = 50  # samples


class Compared(NamedTuple):
    """n samples of model against measurement.

    Parameters
    ----------
    time : (n,) array
        Stamps as they came [s].
    model, residual : (n, D) arrays
        The model's effort, and measured minus model [N, N m]; the latter NaN where not measured,
        and where a joint of an arm stands.
    """

    time: Array
    model: Array
    residual: Array


class LiveComparison:
    """Compares joint states with the model one by one: model effort and residual.

    Answers lag by half the smoothing window: acceleration needs samples from both sides. They
    are computed many at a time, which costs hardly more than one. A window has at least `FEWEST`
    samples: of a stream at 10 Hz it lasts a second.

    Parameters
    ----------
    model : DriveModel
    window : float, optional
        Duration of the smoothing window [s]; that of the kind of model where it is not given.
    span : float
        Duration over which the running error is taken [s].
    """

    def __init__(self, model: DriveModel, window: float | None = None, span: float = ERROR_SPAN,
                 ) -> None:
        self._window = window or (WINDOW if model.robot.has_guides else GEAR_WINDOW)
        self._span = span
        self._learning: list[tuple[float, ArrayLike, ArrayLike]] = []
        self._live: LiveReconstruction | None = None
        self._gaps_before = self._bridged_before = self._lost_in_a_row = 0
        self._waiting: list[LiveSample] = []
        self._recent: deque[tuple[float, Array, Array, Array]] = deque()
        self._model, self._state = model, model.initial_state()
        self.use_model(model)

    def use_model(self, model: DriveModel) -> None:
        """Compare with another model from the next sample on; the running error starts afresh."""
        self._state = model.continued_state(self._model, self._state)
        self._model = model
        self._recent.clear()

    @property
    def gaps(self) -> int:
        """Number of interruptions of the stream."""
        return self._gaps_before + (0 if self._live is None else self._live.gaps)

    @property
    def bridged(self) -> int:
        """Number of single missing samples that were interpolated."""
        return self._bridged_before + (0 if self._live is None else self._live.bridged)

    def push(self, time: float, position: ArrayLike, effort: ArrayLike) -> None:
        """Take one recorded sample, drives in order; effort NaN means no measurement."""
        if self._live is None:
            self._learn(time, position, effort)
            return
        lost = self._live.gaps + self._live.bridged
        sample = self._live.push(time, position, np.asarray(effort) * self._model.recorded_gain)
        if sample is not None:
            self._waiting.append(sample)
        self._lost_in_a_row = (
            self._lost_in_a_row + 1 if self._live.gaps + self._live.bridged > lost else 0)
        if self._lost_in_a_row == STAMPS_TO_LEARN:  # nothing is lost: another rate
            self._gaps_before, self._bridged_before = self.gaps + 1, self.bridged
            self._lost_in_a_row, self._live = 0, None

    def evaluate(self) -> Compared | None:
        """Return the samples that have become judgeable since the last call, None for none.

        Raises
        ------
        PprsError
            Where the model cannot follow the motion; these samples are given up.
        """
        samples, self._waiting = self._waiting, []
        if not samples:
            return None
        starts = [k for k, sample in enumerate(samples) if sample.is_start]
        model_effort = []
        for first, last in zip([0, *starts], [*starts, len(samples)], strict=True):
            if first == last:
                continue
            if first in starts:
                self._begin_again(samples[first].time)
            model_effort.append(self._forces(samples[first:last]))
        time = np.array([sample.time for sample in samples])
        model = np.concatenate(model_effort)
        residual = np.stack([sample.effort for sample in samples]) - model
        if self._model.rest_speed:
            # Where a joint stands, its gear holds any torque within its static friction.
            moving = np.abs([sample.velocity for sample in samples]) >= self._model.rest_speed
            residual = np.where(moving, residual, np.nan)
        speed = np.abs([sample.velocity for sample in samples])
        moves = speed >= (self._model.rest_speed or self._model.values.get(
            'friction.reversal_velocity', 0.0))
        self._recent.extend(zip(time, residual, model, moves, strict=True))
        # Stamps may go back, too: then what came before them is of another stream.
        while not time[-1] - self._span <= self._recent[0][0] <= time[-1]:
            self._recent.popleft()
        return Compared(time, model, residual)

    def _begin_again(self, time: float) -> None:
        """Reset after a gap; the memory of effects is reset if time went back."""
        start = self._state.start
        self._state = self._model.initial_state(
            start if start is not None and start <= time else None)

    def running_error(self) -> Array:
        """Return the root of the mean squared residual of the last span, (D,); NaN: none."""
        if not self._recent:
            return np.full(len(self._model.drives), np.nan)
        errors = np.stack([error for _, error, _, _ in self._recent])
        return np.array([root_mean_square(of_drive) for of_drive in errors.T])

    def unexplained(self) -> tuple[str, ...]:
        """Return the drives whose error of the last span is as large as their effort."""
        if len(self._recent) < FEWEST_JUDGED:
            return ()
        errors, models, moves = (np.stack([row[k] for row in self._recent]) for k in (1, 2, 3))
        return tuple(
            drive for drive, error, model, moving in zip(
                self._model.drives, errors.T, models.T, moves.T, strict=True)
            if _is_unexplained(error, model, moving))

    def _learn(self, time: float, position: ArrayLike, effort: ArrayLike) -> None:
        """Find the step of the stamps; the samples it was found from are taken then."""
        learning = self._learning
        if learning and not time > learning[-1][0]:
            learning.clear()
        learning.append((time, position, effort))
        if len(learning) < STAMPS_TO_LEARN:
            return
        step = float(np.median(np.diff([stamp for stamp, _, _ in learning])))
        samples = max(FEWEST, 2 * round(self._window / step / 2) + 1)
        self._live, self._learning = LiveReconstruction(LocalPolynomial(samples, step)), []
        for sample in learning:
            self.push(*sample)

    def _forces(self, samples: list[LiveSample]) -> Array:
        model: Any = self._model
        position = np.stack([sample.position for sample in samples])
        forces = model.drive_forces(JointMotion(
            position - model.position_error(position),
            np.stack([sample.velocity for sample in samples]),
            np.stack([sample.acceleration for sample in samples]),
            np.array([sample.time for sample in samples])), self._state)
        total: Array = model.measured(forces, self._state).total
        return total


def _is_unexplained(error: Array, model: Array, moving: Mask) -> bool:
    """Return whether a model explains nothing of a drive's effort; arrays (n,)."""
    measured = error + model
    with np.errstate(invalid='ignore'):  # not measured
        judged = np.isfinite(error) & (moving | (np.abs(model) >= SAYS * np.abs(measured)))
    if judged.sum() < FEWEST_JUDGED:
        return False
    # Of white noise the differences between neighbours have twice the variance.
    noise = root_mean_square(np.diff(error[judged])) / np.sqrt(2)
    size = max(root_mean_square(measured[judged]), root_mean_square(model[judged]))
    return bool(root_mean_square(error[judged]) >= AS_LARGE * size > ABOVE_NOISE * noise)
