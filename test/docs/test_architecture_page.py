# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""docs/architecture.md says what test_architecture.py enforces, and its journeys can be walked."""

from __future__ import annotations

import re

import pytest
from documents import PROJECT
from layers import FOLDERS, MAY_USE, PACKAGE, imported_files

TEXT = (PROJECT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
JOURNEYS = re.findall(r'^### (.+?)\n\n(.+?)(?=\n###|\Z)', TEXT, re.M | re.S)


def table(second: str) -> dict[str, list[str]]:
    """Return the rows of the table with that second heading, names in their order."""
    rows = TEXT.split(f'| layer | {second} |\n')[1].splitlines()[1:]
    found = {}
    for row in rows:
        if not row.startswith('|'):
            break
        _, layer, names, _ = row.split('|')
        found[layer.strip(' `')] = re.findall(r'`(\w+)`', names)
    return found


def test_the_rule_that_is_stated_is_the_rule_that_is_tested() -> None:
    assert {layer: set(used) for layer, used in table('may use').items()} == MAY_USE
    assert table('folders') == FOLDERS


def test_every_layer_has_its_paragraph_and_no_other_has() -> None:
    told = re.findall(r'^\*\*`pprs_dynamics/(\w+)`\*\*', TEXT, re.M)
    there = {file.parent.name for file in PACKAGE.glob('*/__init__.py')}
    assert sorted(told) == sorted(there) == sorted(MAY_USE)


@pytest.mark.parametrize(('title', 'steps'), JOURNEYS, ids=[title for title, _ in JOURNEYS])
def test_each_file_of_a_journey_is_imported_by_one_before_it(title: str, steps: str) -> None:
    files = [PROJECT / name for name in re.findall(r'^\d+\. `([^`]+)`', steps, re.M)]
    assert len(files) >= 8
    assert [str(file) for file in files if not file.is_file()] == []
    python = [file for file in files if file.suffix == '.py']
    reached = set().union(*(imported_files(file) for file in python[:1])) | {python[0]}
    for file in python[1:]:
        assert file in reached, f'{file.name} is imported by no file above it'
        reached |= imported_files(file)


def test_three_journeys_are_told() -> None:
    assert [title for title, _ in JOURNEYS] == [
        'From a message to forces', 'From a bag to a verdict', 'From a tick to a curve']
