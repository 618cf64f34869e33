# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Kept diagnoses: found again, bounded, and never read from where others could write."""

from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from made_up_diagnosis import found_effect, made_up_diagnosis

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands import diagnosis_cache
from pprs_dynamics.app.commands.diagnosis_cache import diagnosis_key, keep, kept_diagnosis


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    return tmp_path / 'pprs_dynamics'


class Harm:
    """Leaves a trace where it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.trace,)


def test_what_is_kept_is_found_again_in_a_folder_of_the_user_alone(folder: Path) -> None:
    diagnosis = made_up_diagnosis(effects=(found_effect('coulomb_friction'),))
    keep('key', diagnosis)
    found = kept_diagnosis('key')
    assert found is not None
    assert found.to_json() == diagnosis.to_json()
    np.testing.assert_array_equal(found.remaining, diagnosis.remaining)
    assert kept_diagnosis('other') is None
    assert folder.stat().st_mode & 0o777 == 0o700
    assert next(folder.iterdir()).stat().st_mode & 0o077 == 0


def test_a_folder_that_others_may_write_to_is_not_used(folder: Path, tmp_path: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)
    (folder / 'key.pickle').write_bytes(pickle.dumps(Harm(tmp_path / 'harm')))
    assert kept_diagnosis('key') is None
    keep('other', made_up_diagnosis())
    assert not (tmp_path / 'harm').exists()
    assert [one.name for one in folder.iterdir()] == ['key.pickle']


def test_a_link_is_not_followed(folder: Path, tmp_path: Path) -> None:
    keep('key', made_up_diagnosis())
    (folder / 'key.pickle').rename(tmp_path / 'elsewhere')
    (folder / 'key.pickle').symlink_to(tmp_path / 'elsewhere')
    assert kept_diagnosis('key') is None


@pytest.mark.parametrize('content', [b'', b'\x80\x05', pickle.dumps({'no': 'diagnosis'})])
def test_what_is_no_diagnosis_is_none(folder: Path, content: bytes) -> None:
    keep('key', made_up_diagnosis())
    (folder / 'key.pickle').write_bytes(content)
    assert kept_diagnosis('key') is None


def test_the_oldest_go_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis_cache, 'MOST_ENTRIES', 2)
    for number in range(4):
        keep(str(number), made_up_diagnosis())
        os.utime(folder / f'{number}.pickle', (number, number))
    assert sorted(one.stem for one in folder.iterdir()) == ['2', '3']


def test_a_key_belongs_to_recordings_topic_model_and_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = DriveModel.load()
    files = [str(tmp_path / name) for name in ('a.csv', 'b.csv')]
    for name in files:
        Path(name).write_text(name)
    keys = {diagnosis_key(model, files, None), diagnosis_key(model, files[:1], None),
            diagnosis_key(model, files[::-1], None), diagnosis_key(model, files, 'topic')}
    assert len(keys) == 4
    assert diagnosis_key(model, files, None) in keys
    monkeypatch.setattr(diagnosis_cache, '_code', lambda: ['changed'])
    assert diagnosis_key(model, files, None) not in keys
