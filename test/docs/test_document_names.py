# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""README and docs name no file, option, command, topic, parameter or module that is not there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from functools import cache
from importlib import import_module
from io import StringIO
from pathlib import Path

import pytest
from documents import FENCE, PROJECT, anchors, code, links, pages, text_of

from pprs_dynamics.app.commands.pprs import COMMANDS, main
from pprs_dynamics.inference.search.decisions import OUTSIDE_COST
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.model.keys import NAMES
from pprs_dynamics.physics.model.parameter_values import is_known
from pprs_dynamics.ros.messages.status_codes import CODES
from pprs_dynamics.simulation.injection import NAMES as INJECTED

# Options of other programs that pages show.
FOREIGN = {'--ros-args', '--params-file', '--packages-select', '--symlink-install', '--upgrade',
           '--once', '--help', '--version', '--strict', '--nworkers'}
FILE = re.compile(r'(?<![\w/.-])((?:[\w.-]+/)+[\w.-]+\.(?:py|md|yaml|toml|ipynb|rst|js|css|svg))\b')
MODULE = re.compile(r'(?<![\w/.])pprs_dynamics(?:\.\w+)+')


@cache
def options(command: str) -> frozenset[str]:
    """Return the options of a command of `pprs`."""
    with redirect_stdout(StringIO()) as shown, suppress(SystemExit):
        main([command, '--help'])
    return frozenset(re.findall(r'--[a-z][a-z-]+', shown.getvalue()))


@cache
def script_options() -> frozenset[str]:
    """Return the options of the project's own scripts, which stand in them as strings."""
    return frozenset(found for folder in ('benchmarks', 'docs', 'demo')
                     for file in (PROJECT / folder).rglob('*.py')
                     for found in re.findall(r"'(--[a-z-]+)'", file.read_text(encoding='utf-8')))


@cache
def ros_sources() -> str:
    return '\n'.join(file.read_text(encoding='utf-8')
                     for file in sorted((PROJECT / 'pprs_dynamics' / 'ros').rglob('*.py')))


@cache
def executables() -> frozenset[str]:
    return frozenset(re.findall(r"'(\w+) = pprs_dynamics", (PROJECT / 'setup.py').read_text()))


def wrong_commands(line: str) -> Iterator[str]:
    """Yield what a line of code calls that is no command, option, target or node."""
    for match in re.finditer(r'(?<![\w/.-])pprs ([a-z][a-z-]*)((?:(?!&&|\|| pprs ).)*)', line):
        command, rest = match[1], match[2].split(' #')[0]
        if command not in COMMANDS:
            yield f'pprs {command}'
            continue
        yield from (f'pprs {command} {found}' for found in re.findall(r'(?<!\S)(--[a-z-]+)', rest)
                    if found not in options(command) | {'--help', '--demo'})
    for found in re.findall(r'^make ([a-z-]+)', line):
        if not re.search(rf'^{found}:', (PROJECT / 'Makefile').read_text(), re.M):
            yield f'make {found}'
    for found in re.findall(r'python -m (benchmarks[\w.]*)', line):
        if not (PROJECT / f'{found.replace(".", "/")}.py').is_file():
            yield f'python -m {found}'
    for found in re.findall(r'ros2 run pprs_dynamics (\w+)', line):
        if found not in executables():
            yield f'ros2 run pprs_dynamics {found}'


def wrong_options(line: str) -> Iterator[str]:
    """Yield options that are shown alone, or with a script, and are of nothing."""
    if re.match(r'(?:\w+=\S+ )*(colcon|pip|cd|ros2) ', line):
        return
    known = FOREIGN | {'--demo'} | script_options() | {
        found for name in COMMANDS for found in options(name)}
    yield from (found for found in re.findall(r'(?<![\w-])(--[a-z][a-z-]+)', line)
                if found not in known)


def wrong_files(line: str) -> Iterator[str]:
    """Yield paths of sources and pages that do not exist, from the project, docs or package."""
    for found in FILE.findall(line):
        # `install/…`, `output/…` and `~/…` are made when the project is used.
        if found.split('/')[0] in ('install', 'output', 'share', 'build') or f'~/{found}' in line:
            continue
        if not any((root / found).exists() for root in (
                PROJECT, PROJECT / 'docs', PROJECT / 'docs' / 'example_effect')):
            yield found


def wrong_names(line: str) -> Iterator[str]:
    """Yield modules, topics, parameters, keys and effects that do not exist."""
    for found in MODULE.findall(line):
        if not resolves(found) and found != 'pprs_dynamics.effects':
            yield found
    for topic in re.findall(r'(?<![\w.])~/([a-z_]+)', line):
        if f"~/{topic}" not in ros_sources() and topic not in ('ws',):
            yield f'~/{topic}'
    for node, topic in re.findall(r'(?<![\w~.])/?(feedforward|monitor|simulated_robot)/([a-z_]+)\b',
                                  line):
        if f'~/{topic}' not in ros_sources() and f"'{topic}'" not in ros_sources():
            yield f'/{node}/{topic}'
    for parameter in re.findall(r'-p (\w+):=', line):
        if f"'{parameter}'" not in ros_sources() and not is_known(parameter):
            yield parameter
    for found in re.findall(r'(?<![\w/])(?:geometry|masses|friction|limits)\.\w+(?:\.\w+)*', line):
        # A sentence about an unknown key shows one.
        if 'unknown key' in line:
            break
        if found not in NAMES and not any(name.startswith(f'{found}.') for name in NAMES):
            yield found
    for found in re.findall(r'--effect ([a-z_]+)', line):
        if found not in (*INJECTED, *CATALOGUE):
            yield found


def resolves(dotted: str) -> bool:
    """Return whether a dotted name is a module of the package, or something in one."""
    parts = dotted.split('.')
    for length in range(len(parts), 0, -1):
        try:
            thing: object = import_module('.'.join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for name in parts[length:]:
            if not hasattr(thing, name):
                return False
            thing = getattr(thing, name)
        return True
    return False


def wrong_imports(text: str) -> Iterator[str]:
    """Yield what blocks of Python import from the package that is not in it."""
    for match in FENCE.finditer(text):
        if not match[0].startswith('```python'):
            continue
        for node in ast.walk(ast.parse(match[2])):
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('pprs_dynamics'):
                yield from (f'{node.module}.{alias.name}' for alias in node.names
                            if not resolves(f'{node.module}.{alias.name}'))


def wrong(text: str) -> list[str]:
    """Return everything that a text names and that does not exist."""
    found = [fault for line in code(text) for check in (
        wrong_commands, wrong_options, wrong_files, wrong_names) for fault in check(line)]
    return [*found, *wrong_imports(text)]


@pytest.mark.parametrize('page', pages(), ids=lambda page: str(page.relative_to(PROJECT)))
def test_a_page_names_only_what_exists(page: Path) -> None:
    assert wrong(text_of(page)) == []


@pytest.mark.parametrize(('shown', 'named'), [
    ('`pprs diagnos run.mcap`', 'pprs diagnos'),
    ('`pprs compare run.mcap --seed 3`', 'pprs compare --seed'),
    ('```sh\npprs simulate \\\n  --outputs x.mcap\n```', 'pprs simulate --outputs'),
    ('`ros2 run pprs_dynamics feedback`', 'ros2 run pprs_dynamics feedback'),
    ('`pprs_dynamics/physics/no_such.py`', 'pprs_dynamics/physics/no_such.py'),
    ('`pprs_dynamics.physics.nothing`', 'pprs_dynamics.physics.nothing'),
    ('`ros2 topic echo /monitor/errors`', '/monitor/errors'),
    ('```python\nfrom pprs_dynamics import Nothing\n```', 'pprs_dynamics.Nothing')])
def test_what_does_not_exist_is_found(shown: str, named: str) -> None:
    assert named in wrong(shown)
    assert len(executables()) >= 5


def test_the_table_of_effects_is_the_catalogue() -> None:
    rows = re.findall(r'^\| `(\w+)` \| `(.+)` \|$',
                      (PROJECT / 'docs' / 'effects.md').read_text(encoding='utf-8'), re.M)
    assert len(rows) == len(CATALOGUE)
    assert dict(rows) == {name: effect.card.equation.replace('|', r'\|')
                          for name, effect in CATALOGUE.items()}


def test_every_command_has_its_row() -> None:
    text = (PROJECT / 'docs' / 'commands.md').read_text(encoding='utf-8')
    table = '\n'.join(line for line in text.splitlines() if line.startswith('| `pprs '))
    assert set(re.findall(r'`pprs ([a-z-]+)`', table)) == set(COMMANDS)


def test_codes_of_the_status_are_on_the_page() -> None:
    page = (PROJECT / 'docs/nodes.md').read_text(encoding='utf-8')
    assert [code for code in CODES if not re.search(rf'^\|[^|]*`{code}`', page, re.M)] == []


def test_schemas_are_those_of_the_dataclasses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(PROJECT / 'docs')
    found = import_module('json_schemas').texts()
    assert {file: file.read_text(encoding='utf-8') for file in found} == found


def test_tests_that_protect_against_a_risk_are_there() -> None:
    text = (PROJECT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    named = re.findall(r'`(test/[\w/]*test_\w+\.py)(?:::(\w+))?`', text)
    assert len(named) > 50
    for file, name in named:
        assert f'def {name or "test_"}' in (PROJECT / file).read_text(encoding='utf-8'), name


@pytest.mark.parametrize('script', ['command_table', 'json_schemas', 'outside_cost', 'real_drive'])
def test_what_a_script_writes_in_a_page_is_up_to_date(
    script: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(PROJECT / 'docs')
    made = import_module(script)
    assert f'\n\n{made.table()}\n\n' in made.PAGE.read_text(encoding='utf-8')


def test_there_are_at_most_twelve_rules_outside_the_cost() -> None:
    import_module('pprs_dynamics.inference.adoption.adopt')  # lists all rules
    assert 0 < len(OUTSIDE_COST) <= 12


# Links of README and docs lead somewhere: to files that exist and headings that stand there.

def broken(page: Path, text: str) -> list[str]:
    """Return the links of a page's text that lead nowhere."""
    wrong = []
    for target in links(text):
        path, _, anchor = target.partition('#')
        file = (page.parent / path).resolve() if path else page
        known = anchors(text if file == page else text_of(file)) if (
            anchor and file.is_file()) else set()
        if not file.exists() or PROJECT not in file.parents or (anchor and anchor not in known):
            wrong.append(target)
    return wrong


@pytest.mark.parametrize('page', pages(), ids=lambda page: str(page.relative_to(PROJECT)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert broken(page, text_of(page)) == []


@pytest.mark.parametrize('link', ['nowhere.md', 'docs/nodes.md#no-such-heading', '#no-heading',
                                  '../outside.md', 'docs/images/no.png'])
def test_a_link_that_leads_nowhere_is_found(link: str) -> None:
    text = f'# Heading\n[good](docs/nodes.md) [good](#heading) ![bad]({link}) `[code](x.md)`'
    assert broken(PROJECT / 'README.md', text) == [link]
