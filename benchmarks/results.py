# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Result pages below `benchmarks/results`, each with the revision and the command that made it."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / 'benchmarks' / 'results'


def revision() -> str:
    """Return the commit of the project, marked if files of the package were changed after it."""
    def git(*arguments: str) -> str:
        return subprocess.run(['git', *arguments], cwd=ROOT, capture_output=True, text=True,
                              check=False).stdout.strip()

    commit = git('rev-parse', '--short=8', 'HEAD') or 'unknown'
    return commit + (' with changes' if git('status', '--porcelain', 'pprs_dynamics') else '')


def write_results(page: str | Path, title: str, command: str, body: str) -> Path:
    """Write one page of results, by name or path, and return its path."""
    path = page if isinstance(page, Path) else RESULTS / f'{page}.md'
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'# {title}\n\nMade by `{command}` at revision {revision()}.\n\n'
                    f'{body.strip()}\n', encoding='utf-8')
    return path
