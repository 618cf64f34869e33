# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The site of the documentation builds without a warning, with a page and a plot of each effect."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from documents import PROJECT

from pprs_dynamics.physics.effects.catalogue import CATALOGUE

pytestmark = pytest.mark.slow

DOCS = PROJECT / 'docs'


# Short words of the laws that are no symbols of theirs: numbers, derivatives, transposed, English.
@pytest.fixture(scope='module')
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of generated pages, once Sphinx has read every page and docstring."""
    pytest.importorskip('sphinx')
    target = tmp_path_factory.mktemp('site')
    # `dummy` reads and checks everything and writes no page, which would take as long again.
    built = subprocess.run(
        [sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', '-b', 'dummy',
         '-d', str(target / 'doctrees'), str(DOCS), str(target / 'out')],
        capture_output=True, text=True, timeout=900)
    assert built.returncode == 0, built.stderr
    assert built.stderr == ''
    return DOCS / 'generated'


def test_every_effect_has_a_page_with_its_card_and_a_plot(generated: Path) -> None:
    for name, effect in CATALOGUE.items():
        text = (generated / 'effects' / f'{name}.md').read_text(encoding='utf-8')
        assert f'({name}.svg)' in text
        assert effect.card.equation in text
        assert all(f'| `{parameter.name}` |' in text for parameter in effect.parameters)
        assert '<path' in (generated / 'effects' / f'{name}.svg').read_text(encoding='utf-8')


def test_the_api_has_a_page_for_each_folder(generated: Path) -> None:
    folders = {file.parent for file in (PROJECT / 'pprs_dynamics').rglob('*.py')
               if file.stem != '__init__' and file.parent != PROJECT / 'pprs_dynamics'}
    names = {'.'.join(folder.relative_to(PROJECT / 'pprs_dynamics').parts) for folder in folders}
    assert {file.stem for file in (generated / 'api').glob('[a-z]*.md')} == names
