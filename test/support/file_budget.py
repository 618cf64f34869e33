# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`--file-budget SECONDS`: report the dearest test files by processor time; too dear ones fail."""

from __future__ import annotations

import resource
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

SHOWN = 15  # files
TOLERANCE = 4.0  # of the budget: on busy or slower machines tests take more processor time
KEY = 'processor_seconds'


def processor_seconds() -> float:
    """Return the processor time of this process and of its ended children [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def add_option(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption('--file-budget', type=float, metavar='SECONDS',
                     help='processor time that a test file should take at most')


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Iterator[None]:
    """Note the processor time of a test with its fixtures, which workers report to the main."""
    now = processor_seconds()
    if call.when == 'teardown':
        item.user_properties.append((KEY, now - item.stash.get(BEGAN, now)))
    elif call.when == 'setup':
        item.stash[BEGAN] = SINCE.get('now', now)
    SINCE['now'] = now
    yield


BEGAN = pytest.StashKey[float]()
SINCE: dict[str, float] = {}


def by_file(config: pytest.Config) -> Counter[str]:
    """Return the processor time of each test file [s]."""
    reporter: Any = config.pluginmanager.get_plugin('terminalreporter')
    spent: Counter[str] = Counter()
    for reports in reporter.stats.values() if reporter else ():
        for report in reports:
            if getattr(report, 'when', '') == 'teardown':
                spent[report.nodeid.partition('::')[0]] += dict(report.user_properties).get(KEY, 0)
    return spent


def over_budget(config: pytest.Config) -> list[str]:
    """Return the files that take more than the budget and its tolerance."""
    budget = config.getoption('--file-budget', default=None)
    return [] if budget is None else [file for file, spent in by_file(config).items()
                                      if spent > TOLERANCE * budget]


def report(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the dearest files."""
    budget = config.getoption('--file-budget', default=None)
    if budget is None:
        return
    dear = by_file(config)
    terminalreporter.section(f'processor time by file, budget {budget:g} s')
    for file, spent in dear.most_common(SHOWN):
        terminalreporter.line(f'{spent:7.1f} s  {file}' + ('  OVER' if spent > budget else ''))
    terminalreporter.line(f'{sum(dear.values()):7.1f} s  in {len(dear)} files')
