# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Work on many items by Dask: processes of this machine, or a cluster that is running."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from pprs_dynamics.errors import MissingLibraryError, PprsError

LOOPBACK = '127.0.0.1'
ALLOWED_FAILURES = 2  # workers that an item may lose before it is given up
REACHED_WITHIN = '15s'  # the scheduler
SILENCE = '60s'  # without a message a worker is killed and started again


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
    try:
        import dask
        import distributed
    except ImportError:
        raise MissingLibraryError('distributed', 'a survey', 'fleet') from None
    library: Any = distributed  # its functions have no types
    settings = {'distributed.scheduler.allowed-failures': ALLOWED_FAILURES,
                'distributed.scheduler.worker-ttl': SILENCE,
                'distributed.admin.log-format': '', 'logging.distributed': 'critical'}
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
    running = {client.submit(work, item, pure=False): item for item in items}
    for future in library.as_completed(running, loop=client.loop):
        item = running.pop(future)
        if future.status == 'finished':
            yield item, future.result(), None
        elif client.status != 'running' or future.status != 'error':
            raise SchedulerError('the scheduler has stopped; what was written remains, and the '
                                 'same command does the rest')
        else:
            error = future.exception()
            yield item, None, f'{type(error).__name__}: {error}'
