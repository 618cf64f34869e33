# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`--listed-skips`: a test that is skipped without an entry of test/skips.toml fails the run.

The hooks of pytest for this option and for `--file-budget`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import file_budget
import pytest

LIST = Path(__file__).parents[1] / 'skips.toml'
HEADING = 'skipped, and not in test/skips.toml'


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    file_budget.add_option(parser)
    parser.addoption('--listed-skips', action='store_true',
                     help='fail where a test is skipped without an entry of test/skips.toml')


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run that passed but for such skips; workers leave it to who started them."""
    if unlisted(_skips(session.config)) or file_budget.over_budget(session.config):
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print which they are, and the dearest files."""
    file_budget.report(terminalreporter, config)
    if left := unlisted(_skips(config)):
        terminalreporter.section(HEADING, red=True)
        for place, reason in left:
            terminalreporter.line(f'{place}: {reason}')


def unlisted(skips: Iterable[tuple[str, str]], file: Path = LIST) -> list[tuple[str, str]]:
    """Return the skips, each a test's id and its reason, that no entry allows."""
    allowed = tomllib.loads(file.read_text(encoding='utf-8'))['allowed']
    return sorted({(place, reason) for place, reason in skips if not any(
        place.startswith(entry['where']) and entry['skip'] in reason for entry in allowed)})


def _skips(config: pytest.Config) -> list[tuple[str, str]]:
    """Return the skips that were asked about."""
    if not config.getoption('--listed-skips', default=False):
        return []
    reporter = config.pluginmanager.get_plugin('terminalreporter')
    reports = reporter.stats.get('skipped', []) if reporter else []  # a worker reports elsewhere
    return [(report.nodeid, str(report.longrepr[2] if isinstance(report.longrepr, tuple)
                                else report.longrepr)) for report in reports]
