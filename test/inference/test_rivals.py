# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Rivals of an ambiguous answer, with their own values: a spring and a mass on one sine."""

from __future__ import annotations

import numpy as np
import pytest
from single_axis import AXIS, axis_values

from pprs_dynamics import DriveModel
from pprs_dynamics.inference.diagnosis.answer import rival_effects
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording

MASS, VISCOUS, COULOMB, WIDTH = 20.0, 40.0, 6.0, 0.001
SPRING, OMEGA = 55.0, 2 * np.pi * 0.5  # [N/m], [rad/s]
NOISE = 0.05  # [N]


@pytest.fixture(scope='module')
def ambiguous() -> Diagnosis:
    """Diagnose one sine, on which a spring is a negative mass."""
    time = np.arange(0.0, 20.0, 0.004)
    q, q_dot = 0.08 * np.sin(OMEGA * time), 0.08 * OMEGA * np.cos(OMEGA * time)
    force = (MASS * -OMEGA ** 2 * q + VISCOUS * q_dot + COULOMB * np.tanh(q_dot / WIDTH)
             + SPRING * q + NOISE * np.random.default_rng(3).standard_normal(len(time)))
    model = DriveModel.from_parameters(
        axis_values(MASS, VISCOUS, COULOMB, width=WIDTH))
    return diagnose(model, [Recording.from_arrays('sine', time, q[:, None], None, force[:, None],
                                                  (AXIS,))])


def test_a_rival_has_the_value_that_explains_the_same(ambiguous: Diagnosis) -> None:
    assert ambiguous.verdict == 'ambiguous'
    best = ambiguous.effects[0]
    rivals = rival_effects(ambiguous)
    found = [best, *(rival.found for rival in rivals)]
    assert {effect.name for effect in found} >= {'drive_spring', 'drive_inertia'}
    values = {one.name: one.parameters for one in found}
    spring = values['drive_spring'][f'{AXIS}.stiffness']
    mass = values['drive_inertia'][f'{AXIS}.mass']
    assert spring.value == pytest.approx(SPRING, abs=4 * spring.std)
    assert mass.value == pytest.approx(-SPRING / OMEGA ** 2, abs=4 * mass.std)
    for rival in rivals:
        if rival.found.name in ('drive_spring', 'drive_inertia'):
            left = rival.found.force - best.force
            assert np.sqrt(np.mean(left ** 2)) < 0.1 * np.sqrt(np.mean(best.force ** 2))
            assert rival.found.error_after == pytest.approx(best.error_after, rel=0.05)
            assert rival.found.held_out_after == pytest.approx(best.held_out_after, rel=0.05)
            assert 0 <= rival.cost < 10
