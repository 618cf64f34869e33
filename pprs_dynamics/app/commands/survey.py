# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs survey: many recordings into a store of results, on all cores or on a cluster."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from pprs_dynamics.app.commands.arguments import (
    DEFAULT_MODEL,
    UsageError,
    add_reference,
    add_report,
    add_topic,
    output_folder,
    whole,
)
from pprs_dynamics.app.commands.input_output import write_json
from pprs_dynamics.app.fleet.engine import cluster, run_survey
from pprs_dynamics.app.fleet.manifest import entries
from pprs_dynamics.app.fleet.store import AUTO, Store, arrow
from pprs_dynamics.app.fleet.survey import SurveyJob, requests_of
from pprs_dynamics.app.fleet.trend import fleet_trends
from pprs_dynamics.app.fleet.trend_sentences import sentences
from pprs_dynamics.app.report.fleet_page import fleet_page
from pprs_dynamics.app.report.terminal import console, counting_bar, shown
from pprs_dynamics.inference.fit.reference_runs import read_reference
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import load_model
from pprs_dynamics.system.plain_text import counted, displayed

MOST_SHOWN = 10  # errors
MOST_WORKERS = 1024

EXAMPLE = 'pprs survey recordings --model robot.yaml --output store'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    parser.add_argument('recordings', metavar='RECORDING', nargs='*',
                        help='recordings, folders of them, globs, or addresses such as s3://…')
    parser.add_argument('--manifest', metavar='FILE.csv', help='columns path, robot, time and '
                        'optionally model; further columns are conditions')
    parser.add_argument('--output', metavar='STORE', required=True, type=output_folder,
                        help='folder of Parquet files; what is in it already is not done again')
    parser.add_argument('--effects', metavar='auto|NAME,…', default=AUTO,
                        help='auto: diagnose each recording; else these effects are fitted, many '
                        'times faster; EFFECT or EFFECT:drive+drive')
    add_reference(parser)
    add_topic(parser)
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--workers', metavar='N', type=whole(1, MOST_WORKERS),
                       help='processes on this machine (default: one for every core)')
    where.add_argument('--scheduler', metavar='tcp://HOST:PORT',
                       help='use a running Dask cluster')
    add_report(parser, "write the fleet's page, as pprs trend does")


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    if not options.recordings and not options.manifest:
        raise UsageError('no recording is given, must be RECORDING… or --manifest')
    arrow()
    model_of = lru_cache(maxsize=None)(_model)
    base, _ = model_of(options.model)
    if options.effects != AUTO and not requests_of(options.effects, base):
        raise UsageError(f'--effects {options.effects!r}: must be auto or names of effects')

    if options.reference is not None and options.effects != AUTO:
        raise UsageError('--reference: it is given with --effects, but only a diagnosis tells what '
                         'has changed: take one of them out')
    reference = None if options.reference is None else tuple(options.reference)
    if reference is not None:
        read_reference(base, reference)  # what is wrong with it ends the command

    def jobs() -> Iterator[SurveyJob]:
        for entry in entries(options.recordings, options.manifest):
            model, name = model_of(entry.model or options.model)
            yield SurveyJob(entry, model.values, name, options.effects, options.topic,
                            reference, model.source)

    total = sum(1 for _ in entries(options.recordings, options.manifest))
    if not total:
        raise UsageError(f'{options.manifest}: no recording is listed')
    store = Store(options.output)
    store.begin()
    done, failures = _run(options, screen, jobs(), total, store)
    for recording, error in failures[:MOST_SHOWN]:
        screen.print(f'[yellow]![/] {shown(recording)}: {shown(error)}')
    if len(failures) > MOST_SHOWN:
        screen.print(f'… and {len(failures) - MOST_SHOWN} more, in the store')
    earlier = total - done - len(failures)
    screen.print(f'{counted(total, "recording")}: {done} done, {earlier} done before, '
                 f'{len(failures)} without a result; store: {shown(options.output)}')
    if options.json:
        write_json(options.json, {
            'recordings': total, 'done': done, 'done_before': earlier,
            'errors': [{'recording': name, 'error': error} for name, error in failures]})
    if options.report:
        fleet = fleet_trends(store)
        for text in sentences(fleet):
            screen.print(shown(text))
        given = [word for option, value in (('--model', options.model), ('--topic', options.topic))
                 if value and value != DEFAULT_MODEL for word in (option, value)]
        page = fleet_page(fleet, given=given)
        screen.print(f'page: {shown(page.write(options.report))}')
    return 0


def _run(options: argparse.Namespace, screen: Any, jobs: Iterator[SurveyJob], total: int,
         store: Store) -> tuple[int, list[tuple[str, str]]]:
    done, failures = 0, []
    with (cluster(options.workers, options.scheduler) as client,
          counting_bar(screen, 'recordings', total) as advance):
        for result in run_survey(client, jobs, store):
            if result is not None and result.error is None:
                done += 1
            elif result is not None:
                failures.append((displayed(result.rows[0]['recording']), result.error or ''))
            advance()
    return done, failures


def _model(path: str) -> tuple[ForceModel, str]:
    model = load_model(path)
    return model, model.fingerprint
