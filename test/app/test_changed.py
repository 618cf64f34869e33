# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs changed: what two recordings differ in is told with both values, and nothing else is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from model_recordings import record, with_effects

from pprs_dynamics import DriveModel, changed
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.measurement.files.recording import write_recording

MODEL = DriveModel.load()
NOISE = 0.06  # [N]
BEFORE = {'coulomb_friction': {'slide_2.force': 0.3}}
WORN = {'coulomb_friction': {'slide_2.force': 0.5}}
LOADED = {**BEFORE, 'payload_mass': {'mass': 0.2}}


def test_a_number_that_changed_is_told_with_both_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    files = [tmp_path / 'before.csv', tmp_path / 'after.csv']
    for file, effects, seed in zip(files, (BEFORE, WORN), (1, 2), strict=True):
        write_recording(file, record(with_effects(MODEL, effects), NOISE, seed=seed))
    assert main(['changed', *map(str, files), '--json', str(tmp_path / 'x.json'), '--report',
                 str(tmp_path / 'x.html')]) == 0
    result = json.loads((tmp_path / 'x.json').read_text())
    (change,) = result['changes']
    assert change['name'] == 'coulomb_friction'
    assert change['drives'] == ['slide_2']
    assert change['parameter'] == 'slide_2.force'
    assert abs(change['before'] - 0.3) < 0.05
    assert abs(change['after'] - 0.5) < 4 * change['std'] < 0.15
    assert result['error_after'] < 1.05 * NOISE < 0.95 * result['error_before']
    said = ' '.join(capsys.readouterr().out.split())
    assert 'coulomb_friction changed: the model of before leaves' in said
    assert 'coulomb_friction changed' in (tmp_path / 'x.html').read_text()


def test_what_is_new_is_told_alone_and_was_0_before() -> None:
    result = changed(MODEL, record(with_effects(MODEL, BEFORE), NOISE, seed=1),
                     record(with_effects(MODEL, LOADED), NOISE, seed=2))
    assert {one.name for one in result.changes} == {'payload_mass'}
    (mass,) = (one for one in result.changes if one.parameter == 'mass')
    assert mass.before == 0.0
    assert abs(mass.after - 0.2) < 4 * mass.std < 0.1


def test_nothing_changed_is_an_answer() -> None:
    model = with_effects(MODEL, BEFORE)
    result = changed(MODEL, record(model, NOISE, seed=1), record(model, NOISE, seed=2))
    assert result.changes == ()
    assert str(result).startswith('Nothing changed that these recordings can tell')
