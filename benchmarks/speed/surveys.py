# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a survey costs: a recording, two workers against one, and the client's memory.

Run `python -m benchmarks.speed.surveys cost|workers|memory [--recordings N]`. The first two take
recordings of 20 s of the six drives by the physics engine, as `benchmarks.fleets.fleet` makes
them; `memory` takes small ones of the single axis. `workers` runs one, two, one, two, so that other
work on the machine meets both.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from benchmarks.fleets import fleet
from benchmarks.fleets.cluster_kills import EFFECTS, MODEL, write_axis
from pprs_dynamics.app.fleet.engine import cluster, run_survey
from pprs_dynamics.app.fleet.manifest import ManifestEntry
from pprs_dynamics.app.fleet.store import Store
from pprs_dynamics.app.fleet.survey import SurveyJob, examine, identify
from pprs_dynamics.physics.model.model_file import load_model

SEED = 700  # of no fleet in the table
WARM = 6  # recordings that load libraries and compile
SMALL = 150  # samples
PAGE = resource.getpagesize()


def fleet_jobs(folder: Path, count: int) -> list[SurveyJob]:
    """Return recordings of one robot."""
    fleet.make_fleet(folder, SEED, 1, count, quiet=True)
    return list(fleet.jobs(folder))


def cost(folder: Path, count: int) -> None:
    """Print the processor time of named-effects recordings."""
    taken = []
    for job in fleet_jobs(folder, count + WARM):
        began = process_time()
        result = examine(job, identify(job.entry.path))
        taken.append(process_time() - began)
    low, middle, high = np.quantile(taken[WARM:], (0.1, 0.5, 0.9))
    print(f'{len(result.rows)} rows of a recording of {fleet.DURATION:.0f} s: {middle:.2f} s of '
          f'processor time ({low:.2f} to {high:.2f})')


def rate(workers: int, jobs: list[SurveyJob], store: Path) -> float:
    """Return recordings per minute, after the first ones."""
    with cluster(workers) as client:
        # A recording for every worker, several times, so that each is warm.
        for _ in run_survey(client, jobs[:WARM], Store(str(store))):
            pass
        began = perf_counter()
        for _ in run_survey(client, jobs[WARM:], Store(str(store))):
            pass
        return 60 * (len(jobs) - WARM) / (perf_counter() - began)


def workers(folder: Path, count: int) -> None:
    """Print how many recordings a minute one worker and two examine."""
    jobs = fleet_jobs(folder / 'fleet', count + WARM)
    for number, load in enumerate((1, 2, 1, 2)):
        before = os.getloadavg()[0]
        found = rate(load, jobs, folder / f'store {number}')
        print(f'{load} workers: {found:.0f} recordings a minute, load {before:.1f} before, '
              f'{os.getloadavg()[0]:.1f} after', flush=True)


def small_jobs(folder: Path, count: int, refused: bool) -> Iterator[SurveyJob]:
    """Yield small recordings, or files that are refused, each written when it is asked for."""
    model = load_model(MODEL)
    name = model.fingerprint
    text = write_axis(folder / 'whole.csv').read_text().splitlines(keepends=True)[:SMALL + 1]
    for k in range(count):
        path = folder / f'robot_{k % 100}' / f'{k}.csv'
        path.parent.mkdir(exist_ok=True)
        # The same but for a digit that nobody sees, so that contents differ.
        path.write_text(f'no recording {k}\n' if refused else
                        ''.join(text[:-1]) + f'{text[-1].rstrip()}{k:05d}\n')
        entry = ManifestEntry(str(path), f'robot_{k % 100}', float(k))
        yield SurveyJob(entry, model.values, name, EFFECTS)


def memory(folder: Path, count: int, refused: bool) -> None:
    """Print the memory of the client, in which the scheduler is, as a survey goes on."""
    with cluster(1) as client:
        store = Store(str(folder / 'store'))
        results = run_survey(client, small_jobs(folder, count, refused), store)
        for done, result in enumerate(results, start=1):
            assert result is not None
            assert (result.error is not None) == refused, result.error
            if done in (100, 300, 1000, 3000) or done % 10_000 == 0:
                pages = int(Path('/proc/self/statm').read_text().split()[1])
                print(f'{done} recordings: {pages * PAGE / 1e6:.0f} MB', flush=True)


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('what', choices=('cost', 'workers', 'memory'))
    parser.add_argument('--recordings', type=int)
    parser.add_argument('--refused', action='store_true', help='for memory: files that are no '
                        'recordings, which take the same way with less work')
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix='survey'))
    try:
        if options.what == 'cost':
            cost(folder, options.recordings or 30)
        elif options.what == 'workers':
            workers(folder, options.recordings or 60)
        else:
            memory(folder, options.recordings or 10_000, options.refused)
    finally:
        shutil.rmtree(folder)


if __name__ == '__main__':
    main()
