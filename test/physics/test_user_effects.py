# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects from other packages: found by their entry point, used like the package's own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from pprs_dynamics.physics.effects.catalogue import CATALOGUE, GROUP

PROJECT = Path(__file__).parents[2]
EXAMPLE = PROJECT / 'docs' / 'example_effect'
PAPER = PROJECT / 'config' / 'paper.yaml'


def python(code: str, packages: Path, *arguments: object, limit: float = 60,
           ) -> subprocess.CompletedProcess[str]:
    """Run code in a new process that finds `packages`, too."""
    path = os.pathsep.join(filter(None, (str(packages), os.environ.get('PYTHONPATH'))))
    return subprocess.run(
        [sys.executable, '-c', code, *map(str, arguments)], capture_output=True, text=True,
        timeout=limit, env={**os.environ, 'PYTHONPATH': path}, cwd=packages)


@pytest.fixture(scope='module')
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the example as setuptools installs it from its pyproject.toml."""
    source = tmp_path_factory.mktemp('source') / 'example_effect'
    shutil.copytree(EXAMPLE, source)
    target = tmp_path_factory.mktemp('site')
    built = subprocess.run(
        [sys.executable, '-c', 'from setuptools import setup; setup()', '-q', 'build_py',
         '--build-lib', str(target), 'egg_info', '--egg-base', str(target)],
        cwd=source, capture_output=True, text=True, timeout=60)
    assert built.returncode == 0, built.stderr
    return target


def model_file(folder: Path, effects: dict[str, object]) -> Path:
    content = yaml.safe_load(PAPER.read_text())
    content['/**']['ros__parameters']['effects'] = effects
    file = folder / 'model.yaml'
    file.write_text(yaml.safe_dump(content))
    return file


USE = """
import sys
from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.paths import HelicalPath
forces = DriveModel.load(sys.argv[1]).drive_forces(HelicalPath().motion([1.0, 2.0]))
for row in (*forces.parts['eddy_brake'], *forces.mechanism.velocity):
    print(*row)
"""


def test_a_model_file_uses_an_effect_of_another_package(installed: Path, tmp_path: Path) -> None:
    file = model_file(tmp_path, {
        'active': ['eddy_brake', 'effort_offset'], 'effort_offset': {'lift_1': {'force': 0.5}},
        'eddy_brake': {'slide_2': {'coefficient': 3.0, 'critical_velocity': 0.05}}})
    done = python(USE, installed, file)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ''
    numbers = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    force, velocity = numbers[:2], numbers[2:]
    expected = np.zeros((2, 6))
    expected[:, 1] = 3.0 * velocity[:, 1] / (1 + (velocity[:, 1] / 0.05) ** 2)
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(force, expected, rtol=1e-14)


LIST = """
from pprs_dynamics.physics.effects.catalogue import catalogue
print(*catalogue())
assert catalogue() is catalogue()
"""


GOOD = """
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Parameter
class Mine(DriveEffect):
    '''A force.

    Equation
    --------
    F
    '''
    name = 'mine'
    linear = (Parameter('force', 'F', 'N', 'a force', -1.0, 1.0),)
    @classmethod
    def columns(cls, drive, **shape):
        return (0 * drive.velocity + 1,)
"""
BROKEN = {
    'no_module': ('', 'gone:Mine', 'cannot be imported (ModuleNotFoundError: No module named'),
    'fails': ('raise OSError("no licence\\nserver")', '{module}:Mine',
              'cannot be imported (OSError: no licence server)'),
    'quits': ('raise SystemExit(3)', '{module}:Mine', 'cannot be imported (SystemExit: 3)'),
    'no_card': (GOOD.replace('Equation', 'Chart'), '{module}:Mine',
                'the docstring of Mine must have a section Equation'),
    'taken': (GOOD.replace("'mine'", "'payload_mass'"), '{module}:Mine',
              'the name payload_mass is taken'),
}


def offer(folder: Path, package: str, source: str, target: str) -> None:
    """Put a package with one entry point into a folder."""
    (folder / f'{package}.py').write_text(source)
    info = folder / f'{package}-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n')
    (info / 'entry_points.txt').write_text(
        f'[{GROUP}]\n{package} = {target.format(module=package)}\n')


def test_a_broken_effect_is_left_out_with_one_clear_warning_and_the_others_stay(
    tmp_path: Path,
) -> None:
    for package, (source, target, _) in BROKEN.items():
        offer(tmp_path, f'broken_{package}', source, target)
    offer(tmp_path, 'a_good_one', GOOD, '{module}:Mine')
    offer(tmp_path, 'second_of_that_name', GOOD, '{module}:Mine')
    done = python(LIST, tmp_path)
    assert done.stdout.split() == [*CATALOGUE, 'mine'], done.stderr
    told = [line for line in done.stderr.splitlines() if 'is left out' in line]
    assert len(told) == len(BROKEN) + 1
    for package, (_, target, reason) in BROKEN.items():
        name = f'broken_{package}'
        (line,) = (line for line in told if f'of the package {name} ' in line)
        assert f'the effect {name} = {target.format(module=name)} of the package' in line
        assert reason in line
    assert any('second_of_that_name' in line and 'mine is taken' in line for line in told)
    assert 'Traceback' not in done.stderr
