# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Runs of the simulated robot along a reference, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError
from pprs_dynamics.simulation.drive_control import ControlSettings, Note, Setpoint
from pprs_dynamics.simulation.hidden_effect import HiddenEffect
from pprs_dynamics.simulation.plant import PlantSettings, Truth
from pprs_dynamics.simulation.sensors import SensorSettings
from pprs_dynamics.simulation.virtual_robot import SimulatedRobot

if TYPE_CHECKING:
    from collections.abc import Callable

    from pprs_dynamics.physics.mechanism.motion import PlatformMotion


class HasValues(Protocol):
    """A model: of it, only the flat keys and values of its file are read."""

    @property
    def values(self) -> Mapping[str, Any]:
        """Flat keys and values."""


@dataclass(frozen=True, init=False)
class DriveReference:
    """Setpoints of the drives at every tick.

    Parameters
    ----------
    position, velocity : (N, 6) array_like
        [m, m/s]
    effort : (N, 6) array_like, optional
        Feedforward [N]; none by default.

    Raises
    ------
    MotionError
        For a wrong shape or a non-finite number.
    """

    position: Array
    velocity: Array
    effort: Array

    def __init__(self, position: ArrayLike, velocity: ArrayLike,
                 effort: ArrayLike | None = None) -> None:
        samples = None
        for name, value in (('position', position), ('velocity', velocity), ('effort', effort)):
            array = (np.zeros((samples or 0, 6)) if value is None
                     else np.array(value, dtype=float, ndmin=2))
            if array.ndim != 2 or array.shape[1] != 6 or len(array) != (samples or len(array)):
                raise MotionError(f'drive {name}', f'its shape is {array.shape}',
                                  f'be ({samples or "N"}, 6)', 'shape')
            if len(array) == 0 or not np.all(np.isfinite(array)):
                raise MotionError(f'drive {name}', 'it is empty or not finite',
                                  'hold finite numbers', 'finite')
            samples = len(array)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.position)

    def setpoint(self, sample: int) -> Setpoint:
        """Return the command of one tick."""
        return Setpoint(self.position[sample], self.velocity[sample], self.effort[sample])


@dataclass(frozen=True)
class SimulatedRun:
    """A recording, and the true motion and forces.

    Parameters
    ----------
    time : (N,) array
    position, velocity, effort : (N, 6) arrays
        As measured.
    reference : DriveReference
        The commands of these samples.
    truth : Truth or None
        True motion and efforts: every field with the samples as first axis.
    effects : list of dict
        Name, drives, parameters and form of each hidden effect.
    notes : list of Note
    saturated_steps : (6,) int array
        Time steps that each drive spent at its limit.
    """

    time: Array
    position: Array
    velocity: Array
    effort: Array
    reference: DriveReference
    truth: Truth | None
    effects: list[dict[str, Any]]
    notes: list[Note]
    saturated_steps: np.ndarray

    def platform_motion(self) -> PlatformMotion:
        """Return the true motion in the form that a model takes."""
        from pprs_dynamics.physics.mechanism.motion import PlatformMotion

        if self.truth is None:
            raise MotionError('true motion', 'the run was made without it', 'be recorded', 'shape')
        truth = self.truth
        return PlatformMotion(
            truth.platform_position, truth.orientation, truth.linear_velocity,
            truth.angular_velocity, truth.linear_acceleration, truth.angular_acceleration,
            self.time)


def simulate(
    model: HasValues, reference: DriveReference, effects: Sequence[HiddenEffect] = (), *,
    seed: int = 0, duration: float | None = None, rate: float = 500.0, truth: bool = True,
    plant: PlantSettings | None = None, control: ControlSettings | None = None,
    sensors: SensorSettings | None = None, progress: Callable[[float], None] | None = None,
) -> SimulatedRun:
    """Run the simulated robot along a reference.

    It starts on the reference and moving with it. After the reference's end it holds there.

    Parameters
    ----------
    model : DriveModel, or anything with its `values`
    reference : DriveReference
        One sample per tick.
    effects : sequence of HiddenEffect
    seed : int
        Of the noise.
    duration : float, optional
        [s]; the reference's own by default.
    rate : float
        Ticks per second [Hz].
    truth : bool
        Record what really happens, too; a third slower.
    plant, control, sensors : settings, optional
    progress : callable, optional
        Called with the share that is done, about a hundred times.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    SingularityError
        Where the reference starts out of reach. A robot that comes to a singular pose on its
        way stops there and notes it.
    UnsolvedError
        Where the engine finds no motion, as with effects far beyond what a machine has.
    """
    robot = SimulatedRobot(model.values, effects, seed=seed, rate=rate, plant=plant,
                           control=control, sensors=sensors)
    robot.place(reference.position[0], reference.velocity[0])
    samples = len(reference) if duration is None else max(1, round(duration * rate))
    measured, true = [], []
    for k in range(samples):
        if k < len(reference):
            robot.command(reference.setpoint(k),
                          reference.setpoint(k + 1) if k + 1 < len(reference) else None)
        measurement, moment = robot.tick_with_truth(truth)
        if robot.unsolved is not None:
            raise robot.unsolved
        measured.append(measurement)
        true.append(moment)
        if progress is not None and k % max(1, samples // 100) == 0:
            progress(k / samples)
    return SimulatedRun(
        np.array([m.time for m in measured]), np.array([m.position for m in measured]),
        np.array([m.velocity for m in measured]), np.array([m.effort for m in measured]),
        reference, _stacked(true), robot.hidden,
        list(robot.notes), robot.control.saturated_steps)


def _stacked(moments: Sequence[Truth | None]) -> Truth | None:
    known = [moment for moment in moments if moment is not None]
    if not known:
        return None
    columns: dict[str, Any] = {
        f.name: np.array([getattr(moment, f.name) for moment in known]) for f in fields(Truth)}
    return Truth(**columns)
