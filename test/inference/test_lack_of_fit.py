# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the forms of effects leave is no unknown, and what is more than that is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_up_arm import motion, real_arm, record

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis

NOISE = 0.2  # [N m] of a sample
SWING, VISCOUS = 1, 15.0  # [N m s/rad]


def said(folder: Path, force: Array) -> Diagnosis:
    """Return what is said of an arm whose second joint has a force (N,) that its model lacks."""
    arm = real_arm(folder)
    recording = record(arm, motion(), NOISE)
    recording.effort[:, SWING] += force
    return diagnose(arm, [recording])


def test_what_a_form_leaves_is_no_unknown(tmp_path: Path) -> None:
    """Viscous friction of which 6 % swings with the speed: nearly twice the noise."""
    v = motion().velocity[:, SWING]
    wave = np.sqrt(2) * np.cos(4 * np.pi * v / np.ptp(v) + 1)
    found = said(tmp_path, VISCOUS * v * (1 + 0.06 * wave))
    assert [(one.name, one.drives) for one in found.effects] == [('viscous_friction', ('swing',))]
    assert np.nanstd(found.remaining[:, SWING]) > 1.5 * found.noise_floors['swing']
    assert (found.verdict, dict(found.above_noise)) == ('effect', {})


def test_a_force_of_no_catalogue_is_unknown_however_strong_the_friction_beside_it(
        tmp_path: Path) -> None:
    moved = motion()
    q, v = moved.position[:, SWING], moved.velocity[:, SWING]
    bump = 6.0 * np.exp(-((q - np.median(q)) / (0.04 * np.ptp(q))) ** 2)
    assert said(tmp_path, VISCOUS * v + bump).verdict == 'unknown'
