# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stops near the end of a stroke, of another form: found, and springs and ripples stay these."""

from __future__ import annotations

from pathlib import Path

import made_up_arm
import numpy as np
import pytest

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording

SWING = 1
NOISE = 0.1  # [N m]
REACH = 0.15  # of the stroke


def found_beside(folder: Path, force: object) -> tuple[Diagnosis, Array]:
    """Return what is said of an arm with a further force on a joint, and the joint's positions."""
    model = made_up_arm.real_arm(folder)
    moved = made_up_arm.motion(20.0)
    effort = model.drive_forces(moved).total
    assert callable(force)
    effort[:, SWING] += force(moved.position[:, SWING])
    effort += NOISE * np.random.default_rng(3).normal(size=effort.shape)
    grain = 1e-5 * np.random.default_rng(4).normal(size=effort.shape)
    recording = Recording.from_arrays('run', moved.time, moved.position + grain, None, effort,
                                      model.drives)
    return diagnose(model, [recording]), moved.position[:, SWING]


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_stop_is_found_at_its_end_and_place(tmp_path: Path, side: float) -> None:
    def rubber(q: Array) -> Array:
        x = np.maximum(side * q - (side * q).max() + REACH * np.ptp(q), 0.0) / (REACH * np.ptp(q))
        return side * 6.0 * x ** 1.5

    found, q = found_beside(tmp_path, rubber)
    assert [(one.name, one.drives) for one in found.effects] == [('stop_contact', ('swing',))]
    told = {key: one.value for key, one in found.effects[0].parameters.items()}
    stiffness, other = ('upper', 'lower')[::int(side)]
    assert told[f'swing.{stiffness}'] * REACH * np.ptp(q) == pytest.approx(6.0, rel=0.5)
    assert told[f'swing.{other}'] == 0
    # A bumper that stiffens begins to be felt behind its edge.
    beyond = side * told['swing.position'] - ((side * q).max() - REACH * np.ptp(q))
    assert -0.1 < beyond / (REACH * np.ptp(q)) < 0.5


@pytest.mark.parametrize(('force', 'name'), [
    (lambda q: 8.0 * (q - 0.2), 'drive_spring'),
    (lambda q: 2.0 * np.sin(2 * np.pi * q / 0.3) + 0.5 * np.sin(4 * np.pi * q / 0.3),
     'force_ripple')])
def test_what_it_is_taken_for_stays_what_it_is(tmp_path: Path, force: object, name: str) -> None:
    found, _ = found_beside(tmp_path, force)
    assert [(one.name, one.drives) for one in found.effects] == [(name, ('swing',))]
