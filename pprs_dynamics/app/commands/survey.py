# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs survey`: put the results of many recordings into a store."""

from __future__ import annotations

import argparse
import logging
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypedDict

from pprs_dynamics.app.commands.arguments import UsageError, output_folder, whole, write_json
from pprs_dynamics.app.fleet.recordings import (
    AUTO,
    find_recordings,
    pandas,
    read_manifest,
    write_rows,
)
from pprs_dynamics.app.fleet.survey import SurveyJob, examine, key, model_of, requests_of
from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.errors import PprsError, optional_library
from pprs_dynamics.system.plain_text import counted

LOOPBACK = '127.0.0.1'
ALLOWED_FAILURES = 2  # workers that an item may lose before it is given up
REACHED_WITHIN = '15s'  # the scheduler
SILENCE = '60s'  # without a message a worker is killed and started again
NEVER = '365 days'
MOST_SHOWN = 10  # errors
STOPPED = 'the scheduler has stopped; what was written remains, and the same command does the rest'
MOST_WORKERS = 1024
EXAMPLE = 'pprs survey recordings --model robot.yaml --output store'


class SurveyJson(TypedDict):
    """Counts of the recordings of a survey.

    Parameters
    ----------
    recordings, done, done_before : int
        All, those with a result, and those that the store contained already.
    errors : dict of str to str
        Recordings without a result, with the reason.
    """

    recordings: int
    done: int
    done_before: int
    errors: dict[str, str]


class SchedulerError(PprsError, ConnectionError):
    """A scheduler that cannot be reached, or has stopped."""


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Give a Dask client; without `scheduler` its processes last as long as the block.

    Parameters
    ----------
    workers : int, optional
        Processes; by default one for every core.
    scheduler : str, optional
        Address of a running one: tcp://HOST:PORT, or tls://HOST:PORT with certificates in Dask's
        configuration.

    Raises
    ------
    SchedulerError
        If it cannot be reached.
    """
    library, dask = (optional_library(name, 'distributed', 'a survey', 'fleet')
                     for name in ('distributed', 'dask'))
    settings = {'distributed.scheduler.allowed-failures': ALLOWED_FAILURES,
                # What waits at a worker that dies would count as what killed it.
                'distributed.scheduler.worker-saturation': 1.0,
                'distributed.scheduler.worker-ttl': SILENCE,
                # Else a worker that is being started again is closed for good, where another one
                # of its name died 15 s before.
                'distributed.deploy.lost-worker-timeout': NEVER,
                'distributed.admin.log-format': ''}
    for name in ('distributed', 'distributed.client'):  # what happens is one sentence of ours
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(settings):
        try:
            if scheduler is not None:
                client = library.Client(scheduler, timeout=REACHED_WITHIN, set_as_default=False)
            else:
                client = library.Client(
                    n_workers=workers or len(os.sched_getaffinity(0)), threads_per_worker=1,
                    processes=True, host=LOOPBACK, dashboard_address=f'{LOOPBACK}:0',
                    silence_logs='CRITICAL', set_as_default=False)
        except (OSError, ValueError, RuntimeError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            where = 'a cluster of this machine' if scheduler is None else f'--scheduler {scheduler}'
            raise SchedulerError(f'{where}: cannot be reached: {reason}') from None
        with client:
            yield client


def run_each(client: Any, work: Callable[[Any], Any], items: Iterable[Any],
             ) -> Iterator[tuple[Any, Any, str | None]]:
    """Yield each item, what work returns for it, and its error (None for none), as they end.

    Raises
    ------
    SchedulerError
        If the scheduler stops.
    """
    import distributed

    library: Any = distributed
    waiting, running = deque(items), dict[Any, Any]()
    ended = library.as_completed(loop=client.loop, with_results=True, raise_errors=False)
    while waiting or running:
        try:
            # A worker gets its next item when its last result is here: what a worker dies of
            # takes no result with it.
            while waiting and len(running) < max(1, sum(client.nthreads().values())):
                item = waiting.popleft()
                future = client.submit(work, item, pure=False)
                running[future] = item
                ended.add(future)
            future, result = next(ended)
        except (OSError, RuntimeError):
            raise SchedulerError(STOPPED) from None
        if future.status == 'error':
            _, error, _ = result
            yield running.pop(future), None, f'{type(error).__name__}: {error}'
        elif client.status == 'running' and not future.cancelled():
            yield running.pop(future), result, None
        else:
            raise SchedulerError(STOPPED)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='*',
                        help='recordings, folders of recordings, or patterns such as "run_*.mcap"')
    parser.add_argument('--manifest', metavar='FILE.csv', help='list of recordings with the '
                        'columns path and robot, and optionally time and model')
    parser.add_argument('--output', metavar='STORE', required=True, type=output_folder,
                        help='folder of Parquet files; finished recordings in it are skipped')
    parser.add_argument('--effects', metavar='auto|NAME,…', default=AUTO,
                        help='auto (default): diagnose each recording; NAME: fit these effects '
                        'only, which is many times faster; EFFECT or EFFECT:drive+drive')
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--workers', metavar='N', type=whole(1, MOST_WORKERS),
                       help='processes on this machine (default: one for every core)')
    where.add_argument('--scheduler', metavar='tcp://HOST:PORT', help='use a running Dask cluster')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen, store = console(), Path(options.output)
    pandas()
    if bool(options.recordings) == bool(options.manifest):
        raise UsageError('recordings and --manifest: one of the two must be given')
    base = model_of(options.model)
    if options.effects != AUTO and not requests_of(options.effects, base):
        raise UsageError(f'--effects {options.effects!r}: must be auto or names of effects')
    entries = (read_manifest(options.manifest) if options.manifest
               else find_recordings(options.recordings))
    jobs = [SurveyJob(entry, entry.model or options.model, options.effects) for entry in entries]
    if not jobs:
        raise UsageError(f'{options.manifest}: no recording is listed')
    waiting = [job for job in jobs if not (store / f'{key(job.common)}.parquet').exists()]
    failed: dict[str, str] = {}
    with (cluster(options.workers, options.scheduler) as client,
          staged_bar(screen) as progress):
        for done, (job, rows, error) in enumerate(run_each(client, examine, waiting), start=1):
            if error is None:
                write_rows(store, key(rows[0]), rows)
                error = rows[0].get('error')
            if error is not None:
                failed[job.entry.path] = error
            progress(f'recordings: {done} of {len(waiting)}', done / len(waiting))
    for path, error in list(failed.items())[:MOST_SHOWN]:
        screen.print(f'[yellow]![/] {shown(path)}: {shown(error)}')
    if len(failed) > MOST_SHOWN:
        screen.print(f'… and {len(failed) - MOST_SHOWN} more')
    done, earlier = len(waiting) - len(failed), len(jobs) - len(waiting)
    screen.print(f'{counted(len(jobs), "recording")}: {done} done, {earlier} done before, '
                 f'{len(failed)} without a result; store: {shown(options.output)}')
    if options.json:
        write_json(options.json, SurveyJson(recordings=len(jobs), done=done, done_before=earlier,
                                            errors=failed))
    return 0
