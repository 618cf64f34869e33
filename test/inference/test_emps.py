# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The method on a real drive: EMPS. Its data is not part of the package."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pprs_command import pprs

from benchmarks import ROOT
from benchmarks.real import emps as real_drive
from benchmarks.real import emps_files as emps
from benchmarks.real.recorded_data import find_data, missing
from pprs_dynamics.inference.adoption.adopt import adopt_all
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.physics.model.drive_model import DriveModel

DATA = find_data('emps', emps.IDENTIFICATION)
pytestmark = pytest.mark.skipif(DATA is None, reason=missing('emps'))
MODEL = ROOT / 'config' / 'single_axis.yaml'


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with both runs as CSV, written by the script."""
    folder = tmp_path_factory.mktemp('emps')
    subprocess.run([sys.executable, '-m', 'benchmarks.real.emps_files', str(DATA), folder],
                   check=True, timeout=60, cwd=ROOT)
    return folder


def result_of(folder: Path, *arguments: str) -> dict[str, object]:
    done = pprs(*arguments, '--model', MODEL, '--json', 'result.json', cwd=folder)
    assert done.returncode == 0, done.stderr
    found: dict[str, object] = json.loads((folder / 'result.json').read_text())
    return found


def test_compare_tells_the_published_error(folder: Path) -> None:
    found = result_of(folder, 'compare', 'DATA_EMPS.csv')
    assert found['overall']['relative'] == pytest.approx(0.041, abs=0.001)  # type: ignore[index]


def test_the_loop_lowers_the_error_on_a_run_that_it_never_saw() -> None:
    assert DATA is not None
    run, pulses = (emps.read_emps(DATA / name) for name in (emps.IDENTIFICATION, emps.PULSES))
    model = DriveModel.load(MODEL)
    diagnosis = diagnose(model, [run])
    # Of all candidates the published effect lowers the error by far the most, from 4.1 to 3.1 %.
    assert min(diagnosis.candidates, key=lambda c: c.error_after).name == 'asymmetric_friction'
    walk = adopt_all(model, [run], diagnosis=diagnosis)
    assert 'asymmetric_friction' in [step.effect for step in walk.adopted]
    assert real_drive.error_of(model, pulses) > 5.9
    assert real_drive.error_of(walk.model, pulses) <= 3.5
