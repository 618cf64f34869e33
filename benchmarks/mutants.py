# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether the tests notice mistakes in the modules that decide: those of `mutants.yaml`.

Each mistake is made in a copy of the sources, where the tests of its module then run.

    python -m benchmarks.mutants [PART OF A MODULE'S PATH ...]
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.results import write_results

ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix('.yaml')
COPIED = ('pprs_dynamics', 'config', 'test', 'benchmarks', 'demo', 'docs')
TIMEOUT = 600.0  # [s] for the tests of a module; tests that hang notice the mistake, too
FAILED = 1  # exit status of pytest; another one is a fault of the list


@dataclass(frozen=True)
class Outcome:
    """A mistake, and the test that noticed it first.

    Parameters
    ----------
    module, mistake : str
    noticed_by : str
        Empty: no test did.
    """

    module: str
    mistake: str
    noticed_by: str


def listed() -> dict[str, dict[str, Any]]:
    """Return the tests and mutants of each module, by its path in the package."""
    found: dict[str, dict[str, Any]] = yaml.safe_load(LIST.read_text(encoding='utf-8'))
    return found


def stale() -> list[str]:
    """Return the mistakes whose text is not in its module exactly once."""
    return [f'{module}: {mutant["mistake"]}' for module, entry in listed().items()
            for mutant in entry['mutants']
            if (ROOT / 'pprs_dynamics' / module).read_text().count(mutant['text']) != 1]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print which tests notice which mistakes; write the page if no module is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('modules', nargs='*', metavar='MODULE', help='by default all')
    options = parser.parse_args(arguments)
    if old := stale():
        raise SystemExit(f'{LIST.name}: the code has changed, so change the mutants: {old}')
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED:
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns('__pycache__'))
        for name in ('pyproject.toml', 'package.xml', 'setup.py', 'README.md', 'LICENSE'):
            shutil.copy(ROOT / name, copy)
        for module, entry in listed().items():
            if not options.modules or any(part in module for part in options.modules):
                for outcome in tried(copy, module, entry):
                    print(f'{module}: {outcome.mistake}: {outcome.noticed_by or "SURVIVED"}',
                          flush=True)
                    outcomes.append(outcome)
    print(report(outcomes))
    if not options.modules:
        write_results('mutants', 'Mutants', 'make mutants', report(outcomes))


def tried(copy: Path, module: str, entry: Mapping[str, Any]) -> Iterator[Outcome]:
    """Yield the outcome of each mutant of a module, in a copy of the sources."""
    path = copy / 'pprs_dynamics' / module
    source = path.read_text(encoding='utf-8')
    for mutant in entry['mutants']:
        path.write_text(source.replace(mutant['text'], mutant['becomes']), encoding='utf-8')
        yield Outcome(module, mutant['mistake'], noticed_by(copy, entry['tests']))
    path.write_text(source, encoding='utf-8')


def noticed_by(copy: Path, tests: Sequence[str]) -> str:
    """Return the first of the tests that fails; '' where all pass."""
    command = [sys.executable, '-m', 'pytest', '-x', '-q', '-m', 'not slow', '-p',
               'no:cacheprovider', *(f'test/{test}' for test in tests)]
    try:
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False,
                              timeout=TIMEOUT, env={**os.environ, 'PYTHONPATH': str(copy),
                                                    'OPENBLAS_NUM_THREADS': '1'})
    except subprocess.TimeoutExpired:
        return 'a test that does not end'
    if done.returncode == 0:
        return ''
    first = next((line.split()[1] for line in done.stdout.splitlines()
                  if line.startswith(('FAILED ', 'ERROR '))), '')
    if done.returncode != FAILED or not first:
        raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
    return first.removeprefix('test/').partition('[')[0]


def report(outcomes: Sequence[Outcome]) -> str:
    """Return tables of the modules, and of the mistakes."""
    rows = ['| module | noticed | of |', '|---|---|---|']
    for module in dict.fromkeys(outcome.module for outcome in outcomes):
        of = [bool(outcome.noticed_by) for outcome in outcomes if outcome.module == module]
        rows.append(f'| `{module}` | {sum(of)} | {len(of)} |')
    rows.append(f'| all | {sum(bool(o.noticed_by) for o in outcomes)} | {len(outcomes)} |')
    rows += ['', '| module | mistake | noticed by |', '|---|---|---|']
    rows += [f'| `{Path(outcome.module).stem}` | {outcome.mistake} | '
             + (f'`{outcome.noticed_by}` |' if outcome.noticed_by else '**no test** |')
             for outcome in outcomes]
    return '\n'.join(rows)


if __name__ == '__main__':
    main()
