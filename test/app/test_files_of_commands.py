# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Files and options of commands: what is refused before anything runs, and how commands end."""

from __future__ import annotations

import argparse
import errno
import os
import signal
import warnings
from pathlib import Path
from typing import Any

import pytest
from made_up_recordings import judged, measured

from pprs_dynamics.app.commands import info
from pprs_dynamics.app.commands.arguments import (
    INPUTS,
    OUTPUTS,
    RECORDING,
    number,
    output_file,
)
from pprs_dynamics.app.commands.pprs import COMMANDS, _parser, main
from pprs_dynamics.app.workbench.server.offered import is_folder
from pprs_dynamics.measurement.files.recording import write_recording
from pprs_dynamics.system.output_files import scratch_folder


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_recording('run.csv', judged(measured(200)))
    write_recording('bag', judged(measured(200)))
    Path('model.yaml').write_text((Path(__file__).parents[2] / 'config/paper.yaml').read_text())
    os.link('model.yaml', 'hard.yaml')
    Path('soft.yaml').symlink_to('model.yaml')
    os.link('run.csv', 'hard.csv')
    os.link('run.csv', 'hard.json')
    Path('soft.html').symlink_to('run.csv')
    Path('once.json').symlink_to('twice.json')
    return tmp_path


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}


SAME = [
    ['compare', 'run.csv', '--json', 'hard.json'],
    ['compare', 'run.csv', '--json', 'twice.json', '--report', 'soft.html'],
    ['info', 'bag', '--json', 'bag/run.json'],
    ['fit', 'run.csv', '--output', 'model.yaml', '--model', 'model.yaml'],
    ['fit', 'run.csv', '--output', 'soft.yaml', '--model', 'model.yaml'],
    ['diagnose', 'run.csv', '--adopt-all', '--output', 'hard.yaml', '--model', 'model.yaml'],
    ['adopt', 'backlash', 'run.csv', '--output', 'bag/metadata.yaml', '--validate', 'bag'],
    ['adopt', 'backlash', 'run.csv', '--output', './model.yaml', '--model', 'soft.yaml'],
    ['history', 'model.yaml', '--undo', '--output', 'hard.yaml'],
    ['next-experiment', 'run.csv', '--output', 'hard.csv'],
    ['simulate', '--path', 'run.csv', '--output', 'hard.csv'],
    ['survey', 'bag', '--output', 'bag'],
]


@pytest.mark.parametrize('command', SAME, ids=' '.join)
def test_an_output_is_never_an_input(
    command: list[str], folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    if command[0] == 'info':
        os.link('hard.json', 'bag/run.json')
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


@pytest.mark.parametrize('names', [('x.json', './x.json'), ('once.json', 'twice.json')])
def test_two_outputs_are_never_one(
    names: tuple[str, str], folder: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(info, 'add_arguments', lambda parser: parser.add_argument(
        '--report', type=output_file('.json')))
    assert main(['info', '--json', names[0], '--report', names[1]]) == 2
    assert '--report and --json at once, must be another file' in capsys.readouterr().err


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


def test_every_option_that_names_files_is_known_to_the_check() -> None:
    """A new option with a file must be told to be read or written."""
    known = {*OUTPUTS, *INPUTS}
    for name in COMMANDS:
        parser = _parser([name])
        (commands,) = [one for one in parser._actions
                       if isinstance(one, argparse._SubParsersAction)]
        files = {one.dest for one in commands.choices[name]._actions
                 if any(word in str(one.metavar) for word in ('FILE', 'RECORDING', 'STORE', 'DIR'))}
        assert files <= known, name


@pytest.mark.parametrize(('arguments', 'said'), [
    (['info', 'run.csv', '--json', f'{"a" * 300}.json'], 'File name too long'),
    (['info', f'{"a" * 300}.csv'], 'File name too long'),
    (['info', 'run.csv', '--model', f'{"a" * 300}.yaml'], 'File name too long'),
    (['info', 'pipe.csv'], 'pipe.csv: it is a pipe, must be a file'),
    (['info', 'run.csv', '--model', 'pipe.csv'], 'pipe.csv: it is a pipe, must be a file'),
    (['info', 'run.csv', '--model=--'], 'argument --model: expected one argument'),
    (['simulate', '--output', 'pipe.csv'], 'pipe.csv: cannot be written: it is a pipe'),
    (['simulate', '--output', 'x.csv', '--duration', '1_0'], "'1_0' must lie between"),
    (['simulate', '--output', 'x.csv', '--seed', '\uff11'], "'\uff11' must be a whole number"),
])
def test_mistakes_are_one_sentence(
    arguments: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    os.mkfifo('pipe.csv')
    try:
        status = main(arguments)
    except SystemExit as end:
        status = int(str(end.code))
    answer = capsys.readouterr().err
    assert status == 2
    assert said in answer
    assert len(answer.splitlines()) == 1


@pytest.mark.parametrize(('error', 'said', 'status'), [
    (OSError('no reason'), 'pprs info: no reason', 2),
    (OSError(), 'pprs info: OSError', 2),
    (OSError(errno.ENOSPC, 'No space left', 'x\x1b.csv'), 'pprs info: x\\x1b.csv: No space', 2),
    (KeyboardInterrupt(), 'pprs info: interrupted', 130),
    (MemoryError(), 'pprs info: there is not enough memory', 2)])
def test_whatever_ends_a_command_is_one_sentence(
    error: BaseException, said: str, status: int, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(options: Any) -> int:
        raise error
    monkeypatch.setattr(info, 'run', fail)
    assert main(['info', 'x']) == status
    answer = capsys.readouterr().err
    assert answer.startswith(said)
    assert len(answer.splitlines()) == 1


def test_a_warning_of_a_library_is_one_line_without_our_files(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    def warn(options: Any) -> int:
        warnings.simplefilter('always')
        warnings.warn('invalid value\nencountered', RuntimeWarning, stacklevel=1)
        return 0
    monkeypatch.setattr(info, 'run', warn)
    assert main(['info', 'x']) == 0
    assert capsys.readouterr().err == 'pprs: warning: invalid value encountered\n'


def test_numbers_of_the_command_line_are_within_their_bounds() -> None:
    read = number(0.0, 2.0, 'N', above=True)
    assert read('1e-3') == 1e-3
    for text in ('0', '-1', '2.1', 'nan', 'inf', '1_0', '', '\uff11'):
        with pytest.raises(argparse.ArgumentTypeError, match='greater than 0 and at most 2 N'):
            read(text)


def test_a_command_that_is_terminated_leaves_nothing_half_written(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(_: argparse.Namespace) -> int:
        with scratch_folder(tmp_path / 'bag') as folder:
            (folder / 'half').write_text('x')
            os.kill(os.getpid(), signal.SIGTERM)
        return 0

    monkeypatch.setattr(info, 'run', run)
    # Without a handler of its own the test would end here, not fail.
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as end:
            main(['info', str(tmp_path / 'any.csv')])
    finally:
        signal.signal(signal.SIGTERM, before)
    assert end.value.code == 128 + signal.SIGTERM
    assert list(tmp_path.iterdir()) == []


def test_a_device_is_told_to_be_one_where_a_bag_may_be_a_folder() -> None:
    with pytest.raises(argparse.ArgumentTypeError, match='it is a device, must be a file'):
        output_file(*RECORDING)('/dev/null')


def test_an_empty_name_is_no_folder_of_the_workbench() -> None:
    assert not is_folder('')
    assert is_folder('.')
