# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The linters of ament on the package, with the project's line length and NumPy docstrings."""

from __future__ import annotations

from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

PACKAGE = str(Path(__file__).parents[1] / 'pprs_dynamics')
# Left to the judgement of people: docstrings of what is named for itself, and of properties, which
# say what they are and not what to do.
OF_TASTE = ['D102', 'D105', 'D401']


def test_flake8(capsys: pytest.CaptureFixture[str]) -> None:
    linter = pytest.importorskip('ament_flake8.main')
    assert linter.main(['--linelength', '100', PACKAGE]) == 0, capsys.readouterr().out


def test_pep257(capsys: pytest.CaptureFixture[str]) -> None:
    linter = pytest.importorskip('ament_pep257.main')
    found = linter.main(['--convention', 'numpy', '--add-ignore', *OF_TASTE, '--', PACKAGE])
    assert found == 0, capsys.readouterr().err

