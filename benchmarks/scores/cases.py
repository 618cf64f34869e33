# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Cases of a benchmark on all cores or a Dask cluster, their outcomes in a file of lines.

Outcomes are appended as they come, and cases that are in the file are not run again: a run can be
stopped and continued. Workers of a cluster need the project's folder on their PYTHONPATH.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks import OUTPUT
from pprs_dynamics.app.commands.survey import cluster, run_each

Outcome = dict[str, Any]
# Takes work and items; yields item, result and what went wrong, as they come.
Each = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[tuple[Any, Any, str | None]]]


def scoring_parser(description: str, file: str) -> argparse.ArgumentParser:
    """Return the parser of a score: where work is done, and the file of outcomes in output/."""
    parser = argparse.ArgumentParser(description=description,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--file', type=Path, default=OUTPUT / file,
                        help=f'outcomes, one a line (default: output/{file})')
    add_options(parser)
    return parser


def outcomes_of(options: argparse.Namespace, work: Callable[[Any], Outcome],
                cases: Mapping[Any, Any], name: Callable[[Outcome], Any],
                shown: Callable[[Outcome], str]) -> list[Outcome]:
    """Run the cases that `options.file` does not have, see `run_missing`; return all in it."""
    with engine(options) as each:
        run_missing(each, work, cases, options.file, name, shown)
    return read_outcomes(options.file)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare where work is done, as `pprs survey` does."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--workers', metavar='N', type=int,
                       help='processes on this machine (default: one for every core)')
    where.add_argument('--scheduler', metavar='tcp://HOST:PORT', help='use a running Dask cluster')


@contextmanager
def engine(options: argparse.Namespace) -> Iterator[Each]:
    """Give what runs work on items while the block lasts."""
    with cluster(options.workers, options.scheduler) as client:
        yield lambda work, items: run_each(client, work, items)


def here(work: Callable[[Any], Any], items: Iterable[Any],
         ) -> Iterator[tuple[Any, Any, str | None]]:
    """Run work in this process, one item after another."""
    for item in items:
        yield item, work(item), None


def run_missing(each: Each, work: Callable[[Any], Outcome], cases: Mapping[Any, Any], file: Path,
                name: Callable[[Outcome], Any], shown: Callable[[Outcome], str]) -> None:
    """Run the cases that a file of outcomes does not have; append and print theirs.

    Parameters
    ----------
    each : callable
        Of `engine`.
    work : callable
        From a case to its outcome.
    cases : mapping
        By what `name` says of their outcomes.
    file : Path
    name, shown : callable
        From an outcome to its case, and to one line for people.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    if file.exists() and not file.read_text().endswith('\n'):
        with file.open('a') as stream:
            stream.write('\n')  # after a line that was cut short
    done = {name(outcome) for outcome in read_outcomes(file)}
    for case, outcome, error in each(work, (c for key, c in cases.items() if key not in done)):
        if error is not None:
            # Its worker was killed, or the like: it is tried again the next time.
            print(f'LOST {case}: {error}', flush=True)
            continue
        with file.open('a') as stream:
            stream.write(json.dumps(outcome) + '\n')
        print(shown(outcome), flush=True)


def read_outcomes(file: Path) -> list[Outcome]:
    """Return the outcomes in a file; of a line that was cut short, none."""
    found = []
    for line in file.read_text().splitlines() if file.exists() else ():
        try:
            found.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return found
