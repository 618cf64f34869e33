# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the forms of effects leave is no unknown, and what is more than that is."""

from __future__ import annotations

import numpy as np

from pprs_dynamics import JointMotion, MechanismModel
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis, diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.model.robot_block import AXIS

VALUES = {'axis.mass': 20.0, 'axis.viscous': 40.0, 'axis.coulomb': 6.0, 'axis.offset': -2.0,
          'friction.reversal_velocity': 0.001}
NOISE = 0.1  # [N]
SPRING = 150.0  # [N/m]: of up to 20 N


def said(spring_off: float = 0.0, bump: float = 0.0) -> Diagnosis:
    """Return what is said of an axis with a spring that its model lacks.

    Parameters
    ----------
    spring_off : float
        Share by which it swings over the velocity.
    bump : float
        Force of no catalogue in a narrow range [N].
    """
    model = build_model(VALUES)
    assert isinstance(model, MechanismModel)
    rng = np.random.default_rng(5)
    time = np.arange(0, 20, 0.002)
    omega = 2 * np.pi * np.array([0.21, 0.37, 0.83])[:, None]
    phase = omega * time + rng.uniform(0, 2 * np.pi, (3, 1))
    size = np.array([0.08, 0.04, 0.015])[:, None]
    q, v = (size * np.sin(phase)).sum(0), (size * omega * np.cos(phase)).sum(0)
    a = -(size * omega ** 2 * np.sin(phase)).sum(0)
    motion = JointMotion(q[:, None], v[:, None], a[:, None], time=time)
    wave = np.sqrt(2) * np.cos(4 * np.pi * v / np.ptp(v) + 1.0)
    force = model.drive_forces(motion).total[:, 0]
    force = force + SPRING * q * (1 + spring_off * wave)
    force += bump * np.exp(-((q - 0.03) / 0.006) ** 2)
    recording = Recording.from_arrays('axis', time, q[:, None], None, (
        force + NOISE * rng.normal(size=len(q)))[:, None], (AXIS,))
    return diagnose(model, [recording])


def test_what_a_form_leaves_is_no_unknown() -> None:
    """A spring of which a twentieth is otherwise, by how fast the drive is."""
    found = said(spring_off=0.05)
    assert [one.name for one in found.effects] == ['drive_spring']
    assert np.nanstd(found.remaining) > 2 * NOISE  # it stands out of the noise
    assert (found.verdict, dict(found.above_noise)) == ('effect', {})


def test_what_is_more_than_a_form_leaves_is_unknown() -> None:
    assert said(bump=12.0).verdict == 'unknown'
