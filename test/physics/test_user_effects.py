# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects from other packages: found by their entry point, used like the package's own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from failing_effects import FAULTS, LOADED, fail, model_file, offer
from feedforward_bench import random_motion
from model_recordings import with_effects

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion
from pprs_dynamics.errors import EffectError
from pprs_dynamics.physics.effects.catalogue import CATALOGUE, check_columns, guard
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples

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


def written(folder: Path, effects: dict[str, object]) -> Path:
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
    file = written(tmp_path, {
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


def test_a_broken_effect_is_left_out_with_one_clear_warning_and_the_others_stay(
    tmp_path: Path,
) -> None:
    for package, (source, target, _) in BROKEN.items():
        name = f'broken_{package}'
        offer(tmp_path, name, source, {name: target.format(module=name)})
    for package in ('a_good_one', 'second_of_that_name'):
        offer(tmp_path, package, GOOD, {package: f'{package}:Mine'})
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


# What effects of other packages do wrong is one error, which names effect, method and reason.

STATE = random_motion(np.random.default_rng(11), 3)[:1]


@pytest.mark.parametrize(('effect', 'place', 'fault', 'told'), [
    *(('worn_brake', 'columns', fault, told) for fault, told in FAULTS.items()),
    ('hose', 'load', 'raises', 'load raised ZeroDivisionError: division by zero ('),
    ('hose', 'load', 'longer', 'apply raised ValueError: the wrench has shape (7,), must'),
    ('hose', 'changed', 'raises', 'changed raised ZeroDivisionError: division by zero (')])
def test_a_failing_effect_is_one_error_with_its_name(
    package: ModuleType, tmp_path: Path, effect: str, place: str, fault: str, told: str,
) -> None:
    model = DriveModel.load(model_file(tmp_path, effect))
    fail(package, place, fault)
    with pytest.raises(EffectError) as raised:
        model.drive_forces(STATE)
    assert raised.value.effect == effect
    assert str(raised.value).startswith(f'effect {effect}: {told}')
    if told.endswith('('):
        assert 'worn_brake.py, line ' in str(raised.value)


def hexapod_with(effect: str, **block: float) -> DriveModel:
    return with_effects(DriveModel.load('config/hexapod.yaml'), {effect: block})


def test_an_effect_on_the_bodies_acts_on_a_robot_with_loops_as_well(package: ModuleType) -> None:
    """Its friction included, as that of the catalogue's wrench of 2 N does."""
    found = hexapod_with('hose', force=2.0)
    wrench = hexapod_with('external_wrench', force_x=0.0, force_y=0.0, force_z=2.0)
    rest = np.zeros((3, 6))
    motion = JointMotion(rest + 0.48, rest + np.arange(3)[:, None] * 0.01, rest)
    ours, theirs = found.drive_forces(motion), wrench.drive_forces(motion)
    assert ours.parts['hose'] == pytest.approx(theirs.parts['external_wrench'], abs=1e-12)
    assert ours.total == pytest.approx(theirs.total, abs=1e-12)
    assert np.max(np.abs(ours.parts['hose'])) > 0.1


@pytest.mark.parametrize(('fault', 'told'), LOADED.items())
def test_wrong_columns_are_found_when_the_package_is_loaded(
    package: ModuleType, fault: str, told: str,
) -> None:
    fail(package, 'columns', fault)
    with pytest.raises(EffectError, match=re.escape(told)):
        check_columns(package.WornBrake)


@pytest.mark.parametrize('method', ['may_show', 'deviations', 'bound'])
def test_whatever_a_diagnosis_asks_is_one_error_with_the_name(method: str) -> None:
    def fails(cls: type, _: Any) -> None:
        raise ZeroDivisionError('by a foreign effect')
    fails.__name__ = method

    def columns(cls: type, drive: DriveSamples) -> tuple[Any, ...]:
        return (drive.velocity,)

    effect: Any = type('Drag', (DriveEffect,), {
        'name': 'drag', 'linear': (), 'columns': classmethod(columns), method: classmethod(fails)})
    guard(effect)
    with pytest.raises(EffectError, match=f'effect drag: {method} raised ZeroDivisionError'):
        getattr(effect, method)(DriveRange(1.0, 0.1, 0.2, 0.3))


def test_what_the_mechanism_refuses_is_not_put_down_to_the_effect(
    package: ModuleType, tmp_path: Path,
) -> None:
    model = DriveModel.load(model_file(tmp_path, 'hose', 'worn_brake'))
    absurd = PlatformMotion(STATE.position, STATE.orientation, np.full((1, 3), 1e200),
                            *(np.zeros((1, 3)) for _ in range(3)))
    assert not np.isfinite(model.drive_forces(absurd).total).all()


def test_an_effect_whose_memory_cannot_be_copied_is_told(package: Any, tmp_path: Path) -> None:
    package.WornBrake.drive_memory = staticmethod(lambda *_: {'log': (x for x in ())})
    model = DriveModel.load(model_file(tmp_path, 'worn_brake'))
    with pytest.raises(EffectError, match='effect worn_brake: its memory cannot be copied'):
        model.initial_state().copy()


@pytest.mark.parametrize('place', ['__init__', 'changed'])
def test_a_model_file_with_an_effect_that_cannot_be_built_is_refused(
    package: ModuleType, tmp_path: Path, place: str,
) -> None:
    fail(package, place)
    name = 'hose' if place == 'changed' else 'worn_brake'
    with pytest.raises(EffectError, match=f'effect {name}: {place} raised ZeroDivisionError'):
        DriveModel.load(model_file(tmp_path, name))
