# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs survey`: put the results of many recordings into a store."""

from __future__ import annotations

import argparse
from pathlib import Path

from pprs_dynamics.app.commands.arguments import UsageError, output_folder, whole, write_json
from pprs_dynamics.app.fleet.engine import cluster, run_each
from pprs_dynamics.app.fleet.recordings import (
    AUTO,
    find_recordings,
    pandas,
    read_manifest,
    write_rows,
)
from pprs_dynamics.app.fleet.survey import SurveyJob, examine, key, model_of, requests_of
from pprs_dynamics.app.report.terminal import console, shown, staged_bar
from pprs_dynamics.system.plain_text import counted

MOST_SHOWN = 10  # errors
MOST_WORKERS = 1024

EXAMPLE = 'pprs survey recordings --model robot.yaml --output store'


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
    where.add_argument('--scheduler', metavar='tcp://HOST:PORT',
                       help='use a running Dask cluster')


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
        write_json(options.json, {
            'recordings': len(jobs), 'done': done, 'done_before': earlier,
            'errors': [{'recording': path, 'error': error} for path, error in failed.items()]})
    return 0
