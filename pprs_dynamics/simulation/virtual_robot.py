# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot: mechanism, drives' control and sensors, advanced tick by tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.simulation.drive_control import (
    ControlSettings,
    DriveControl,
    Note,
    Setpoint,
)
from pprs_dynamics.simulation.hidden_effect import HiddenEffect
from pprs_dynamics.simulation.linkage_plant import LinkagePlant
from pprs_dynamics.simulation.plant import Plant, PlantSettings, Truth, UnsolvedError
from pprs_dynamics.simulation.sensors import Measurement, Sensors, SensorSettings


class SimulatedRobot:
    """A robot to run against; it starts at home and holds.

    Of the 3-PPRS home is the platform unturned at 0.5 m.

    Call `command` whenever a command arrives, and `tick` at the rate at which it publishes.

    Parameters
    ----------
    values : mapping or LinkagePlant
        Flat keys and values of a 3-PPRS's model file, e.g. `DriveModel.values`; or an arm, or a
        robot with loops, and what is hidden in it.
    effects : sequence of HiddenEffect
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
        self, values: Mapping[str, Any] | LinkagePlant, effects: Sequence[HiddenEffect] = (), *,
        seed: int = 0, rate: float = 500.0, plant: PlantSettings | None = None,
        control: ControlSettings | None = None, sensors: SensorSettings | None = None,
    ) -> None:
        self.plant: Plant | LinkagePlant = (
            values if isinstance(values, LinkagePlant) else Plant(values, effects, plant))
        step = self.plant.settings.step
        self.steps_per_tick = max(1, round(1 / (rate * step)))
        if abs(self.steps_per_tick * step * rate - 1) > 1e-9:
            raise ValueError(f'{rate} Hz is no whole number of time steps of {step} s')
        self.sensors = Sensors(
            sensors or SensorSettings(), step, np.random.default_rng(seed), effects,
            values.largest if isinstance(values, LinkagePlant) else None)
        self.control = DriveControl(self.plant.limits, self.plant.holding,
                                    control or ControlSettings(), step, self.sensors.smoothing)
        self._ticks = 0
        self._stopped = False
        self.unsolved: UnsolvedError | None = None
        self.place(self.plant.position)

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._ticks * self.steps_per_tick * self.plant.settings.step

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

    def use_effects(self, effects: Sequence[HiddenEffect]) -> None:
        """Have other hidden effects from now on; the motion goes on, and what stays remembers."""
        if isinstance(self.plant, LinkagePlant):
            raise TypeError('what is hidden in a mechanism stays')
        self.plant.use_effects(effects)
        self.sensors.use_effects(effects)

    def command(self, setpoint: Setpoint, following: Setpoint | None = None) -> bool:
        """Take a command for now, and the next tick's where it is known; False if refused."""
        return self.control.command(
            self.time, setpoint, following, self.steps_per_tick * self.plant.settings.step)

    def tick(self) -> Measurement:
        """Return the readings now, and advance to the next tick."""
        return self.tick_with_truth(want_truth=False)[0]

    def tick_with_truth(self, want_truth: bool = True) -> tuple[Measurement, Truth | None]:
        """Return the readings and the true state now, and advance to the next tick."""
        now, step, plant = self.time, self.plant.settings.step, self.plant
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
