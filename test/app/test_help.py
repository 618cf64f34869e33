# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What `pprs` says to somebody who does not know it: help, what was meant, completion."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from pprs_dynamics.app.commands.pprs import COMMANDS, _module, _parser, main


def said(capsys: pytest.CaptureFixture[str]) -> str:
    captured = capsys.readouterr()
    return ' '.join((captured.out + captured.err).split())


def test_alone_it_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    text = said(capsys)
    assert text.startswith('usage: pprs')
    assert all(command in text for command in COMMANDS)


@pytest.mark.parametrize('command', COMMANDS)
def test_help_ends_with_an_example_that_the_command_takes(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    example = shlex.split(_module(command).EXAMPLE)
    assert example[:2] == ['pprs', command]
    with pytest.raises(SystemExit) as ended:
        main([command, '--help'])
    assert ended.value.code == 0
    assert said(capsys).endswith(f'example: {" ".join(example)}')
    assert _parser(example[1:]).parse_args(example[1:]).command == command


def test_without_a_model_a_recording_of_another_robot_names_init_and_demo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    run = tmp_path / 'run.csv'
    run.write_text('time,elbow/position,elbow/effort\n0,0,1\n0.01,0,1\n0.02,0,1\n')
    assert main(['compare', str(run)]) == 2
    text = said(capsys)
    assert 'no --model is given' in text
    assert '`pprs init ' in text
    assert '--demo' in text


@pytest.mark.parametrize(('line', 'word'), [
    ('pprs comp', 'compare'), ('pprs compare --rep', '--report'), ('pprs adopt strib', 'stribeck'),
    ('pprs simulate --effect payload_m', 'payload_mass')])
def test_a_shell_completes_commands_options_and_effects(
    line: str, word: str, tmp_path: Path,
) -> None:
    # As the function does that register-python-argcomplete gives to bash, zsh and fish.
    pytest.importorskip('argcomplete')
    done = subprocess.run(
        [sys.executable, '-m', 'pprs_dynamics.app.commands.pprs'], check=False, timeout=60,
        env={**os.environ, '_ARGCOMPLETE': '1', 'COMP_LINE': line, 'COMP_POINT': str(len(line)),
             '_ARGCOMPLETE_STDOUT_FILENAME': str(tmp_path / 'found')})
    assert done.returncode == 0
    assert word in (tmp_path / 'found').read_text()
