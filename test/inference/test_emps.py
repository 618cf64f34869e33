# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The method on a real drive: EMPS. Its data is not part of the package."""

from __future__ import annotations

import pytest

from benchmarks import ROOT
from benchmarks.real import emps as real_drive
from benchmarks.real import emps_files as emps
from benchmarks.real.recorded_data import find_data, missing
from pprs_dynamics.inference.adoption.adopt import adopt_all
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

DATA = find_data('emps', emps.IDENTIFICATION)
pytestmark = pytest.mark.skipif(DATA is None, reason=missing('emps'))
MODEL = ROOT / 'config' / 'single_axis.yaml'


def test_the_loop_lowers_the_error_on_a_run_that_it_never_saw() -> None:
    assert DATA is not None
    whole, pulses = (emps.read_emps(DATA / name) for name in (emps.IDENTIFICATION, emps.PULSES))
    half = slice(len(whole.time) // 2)
    run = Recording.from_arrays('half', whole.time[half], whole.position[half], None,
                                whole.effort[half], whole.drives)
    model = DriveModel.load(MODEL)
    diagnosis = diagnose(model, [run])
    # Of all candidates the published effect lowers the error by far the most, from 4.1 to 3.1 %.
    assert min(diagnosis.candidates, key=lambda c: c.error_after).name == 'asymmetric_friction'
    walk = adopt_all(model, [run], diagnosis=diagnosis)
    assert 'asymmetric_friction' in [step.effect for step in walk.adopted]
    assert real_drive.error_of(model, pulses) == pytest.approx(5.98, abs=0.05)  # as published
    assert real_drive.error_of(walk.model, pulses) <= 3.5
