# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A package whose effects fail in the way that a test asks for, and how it is installed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml

from pprs_dynamics.physics.effects.catalogue import GROUP, catalogue

PACKAGE = 'worn_brake'
PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'
# A force of its own that a model file may add, on one drive and on the platform.
SOURCE = '''
import os
import numpy as np
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.state import StructureLoad

PLACE, FAULT = os.environ.get('WORN_BRAKE', 'nowhere none').split()

def fault(place, result):
    if place != PLACE:
        return result
    match FAULT:
        case 'raises':
            return 1 / 0
        case 'exits':
            raise SystemExit(3)
        case 'none':
            return None
        case 'longer':
            return (np.append(result[0], 0.0), *result[1:])
        case 'fewer':
            return result[1:]
        case 'words':
            return ('much', *result[1:])
        case 'nan':
            return (result[0] * np.nan, *result[1:])

class WornBrake(DriveEffect):
    """A brake.

    Equation
    --------
    c q_dot
    """
    name = 'worn_brake'
    linear = (Parameter('coefficient', 'c', 'N s/m', 'a coefficient', 0.0, 1e6),)

    def __init__(self, drives):
        fault('__init__', None)
        super().__init__(drives)

    @classmethod
    def columns(cls, drive, **shape):
        if drive.memory is not None:
            drive.memory['samples'] += len(drive.velocity)
        last = fault('columns', (drive.velocity,))
        return last if drive.memory is None else fault(
            f"columns_{drive.memory['samples']}", last)

    @classmethod
    def drive_memory(cls, start=None):
        return fault('drive_memory', {'samples': 0})

class Hose(BodyEffect):
    """A hose.

    Equation
    --------
    F
    """
    name = 'hose'
    acts_in = frozenset({'platform', 'mechanism'})
    linear = (Parameter('force', 'F', 'N', 'downward force', 0.0, 1e6),)

    def load(self, state):
        wrench = np.zeros((len(state.velocity), 6))
        wrench[:, 2] = self.values['force']
        return StructureLoad(*fault('load', (wrench, {})))

    def changed(self, robot):
        return fault('changed', robot)
'''
# Fault of WornBrake.columns: what the sentence says of it.
FAULTS = {
    'raises': 'columns raised ZeroDivisionError: division by zero (',
    'exits': 'columns raised SystemExit: 3 (',
    'none': "force raised TypeError: 'NoneType' object is not iterable",
    'longer': 'force raised ValueError: ',
    'fewer': 'force raised ValueError: ',
    'words': 'force raised TypeError: ',
}
# The same where they are there when the package is loaded.
LOADED = {
    'raises': 'columns raised ZeroDivisionError: division by zero (',
    'none': 'columns returned None, must be a tuple of 1 arrays (coefficient)',
    'longer': 'columns returned array([0.1, 0.2, 0.3, 0. ]) for three samples',
    'fewer': 'columns returned (), must be a tuple of 1 arrays (coefficient)',
    'words': "columns returned 'much' for three samples",
    'nan': 'columns returned array([nan, nan, nan]) for three samples',
}
EFFECTS = {'worn_brake': 'WornBrake', 'hose': 'Hose'}
BLOCKS = {'worn_brake': {'slide_2': {'coefficient': 3.0}}, 'hose': {'force': 2.0}}


def offer(folder: Path, package: str, source: str, entries: dict[str, str]) -> Path:
    """Put a package with entry points where `folder` on the path makes it an installed one."""
    (folder / f'{package}.py').write_text(source)
    info = folder / f'{package}-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n')
    (info / 'entry_points.txt').write_text(f'[{GROUP}]\n' + ''.join(
        f'{name} = {target}\n' for name, target in entries.items()))
    return folder


def model_file(folder: Path, *effects: str) -> Path:
    """Write the paper's robot with effects of the package."""
    content = yaml.safe_load(PAPER.read_text())
    content['/**']['ros__parameters']['effects'] = {
        'active': list(effects), **{name: BLOCKS[name] for name in effects}}
    file = folder / 'model.yaml'
    file.write_text(yaml.safe_dump(content))
    return file


def parameters(*effects: str) -> dict[str, Any]:
    """Return the effects as parameters of a node, `__` for the dot."""
    values: dict[str, Any] = {'effects__active': list(effects)}
    if 'worn_brake' in effects:
        values['effects__worn_brake__slide_2__coefficient'] = 3.0
    if 'hose' in effects:
        values['effects__hose__force'] = 2.0
    return values


def fail(package: Any, place: str, fault: str = 'raises') -> None:
    """Make a method fail from now on."""
    package.PLACE, package.FAULT = place, fault


@contextmanager
def installed(folder: Path) -> Iterator[ModuleType]:
    """Give the package's module, installed for this process; nothing fails until `fail`."""
    sys.path.insert(0, str(offer(folder, PACKAGE, SOURCE, {
        name: f'{PACKAGE}:{kind}' for name, kind in EFFECTS.items()})))
    catalogue.cache_clear()
    try:
        assert set(EFFECTS) <= set(catalogue())
        module = sys.modules[PACKAGE]
        fail(module, 'nowhere', 'none')
        yield module
    finally:
        sys.path.remove(str(folder))
        sys.modules.pop(PACKAGE, None)
        catalogue.cache_clear()
