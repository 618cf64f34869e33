# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of other people, which lie beside the project and not in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pprs_dynamics import DriveModel, Recording, read_recording
from pprs_dynamics.physics.model.parameter_file import read_parameters

PROJECT = Path(__file__).resolve().parents[2]
CASES = PROJECT.parent / 'shared' / 'cases'


def shared_case(folder: str, model: str, recording: str) -> tuple[DriveModel, Recording]:
    """Return a model and a recording of it; the test is skipped where there are none."""
    if not CASES.is_dir():
        pytest.skip('no recordings in ../shared/cases')
    path = CASES / folder / model
    # They are older than some names.
    values = {}
    for key, value in read_parameters(path).items():
        if key.startswith('columns.') and key.endswith('.scale'):
            key = key.replace('.scale', '.effort_scale')
        values[key.replace('arm.joints', 'robot.drives').replace('arm.', 'robot.')] = value
    read = DriveModel.from_parameters(_as_robot(values), str(path))
    return read, read_recording(CASES / folder / recording, read.recorded)


def _as_robot(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of an old block `axis` as those of a robot with one slide."""
    if 'axis.mass' not in values:
        return values
    own = {key.removeprefix('axis.'): value for key, value in values.items()
           if key.startswith('axis.')}
    rest = {key: value for key, value in values.items() if not key.startswith('axis.')}
    return rest | {
        'robot.urdf': str(PROJECT / 'config' / 'single_axis.urdf'), 'robot.base': 'base',
        'robot.tool': 'carriage', 'robot.drives': ['axis'], 'links.mass': [own['mass']],
        'robot.gravity': [0.0, 0.0, own.get('gravity', 0.0)],
        **{f'friction.{name}': [own.get(name, 0.0)] for name in ('viscous', 'coulomb', 'offset')},
    }
