# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of the simulated robot with physics hidden in it, and what the truth is.

The robot follows a random motion. Its numbers are off by up to the model file's tolerances, its
friction turns over in widths unlike the model's, its loads are those with friction, encoders
count micrometres and efforts carry correlated noise. `make_case` builds one recording, `save_case`
and `load_case` keep it in a file.
"""

from __future__ import annotations

import copy
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.effort_noise import EffortNoise, NoiseSettings
from benchmarks.hidden.motions import RandomMotion, draw_motion
from benchmarks.hidden.off_forms import off_form
from benchmarks.hidden.strength import Refit, Whitening, sensitivities, tolerated_numbers
from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.drives import CHANNELS
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.differentiation import Stretch, choose_smoothing
from pprs_dynamics.measurement.motion.treatment import Treatment, block_length
from pprs_dynamics.physics.mechanism.state import Reversal
from pprs_dynamics.physics.model.parameter_file import default_parameters
from pprs_dynamics.simulation.injected_forms import read_thermometers
from pprs_dynamics.simulation.injection import (
    CLIMATE,
    NAMES,
    NOT_IN_CATALOGUE,
    Choice,
    Injection,
    PlainRobot,
)
from pprs_dynamics.simulation.simulated_robot import SensorSettings

# What of the catalogue can be injected into a 3-PPRS.
IN_CATALOGUE = tuple(name for name in NAMES if name not in (
    *NOT_IN_CATALOGUE, 'counterbalance', 'eccentric_encoder', 'elastic_joint', 'coupled_drives',
    'current_gain'))
DURATION, RATE = 40.0, 500.0  # [s, Hz]
ROUNDS = 4  # of loads with friction in them
LEAD = 50  # samples before the recording, for what looks back in time
NOISE = 0.08  # [N], of which 70 % of the variance is correlated
QUIETEST = 0.01  # [N]; an effect that would need less is drawn anew
DRAWS = 8
NARROWEST, WIDEST = 0.2, 5.0  # widths of the robot's reversals over the model's
TOLERANCES = (0.03, 0.05)
# Strengths of a hidden effect, as a multiple of what it is drawn with. Where they do not do, the
# noise is another.
SCALES = (0.01, 3.0)
SCALINGS, SCALED = 8, 0.03  # rounds, and relative error of the strength that is good enough
PINK = '1/f'
VIBRATIONS = (0.3, 50.0)  # [Hz], of the row of that name


@dataclass(frozen=True)
class Case:
    """One recording.

    Parameters
    ----------
    row : str
        Of the table, e.g. 'effects'.
    effects : tuple of str
        Names of hidden effects.
    seed : int
        Of motion and robot.
    snr : float
        Wanted strength of every effect; 0: drawn from 1 to 3 for each.
    noise : float or '1/f'
        Correlation of 70 % of the noise from sample to sample; '1/f': all of it is 1/f.
    width : float
        Of the robot's reversals over the model's; 0: drawn, for all drives or each of them.
    duration : float
        [s]
    """

    row: str
    effects: tuple[str, ...]
    seed: int
    snr: float = 1.0
    noise: float | str = 0.9
    width: float = 0.0
    duration: float = DURATION

    @property
    def name(self) -> str:
        """Name of its file."""
        what = '+'.join(self.effects) or 'none'
        noise = str(self.noise).replace('/', '-')
        return f'{self.row}_{what}_snr{self.snr:g}_noise{noise}_width{self.width:g}_{self.seed}'

    def rng(self, what: str) -> np.random.Generator:
        """Return random numbers for one purpose."""
        return np.random.default_rng((self.seed, zlib.crc32(what.encode())))


class Scene:
    """Robot and motion of one seed, and all about them that no hidden effect changes.

    Parameters
    ----------
    seed : int
    width, duration : float
        See `Case`.
    """

    def __init__(self, seed: int, width: float, duration: float = DURATION) -> None:
        rng = np.random.default_rng((seed, 2))
        self.seed, self.duration = seed, duration
        self.tolerance = float(rng.uniform(*TOLERANCES))
        self.model = tolerant_model(self.tolerance)
        numbers = list(tolerated_numbers(self.model.values))
        self.off = rng.uniform(-1, 1, len(numbers))
        self.robot: dict[str, Any] = {}
        for (key, index), off in zip(numbers, self.off, strict=True):
            value = self.robot.get(key, self.model.values[key])
            factor = 1 + self.tolerance * off
            self.robot[key] = value * factor if index is None else tuple(
                v * factor if i == index else v for i, v in enumerate(value))
        self.drive_width = _draw_widths(rng) if not width else (width,) * 6
        self.passive_width = width or _draw_width(rng)
        self.block = block_length(1 / RATE)
        self.move(seed)

    def move(self, seed: int) -> None:
        """Let the robot move along the motion of a seed."""
        self.path, self.platform, motion = _motion(seed, self.duration)
        self.plain = PlainRobot(simulated(
            self.model, self.robot, self.drive_width, self.passive_width), motion, ROUNDS)
        kept = len(motion) - LEAD
        self.treat = Treatment(np.arange(0, kept, self.block), kept)
        self._refits: dict[str | float, Refit] = {}
        vars(self).pop('_columns', None)

    def on_motion(self, seed: int) -> Scene:
        """Return the same robot on the motion of another seed."""
        other = copy.copy(self)
        other.move(seed)
        return other

    @property
    def time(self) -> np.ndarray:
        """Times of a recording [s]."""
        return np.asarray(self.plain.motion.time)[LEAD:]

    def inject(self, effects: Sequence[Choice]) -> Injection:
        """Return the robot along its motion with effects."""
        return Injection(self.plain, effects, np.random.default_rng((self.seed, CLIMATE)))

    @cached_property
    def _columns(self) -> np.ndarray:
        return sensitivities(self.model, self.platform[LEAD:], self.treat, self.tolerance)

    def refit(self, noise: float | str) -> Refit:
        """Return the refitted model under noise of `NOISE` of one sort."""
        if noise not in self._refits:
            self._refits[noise] = Refit(self._columns, self.off,
                                        Whitening(noise_settings(noise, NOISE), self.block))
        return self._refits[noise]

    def contribution(self, effect: Choice, off: np.random.Generator | None = None) -> np.ndarray:
        """Return what an effect adds to the treated residual of the model, (M, 6) [N].

        With a generator, its form is off.
        """
        run = self.inject([effect])
        added = run.efforts - self.plain.effort
        if off is not None:
            added = added * off_form(self.plain.motion, off)
        if run.beside.any():
            added -= self._model_force(run) - self.model.drive_forces(self.platform).total
        return self.treat(added[LEAD:])

    def _model_force(self, run: Injection) -> np.ndarray:
        """Return the forces that the model gives for the recorded motion, (N, 6) [N].

        An encoder that leads its drive shows in the rates above all: a play of 0.1 mm is nothing
        as a position, and a burst of acceleration at each reversal.
        """
        motion = self.plain.motion
        # As a comparison would differentiate these positions; its edges are dropped there.
        differentiator = choose_smoothing([Stretch(SensorSettings().quantised(
            run.position[LEAD:]), 1 / RATE)]).polynomial(1 / RATE)
        inside = slice(differentiator.half, len(motion) - differentiator.half)
        velocity, acceleration = motion.velocity.copy(), motion.acceleration.copy()
        _, rate, burst = differentiator.differentiated(run.beside)
        velocity[inside] += rate
        acceleration[inside] += burst
        return self.model.drive_forces(JointMotion(
            run.position, velocity, acceleration, motion.time)).total

    def recording(self, name: str, effects: Sequence[Choice], noise: np.ndarray,
                  off: Sequence[np.random.Generator] = ()) -> Recording:
        """Return a recording with effects and noise (M, 6) [N].

        With a generator for each effect, their forms are off.
        """
        run = self.inject(effects)
        effort = run.efforts
        for effect, rng in zip(effects, off, strict=False):
            added = self.inject([effect]).efforts - self.plain.effort
            effort = effort + added * (off_form(self.plain.motion, rng) - 1)
        channels = {}
        if any(effect.name == 'friction_temperature' for effect in effects):
            channels['temperature'] = read_thermometers(run.time, run.temperature)[LEAD:]
        return Recording.from_arrays(
            name, self.time, SensorSettings().quantised(run.position[LEAD:]), None,
            effort[LEAD:] + noise, channels=channels)


def simulated(model: DriveModel, robot: Mapping[str, Any],
              drive_width: Sequence[float] = (1.0,) * 6, passive_width: float = 1.0,
              ) -> DriveModel:
    """Return a robot with other numbers than the model's, and widths of reversal over its own."""
    own = DriveModel.from_parameters({**model.values, **robot})
    reversal = own.reversal
    return replace(own, reversal=Reversal(
        tuple(np.multiply(drive_width, reversal.velocity).tolist()),
        passive_width * reversal.rate, passive_width * reversal.slide))


@lru_cache(maxsize=2)
def scene(seed: int, width: float, duration: float = DURATION) -> Scene:
    """Return a scene, the last ones from memory."""
    return Scene(seed, width, duration)


@lru_cache(maxsize=2)
def _motion(seed: int, duration: float) -> tuple[RandomMotion, PlatformMotion, JointMotion]:
    model = DriveModel.load()
    path = draw_motion(model, seed, duration)
    platform = path.motion(np.arange(-LEAD, round(duration * RATE)) / RATE)
    return path, platform, driven(model, platform)


def driven(model: DriveModel, platform: PlatformMotion) -> JointMotion:
    """Return the motion of the drives along one of the platform."""
    state = model.mechanism(platform)
    return JointMotion(state.position, state.velocity, state.acceleration, platform.time)


def tolerant_model(tolerance: float) -> DriveModel:
    """Return the paper's robot, its masses and friction coefficients known to a tolerance."""
    values = default_parameters()
    model = DriveModel.from_parameters(values)
    keys = dict.fromkeys(key for key, _ in tolerated_numbers(model.values))
    return DriveModel.from_parameters(
        {**values, **{f'tolerances.{key}': tolerance for key in keys}})


def noise_settings(noise: float | str, deviation: float) -> NoiseSettings:
    """Return noise of a sort and a standard deviation [N]."""
    if noise == PINK:
        return NoiseSettings(0.0, 0.0, pink=deviation)
    return NoiseSettings(np.sqrt(0.3) * deviation, np.sqrt(0.7) * deviation, float(noise))


def make_case(case: Case) -> tuple[DriveModel, Recording, dict[str, Any]]:
    """Return the model, a recording, and the truth about it as data for JSON."""
    place = scene(case.seed, case.width, case.duration)
    found = [_draw(case, place, name) for name in case.effects]
    deviation = min([drawn.noise for drawn in found], default=NOISE)
    effects = [drawn.effect for drawn in found]
    settings = noise_settings(case.noise, deviation)
    noise = EffortNoise(settings, case.rng(f'noise {case.name}')).samples(len(place.time))
    recording = place.recording(case.name, effects, noise, [
        case.rng(f'form {drawn.what}') for drawn in found] if case.row == 'forms' else ())
    truth = {
        'case': asdict(case), 'name': case.name,
        'effects': [{**place.inject([drawn.effect]).truths[0], 'scale': drawn.scale,
                     'snr': drawn.snr * NOISE / deviation,
                     'snr_by_drive': (drawn.by_drive * NOISE / deviation).tolist()}
                    for drawn in found],
        'noise': deviation, 'noise_floor': float(np.sqrt(np.mean(place.treat(noise) ** 2))),
        'noise_by_drive': np.sqrt(np.mean(place.treat(noise) ** 2, axis=0)).tolist(),
        'drive_width': list(place.drive_width), 'passive_width': place.passive_width,
        'tolerance': place.tolerance, 'robot': place.robot, 'motion': place.path.to_dict()}
    # As it comes back from a file.
    return place.model, recording, json.loads(json.dumps(truth))


def save_case(folder: Path, case: Case) -> Path:
    """Make a case's recording, unless there is one, and return its file."""
    path = folder / f'{case.name}.npz'
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        _, recording, truth = make_case(case)
        partial = path.with_suffix('.part')
        with partial.open('wb') as file:
            np.savez_compressed(file, time=recording.time, position=recording.position,
                                effort=recording.effort.astype(np.float32),
                                **recording.channels, truth=json.dumps(truth))
        partial.rename(path)
    return path


def load_case(path: Path | str) -> tuple[DriveModel, Recording, dict[str, Any]]:
    """Return model, recording and truth of a file of `save_case`."""
    with np.load(path) as content:
        truth = json.loads(str(content['truth']))
        recording = Recording.from_arrays(Path(path).stem, content['time'], content['position'],
                                          None, content['effort'].astype(float), channels={
                                              name: content[name] for name in CHANNELS
                                              if name in content})
    return tolerant_model(truth['tolerance']), recording, truth


@dataclass(frozen=True)
class _Drawn:
    effect: Choice
    what: str  # its generator is for
    scale: float
    snr: float  # at a noise of NOISE
    by_drive: np.ndarray  # the same, (6,)
    noise: float  # [N], that gives the wanted strength


def _draw(case: Case, place: Scene, name: str) -> _Drawn:
    """Return an effect of the wanted strength, in noise as near to `NOISE` as can be."""
    wanted = case.snr or float(np.exp(case.rng(f'strength {name}').uniform(0, np.log(3.0))))
    for attempt in range(DRAWS):
        drawn = _scaled(case, place, name, f'{name} {attempt}', wanted)
        if drawn.noise > QUIETEST:
            break
    return drawn


def _effect(case: Case, place: Scene, name: str, what: str, scale: float) -> Choice:
    """Return the effect that a case draws; in the row `vibration` at any frequency."""
    effect = Choice(name, case.rng(what), scale)
    if case.row == 'vibration':
        place.inject([effect])
        assert effect.sizes is not None
        for _, _, drawn in effect.sizes.values():
            drawn['frequency'] = float(np.exp(
                case.rng(f'frequency {what}').uniform(*np.log(VIBRATIONS))))
    return effect


def _scaled(case: Case, place: Scene, name: str, what: str, wanted: float) -> _Drawn:
    refit, scale = place.refit(case.noise), 1.0
    past: list[tuple[float, float]] = []
    rays = {}
    for _ in range(SCALINGS):
        effect = _effect(case, place, name, what, scale)
        ray = refit.beyond(place.contribution(
            effect, case.rng(f'form {what}') if case.row == 'forms' else None))
        strength = ray.strength()
        past.append((scale, strength))
        rays[scale] = ray
        if abs(strength / wanted - 1) < SCALED:
            break
        following = float(np.clip(_next_scale(past, ray.factor(wanted), wanted),
                                  *SCALES))
        if following == scale:
            break
        scale = following
    scale, strength = min(past, key=lambda pair: abs(np.log(max(pair[1], 1e-9) / wanted)))
    effect = _effect(case, place, name, what, scale)
    near = abs(strength / wanted - 1) < SCALED
    return _Drawn(effect, what, scale, strength, rays[scale].by_drive(),
                  NOISE if near else NOISE * strength / wanted)


def _next_scale(past: Sequence[tuple[float, float]], factor: float, wanted: float) -> float:
    scale, strength = past[-1]
    if len(past) > 1 and min(strength, past[-2][1]) > 0 and scale != past[-2][0]:
        # Not every effect grows as its parameter does.
        power = np.log(strength / past[-2][1]) / np.log(scale / past[-2][0])
        if 0.1 < power < 0.9:
            return float(scale * (wanted / strength) ** (1 / power))
    return scale * factor


def _draw_width(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(NARROWEST), np.log(WIDEST))))


def _draw_widths(rng: np.random.Generator) -> tuple[float, ...]:
    """Return widths of the drives: the same for all, or each its own."""
    if rng.random() < 0.5:
        return (_draw_width(rng),) * 6
    return tuple(_draw_width(rng) for _ in range(6))
