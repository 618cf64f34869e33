# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Work on many items by Dask distributed: a cluster of this machine, or one that is running.

Only a bounded number of items is in the cluster at a time, so that the client's memory does not
grow with their number.
"""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing import resource_tracker
from time import monotonic
from typing import Any

from pprs_dynamics.app.fleet.store import Store
from pprs_dynamics.app.fleet.survey import SurveyJob, SurveyResult, examine, identify, lost
from pprs_dynamics.errors import MissingLibraryError, PprsError

LOOPBACK = '127.0.0.1'
PER_WORKER = 4  # items in the cluster for each worker: enough that none waits
# A recording may lose this many workers before it is given up: others may be killed by chance.
ALLOWED_FAILURES = 2
ASKED_EVERY = 5.0  # [s], for workers that have come or gone
REACHED_WITHIN = '15s'  # the scheduler
# Without a word from a worker of a cluster of its own, which tells of itself twice a second: it is
# killed and started again, and others do its work.
SILENCE = '60s'

Task = Generator[Callable[[], Any], tuple[Any, str | None], Any]
"""The steps of one item: yields what submits the next one, gets that one's value or error."""


class SchedulerError(PprsError, ConnectionError):
    """A scheduler that cannot be reached, or has gone."""


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Give a Dask client; a cluster of its own lasts as long as the block, on the loopback only.

    Parameters
    ----------
    workers : int, optional
        Processes; None: one for every core.
    scheduler : str, optional
        Address of a running one, tcp://HOST:PORT or tls://HOST:PORT; Dask's own configuration
        holds certificates.

    Raises
    ------
    SchedulerError
        Where it cannot be reached.
    """
    try:
        import dask
        import distributed
    except ImportError:
        raise MissingLibraryError('distributed', 'a survey', 'fleet') from None
    library: Any = distributed  # whose functions carry no types
    with _without_log():
        if scheduler is not None:
            client = _reached(library, scheduler)
            try:
                yield client
            finally:
                client.close(timeout=2)
            return
        settings = {'distributed.scheduler.allowed-failures': ALLOWED_FAILURES,
                    # Workers that are killed with their nannies are nobody's to restart.
                    'distributed.worker.daemon': True,
                    'distributed.scheduler.worker-ttl': SILENCE}
        with dask.config.set(settings), _workers_spared():
            try:
                local = library.LocalCluster(
                    n_workers=workers or len(os.sched_getaffinity(0)), threads_per_worker=1,
                    processes=True, host=LOOPBACK, dashboard_address=f'{LOOPBACK}:0',
                    worker_dashboard_address=f'{LOOPBACK}:0', silence_logs='CRITICAL')
            except (OSError, RuntimeError) as error:
                raise SchedulerError(f'a cluster of this machine cannot be started: {error}'
                                     ) from None
        with local, library.Client(local, set_as_default=False) as client:
            yield client


def _reached(library: Any, scheduler: str) -> Any:
    """Return a client of a running cluster."""
    encrypted = scheduler.startswith('tls://')
    security = library.Security()  # of Dask's configuration
    # What Dask itself says of these two comes late, and more than once.
    if encrypted and security.get_connection_args('client').get('ssl_context') is None:
        raise SchedulerError(f"--scheduler {scheduler}: cannot be reached: Dask's configuration "
                             'names no certificates (distributed.comm.tls)')
    if security.require_encryption and not encrypted:
        raise SchedulerError(f"--scheduler {scheduler}: cannot be reached: Dask's configuration "
                             'requires encryption, an address must begin with tls://')
    try:
        return library.Client(scheduler, timeout=REACHED_WITHIN, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise SchedulerError(f'--scheduler {scheduler}: cannot be reached: {reason}') from None


@contextmanager
def _without_log() -> Iterator[None]:
    """Keep Dask's log of what comes and goes out of the terminal: what matters is raised."""
    handlers = {handler: handler.level for name in logging.root.manager.loggerDict
                if name.startswith('distributed') for handler in logging.getLogger(name).handlers}
    for handler in handlers:
        handler.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for handler, level in handlers.items():
            handler.setLevel(level)


@contextmanager
def _workers_spared() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach: this one hears it, and ends them.

    Threads and processes that begin in the block inherit that the signal is held back.
    """
    # Starting it later would let the signal through again.
    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def run_each(client: Any, work: Callable[[Any], Any], items: Iterable[Any],
             ) -> Iterator[tuple[Any, Any, str | None]]:
    """Yield item, what work returns for it, and its error if it has one, as they come.

    Raises
    ------
    SchedulerError
        Where the scheduler goes.
    """
    def steps(item: Any) -> Task:
        value, error = yield partial(client.submit, work, item, pure=False)
        return item, value, error

    yield from _carried_out(client, map(steps, items))


def run_survey(client: Any, jobs: Iterable[SurveyJob], store: Store,
               ) -> Iterator[SurveyResult | None]:
    """Write the rows of every recording to a store; yield each, or None for one done already.

    Raises
    ------
    SchedulerError
        Where the scheduler goes; what was written stays, and the same survey goes on from there.
    """
    def steps(job: SurveyJob) -> Task:
        content, error = yield partial(client.submit, identify, job.entry.path, pure=False)
        if error is None:
            if content is not None and store.has(job.entry.robot, job.key(content)):
                return None
            # Ahead of other recordings' beginnings, so that what was begun is ended.
            result, error = yield partial(client.submit, examine, job, content, pure=False,
                                          priority=1)
        if error is not None:
            result = lost(job, content, error)
        store.write(job.entry.robot, result.key, result.rows, result.failed)
        return result

    yield from _carried_out(client, map(steps, jobs))


def _carried_out(client: Any, tasks: Iterable[Task]) -> Iterator[Any]:
    """Yield what tasks return, as they come; a bounded number is in the cluster at a time."""
    import distributed

    library: Any = distributed
    waiting = iter(tasks)
    there: dict[Any, tuple[Task, Callable[[], Any]]] = {}
    queue = library.as_completed(loop=client.loop)

    def add(task: Task, submit: Callable[[], Any]) -> None:
        future = submit()
        there[future.key] = (task, submit)
        queue.add(future)

    most, asked = 0, -ASKED_EVERY

    def fill() -> None:
        nonlocal most, asked
        if monotonic() > asked + ASKED_EVERY:
            most, asked = PER_WORKER * max(len(client.ncores()), 1), monotonic()
        while len(there) < most and (task := next(waiting, None)) is not None:
            add(task, next(task))

    fill()
    while there:
        future = next(queue)
        task, submit = there.pop(future.key)
        outcome = _outcome(client, future)
        future.release()
        if outcome is None:
            # Done, but on a worker that was killed before it handed the result over.
            add(task, submit)
            continue
        try:
            add(task, task.send(outcome))
        except StopIteration as end:
            yield end.value
        fill()


def _outcome(client: Any, future: Any) -> tuple[Any, str | None] | None:
    """Return the value of a future, or what became of it; None where it went with its worker.

    Raises
    ------
    SchedulerError
        Where the scheduler has gone.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    status = future.status
    try:
        if status == 'finished':
            return future.result(), None
    except (CancelledError, KeyError, OSError):
        status = 'lost'
    if status == 'error':
        error = future.exception()
        if isinstance(error, KilledWorker):
            return None, (f'its worker was killed {ALLOWED_FAILURES + 1} times, by the system or '
                          'for lack of memory')
        return None, f'{type(error).__name__}: {error}'
    if client.status == 'running':
        return None
    raise SchedulerError('the scheduler has gone; what was written stays, and the same command '
                         'does what is missing')
