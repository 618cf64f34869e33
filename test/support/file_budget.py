# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`--file-budget SECONDS`: report the dearest test files; one far over the budget fails the run.

Time is processor time over what a fixed piece of work takes meanwhile. A slower or busier machine
prolongs both, but not quite alike: caches, disks and browsers count otherwise. So a file over the
budget is marked, and only one over `NOISE` times the budget fails.
"""

from __future__ import annotations

import resource
import time
from collections import Counter
from collections.abc import Iterator
from statistics import median
from typing import Any

import pytest

SHOWN = 15  # files
IDLE = 0.0245  # [s] of `fixed_work` on an idle core of the machine that the budget is meant for
# Of a measurement. The same file took 1.4 times as long on one machine as on another, and 1.44
# times as long in the first run after a start of the machine as in the second.
NOISE = 1.5
SECONDS, PACE = 'processor_seconds', 'pace'
BEGAN = pytest.StashKey[float]()
SINCE: dict[str, Any] = {}


def fixed_work() -> float:
    """Return the processor time of a piece of work in Python and LAPACK [s]."""
    import numpy as np  # once conftest has set its threads

    matrix = np.add.outer(np.arange(150.0), np.arange(150.0)) + 150 * np.eye(150)
    began, total = time.thread_time(), 0.0
    for _ in range(5):
        for k in range(100_000):
            total += 0.5 * k
        total += np.linalg.eigvalsh(matrix)[0]
    return time.thread_time() - began


def processor_seconds() -> float:
    """Return the processor time of this process and of its ended children [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def add_option(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption('--file-budget', type=float, metavar='SECONDS',
                     help='processor time that a test file may take on an idle machine')


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Iterator[None]:
    """Note the processor time of a test with its fixtures, which workers report to the main."""
    now = processor_seconds()
    if call.when == 'teardown':
        item.user_properties.append((SECONDS, now - item.stash.get(BEGAN, now)))
        if SINCE.get('file') != item.path and item.config.getoption('--file-budget'):
            SINCE['file'] = item.path
            item.user_properties.append((PACE, fixed_work() / IDLE))
            now = processor_seconds()
    elif call.when == 'setup':
        item.stash[BEGAN] = SINCE.get('now', now)
    SINCE['now'] = now
    yield


def by_file(config: pytest.Config) -> Counter[str]:
    """Return the processor time of each test file on an idle machine [s]."""
    reporter: Any = config.pluginmanager.get_plugin('terminalreporter')
    spent: Counter[str] = Counter()
    paces: list[float] = []
    for reports in reporter.stats.values() if reporter else ():
        for report in reports:
            if getattr(report, 'when', '') == 'teardown':
                noted = dict(report.user_properties)
                spent[report.nodeid.partition('::')[0]] += noted.get(SECONDS, 0.0)
                paces += [noted[PACE]] if PACE in noted else []
    pace = median(paces or [1.0])
    return Counter({file: seconds / pace for file, seconds in spent.items()})


def over_budget(config: pytest.Config) -> list[str]:
    """Return the files that take more than the budget on any machine."""
    budget = config.getoption('--file-budget', default=None)
    return [] if budget is None else [file for file, spent in by_file(config).items()
                                      if spent > NOISE * budget]


def report(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the dearest files."""
    budget = config.getoption('--file-budget', default=None)
    if budget is None:
        return
    dear, over = by_file(config), over_budget(config)
    terminalreporter.section(f'processor time by file on an idle machine, budget {budget:g} s')
    for file, spent in dear.most_common(SHOWN):
        mark = '  OVER, fails' if file in over else '  over' if spent > budget else ''
        terminalreporter.line(f'{spent:7.1f} s  {file}{mark}')
    terminalreporter.line(f'{sum(dear.values()):7.1f} s  in {len(dear)} files')
