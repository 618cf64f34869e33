# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What commands print and write: for every terminal, pipe and file name."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from model_recordings import record, with_effects
from pprs_command import pprs
from ros_processes import executable

from pprs_dynamics import DriveModel
from pprs_dynamics.app.report import terminal
from pprs_dynamics.app.report.terminal import as_text, shell_command, stacked, verdict_panel
from pprs_dynamics.measurement.files.recording import write_recording
from pprs_dynamics.physics.model.model_writer import format_model
from pprs_dynamics.physics.model.parameter_file import default_parameters

# A drive force that the model lacks, so that commands have something to say.
VISCOUS = 12.0  # [N s/m]
UNDECODABLE = os.fsdecode(b'bad\xff[m].csv')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the recording run.csv."""
    folder = tmp_path_factory.mktemp('terminal')
    robot = with_effects(DriveModel.load(), {'viscous_friction': {'slide_2.coefficient': VISCOUS}})
    write_recording(folder / 'run.csv', record(robot, 0.05))
    (folder / 'model.yaml').write_text(format_model(default_parameters()), encoding='utf-8')
    return folder


def process(
    folder: Path, *arguments: str, redirect: str = '', **variables: str,
) -> subprocess.CompletedProcess[bytes]:
    """Run the command in a shell, which closes or redirects streams."""
    return subprocess.run(
        ['sh', '-c', f'"$@" {redirect}', 'sh', executable('pprs'), *arguments], cwd=folder,
        capture_output=True, timeout=300, env={**os.environ, **variables})


COMMANDS = {
    'info': ('info', 'run.csv'),
    'compare': ('compare', 'run.csv', '--json', '{name}.json', '--report', '{name}.html')}


@pytest.mark.parametrize(('stream', 'command'), [('ascii', 'info'), ('latin-1', 'compare')])
def test_a_terminal_that_is_not_utf_8_gets_plain_characters(
    folder: Path, stream: str, command: str,
) -> None:
    arguments = [word.format(name=f'{command}-{stream}') for word in COMMANDS[command]]
    done = pprs(*arguments, cwd=folder, encoding=stream)
    assert done.returncode == 0, done.stderr
    assert_plain(done.stdout, command)


def assert_plain(text: str, command: str) -> None:
    """Assert that nothing was lost to the encoding."""
    assert len(text.splitlines()) >= 1
    assert '?' not in text
    assert '\\u' not in text
    if command == 'info':
        assert '-0.0' in text
        assert ' ... ' in text
        # Every line of the table is as wide as its frame.
        widths = {len(line) for line in text.splitlines() if line.startswith(('|', '+'))}
        assert len(widths) == 1


def test_a_reader_that_goes_away_does_not_take_the_files_with_it(folder: Path) -> None:
    answer = folder / 'read.json'
    answer.unlink(missing_ok=True)
    done = process(folder, 'compare', 'run.csv', '--json', answer.name,
                   redirect=f'| true; test -s {answer.name}')
    assert done.returncode == 0
    assert b'Traceback' not in done.stderr
    assert b'pipe' not in done.stderr


@pytest.mark.parametrize('command', ['info', 'compare'])
def test_names_of_files_are_shown_and_written_as_they_are(folder: Path, command: str) -> None:
    shutil.copy(folder / 'run.csv', folder / 'x[bold].csv')
    page = ['--report', 'x[bold].html'] if command == 'compare' else []
    done = pprs(command, 'x[bold].csv', *page, '--json', 'name.json', cwd=folder)
    assert done.returncode == 0, done.stderr
    assert ('page: x[bold].html' if page else 'x[bold].csv: ') in done.stdout


def test_a_name_that_is_no_text_is_shown_and_written_with_its_bytes(folder: Path) -> None:
    shutil.copy(folder / 'run.csv', folder / UNDECODABLE)
    done = process(folder, 'info', UNDECODABLE, '--json', 'name.json')
    assert done.returncode == 0, done.stderr
    assert 'bad\\xff[m].csv: ' in done.stdout.decode()
    content = json.loads((folder / 'name.json').read_text(encoding='utf-8'))
    assert content['recordings'][0]['name'] == 'bad\\xff[m].csv'


def test_sentences_wrap_between_words_and_commands_stay_on_one_line() -> None:
    sentence = 'With it the error falls from 0.123 N to 0.039 N, which is the noise. ' * 3
    command = f'pprs adopt drive_inertia {"folder/" * 12}run.mcap --output better.yaml'
    lines = as_text(stacked(sentence, verdict_panel('effect', 'cyan', sentence),
                            shell_command(command)), 80).splitlines()
    assert f'  {command}' in lines
    assert as_text(shell_command(command), 80).splitlines() == [f'  {command}'], 'printed alone'
    text = [line.strip('│ ') for line in lines if command not in line and '─' not in line]
    assert max(map(len, text)) <= 80
    assert ' '.join(' '.join(text).split()) == ' '.join(f'{sentence}{sentence}'.split())


def test_long_work_leaves_lines_in_a_log(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(terminal, 'LOGGED_EVERY', 0.02)
    screen = terminal.console()
    with terminal.staged_bar(screen) as show:
        show('diagnosing', 0.3)
        time.sleep(0.2)
    assert 'diagnosing 30% after 0 s' in capsys.readouterr().err.splitlines()
