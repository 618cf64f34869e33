# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The house rules: who may import whom, and every equation of the paper in one place."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from layers import FOLDERS, MAY_USE, PACKAGE, circles, files, imported_files, imports

import pprs_dynamics
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.effect import CatalogueEffect

ROS = {'rclpy', 'std_msgs', 'sensor_msgs', 'trajectory_msgs', 'geometry_msgs', 'rcl_interfaces',
       'builtin_interfaces', 'diagnostic_msgs'}
PLOTTING = {'matplotlib', 'plotly', 'rich'}
WEB = {'starlette', 'uvicorn'}
# Equations of the paper that the code must state; (14) is the sum, (1) and (2) the friction laws.
EQUATIONS = set(range(1, 17))

# The header of every file; LICENSE has the text.
LICENCE = """\
# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0
"""


@pytest.mark.parametrize('file', files(), ids=lambda file: str(file.relative_to(PACKAGE)))
def test_arrows_point_one_way(file: Path) -> None:
    layer = file.relative_to(PACKAGE).parts[0]
    used = imports(file)
    own = {name.split('.')[1] for name in used if name.startswith('pprs_dynamics.')}
    assert own - {'arrays', 'drives', 'errors', layer} <= MAY_USE[layer]
    folders = FOLDERS.get(layer, [])
    if folders and (folder := file.relative_to(PACKAGE).parts[1]) in folders:
        below = {name.split('.')[2] for name in used
                 if name.startswith(f'pprs_dynamics.{layer}.') and name.count('.') > 2}
        above = set(folders[folders.index(folder) + 1:])
        assert below & above == set()
    libraries = {name.split('.')[0] for name in used}
    if layer != 'ros':
        assert not libraries & ROS
    if layer != 'app':
        assert not libraries & PLOTTING
    if 'server' not in file.parts:
        assert not libraries & WEB


def test_no_file_imports_one_that_imports_it() -> None:
    found = circles({file: imported_files(file) for file in files()})
    assert {str(file.relative_to(PACKAGE)) for file in found} == set()


@pytest.mark.parametrize('file', sorted((PACKAGE / 'ros').rglob('*.py')), ids=lambda f: f.name)
def test_nodes_hold_no_mathematics(file: Path) -> None:
    assert 'Eq. (' not in file.read_text()
    assert not {name.split('.')[0] for name in imports(file)} & {'scipy', 'cmath'}


def test_a_recording_is_read_without_the_model(tmp_path: Path) -> None:
    file = tmp_path / 'run.csv'
    file.write_text('time,axis/position,axis/effort\n' + ''.join(
        f'{k / 100},{k / 1000},1\n' for k in range(100)))
    code = ('import sys; from pprs_dynamics import read_recording; '
            f'assert read_recording({str(file)!r}, ("axis",)).effort.mean() == 1; '
            'print([name for name in sys.modules if "physics" in name])')
    assert subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True).stdout.strip() == '[]'


def test_every_equation_of_the_paper_is_cited_and_no_other() -> None:
    cited: set[int] = set()
    for file in files():
        for line in file.read_text().splitlines():
            _, found, comment = line.partition('# Eq. ')
            if found:
                cited |= {int(number) for number in re.findall(r'\((\d+)\)', comment)}
    assert cited == EQUATIONS


def test_each_catalogue_effect_has_a_file_of_its_name_and_the_list_is_sorted() -> None:
    assert list(CATALOGUE) == sorted(CATALOGUE)
    for name, effect in CATALOGUE.items():
        assert Path(sys.modules[effect.__module__].__file__ or '').stem == name
        assert effect.__doc__
        assert issubclass(effect, CatalogueEffect)
        for parameter in effect.parameters:
            assert parameter.unit
            assert parameter.description
            assert parameter.lower < parameter.upper


def test_no_test_imports_another() -> None:
    """What two tests need is a helper; a test that moves or goes must not take others with it."""
    tests = {file.stem: file for file in (PACKAGE.parent / 'test').rglob('test_*.py')}
    helpers = [*tests.values(), *(PACKAGE.parent / 'test').glob('[os]*/*.py')]
    assert len(helpers) > len(tests) > 100
    assert [str(file) for file in helpers
            if {name.split('.')[-1] for name in imports(file)} & tests.keys()] == []


@pytest.mark.parametrize('folder', ['pprs_dynamics', 'test', 'benchmarks', 'demo', 'docs'])
def test_every_file_begins_with_the_licence(folder: str) -> None:
    assert [str(file) for file in sorted((PACKAGE.parent / folder).rglob('*.py'))
            if not file.read_text(encoding='utf-8').startswith(LICENCE)] == []


DESCRIPTION = ElementTree.parse(PACKAGE.parent / 'package.xml').getroot()


def test_the_version_is_that_of_the_package_description() -> None:
    assert DESCRIPTION.findtext('version') == pprs_dynamics.__version__


def test_the_package_description_names_the_licence_of_all_that_is_handed_on() -> None:
    named = {PACKAGE.parent / element.get('file', '') for element in DESCRIPTION.findall('license')}
    assert named == {PACKAGE.parent / 'LICENSE', *PACKAGE.rglob('*.LICENSE')}


def test_the_package_description_names_what_the_nodes_import() -> None:
    used = {name.split('.')[0] for file in (PACKAGE / 'ros').rglob('*.py')
            for name in imports(file)}
    others = used - set(sys.stdlib_module_names) - {'pprs_dynamics'}
    assert {'rclpy', 'sensor_msgs', 'numpy'} <= others
    named = {element.text for element in DESCRIPTION.findall('exec_depend')}
    assert {name for name in others if not {name, f'python3-{name}'} & named} == set()
