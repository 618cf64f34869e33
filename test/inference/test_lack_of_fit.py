# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the forms of effects leave: no unknown, and no false certainty of numbers."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics import JointMotion, MechanismModel
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis, diagnose
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.model_discrepancy import LackOfFit
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.model.robot_block import AXIS

VALUES = {'axis.mass': 20.0, 'axis.viscous': 40.0, 'axis.coulomb': 6.0, 'axis.offset': -2.0,
          'friction.reversal_velocity': 0.001}
NOISE = 0.1  # [N]
SPRING = 150.0  # [N/m]: of up to 20 N


def said(spring_off: float = 0.0, bump: float = 0.0, friction_off: float = 0.0,
         mass: float = 0.0) -> Diagnosis:
    """Return what is said of an axis with a spring that its model lacks, or a mass.

    Parameters
    ----------
    spring_off, friction_off : float
        Share by which the spring swings over the velocity, the model's friction over the position.
    bump : float
        Force of no catalogue in a narrow range [N].
    mass : float
        Instead of a spring [kg].
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
    over_q, over_v = (np.sqrt(2) * np.cos(4 * np.pi * x / np.ptp(x) + 1.0) for x in (q, v))
    force = model.drive_forces(motion).total[:, 0]
    force = force + friction_off * over_q * (40.0 * v + 6.0 * np.sign(v))
    force += mass * a if mass else SPRING * q * (1 + spring_off * over_v)
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


def test_forces_that_cancel_leave_nothing() -> None:
    """Two springs of opposite sign are no springs, and none of their lack of fit is there."""
    design = said().selection.last.design  # type: ignore[union-attr]
    force = np.ones_like(design.residuals.measured)
    assert LackOfFit.of(design, DECISIONS, [force]).rms(0) == pytest.approx(DECISIONS.form_share)
    assert LackOfFit.of(design, DECISIONS, [force, -force]).rms(0) == 0.0
    waves = LackOfFit.of(design, DECISIONS, [force]).waves(0)
    assert len(waves) == 24
    # A wave has the mean square of its force, evenly over a range; a motion is not even.
    assert np.sum(np.mean(waves[:12] ** 2, axis=1)) == pytest.approx(
        DECISIONS.form_share ** 2, rel=0.3)


def test_a_number_is_less_certain_where_forms_are_seen_to_be_off() -> None:
    """A mass beside friction of the model's own that is off by 2 % and seen to be."""
    exact, off = said(mass=4.0), said(mass=4.0, friction_off=0.02)
    both = [next(value for key, value in one.effects[0].parameters.items()
                 if key.endswith('mass')) for one in (exact, off)]
    for one in both:
        assert abs(one.value - 4.0) < 2 * one.std
    assert both[1].std > 2 * both[0].std
    assert both[0].std < 0.01
