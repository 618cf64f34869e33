# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of other people, which lie beside the project and not in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pprs_dynamics import DriveModel, Recording, read_recording
from pprs_dynamics.physics.model.parameter_file import read_parameters

CONFIG = Path(__file__).parents[2] / 'config'
CASES = Path(__file__).resolve().parents[3] / 'shared' / 'cases'


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
    if 'axis.mass' in values:
        mass, gravity, *friction = (values.pop(f'axis.{name}') for name in (
            'mass', 'gravity', 'viscous', 'coulomb', 'offset'))
        values = {**read_parameters(CONFIG / 'single_axis.yaml'), **values, 'links.mass': (mass,),
                  'robot.urdf': str(CONFIG / 'single_axis.urdf'),
                  'robot.gravity': (0.0, 0.0, gravity),
                  **{f'friction.{name}': (value,) for name, value in zip(
                      ('viscous', 'coulomb', 'offset'), friction, strict=True)}}
    read = DriveModel.from_parameters(values, str(path))
    return read, read_recording(CASES / folder / recording, read.recorded)
