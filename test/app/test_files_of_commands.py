# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Files and options of commands: what is refused before anything runs, and how commands end."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import pytest
from made_up_recordings import judged, measured

from pprs_dynamics.app.commands.arguments import number
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.measurement.files.recording import write_recording


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_recording('run.csv', judged(measured(200)))
    write_recording('bag', judged(measured(200)))
    Path('model.yaml').write_text((Path(__file__).parents[2] / 'config/paper.yaml').read_text())
    Path('soft.yaml').symlink_to('model.yaml')
    os.link('run.csv', 'hard.csv')
    Path('soft.html').symlink_to('run.csv')
    return tmp_path


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}


SAME = [
    ['compare', 'run.csv', '--json', 'twice.json', '--report', 'soft.html'],
    ['fit', 'run.csv', '--output', 'model.yaml', '--model', 'model.yaml'],
    ['fit', 'run.csv', '--output', 'soft.yaml', '--model', 'model.yaml'],
    ['adopt', 'backlash', 'run.csv', '--output', './model.yaml', '--model', 'soft.yaml'],
    ['next-experiment', 'run.csv', '--output', 'hard.csv'],
    ['simulate', '--path', 'run.csv', '--output', 'hard.csv'],
    ['survey', 'bag', '--output', 'bag'],
]


@pytest.mark.parametrize('command', SAME, ids=' '.join)
def test_an_output_is_never_an_input(
    command: list[str], folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    before = contents(folder)
    try:
        status = main(command)
    except SystemExit as end:
        status = int(str(end.code))
    said = capsys.readouterr().err
    assert status == 2, said
    assert 'must be' in said
    assert len(said.splitlines()) == 1
    assert contents(folder) == before


@pytest.mark.parametrize('command', [
    ['simulate', '--duration', '2', '--output', 'run.csv'],
    ['simulate', '--duration', '2', '--output', 'link.csv'],
    ['compare', 'run.csv', '--mcap', 'old.mcap'],
    ['next-experiment', '--purpose', 'commission', '--output', 'run.csv'],
], ids=' '.join)
def test_a_recording_that_exists_is_not_replaced(
    command: list[str], folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    (folder / 'old.mcap').write_bytes(b'a measurement')
    (folder / 'link.csv').symlink_to('run.csv')
    before = contents(folder)
    assert main(command) == 2
    said = capsys.readouterr().err
    assert f'{command[-1]}: it exists already' in said
    assert 'never replaced' in said
    assert len(said.splitlines()) == 1
    assert contents(folder) == before


def test_numbers_of_the_command_line_are_within_their_bounds() -> None:
    read = number(0.0, 2.0, 'N', above=True)
    assert read('1e-3') == 1e-3
    for text in ('0', '-1', '2.1', 'nan', 'inf', '1_0', '', '\uff11'):
        with pytest.raises(argparse.ArgumentTypeError, match='greater than 0 and at most 2 N'):
            read(text)
