# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs diagnose, from files of a robot with a hidden effect to its answer and its page."""

from __future__ import annotations

import hashlib
import html
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from pprs_command import pprs
from workbench_bench import AXIS, write_axis

from pprs_dynamics import DriveModel, __version__


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Diagnose one recording, with another one held out."""
    folder = tmp_path_factory.mktemp('diagnose')
    write_axis(folder / 'run.csv', 1)
    write_axis(folder / '<b>other<b>.mcap', 2)
    done = pprs('diagnose', 'run.csv', '--validate', '<b>other<b>.mcap', '--model', AXIS, '--json',
                'result.json', '--report', 'page.html', '--adopt-all', '--output', 'better.yaml',
                cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / 'stdout.txt').write_text(done.stdout)
    return folder


@pytest.fixture(scope='module')
def result(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / 'result.json').read_text())
    return content


def test_the_json_has_the_keys_that_others_rely_on(result: dict[str, Any]) -> None:
    promised = {'verdict', 'effects', 'indistinguishable', 'candidates', 'depends_on', 'suspects'}
    added = {'above_noise', 'adoption', 'calibrated', 'detectable', 'effort_looks_like',
             'explained', 'held_out_on', 'little_explained', 'noise_floor',
             'noise_floors', 'reference', 'refit', 'sets', 'stick_slip',
             'unconfirmed', 'warnings'}
    assert set(result) == promised | added
    for effect in result['effects']:
        assert set(effect) == {'name', 'drives', 'alike', 'parameters', 'error_before',
                               'error_after', 'held_out_before', 'held_out_after', 'evidence',
                               'without', 'since', 'course', 'held_out_certainty'}
        assert effect['drives'] == ['axis']
        for parameter in effect['parameters'].values():
            assert set(parameter) == {'value', 'std', 'unit'}
    for candidate in result['candidates']:
        assert set(candidate) == {'name', 'drives', 'evidence', 'error_after'}
    assert set(result['noise_floors']) == {'axis'}
    assert [effect['name'] for effect in result['sets'][0]['effects']] == ['coulomb_friction']
    assert result['held_out_on'] == 'validation'
    assert all(isinstance(warning, str) for warning in result['warnings'])


def test_the_model_that_is_written_has_the_effect(folder: Path, result: dict[str, Any]) -> None:
    written = DriveModel.load(folder / 'better.yaml').values
    assert list(written['effects.active']) == ['coulomb_friction']
    found, = result['effects']
    assert written['effects.coulomb_friction.axis.force'] == pytest.approx(
        found['parameters']['axis.force']['value'], rel=0.02)


def test_the_page_is_a_record_that_can_be_filed(folder: Path) -> None:
    page = html.unescape((folder / 'page.html').read_text())
    for name in ('run.csv', '<b>other<b>.mcap'):
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() in page
    assert DriveModel.load(AXIS).fingerprint in page
    assert (f"pprs diagnose run.csv --validate '<b>other<b>.mcap' --model {AXIS} --json "
            'result.json --report page.html --adopt-all --output better.yaml') in page
    assert '1600 samples, 8.00 s at 200 Hz' in page
    assert f'pprs_dynamics {__version__}' in page
    assert datetime.now(UTC).date().isoformat()[:7] in page
