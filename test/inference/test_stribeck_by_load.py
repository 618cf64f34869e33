# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Breakaway friction that grows with the load, of another form, or that no load changes."""

from __future__ import annotations

from pathlib import Path

import made_up_arm
import numpy as np
import pytest

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording

SWING, SLOW, USUAL = 1, 0.1, 30.0  # [rad/s], [N m]


@pytest.mark.parametrize(('exponent', 'coefficient'), [(0.9, 'coefficient'), (0.0, 'force')])
def test_breakaway_by_load_is_told_from_one_that_no_load_changes(
        tmp_path: Path, exponent: float, coefficient: str) -> None:
    model = made_up_arm.real_arm(tmp_path)
    moved = made_up_arm.motion(20.0)
    forces = model.drive_forces(moved)
    load = np.abs(forces.mechanism.transmitted[:, SWING]) / USUAL
    v = moved.velocity[:, SWING]
    effort = forces.total + 0.1 * np.random.default_rng(3).normal(size=forces.total.shape)
    effort[:, SWING] += (4.0 * load ** exponent * np.exp(-np.abs(v) / SLOW) * v
                         / np.hypot(v, 0.01))
    found = diagnose(model, [Recording.from_arrays('run', moved.time, moved.position, None, effort,
                                                   model.drives)])
    assert [(one.name, one.drives) for one in found.effects] == [
        ('stribeck_friction', ('swing',))]
    sizes = {name: found.effects[0].parameters[f'swing.{name}'].value
             for name in ('force', 'coefficient')}
    assert [name for name, size in sizes.items() if size] == [coefficient]
