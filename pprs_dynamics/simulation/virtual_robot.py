# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot: mechanism, drives' control and sensors, advanced tick by tick; its runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError, WorkspaceError
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.simulation.drive_control import ControlSettings, DriveControl, Note, Setpoint
from pprs_dynamics.simulation.injected_effect import InjectedEffect
from pprs_dynamics.simulation.injected_forces import FrictionTemperature
from pprs_dynamics.simulation.mechanism_plant import MechanismPlant
from pprs_dynamics.simulation.plant import Plant, PlantSettings, Truth, UnsolvedError
from pprs_dynamics.simulation.sensors import Measurement, Sensors, SensorSettings
from pprs_dynamics.simulation.temperatures import read_thermometers


class SimulatedRobot:
    """A robot to run against; it starts at home and holds.

    Of the 3-PPRS home is the platform unturned at 0.5 m.

    Call `command` whenever a command arrives, and `tick` at the rate at which it publishes.

    Parameters
    ----------
    values : mapping or MechanismPlant
        Flat keys and values of a 3-PPRS's model file, e.g. `DriveModel.values`; or an arm, or a
        robot with loops, and what is hidden in it.
    effects : sequence of InjectedEffect
        Of the 3-PPRS, that the model knows nothing of. They carry memory: every robot needs its
        own.
    seed : int
        Of the noise.
    rate : float
        Ticks per second [Hz].
    plant, control, sensors : settings, optional

    Attributes
    ----------
    unsolved : UnsolvedError or None
        Why it stopped, where that is not a matter of the mechanism.

    Raises
    ------
    MissingLibraryError
        Where mujoco is not installed.
    """

    def __init__(
        self, values: Mapping[str, Any] | MechanismPlant, effects: Sequence[InjectedEffect] = (), *,
        seed: int = 0, rate: float = 500.0, plant: PlantSettings | None = None,
        control: ControlSettings | None = None, sensors: SensorSettings | None = None,
    ) -> None:
        self.plant: Plant | MechanismPlant = (
            values if isinstance(values, MechanismPlant) else Plant(values, effects, plant))
        step = self.plant.time_step
        self.steps_per_tick = max(1, round(1 / (rate * step)))
        if abs(self.steps_per_tick * step * rate - 1) > 1e-9:
            raise ValueError(f'{rate} Hz is no whole number of time steps of {step} s')
        self.sensors = Sensors(
            sensors or SensorSettings(), step, np.random.default_rng(seed), effects,
            self.plant.largest)
        self.control = DriveControl(self.plant.limits, self.plant.holding,
                                    control or ControlSettings(), step, self.sensors.smoothing)
        self._ticks = 0
        self._stopped = False
        self.unsolved: UnsolvedError | None = None
        self.place(self.plant.position)

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._ticks * self.steps_per_tick * self.plant.time_step

    @property
    def hidden(self) -> list[dict[str, Any]]:
        """What is hidden in it: name, drives, parameters and form of each effect."""
        return self.plant.hidden

    @property
    def notes(self) -> list[Note]:
        """Messages of the robot so far."""
        return self.control.notes

    def place(self, position: Array, velocity: Array | None = None) -> None:
        """Put the drives at encoder positions (D,) [m, rad], at rest or with velocities [m/s].

        Raises
        ------
        SingularityError
            Where the mechanism cannot go there.
        """
        true = np.asarray(position, dtype=float) - self.sensors.zero
        self.plant.place(true, velocity)
        self.sensors.start(true, self.plant.velocity)
        self.control.start(self.sensors.position)
        self._effort: Array | None = None
        self._stopped = False

    def use_effects(self, effects: Sequence[InjectedEffect]) -> None:
        """Have other hidden effects from now on; the motion goes on, and what stays remembers."""
        self.plant.use_effects(effects)
        self.sensors.use_effects(effects)

    def command(self, setpoint: Setpoint, following: Setpoint | None = None) -> bool:
        """Take a command for now, and the next tick's where it is known; False if refused."""
        return self.control.command(
            self.time, setpoint, following, self.steps_per_tick * self.plant.time_step)

    def tick(self) -> Measurement:
        """Return the readings now, and advance to the next tick."""
        return self.tick_with_truth(want_truth=False)[0]

    def tick_with_truth(self, want_truth: bool = True) -> tuple[Measurement, Truth | None]:
        """Return the readings and the true state now, and advance to the next tick."""
        now, step, plant = self.time, self.plant.time_step, self.plant
        measurement, truth = None, None
        for k in range(self.steps_per_tick):
            effort = self._next_effort(now + k * step)
            if measurement is None:
                measurement = self.sensors.measure(now)
                truth = (plant.observe(effort) if want_truth and isinstance(plant, Plant)
                         else None)
            if not self._stopped:
                try:
                    plant.step(effort)
                except (WorkspaceError, UnsolvedError) as error:
                    self._stop(now + k * step, error)
                    self.unsolved = error if isinstance(error, UnsolvedError) else None
            self.sensors.read_encoders(plant.position, plant.velocity)
        self._ticks += 1
        assert measurement is not None
        return measurement, truth

    def _next_effort(self, now: float) -> Array:
        effort = self.control.effort(now, self.sensors.position, self.sensors.velocity)
        self.sensors.read_effort(effort if self._effort is None else self._effort, effort)
        self._effort = effort
        return effort

    def _stop(self, now: float, error: WorkspaceError | UnsolvedError) -> None:
        self._stopped = True
        self.plant.velocity = np.zeros_like(self.plant.velocity)
        self.notes.append(Note(now, 'STOPPED', f'the robot stopped: {error.found}'))


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
    channels : mapping of str to (N, 6) array
        What thermometers say, where an effect follows the temperature.
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
    channels: Mapping[str, Array]

    def platform_motion(self) -> PlatformMotion:
        """Return the true motion in the form that a model takes."""
        if self.truth is None:
            raise MotionError('true motion', 'the run was made without it', 'be recorded', 'shape')
        truth = self.truth
        return PlatformMotion(
            truth.platform_position, truth.orientation, truth.linear_velocity,
            truth.angular_velocity, truth.linear_acceleration, truth.angular_acceleration,
            self.time)


def simulate(
    values: Mapping[str, Any], reference: DriveReference, effects: Sequence[InjectedEffect] = (), *,
    seed: int = 0, duration: float | None = None, rate: float = 500.0, truth: bool = True,
    plant: PlantSettings | None = None, control: ControlSettings | None = None,
    sensors: SensorSettings | None = None, progress: Callable[[float], None] | None = None,
) -> SimulatedRun:
    """Run the simulated robot along a reference.

    It starts on the reference and moving with it. After the reference's end it holds there.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a 3-PPRS's model file, e.g. `DriveModel.values`.
    reference : DriveReference
        One sample per tick.
    effects : sequence of InjectedEffect
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
    robot = SimulatedRobot(values, effects, seed=seed, rate=rate, plant=plant,
                           control=control, sensors=sensors)
    robot.place(reference.position[0], reference.velocity[0])
    samples = len(reference) if duration is None else max(1, round(duration * rate))
    warm = next((one for one in effects if isinstance(one, FrictionTemperature)), None)
    measured, true, temperatures = [], [], []
    for k in range(samples):
        if k < len(reference):
            robot.command(reference.setpoint(k),
                          reference.setpoint(k + 1) if k + 1 < len(reference) else None)
        measurement, moment = robot.tick_with_truth(truth)
        if robot.unsolved is not None:
            raise robot.unsolved
        measured.append(measurement)
        true.append(moment)
        if warm is not None:
            temperatures.append(warm.temperature)
        if progress is not None and k % max(1, samples // 100) == 0:
            progress(k / samples)
    time = np.array([m.time for m in measured])
    return SimulatedRun(
        time, np.array([m.position for m in measured]),
        np.array([m.velocity for m in measured]), np.array([m.effort for m in measured]),
        reference, _stacked(true), robot.hidden,
        list(robot.notes), robot.control.saturated_steps,
        {'temperature': read_thermometers(time, np.array(temperatures))} if temperatures else {})


def _stacked(moments: Sequence[Truth | None]) -> Truth | None:
    known = [moment for moment in moments if moment is not None]
    if not known:
        return None
    columns: dict[str, Any] = {
        f.name: np.array([getattr(moment, f.name) for moment in known]) for f in fields(Truth)}
    return Truth(**columns)
