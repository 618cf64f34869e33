# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How well a survey and its trends find what changes in a fleet of the physics engine.

Run `python -m benchmarks.fleets.fleet [--fleets 5] [--robots 20] [--days 30] [--first 0]
[--folder output/fleets] [--workers N | --scheduler ADDRESS] [--quiet]`. Each robot is recorded once
a day, 20 s of the same motion, and has its own masses and friction within tolerances and its own
noise; friction falls as the robot warms up, by the hour of the recording. On three robots the
friction of one drive starts to grow, on one the payload changes, on one a drive's zero shifts, on
one a cable begins to pull, each from a drawn day on; `--quiet` changes nothing on any. Recordings
are kept, and the survey's store too, so that what was interrupted goes on.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.hidden.driven_motion import DrivenMotion
from benchmarks.hidden.motions import draw_motion
from benchmarks.hidden.prescribed import PrescribedPlant
from benchmarks.hidden.recordings import tolerant_model
from benchmarks.hidden.strength import tolerated_numbers
from pprs_dynamics.app.fleet.engine import cluster, run_survey
from pprs_dynamics.app.fleet.manifest import read_manifest
from pprs_dynamics.app.fleet.store import Store
from pprs_dynamics.app.fleet.survey import SurveyJob
from pprs_dynamics.app.fleet.trend import FleetTrends, fleet_trends, main_change
from pprs_dynamics.app.fleet.trend_sentences import sentences
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.simulation.hidden_bodies import payload_mass
from pprs_dynamics.simulation.hidden_effect import HiddenEffect
from pprs_dynamics.simulation.hidden_forces import coulomb_friction, drive_spring
from pprs_dynamics.simulation.plant import PlantSettings
from pprs_dynamics.simulation.sensors import EffortNoise, HomingError, SensorSettings

DURATION, RATE = 20.0, 100.0  # [s, Hz]
LEAD = 10  # samples before the recording, for effects that look back
TOLERANCE = 0.03
NOISES = (0.05, 0.15)  # [N], drawn per robot
WARM = 0.03  # share by which friction falls at working temperature
EFFECTS = 'coulomb_friction,payload_mass,homing_error,drive_spring'
EPOCH = 20_454  # day since 1970 of the first recordings: 2026-01-01
# What grows, and how much: friction [N per day], payload [kg], zero of slides and of lifts [m],
# stiffness of a cable [N/m].
GROWTH, PAYLOAD, ZERO, CABLE = (0.01, 0.03), (0.05, 0.2), (0.003, 0.01), (8.0, 20.0)
EARLIEST = 0.25  # share of the days before which nothing begins
LATEST = 0.65
CHANGES = ('friction', 'friction', 'friction', 'payload', 'zero', 'cable')
TOLD = {'friction': ('coulomb_friction.force',), 'payload': ('payload_mass.mass',),
        'zero': ('homing_error.zero',),
        # A spring that is relaxed elsewhere is a stiffness and a force.
        'cable': ('drive_spring.stiffness', 'drive_spring.force')}


@dataclass(frozen=True)
class Truth:
    """What changes on a robot: kind, drive, day from which on, size (of friction: per day)."""

    kind: str
    drive: str
    day: int
    size: float

    def effect(self, day: int) -> HiddenEffect | None:
        """Return what is hidden in the robot on a day."""
        if day < self.day:
            return None
        if self.kind == 'friction':
            force = self.size * (day - self.day)
            return coulomb_friction({self.drive: {'force': force, 'width': 0.001}})
        if self.kind == 'payload':
            return payload_mass(mass=self.size)
        if self.kind == 'zero':
            return HomingError({self.drive: {'zero': self.size}})
        rest = 0.2 if self.drive.startswith('lift') else 0.0
        return drive_spring({self.drive: {'stiffness': self.size, 'rest': rest,
                                         'hardening': 0.25}})


def draw_truths(rng: np.random.Generator, robots: int, days: int, quiet: bool,
                ) -> dict[int, Truth]:
    """Return what changes, by robot."""
    kinds = () if quiet else CHANGES[:robots]
    chosen = rng.choice(robots, len(kinds), replace=False)
    truths = {}
    for robot, kind in zip(chosen, kinds, strict=True):
        day = int(rng.integers(round(EARLIEST * days), round(LATEST * days) + 1))
        drive = '' if kind == 'payload' else str(rng.choice(DRIVES[:3] if kind == 'zero'
                                                            else DRIVES))
        size = float(rng.uniform(*{'friction': GROWTH, 'payload': PAYLOAD, 'zero': ZERO,
                                   'cable': CABLE}[kind]))
        if kind in ('payload', 'zero') and rng.random() < 0.5:
            size = -size
        truths[int(robot)] = Truth(kind, drive, day, size)
    return truths


def make_fleet(folder: Path, seed: int, robots: int, days: int, quiet: bool) -> dict[int, Truth]:
    """Make recordings and manifest of a fleet, as far as they are not there; return the truth."""
    rng = np.random.default_rng((seed, 20))
    truths = draw_truths(rng, robots, days, quiet)
    folder.mkdir(parents=True, exist_ok=True)
    model = tolerant_model(TOLERANCE)
    time = np.arange(-LEAD, round(DURATION * RATE)) / RATE
    path = draw_motion(model, seed, DURATION)
    drives = model.mechanism(path.motion(time))
    motion = DrivenMotion.of_drives(model.values, time, drives.position, drives.velocity,
                                    drives.acceleration)
    rows = []
    for robot in range(robots):
        own = np.random.default_rng((seed, 21, robot))
        values = dict(model.values)
        for key, index in tolerated_numbers(model.values):
            factor = 1 + TOLERANCE * own.uniform(-1, 1)
            values[key] = values[key] * factor if index is None else tuple(
                v * (factor if i == index else 1) for i, v in enumerate(values[key]))
        noise = float(np.exp(own.uniform(*np.log(NOISES))))
        # Its bodies are weighed once, and again only where one changes.
        plant = PrescribedPlant(values, motion, PlantSettings(actual_loads=True))
        for day in range(days):
            hour = float(own.uniform(0, 2))
            warmth = 1 - float(np.exp(-hour / 0.5))
            name = f'robot_{robot + 1:02d}/day_{day + 1:03d}.csv'
            rows.append((name, f'robot_{robot + 1:02d}',
                         (EPOCH + day) * 86400 + 8 * 3600 + 3600 * hour, 20 + 15 * warmth))
            if not (folder / name).exists():
                (folder / name).parent.mkdir(exist_ok=True)
                plant.values = {
                    key: _scaled(value, 1 - WARM * warmth) if key.startswith('friction.')
                    and key.endswith(('viscous', 'coulomb')) else value
                    for key, value in values.items()}
                _record(folder / name, plant, truths.get(robot), day, noise,
                        np.random.default_rng((seed, 22, robot, day)))
    with (folder / 'robots.csv').open('w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(('path', 'robot', 'time', 'temperature'))
        writer.writerows(rows)
    return truths


def _scaled(value: float | tuple[float, ...], factor: float) -> float | tuple[float, ...]:
    return (tuple(v * factor for v in value) if isinstance(value, (tuple, list))
            else value * factor)


def _record(path: Path, plant: PrescribedPlant, truth: Truth | None, day: int, noise: float,
            rng: np.random.Generator) -> None:
    effect = truth.effect(day) if truth is not None else None
    read = plant.readings([effect] if effect is not None else [])
    settings = SensorSettings.with_effort_noise(noise)
    time = plant.motion.time[LEAD:]
    recording = Recording.from_arrays(
        path.stem, time, settings.quantised(read.position[LEAD:]), None,
        read.effort[LEAD:] + EffortNoise(settings, rng).samples(len(time)))
    part = path.with_suffix('.part.csv')
    write_recording(part, recording)
    part.rename(path)


def jobs(folder: Path) -> Iterator[SurveyJob]:
    """Yield the recordings of a fleet."""
    model = tolerant_model(TOLERANCE)
    name = model.fingerprint
    for entry in read_manifest(str(folder / 'robots.csv')):
        yield SurveyJob(entry, model.values, name, EFFECTS)


def judge(fleet: FleetTrends, truths: dict[int, Truth], robots: int) -> dict[str, object]:
    """Return what is right about trends."""
    answer: dict[str, object] = {'changed': len(truths), 'unchanged': robots - len(truths),
                                 'found': 0, 'flagged': 0, 'step_days': [], 'slope_days': [],
                                 'slopes': [], 'wrong': []}
    for k in range(robots):
        told, truth = fleet.flagged(f'robot_{k + 1:02d}'), truths.get(k)
        if truth is None:
            if told:
                answer['flagged'] += 1
                answer['wrong'].append(f'robot {k + 1}: nothing, told {told[0].quantity.label}')
            continue
        first = told[0] if told else None
        if first is None or first.quantity.name not in TOLD[truth.kind] or (
                first.quantity.drive != truth.drive):
            answer['wrong'].append(f'robot {k + 1}: {truth}, told '
                                   f'{first.quantity.label if first else "nothing"}')
            continue
        answer['found'] += 1
        change = main_change(first)
        off = abs(np.floor(change.time) - EPOCH - truth.day) if change.kind == 'step' else abs(
            change.time - EPOCH - 9 / 24 - truth.day)
        if truth.kind == 'friction':
            answer['slope_days'].append(float(off))
            answer['slopes'].append(bool(change.kind == 'slope' and abs(
                change.size - truth.size) < 1.96 * change.size_std))
        else:
            answer['step_days'].append(float(off))
    return answer


def main(arguments: Sequence[str] | None = None) -> None:
    """Make fleets, survey them, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, default in (('fleets', 5), ('robots', 20), ('days', 30), ('first', 0)):
        parser.add_argument(f'--{name}', type=int, default=default)
    parser.add_argument('--folder', type=Path, default=Path('output/fleets'))
    parser.add_argument('--workers', type=int)
    parser.add_argument('--scheduler')
    parser.add_argument('--quiet', action='store_true')
    options = parser.parse_args(arguments)
    answers = []
    with cluster(options.workers, options.scheduler) as client:
        for seed in range(options.first, options.first + options.fleets):
            kind = 'quiet' if options.quiet else 'fleet'
            folder = options.folder / f'{kind}_{seed}_{options.robots}x{options.days}'
            began = perf_counter()
            truths = make_fleet(folder, seed, options.robots, options.days, options.quiet)
            made = perf_counter()
            store = Store(str(folder / 'store'))
            results = list(run_survey(client, jobs(folder), store))
            surveyed = perf_counter()
            fleet = fleet_trends(store, {'coulomb_friction.force': 2.0})
            answer = {'seed': seed, **judge(fleet, truths, options.robots),
                      'sentences': sentences(fleet)}
            new = sum(one is not None for one in results)
            rate = f'{60 * new / (surveyed - made):.0f} a minute' if new else 'none new'
            print(f'fleet {seed}: made in {made - began:.0f} s, {new} recordings surveyed, {rate}, '
                  f'trends in {perf_counter() - surveyed:.1f} s', flush=True)
            for line in (*answer['sentences'], *answer['wrong']):
                print('  ', line)
            answers.append(answer)
    total = {name: sum(one[name] for one in answers)
             for name in ('changed', 'unchanged', 'found', 'flagged')}
    joined = {name: [value for one in answers for value in one[name]]
              for name in ('step_days', 'slope_days', 'slopes')}
    print(f'changed robots found, with the right drive and quantity: {total["found"]} of '
          f'{total["changed"]}\nrobots with nothing wrong that are flagged: {total["flagged"]} of '
          f'{total["unchanged"]}')
    if joined['step_days']:
        print(f'day of a step: off by {np.median(joined["step_days"]):.1f} (median)')
    if joined['slope_days']:
        print(f'begin of a slope: off by {np.median(joined["slope_days"]):.1f} days (median)\n'
              f'slope within its 95 % interval: {sum(joined["slopes"])} of '
              f'{len(joined["slopes"])}')
    (options.folder / 'answers.json').write_text(json.dumps(answers, indent=2))


if __name__ == '__main__':
    main()
