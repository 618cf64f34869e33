# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""One sample of an arm, as a control loop asks for it."""

from __future__ import annotations

from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import ArmModel, JointMotion
from pprs_dynamics.physics.mechanism import linkage
from pprs_dynamics.physics.model.arm_sample import ArmSample
from pprs_dynamics.physics.model.model_file import build_model


@pytest.mark.parametrize('changes', [
    {}, {'effects.active': ['payload_mass'], 'effects.payload_mass.mass': 1.0}])
def test_one_sample_is_that_of_a_whole_motion(tmp_path: Path, changes: dict[str, object]) -> None:
    model = arm.real_arm(tmp_path, **changes)
    motion = arm.motion(2.0)
    sample = ArmSample(model)
    found = np.array([sample(*row) for row in zip(
        motion.position, motion.velocity, motion.acceleration, strict=True)])
    assert found == pytest.approx(model.drive_forces(motion).total, abs=1e-9)


def test_joints_in_another_order_than_in_the_description(tmp_path: Path) -> None:
    model = ArmModel.load(arm.write_arm(tmp_path, joints=('reach', 'turn', 'swing')))
    model = build_model({**model.values, 'friction.coulomb': (1.0, 2.0, 3.0)}, model.source)
    assert isinstance(model, ArmModel)
    q, v, a = np.random.default_rng(0).normal(size=(3, 3))
    assert ArmSample(model)(q, v, a) == pytest.approx(
        model.drive_forces(JointMotion(q[None], v[None], a[None])).total[0], abs=1e-12)


def test_a_sample_without_a_compiler_is_the_same(tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    model = arm.real_arm(tmp_path)
    q, v, a = np.random.default_rng(1).normal(size=(3, 3)) * 0.02
    compiled = ArmSample(model)(q, v, a)
    monkeypatch.setattr(linkage, 'compiled_or_none', lambda function: None)
    assert ArmSample(model)(q, v, a) == pytest.approx(compiled, abs=1e-12)
