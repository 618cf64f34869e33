# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The loop of docs/own_loop.py gives, sample by sample, what one call gives for all."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pprs_dynamics import DriveModel

PAGE = Path(__file__).parents[2] / 'docs' / 'own_loop.py'
RATE = 200.0
POSES = ('position', 'orientation', 'linear_velocity', 'angular_velocity',
         'linear_acceleration', 'angular_acceleration')


@pytest.fixture(scope='module')
def script() -> ModuleType:
    found = importlib.util.spec_from_file_location('own_loop', PAGE)
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@pytest.mark.parametrize('path', ['config/paper.yaml', 'config/delta.yaml'])
def test_single_samples_with_a_state_are_the_samples_of_one_call(
    script: ModuleType, path: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent: list[np.ndarray] = []
    monkeypatch.setattr(script, 'send', lambda forces: sent.append(forces.copy()))
    took, late = script.run(path, 0.1, RATE)
    assert len(sent) == len(took) == len(late) == 20
    assert np.all(took > 0)
    assert np.all(late >= 0)
    model = DriveModel.load(path)
    motions = [script.one_sample(model, k / RATE) for k in range(20)]
    names = POSES if path == 'config/paper.yaml' else ('position', 'velocity', 'acceleration')
    whole = type(motions[0])(**{
        name: np.concatenate([getattr(motion, name) for motion in motions])
        for name in (*names, 'time')})
    np.testing.assert_allclose(np.array(sent), model.drive_forces(whole).total, atol=1e-9)
