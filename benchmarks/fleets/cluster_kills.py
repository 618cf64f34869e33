# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A scheduler, workers and a client as processes over TCP, each killed in the midst of a survey.

Run `python -m benchmarks.fleets.cluster_kills [--recordings 400] [--rounds 10]`. Small
recordings of a single axis are surveyed once on a cluster of its own, without an accident: the
reference. Then, in each round, a worker is killed (SIGKILL) when a drawn share is done, then the
scheduler, then the client, with the same command run again after each; the store must come out the
same, with nothing twice and nothing that was done written again.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from benchmarks import ROOT
from pprs_dynamics.app.fleet.store import DONE, FAILED, Store

MODEL, EFFECTS = str(ROOT / 'config' / 'single_axis.yaml'), 'coulomb_friction'
NOISE = 0.5  # [N]
PATIENCE = 120.0  # [s], for a process on a busy machine
CHANGING = ('seconds', 'path')  # columns that differ from run to run, and with the place


def write_axis(path: Path, friction: float = 0.0, seed: int = 0) -> Path:
    """Write 8 s of the single axis, with Coulomb friction that its model lacks [N]."""
    rng = np.random.default_rng(seed)
    time = np.arange(800) / 100
    position = 0.05 * np.sin(np.pi * time) + 0.02 * np.sin(2.6 * np.pi * time)
    velocity = np.pi * (0.05 * np.cos(np.pi * time) + 0.052 * np.cos(2.6 * np.pi * time))
    acceleration = -np.pi ** 2 * (0.05 * np.sin(np.pi * time)
                                  + 0.1352 * np.sin(2.6 * np.pi * time))
    # The numbers of config/single_axis.yaml.
    effort = (95.109 * acceleration + 203.5 * velocity - 3.165
              + (20.394 + friction) * np.tanh(velocity / 0.0003))
    effort = effort + rng.normal(scale=NOISE, size=len(time))
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = '\n'.join(f'{t:.4f},{q:.9f},{f:.6f}' for t, q, f in zip(
        time, position, effort, strict=True))
    path.write_text(f'time,axis/position,axis/effort\n{rows}\n')
    return path


def write_axes(folder: Path, count: int) -> Path:
    """Write small recordings of three robots, one of them unreadable."""
    for k in range(count - 1):
        write_axis(folder / f'robot_{k % 3}' / f'{k}.csv', seed=k)
    (folder / 'robot_0' / 'bad.csv').write_text('this is no recording\n')
    return folder


class Cluster:
    """A scheduler and workers as processes of their own.

    Parameters
    ----------
    workers : int
    settings : mapping of str to str, optional
        Environment variables, e.g. of Dask's configuration.
    protocol : str
    """

    def __init__(self, workers: int, settings: dict[str, str] | None = None,
                 protocol: str = 'tcp') -> None:
        self.settings, self.protocol = settings or {}, protocol
        self.folder = tempfile.TemporaryDirectory(prefix='cluster')
        self.processes: list[subprocess.Popen[Any]] = []
        self.begin(workers)

    def begin(self, workers: int) -> None:
        """Start a scheduler and workers, wherever the system has a free port."""
        known = Path(self.folder.name) / f'{len(self.processes)}.json'
        self.scheduler = self._start('dask_scheduler', '--host', '127.0.0.1', '--port', '0',
                                     '--protocol', self.protocol, '--no-dashboard', '--no-show',
                                     '--scheduler-file', str(known))
        wait_for(lambda: known.exists() and known.read_text().strip().endswith('}'))
        self.workers = [self._start(
            'dask_worker', '--scheduler-file', str(known), '--nthreads', '1', '--no-nanny',
            '--no-dashboard', '--protocol', self.protocol, '--local-directory', self.folder.name)
            for _ in range(workers)]

        self.address = json.loads(known.read_text())['address']

    def _start(self, module: str, *arguments: str) -> subprocess.Popen[Any]:
        process = subprocess.Popen(
            [sys.executable, '-m', f'distributed.cli.{module}', *arguments],
            cwd=ROOT, env={**os.environ, 'PYTHONPATH': str(ROOT), **self.settings},
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.processes.append(process)
        return process

    def end(self) -> None:
        """Kill all that is left."""
        for process in self.processes:
            process.kill()
            process.wait()
        self.folder.cleanup()


@contextmanager
def running(workers: int, settings: dict[str, str] | None = None,
            protocol: str = 'tcp') -> Iterator[Cluster]:
    """Give a cluster that lasts as long as the block."""
    cluster = Cluster(workers, settings, protocol)
    try:
        yield cluster
    finally:
        cluster.end()


def wait_for(true: Any) -> None:
    """Wait until something is true."""
    end = monotonic() + PATIENCE
    while not true():
        if monotonic() > end:
            raise TimeoutError('a process takes too long')
        sleep(0.02)


def survey(recordings: Path | str, store: Path | str, *arguments: str,
           settings: dict[str, str] | None = None, **options: Any) -> subprocess.Popen[str]:
    """Start the command; options are Popen's."""
    return subprocess.Popen(
        [sys.executable, '-m', 'pprs_dynamics.app.commands.pprs', 'survey', str(recordings),
         '--model',
         MODEL, '--effects', EFFECTS, '--output', str(store), *arguments], cwd=ROOT,
        env={**os.environ, 'PYTHONPATH': str(ROOT), **(settings or {})},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def files(store: Path) -> dict[str, int]:
    """Return what is done, with the time at which it was written [ns]."""
    found = {}
    for path in store.rglob(f'*{DONE}'):
        if not path.name.startswith('.') and not path.name.endswith(FAILED):
            found[str(path.relative_to(store))] = path.stat().st_mtime_ns
    return found


def rows(store: Path | str) -> list[str]:
    """Return all rows of a store, without what changes from run to run, in order."""
    table = Store(str(store)).read()
    return sorted(str([(name, value) for name, value in row.items() if name not in CHANGING])
                  for row in table.to_pylist())


def kill_one_after_another(recordings: Path, store: Path, shares: Sequence[float],
                           count: int) -> list[str]:
    """Kill a worker, the scheduler and the client when shares of a survey are done.

    Returns
    -------
    list of str
        What the clients said at their end: the one whose scheduler was killed, and the last.
    """
    def done(share: float) -> Any:
        return lambda: len(files(store)) >= share * count

    with running(2) as cluster:
        first = survey(recordings, store, '--scheduler', cluster.address)
        wait_for(done(shares[0]))
        cluster.workers[0].send_signal(signal.SIGKILL)
        wait_for(done(shares[1]))
        cluster.scheduler.send_signal(signal.SIGKILL)
        _, lost = first.communicate(timeout=PATIENCE)
        assert first.returncode == 2, lost
        kept = files(store)
        cluster.begin(2)
        second = survey(recordings, store, '--scheduler', cluster.address)
        wait_for(done(shares[2]))
        second.send_signal(signal.SIGKILL)
        second.communicate(timeout=PATIENCE)
        kept = {**files(store), **kept}
        third = survey(recordings, store, '--scheduler', cluster.address)
        said, wrong = third.communicate(timeout=PATIENCE)
        assert third.returncode == 0, wrong
    after = files(store)
    again = [name for name, time in kept.items() if after.get(name) != time]
    assert not again, f'written again: {again}'
    return [lost, said]


def main() -> None:
    """Run rounds, and say how each went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--recordings', type=int, default=400)
    parser.add_argument('--rounds', type=int, default=10)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recordings = write_axes(folder / 'recordings', options.recordings)
        survey(recordings, folder / 'reference').communicate()
        reference = rows(folder / 'reference')
        for k in range(options.rounds):
            store = folder / f'store_{k}'
            shares = np.sort(rng.uniform(0.02, 0.95, 3))
            began = monotonic()
            said = kill_one_after_another(recordings, store, shares, options.recordings)[-1]
            same = rows(store) == reference
            print(f'round {k}: killed at {shares.round(2)}, {monotonic() - began:.0f} s, '
                  f'{"the same store" if same else "ANOTHER STORE"}; {said.splitlines()[-1]}',
                  flush=True)


if __name__ == '__main__':
    main()
