# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A diagnosis of a drive that sticks and slips says so, and claims nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from single_axis import axis_values
from sticking_block import TIME, dragged, slow

from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.next_step import PLACEHOLDERS, next_step
from pprs_dynamics.inference.diagnosis.sentences import word_diagnosis
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

MODEL = axis_values(0.02, 0.4, 0.6)


def test_it_is_named_with_its_frequency_and_no_ripple_is_claimed() -> None:
    position, effort = dragged(slow())
    noise = 0.005 * np.random.default_rng(4).normal(size=len(TIME))
    found = diagnose(DriveModel.from_parameters(MODEL), [Recording.from_arrays(
        'run', TIME, position[:, None], None, (effort + noise)[:, None], ('axis',))])
    assert (found.verdict, found.effects) == ('unknown', ())
    assert found.to_dict()['stick_slip']['axis']['frequency'] == pytest.approx(2.3, abs=0.1)
    assert 'Stick-slip on axis at 2.3' in word_diagnosis(found).headline
    assert 'faster' in next_step(found, PLACEHOLDERS)[0]
