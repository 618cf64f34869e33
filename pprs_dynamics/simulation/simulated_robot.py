# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot: plant, control of the drives and sensors, advanced tick by tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.simulation.drive_control import ControlSettings, DriveControl, Note
from pprs_dynamics.simulation.plant import Plant, UnsolvedError

CORRELATED, CORRELATION = 0.36, 0.9  # share of the noise's variance, and from sample to sample


@dataclass(frozen=True)
class SensorSettings:
    """Quality of the sensors.

    Parameters
    ----------
    quantisation : float
        Of the encoders [m]; 0 for none.
    effort_noise : float
        Standard deviation of the noise of the efforts [N], a part of it correlated.
    velocity_bandwidth : float
        Of the first-order low-pass behind the differentiated positions [Hz].
    """

    quantisation: float = 1e-6
    effort_noise: float = 0.08
    velocity_bandwidth: float = 80.0

    def quantised(self, position: Array) -> Array:
        """Return positions [m] as the encoders count them."""
        grain = self.quantisation
        return np.round(position / grain) * grain if grain > 0 else position


@dataclass(frozen=True)
class Measurement:
    """Readings of the sensors at one moment: `time` [s] and (D,) arrays in drive order."""

    time: float
    position: Array
    velocity: Array
    effort: Array


class Sensors:
    """Encoders and effort sensors of the drives.

    Parameters
    ----------
    settings : SensorSettings
    step : float
        Time between readings of the encoders [s].
    rng : numpy.random.Generator
    scale : (D,) array
        Units in which the settings give the noise of the efforts.
    position : (D,) array
        At the start, at rest [m, rad].

    Attributes
    ----------
    position, velocity : (D,) arrays
        As measured.
    smoothing : float
        Share of a change that `velocity` shows after one reading.
    """

    def __init__(self, settings: SensorSettings, step: float, rng: np.random.Generator,
                 scale: Array, position: Array) -> None:
        self.settings, self._step, self._rng = settings, step, rng
        self._noise = settings.effort_noise * scale
        self._correlated = rng.standard_normal(len(scale))
        self.position, self.velocity = settings.quantised(position), np.zeros(len(scale))
        self.smoothing = 1 - float(np.exp(-2 * np.pi * settings.velocity_bandwidth * step))

    def read_encoders(self, position: Array) -> None:
        """Take the true positions, (D,)."""
        measured = self.settings.quantised(position)
        change = (measured - self.position) / self._step
        self.velocity = self.velocity + self.smoothing * (change - self.velocity)
        self.position = measured

    def measure(self, time: float, effort: Array) -> Measurement:
        """Return the readings to publish now, of efforts (D,) with noise."""
        white, new = self._rng.standard_normal((2, len(effort)))
        self._correlated = (CORRELATION * self._correlated + np.sqrt(1 - CORRELATION ** 2) * new)
        noise = np.sqrt(1 - CORRELATED) * white + np.sqrt(CORRELATED) * self._correlated
        return Measurement(time, self.position.copy(), self.velocity.copy(),
                           effort + self._noise * noise)


BANDWIDTH, DAMPING_RATIO = 7.0, 0.9  # of the drives' loops, by default [Hz, 1]


class SimulatedRobot:
    """A robot to run against; it starts at home and holds.

    Call `control.command` whenever a command arrives, and `tick` at the rate of the plant.

    Parameters
    ----------
    plant : Plant
    seed : int
        Of the noise.
    control, sensors : settings, optional
    """

    def __init__(self, plant: Plant, *, seed: int = 0, control: ControlSettings | None = None,
                 sensors: SensorSettings | None = None) -> None:
        self.plant, step = plant, plant.time_step
        self.sensors = Sensors(sensors or SensorSettings(), step, np.random.default_rng(seed),
                               plant.largest, plant.position)
        self.control = DriveControl(
            plant.limits, plant.holding, control or plant.gains(BANDWIDTH, DAMPING_RATIO), step,
            self.sensors.position, self.sensors.smoothing)
        self.notes = self.control.notes
        self._ticks = 0
        self._effort: Array | None = None
        self._stopped = False

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._ticks * self.plant.steps_per_tick * self.plant.time_step

    def tick(self) -> Measurement:
        """Return the readings now, and advance to the next tick."""
        now, step, plant = self.time, self.plant.time_step, self.plant
        measured: Measurement | None = None
        for k in range(plant.steps_per_tick):
            effort = self.control.effort(now + k * step, self.sensors.position,
                                         self.sensors.velocity)
            if measured is None:
                # Efforts are constant over a time step: at its border the mean of both belongs to
                # the motion there. Either one alone would be half a step late or early.
                before = effort if self._effort is None else self._effort
                measured = self.sensors.measure(now, (before + effort) / 2)
            self._effort = effort
            if not self._stopped:
                try:
                    plant.step(effort)
                except (WorkspaceError, UnsolvedError) as error:
                    self._stopped = True
                    plant.velocity = np.zeros_like(plant.velocity)
                    self.notes.append(Note(now + k * step, 'STOPPED',
                                           f'the robot stopped: {error.found}'))
            self.sensors.read_encoders(plant.position)
        self._ticks += 1
        assert measured is not None
        return measured
