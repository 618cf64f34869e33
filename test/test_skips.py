# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A test that is skipped in silence fails a run that asks for it; one on the list does not."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from listed_skips import HEADING, LIST, unlisted

SUPPORT = Path(__file__).with_name('support')
LISTED = 'control_msgs comes with a ROS 2 installation only'
TESTS = '''
import pytest

def test_that_runs():
    pass

@pytest.mark.skip(reason='{reason}')
def test_that_does_not():
    pass
'''


def run(folder: Path, name: str, reason: str, *options: str) -> tuple[int, str]:
    """Run such tests as a session of their own; return its status and what it says."""
    file = folder / 'test' / 'ros' / name
    file.parent.mkdir(parents=True)
    file.write_text(TESTS.format(reason=reason))
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'listed_skips', '-c', '/dev/null',
         '--rootdir', str(folder), *options, str(file)], cwd=folder, capture_output=True,
        text=True, env={'PYTHONPATH': str(SUPPORT), 'PATH': ''})
    return done.returncode, done.stdout


@pytest.mark.parametrize('workers', [[], ['-n', '1']], ids=['alone', 'in a worker'])
def test_a_skip_that_is_not_listed_fails_the_run_and_is_named(
    tmp_path: Path, workers: list[str],
) -> None:
    status, said = run(tmp_path, 'test_new.py', 'in a hurry', '--listed-skips', *workers)
    assert status == pytest.ExitCode.TESTS_FAILED
    assert HEADING in said
    assert 'test/ros/test_new.py::test_that_does_not: Skipped: in a hurry' in said


def test_a_listed_skip_is_none_and_neither_is_one_that_nobody_asks_about(tmp_path: Path) -> None:
    assert run(tmp_path / 'a', 'test_controllers.py', LISTED, '--listed-skips')[0] == 0
    assert run(tmp_path / 'b', 'test_new.py', 'in a hurry')[0] == 0


def test_an_entry_allows_its_reason_in_its_place_alone() -> None:
    here, elsewhere = 'test/ros/test_controllers.py::a', 'test/ros/test_executor.py::b'
    assert unlisted([(here, f'Skipped: {LISTED}')]) == []
    assert unlisted([(elsewhere, LISTED), (here, 'no time')]) == [
        (here, 'no time'), (elsewhere, LISTED)]


def test_every_entry_is_of_tests_that_are_there_and_says_why() -> None:
    for each in tomllib.loads(LIST.read_text())['allowed']:
        assert (LIST.parents[1] / each['where']).exists()
        assert len(each['because']) > 20
