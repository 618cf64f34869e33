# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How often live diagnosis is right: streams in which an effect sets in, and streams without.

    python -m benchmarks.scores.live_diagnosis changes SEEDS [EFFECT ...]
    python -m benchmarks.scores.live_diagnosis nothing WINDOWS [NOISE ...]
    python -m benchmarks.scores.live_diagnosis table

A stream is a row of windows of 40 s of one robot, each along a random motion of its own, with
noise that goes on from one to the next. In `changes` an effect of SNR 1 to 3 sets in at a random
moment of the second window and ends with the fourth; six windows are diagnosed. In `nothing`
there is only noise: white, AR(1) and 1/f in turns, or those named. Lines of JSON go to
output/live_MODE.jsonl; what is there already is not computed again. `table` sums them up.
"""

from __future__ import annotations

import copy
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from operator import itemgetter
from pathlib import Path
from resource import RUSAGE_SELF, getrusage

import numpy as np

from benchmarks import OUTPUT
from benchmarks.hidden.recordings import (
    IN_CATALOGUE,
    LEAD,
    NOISE,
    PINK,
    RATE,
    Case,
    Scene,
    _draw,
    noise_settings,
)
from benchmarks.scores.cases import Outcome, here, read_outcomes, run_missing
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.held_out import predictive_gain
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.simulation.injection import Choice
from pprs_dynamics.simulation.sensors import EffortNoise, SensorSettings

STEPS = ('plain', 'change', 'hidden', 'hidden', 'plain', 'plain')
WHITE = 'white'
NOISES: tuple[float | str, ...] = (WHITE, 0.9, 0.98, 0.997, PINK)
WINDOWS = 10  # of a stream in which nothing changes
# Other ways in which a stream goes on after a window that names an effect by mistake: a false
# alarm needs two, and is too rare to be waited for (splitting, Kahn and Harris, 1951).
CONTINUED = 10
SCREEN = 1.0  # standard errors, below the 2 that a claim takes, from which one is diagnosed


class Stream:
    """What the sensors of one robot add, from the first window to the last.

    Slow noise that began anew with each window would never be the same offset in two of them.
    """

    def __init__(self, seed: int, noise: float | str, deviation: float) -> None:
        self.settings = (SensorSettings(white_noise=deviation, coloured_noise=0.0)
                         if noise == WHITE else noise_settings(noise, deviation))
        self.noise = EffortNoise(self.settings, np.random.default_rng((seed, 77)))

    def continued(self, seed: int) -> Stream:
        """Return a stream with the same past and another future."""
        other = copy.deepcopy(self)
        other.noise._rng = np.random.default_rng((seed, 78))
        return other


def window(place: Scene, seed: int, effects: tuple[Choice, ...], moment: float | None,
           stream: Stream) -> Recording:
    """Return one window along a motion of its own; the effects from a moment on [s], or always."""
    there = place.on_motion(seed)
    run = there.inject(effects)
    position, effort = run.position[LEAD:], run.efforts[LEAD:]
    clock = there.time
    if moment is not None:
        early = (clock < moment)[:, None]
        position = np.where(early, there.plain.motion.position[LEAD:], position)
        effort = np.where(early, there.plain.effort[LEAD:], effort)
    return Recording.from_arrays(f'window {seed}', clock, stream.settings.quantised(position),
                                 None, effort + stream.noise.samples(len(clock)))


def changes(name: str, seed: int) -> Outcome:
    """Return what was said of one stream with a change."""
    case = Case('live', (name,), seed, snr=0.0)
    place = Scene(seed, 1.0)
    drawn = _draw(case, place, name)
    rng = np.random.default_rng((seed, 5))
    length = len(place.time) / RATE
    moment = float(rng.uniform(0.2, 0.8)) * length
    (truth,), stream = place.inject([drawn.effect]).truths, Stream(seed, 0.9, drawn.noise)
    live, said, start, used = LiveDiagnosis(place.model), [], 0.0, time.process_time()
    for number, what in enumerate(STEPS):
        effects = () if what == 'plain' else (drawn.effect,)
        recording = window(place, 1000 * seed + number, effects,
                           moment if what == 'change' else None, stream)
        live = live.with_window(recording, start)
        said.append({'claimed': [[*map(str, sorted(one.names)), one.found.drives, one.since]
                                 for one in live.claimed],
                     'named': [one.found.name for one in live.effects],
                     'withdrawn': [one.found.name for one in live.withdrawn]})
        start += length
    found = [one for one in said[3]['claimed'] if name in one[:-2]]
    return {'name': name, 'seed': seed, 'snr': drawn.snr * NOISE / drawn.noise,
            'drives': truth.get('drives'), 'moment': length + moment,
            'named': bool(found), 'right_drives': bool(found) and (
                found[0][-2] is None or set(found[0][-2]) == set(truth.get('drives') or [])),
            'since': found[0][-1] if found else None,
            'early': bool(said[0]['claimed'] or said[1]['claimed']),
            'others': len(said[3]['claimed']) - bool(found),
            'ended': not said[5]['claimed'], 'said': said,
            'seconds': time.process_time() - used}


def nothing(first: int, noise: float | str) -> Outcome:
    """Return what was said of a stream of windows without any change."""
    place, stream, used = Scene(first, 0.0), Stream(first, noise, NOISE), time.process_time()
    live, claimed, named, start = LiveDiagnosis(place.model), [], [], 0.0
    tried = alarms = 0
    for number in range(WINDOWS):
        recording = window(place, 1000 * first + number, (), None, stream)
        live = live.with_window(recording, start)
        start += recording.time[-1] - recording.time[0]
        claimed.append([one.found.name for one in live.claimed])
        named.append([one.found.name for one in live.effects])
        if live.effects and not live.claimed:
            tried += CONTINUED
            own = 1000 * first + 100 * (number + 1)
            alarms += sum(_goes_on_to_claim(live, place, stream, own + k, start)
                          for k in range(CONTINUED))
    return {'seed': first, 'noise': noise, 'windows': WINDOWS, 'claimed': claimed,
            'named': named, 'continued': tried, 'alarms': alarms,
            'seconds': time.process_time() - used,
            'memory': getrusage(RUSAGE_SELF).ru_maxrss / 1024}


def _goes_on_to_claim(live: LiveDiagnosis, place: Scene, stream: Stream, seed: int,
                      start: float) -> bool:
    """Return whether what the last window names is claimed in one way of going on."""
    recording = window(place, seed, (), None, stream.continued(seed))
    assert live.last is not None
    before, _ = measure_residuals(live.model, [recording])
    after, _ = measure_residuals(live.last.adopted, [recording])
    if predictive_gain(before, after).certainty < SCREEN:
        return False
    return bool(live.with_window(recording, start).claimed)


def cases(mode: str, arguments: list[str]) -> dict[str, Callable[[], Outcome]]:
    """Return what is asked for, by its key in the file of outcomes."""
    if mode == 'changes':
        # The monitor hears no thermometer.
        every = sorted({*IN_CATALOGUE} - {'friction_temperature'})
        # Each with a robot, motions and a moment of its own.
        return {f'{name} {seed}': partial(changes, name,
                                          300 + len(every) * seed + every.index(name))
                for seed in range(int(arguments[0])) for name in arguments[1:] or every}
    noises = [noise for noise in NOISES if str(noise) in (arguments[1:] or map(str, NOISES))]
    return {f'nothing {noise} {first}': partial(nothing, 500 + first, noise)
            for first in range(int(arguments[0]) // WINDOWS)
            for noise in (noises[first % len(noises)],)}


def outcome(case: tuple[str, Callable[[], Outcome]]) -> Outcome:
    """Return what came of a case, or why nothing did."""
    key, work = case
    try:
        return {'key': key, **work()}
    except PprsError as error:
        return {'key': key, 'error': str(error)}


def read(mode: str) -> list[Outcome]:
    """Return the results that are there, without those that came to nothing."""
    return [one for one in read_outcomes(file_of(mode)) if 'error' not in one]


def file_of(mode: str) -> Path:
    """Return the file of outcomes."""
    return OUTPUT / f'live_{mode}.jsonl'


def table() -> list[str]:
    """Return the rows that docs/cell.md has."""
    streams = read('changes')
    rows = ['| | goal | found |', '|---|---|---|']
    if streams:
        late = [abs(one['since'] - one['moment']) for one in streams if one['since'] is not None]
        right = sum(one['named'] and one['right_drives'] for one in streams)
        rows += [f'| named, right effect and drives | 95 % | {right} of {len(streams)} |',
                 f'| error of the moment, median and largest | 3 s | {np.median(late):.2f} s, '
                 f'{max(late):.2f} s; {len(streams) - len(late)} without |',
                 f'| gone two windows after its end | | {sum(one["ended"] for one in streams)} of '
                 f'{len(streams)} |',
                 '| claimed before it came, or beside it | | '
                 f'{sum(one["early"] or one["others"] > 0 for one in streams)} of {len(streams)} |']
    for noise in NOISES:
        quiet = [one for one in read('nothing') if one['noise'] == noise]
        windows = sum(one['windows'] for one in quiet)
        if windows:
            named = sum(bool(each) for one in quiet for each in one['named'])
            tried = sum(one.get('continued', 0) for one in quiet)
            alarms = sum(one.get('alarms', 0) for one in quiet)
            claimed = sum(bool(each) for one in quiet for each in one['claimed'])
            rows.append(f'| false alarms, noise {noise} | 1 in 1 000 windows | {claimed} in '
                        f'{windows}; named once in {named}, of {tried} continuations {alarms} '
                        'claimed |')
    return rows


def main() -> int:
    """Run what is not there yet, or sum up what is."""
    mode, arguments = sys.argv[1], sys.argv[2:]
    if mode == 'table':
        print('\n'.join(table()))
        return 0
    wanted = {key: (key, work) for key, work in cases(mode, arguments).items()}
    run_missing(here, outcome, wanted, file_of(mode), itemgetter('key'), lambda one: json.dumps(
        {key: value for key, value in one.items() if key != 'said'}))
    return 0


if __name__ == '__main__':
    sys.exit(main())
