# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sensors of the simulated robot: quantised positions, noisy efforts, faults.

All randomness comes from one generator, so that a seed repeats a recording bit for bit.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT
from pprs_dynamics.simulation.injected_effect import InjectedEffect, Range, SensorEffect

# A play is crossed whenever a drive turns, however slowly: within that time [s] of it; what is
# slower than the second stands [m/s].
CROSSING, STANDING = 0.02, 1e-4
# Correlation times of the slow processes that add up to 1/f noise [samples], a factor 4 apart:
# the sum follows 1/f within 10 % from 1/200 of the sampling rate down to 1/400 000 of it.
PINK_TIMES = 2.0 * 4.0 ** np.arange(9)


@dataclass(frozen=True)
class SensorSettings:
    """Quality of the sensors.

    Parameters
    ----------
    quantisation : float
        Of the encoders [m]; 0 for none.
    true_velocity : bool
        True: tachometers. False: differentiated positions, smoothed.
    velocity_bandwidth : float
        Of that smoothing, a first-order low-pass [Hz].
    white_noise, coloured_noise, pink_noise : float
        Standard deviations of the noise of the efforts [N].
    noise_correlation : float
        Of the coloured noise, from sample to sample; AR(1).
    pink_exponent : float
        a of the pink noise's spectrum 1/f^a, 0 < a < 2.
    """

    quantisation: float = 1e-6
    true_velocity: bool = False
    velocity_bandwidth: float = 80.0
    white_noise: float = 0.064
    coloured_noise: float = 0.048
    noise_correlation: float = 0.9
    pink_noise: float = 0.0
    pink_exponent: float = 1.0

    @classmethod
    def with_effort_noise(cls, noise: float, quantisation: float = 1e-6) -> SensorSettings:
        """Return settings whose efforts carry noise of a standard deviation [N].

        Of its variance 64 % is white and 36 % correlated, AR(1) with 0.9 from sample to sample.
        """
        return cls(quantisation, white_noise=0.8 * noise, coloured_noise=0.6 * noise)

    def quantised(self, position: Array) -> Array:
        """Return positions [m] as the encoders count them."""
        grain = self.quantisation
        return np.round(position / grain) * grain if grain > 0 else position


@dataclass(frozen=True)
class SensorFaults:
    """Faults of the sensors of D drives, summed over hidden effects; (D,) arrays.

    Parameters
    ----------
    zero : (D,) array
        By which positions are measured too high [m].
    gain : (D,) array
        Share by which efforts are.
    effort_delay, position_delay : (D,) arrays
        By which they are late [s], at least 0.
    time_constant : (D,) array
        Mean delay of the filters of the efforts [s]; 0 for none.
    play : (D,) array
        Of the couplings between encoders and drives [m].
    """

    zero: Array
    gain: Array
    effort_delay: Array
    position_delay: Array
    time_constant: Array
    play: Array

    @classmethod
    def of(cls, effects: Sequence[InjectedEffect], drives: int = COUNT) -> SensorFaults:
        """Return the faults among effects."""
        faults = [effect for effect in effects if isinstance(effect, SensorEffect)]
        zero, gain, delay, time_constant, play = (
            np.sum([effect.values[name] for effect in faults if name in effect.values]
                   or [np.zeros(drives)], axis=0)
            for name in ('zero', 'gain', 'delay', 'time_constant', 'play'))
        # No sensor looks ahead: an effort that comes early is one whose encoders, all of them,
        # come late.
        late = max(0.0, -float(delay.min()))
        return cls(zero, gain, delay + late, np.full(drives, late), time_constant, play)

    def lead(self, velocity: Array, acceleration: Array) -> Array:
        """Return by how much encoders lead their drives, (..., D), at rates (..., D)."""
        turning = np.hypot(acceleration * CROSSING, STANDING)
        return self.play / 2 * velocity / np.hypot(velocity, turning)


class ButterworthFilter:
    """Low-pass filters of second order, one for each of D signals.

    Parameters
    ----------
    time_constant : (D,) array
        Mean delay of each, sqrt(2) / (2 pi f_c) [s]; 0 for none.
    step : float
        Between samples [s].
    """

    def __init__(self, time_constant: Array, step: float) -> None:
        from scipy.signal import butter

        self._filters = {}
        for d in np.flatnonzero(time_constant > 0).tolist():
            highest = 0.9 / (2 * step)  # of what is faster no samples tell
            cutoff = min(np.sqrt(2) / (2 * np.pi * time_constant[d]), highest)
            self._filters[d] = butter(2, cutoff, fs=1 / step)
        self._states: dict[int, Array] = {}

    def forget(self) -> None:
        """Settle at the next sample."""
        self._states = {}

    def samples(self, values: Array) -> Array:
        """Return the next samples filtered, (N, D)."""
        if not self._filters:
            return values
        from scipy.signal import lfilter, lfilter_zi

        filtered = values.copy()
        for d, (b, a) in self._filters.items():
            state = self._states.get(d, lfilter_zi(b, a) * values[0, d])
            filtered[:, d], self._states[d] = lfilter(b, a, values[:, d], zi=state)
        return filtered


class EffortNoise:
    """White, AR(1) and 1/f noise of the drives' efforts, one sample at a time.

    Parameters
    ----------
    settings : SensorSettings
    rng : numpy.random.Generator
    drives : int

    Notes
    -----
    1/f^a noise is a sum of AR(1) processes whose correlation times lie evenly on a logarithmic
    scale and whose variances go with time^(a - 1).
    """

    def __init__(self, settings: SensorSettings, rng: np.random.Generator, drives: int = COUNT,
                 ) -> None:
        self._rng = rng
        weights = PINK_TIMES ** (settings.pink_exponent - 1)
        self._sizes = np.concatenate((
            [settings.coloured_noise],
            settings.pink_noise * np.sqrt(weights / weights.sum())))
        self._keep = np.concatenate(([settings.noise_correlation], np.exp(-1 / PINK_TIMES)))
        self._add = np.sqrt(1 - self._keep ** 2)
        self._white = settings.white_noise
        self._states = rng.standard_normal((len(self._keep), drives))

    def sample(self) -> Array:
        """Return the next sample [N], (D,)."""
        news = self._rng.standard_normal((len(self._keep) + 1, self._states.shape[1]))
        self._states = self._keep[:, None] * self._states + self._add[:, None] * news[1:]
        return self._white * news[0] + self._sizes @ self._states

    def samples(self, count: int) -> Array:
        """Return the next samples [N], (count, D): those that `sample` would give."""
        from scipy.signal import lfilter

        news = self._rng.standard_normal((count, len(self._keep) + 1, self._states.shape[1]))
        noise: Array = self._white * news[:, 0]
        for i, (keep, add, size) in enumerate(zip(self._keep, self._add, self._sizes,
                                                  strict=True)):
            states, last = lfilter([add], [1.0, -keep], news[:, i + 1], axis=0,
                                   zi=keep * self._states[None, i])
            self._states[i] = last[0] / keep if keep else states[-1]
            noise += size * states
        return noise

    def autocovariance(self, lags: Array) -> Array:
        """Return the autocovariance of one effort's noise at whole lags [samples], (L,) [N^2]."""
        steps = np.abs(np.asarray(lags, dtype=float))
        slow: Array = (self._sizes ** 2) @ self._keep[:, None] ** steps
        return slow + self._white ** 2 * (steps == 0)


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
    effects : sequence of InjectedEffect
        Of which the faults of sensors act here.
    scale : (D,) array, optional
        Units in which the settings give the noise of the efforts.

    Attributes
    ----------
    smoothing : float
        Share of a change that `velocity` shows after one reading; 1 with tachometers.
    """

    def __init__(self, settings: SensorSettings, step: float, rng: np.random.Generator,
                 effects: Sequence[InjectedEffect] = (), scale: Array | None = None) -> None:
        self.settings, self._step = settings, step
        self._scale = np.ones(COUNT) if scale is None else scale
        self._noise = EffortNoise(settings, rng, len(self._scale))
        self._past: deque[tuple[Array, Array, Array]] = deque()
        self.position, self.velocity, self.zero = np.zeros((3, len(self._scale)))
        # Of what is recorded; the drives' own control has encoders without a play.
        self._lead, self._lead_rate, self._true_velocity = np.zeros((3, len(self._scale)))
        self.use_effects(effects)
        self.smoothing = 1.0 if settings.true_velocity else 1 - float(
            np.exp(-2 * np.pi * settings.velocity_bandwidth * step))

    def use_effects(self, effects: Sequence[InjectedEffect]) -> None:
        """Have the faults of other effects from now on; a moved zero is no velocity."""
        self._faults = SensorFaults.of(effects, len(self._scale))
        self._filter = ButterworthFilter(self._faults.time_constant, self._step)
        self.position = self.position + self._faults.zero - self.zero
        self.zero = self._faults.zero
        delays = (self._faults.effort_delay, self._faults.position_delay)
        length = int(np.ceil(np.max(delays) / self._step)) + 2
        self._past = deque(islice(self._past, length), maxlen=length)

    def start(self, position: Array, velocity: Array) -> None:
        """Forget the past: the robot is at (D,) [m] and moves with (D,) [m/s]."""
        self._past.clear()
        self._filter.forget()
        self.position, self.velocity = self._encoder(position), np.array(velocity)
        self._lead_rate = np.zeros(len(self._scale))
        self._lead, self._true_velocity = self._faults.lead(
            self.velocity, self._lead_rate), self.velocity.copy()

    def read_encoders(self, position: Array, velocity: Array) -> None:
        """Take the true positions and velocities, (D,), as the drives' electronics see them."""
        seen = self._encoder(position)
        if self.settings.true_velocity:
            self.velocity = np.array(velocity)
        else:
            change = (seen - self.position) / self._step
            self.velocity = self.velocity + self.smoothing * (change - self.velocity)
        self.position = seen
        lead = self._faults.lead(velocity, (velocity - self._true_velocity) / self._step)
        self._true_velocity = np.array(velocity)
        self._lead_rate = self._lead_rate + self.smoothing * (
            (lead - self._lead) / self._step - self._lead_rate)
        self._lead = lead

    def read_effort(self, before: Array, after: Array) -> None:
        """Take the efforts applied just before and after now, (D,) each, and remember them.

        Efforts are constant over a time step: at its border their mean is what belongs to the
        motion there. Either one alone would be half a step late or early.
        """
        effort = self._filter.samples((before + after)[None] / 2)[0]
        self._past.appendleft((self.position + self._lead, self.velocity + self._lead_rate,
                               effort))

    def measure(self, time: float) -> Measurement:
        """Return the readings to publish now, with faults and noise."""
        faults = self._faults
        position, velocity = (self._delayed(i, faults.position_delay) for i in (0, 1))
        effort = self._delayed(2, faults.effort_delay)
        return Measurement(time, position, velocity,
                           (1 + faults.gain) * effort + self._scale * self._noise.sample())

    def _encoder(self, position: Array) -> Array:
        return self.settings.quantised(position + self.zero)

    def _delayed(self, quantity: int, delay: Array) -> Array:
        if not delay.any():
            return self._past[0][quantity].copy()
        # Between readings by straight lines; before the first reading, the first.
        steps = delay / self._step
        whole = np.floor(steps).astype(int)
        share, last, drives = steps - whole, len(self._past) - 1, range(len(delay))
        newer = np.array([self._past[min(whole[i], last)][quantity][i] for i in drives])
        older = np.array([self._past[min(whole[i] + 1, last)][quantity][i] for i in drives])
        return newer + share * (older - newer)


class EffortGain(SensorEffect):
    """A drive constant that is not what the amplifier thinks."""

    name: ClassVar[str] = 'effort_gain'
    form: ClassVar[str] = 'measured effort = (1 + gain) effort'
    ranges: ClassVar[dict[str, Range]] = {'gain': Range('1', 0.03, 0.12, 'signed', scales=True)}


class EffortFilter(SensorEffect):
    """Effort behind the amplifier's filter: Butterworth's, where the catalogue has two lags."""

    name: ClassVar[str] = 'effort_filter'
    form: ClassVar[str] = 'low-pass of second order (Butterworth), T = sqrt(2) / (2 pi f_c)'
    ranges: ClassVar[dict[str, Range]] = {
        'time_constant': Range('s', 0.005, 0.02, scales=True)}


class HomingError(SensorEffect):
    """A drive whose zero is off: it is elsewhere than its encoder, and its control, believe."""

    name: ClassVar[str] = 'homing_error'
    form: ClassVar[str] = 'measured position = position + zero'
    ranges: ClassVar[dict[str, Range]] = {'zero': Range('m', 0.0005, 0.003, 'signed', scales=True)}


class TimeDelay(SensorEffect):
    """Effort measured late (positive), or early because all encoders' values are late."""

    name: ClassVar[str] = 'time_delay'
    form: ClassVar[str] = ('measured effort (t) = effort (t - delay), '
                           'by late encoders where delay < 0')
    ranges: ClassVar[dict[str, Range]] = {'delay': Range('s', 0.003, 0.015, 'signed', scales=True)}


class LostMotion(SensorEffect):
    """A play in an encoder's coupling, crossed within a time; the catalogue has a travel."""

    name: ClassVar[str] = 'lost_motion'
    form: ClassVar[str] = 'measured position = position + play v / (2 sqrt(v^2 + (a T)^2))'
    ranges: ClassVar[dict[str, Range]] = {'play': Range('m', 0.0003, 0.001, 'log', scales=True)}
