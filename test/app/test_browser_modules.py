# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The pages' JavaScript modules by themselves, in Node's own test runner."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULE_FOLDER = ROOT / 'pprs_dynamics' / 'app' / 'browser'
NODE = shutil.which('node')
needs_node = pytest.mark.skipif(NODE is None, reason='no node on PATH to run JavaScript with')


def node(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([NODE or 'node', *map(str, arguments)], capture_output=True, text=True,
                          timeout=120)


@needs_node
@pytest.mark.parametrize('name', ['curve_files', 'format', 'client', 'views'])
def test_modules_do_what_they_say(name: str) -> None:
    done = node('--test', ROOT / 'test' / 'browser' / f'{name}.test.mjs')
    assert done.returncode == 0, done.stdout
    assert 'fail 0\n' in done.stdout
    assert 'pass 0\n' not in done.stdout


@needs_node
@pytest.mark.parametrize('file', sorted(one.name for one in MODULE_FOLDER.glob('*js')))
def test_each_script_is_one(file: str) -> None:
    assert node('--check', MODULE_FOLDER / file).returncode == 0
