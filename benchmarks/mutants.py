# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Do the tests see a mistake in the equations? Mutants of the modules that decide, by Cosmic Ray.

Of every module a fixed sample of mutants is tried, each in a copy of the sources, against that
module's focused tests alone. Numba is switched off: each mutant would compile anew.

    python -m benchmarks.mutants [MODULE ...] [--count 8] [--json output/mutants.json]
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.testing import run_tests
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome

from benchmarks.results import write_results

ROOT = Path(__file__).parents[1]
COPIED = ('pprs_dynamics', 'config', 'test', 'benchmarks', 'demo', 'docs')
SEED = 25  # of the sample
COUNT = 8  # mutants of a module
TIMEOUT = 240.0  # [s] for the tests of a mutant; one that hangs them is killed
# Substitutes that no hand would write and any test would see: they would only flatter the share.
CHEAP = ('LShift', 'RShift', 'BitAnd', 'BitOr', 'BitXor', '_Invert', 'USub_Not', 'RemoveDecorator')

SEARCH = ('inference/test_hypothesis_space.py', 'inference/test_invariants_of_diagnosis.py')
ENGINES = ('physics/test_dynamics.py', 'physics/test_physics_engines.py')
# Where a mistake would give wrong forces or verdicts, and the tests that are to see it.
TESTS = {
    'physics/three_pprs/closed_form.py': ('physics/test_kinematics.py', *ENGINES),
    'physics/effects/laws/joint_friction.py': ENGINES,
    'physics/effects/catalogue.py': ('physics/test_foreign_effects.py',),
    'physics/model/limits.py': ('physics/test_limits.py',),
    'physics/model/ledger.py': ('physics/test_ledger.py',),
    'inference/residuals/noise.py': ('inference/test_noise.py',),
    'inference/regression/joint_fit.py': ('inference/test_joint_fit.py',
                                          'inference/test_noise.py'),
    'inference/regression/normal_equations.py': ('inference/test_joint_fit.py',),
    'inference/search/search.py': SEARCH,
    'inference/search/fitted_sets.py': SEARCH,
    'inference/search/table.py': SEARCH,
    'inference/search/candidates.py': (*SEARCH, 'inference/test_prior_costs.py'),
    'inference/search/held_out.py': ('inference/test_gates.py', *SEARCH),
    'inference/search/form_error.py': SEARCH,
    'inference/diagnosis/answer.py': (*SEARCH, 'inference/test_courses.py'),
    'ros/force_command.py': ('ros/test_force_command.py',),
    'ros/messages/measured_states.py': ('ros/test_measured_states.py',),
    'ros/messages/trajectory_request.py': ('ros/test_trajectory_requests.py',
                                           'ros/test_trajectory_bytes.py'),
    'ros/node/controller_watch.py': ('ros/test_controller_watch.py',),
    'ros/node/senders.py': ('ros/test_senders.py',),
    'ros/setpoints.py': ('ros/test_simulated_robot_node.py',),
    'app/workbench/server/access.py': ('app/test_workbench_safety.py',),
}
# Search and answer decide all verdicts: more of them than COUNT, 40 mutants together.
MORE = {'inference/search/search.py': 8, 'inference/search/fitted_sets.py': 8,
        'inference/search/table.py': 8, 'inference/search/candidates.py': 4,
        'inference/search/held_out.py': 4, 'inference/diagnosis/answer.py': 8}


@dataclass(frozen=True)
class Mutant:
    """One change of a module, and what became of it.

    Parameters
    ----------
    module, operator, function : str
    line : int
    outcome : {'killed', 'survived', 'incompetent'}
    change : str
        The lines that differ.
    """

    module: str
    operator: str
    function: str
    line: int
    outcome: str
    change: str


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table of what was killed, and every mutant that survived."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('modules', nargs='*', metavar='MODULE', help='by default all')
    parser.add_argument('--count', type=int,
                        help=f'mutants of a module; by default {COUNT}, of search and answer more')
    parser.add_argument('--workers', type=int, default=1, help='modules at a time')
    parser.add_argument('--json', type=Path, help='file for every mutant')
    options = parser.parse_args(arguments)
    modules = [name for name in TESTS
               if not options.modules or any(part in name for part in options.modules)]
    found: list[Mutant] = []
    with ThreadPoolExecutor(options.workers) as pool:
        for mutants in pool.map(lambda name: list(_tried(
                name, options.count or MORE.get(name, COUNT))), modules):
            found += mutants
            print(_row(mutants), flush=True)
            if options.json:
                options.json.parent.mkdir(parents=True, exist_ok=True)
                options.json.write_text(json.dumps([asdict(one) for one in found], indent=1))
    page = report(found)
    print(page)
    if not options.modules:
        write_results('mutants', 'Mutants', 'make mutants', page)


def report(mutants: Sequence[Mutant]) -> str:
    """Return a table of modules, and each mutant that no test saw."""
    rows = ['| module | killed | of |', '|---|---|---|']
    for module in dict.fromkeys(one.module for one in mutants):
        outcomes = [one.outcome for one in mutants if one.module == module]
        rows.append(f'| `{module}` | {len(outcomes) - outcomes.count("survived")} '
                    f'| {len(outcomes)} |')
    survived = [one for one in mutants if one.outcome == 'survived']
    rows.append(f'| all | {len(mutants) - len(survived)} | {len(mutants)} |')
    return '\n'.join(rows) + ''.join(
        f'\n\n`{one.module}` line {one.line}, {one.function} ({one.operator}):\n\n'
        f'```diff\n{one.change}\n```' for one in survived)


def _row(mutants: Sequence[Mutant]) -> str:
    counts = Counter(one.outcome for one in mutants)
    return f'{mutants[0].module:48}{len(mutants) - counts["survived"]:4} of {len(mutants)}'


def _tried(module: str, count: int) -> Iterator[Mutant]:
    """Yield a sample of a module's mutants after their tests, in a copy of the sources."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED:
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns('__pycache__'))
        shutil.copy(ROOT / 'pyproject.toml', copy)
        path = copy / 'pprs_dynamics' / module
        tests = [str(copy / 'test' / name) for name in TESTS[module]]
        sources = ':'.join(str(copy / part) for part in (
            '', 'test', 'test/support', 'demo', 'benchmarks'))
        # From the copy's folder: `python -m` finds modules there before all others.
        command = (f'env -C {copy} PYTHONPATH={sources} OPENBLAS_NUM_THREADS=1 '
                   f'NUMBA_DISABLE_JIT=1 {sys.executable} '
                   '-m pytest -x -q -m "not slow" -p no:cacheprovider '
                   f'--rootdir {copy} '
                   f'{" ".join(tests)}')
        outcome, output = run_tests(command, TIMEOUT)
        if outcome is not TestOutcome.SURVIVED:
            raise RuntimeError(f'{module}: its tests fail without any mutant: {output[-2000:]}')
        for mutation in _sample(path, module, count):
            result = mutate_and_test([mutation], command, TIMEOUT)
            if result.worker_outcome is not WorkerOutcome.NORMAL:
                raise RuntimeError(result.output)
            change = '\n'.join(line for line in (result.diff or '').splitlines()
                               if line[:1] in '+-' and line[:3] not in ('+++', '---'))
            what = result.test_outcome or TestOutcome.INCOMPETENT
            print(f'{module} line {mutation.start_pos[0]}: {what.value}', flush=True)
            yield Mutant(module, mutation.operator_name.removeprefix('core/'),
                         mutation.definition_name or '', mutation.start_pos[0], what.value, change)


def _sample(path: Path, module: str, count: int) -> list[MutationSpec]:
    """Return mutations, one place at most once, none in what is not evaluated."""
    with use_db(':memory:', WorkDB.Mode.create) as database:
        init([path], database, {})
        every = [item.mutations[0] for item in database.work_items]
    annotations = set(_annotations(ast.parse(path.read_text())))
    by_place: dict[tuple[int, int], list[MutationSpec]] = {}
    for mutation in every:
        if mutation.start_pos not in annotations and not any(
                part in mutation.operator_name for part in CHEAP):
            by_place.setdefault(mutation.start_pos, []).append(mutation)
    # An operator between two numbers has a dozen substitutes, a condition one: places first.
    chance = random.Random(f'{SEED} {module}')
    places = chance.sample(sorted(by_place), min(count, len(by_place)))
    return [chance.choice(by_place[place]) for place in places]


def _annotations(tree: ast.AST) -> Iterator[tuple[int, int]]:
    """Yield every place within annotations, which are never evaluated."""
    for node in ast.walk(tree):
        for part in (getattr(node, 'annotation', None), getattr(node, 'returns', None)):
            if isinstance(part, ast.expr):
                lines = range(part.lineno, (part.end_lineno or part.lineno) + 1)
                yield from ((line, column) for line in lines for column in range(200)
                            if (part.lineno, part.col_offset) <= (line, column)
                            < (part.end_lineno or 0, part.end_col_offset or 0))


if __name__ == '__main__':
    main()
