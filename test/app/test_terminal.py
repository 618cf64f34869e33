# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What commands print and write: for every terminal, pipe and file name."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from pprs_command import pprs
from ros_processes import executable

from pprs_dynamics import DriveModel
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.model_writer import format_model
from pprs_dynamics.physics.model.parameter_file import default_parameters

RATE, DURATION = 200.0, 8.0
# A drive force that the model lacks, so that commands have something to say.
VISCOUS = 12.0  # [N s/m]
BOXES = '┃│━─┏┓'
UNDECODABLE = os.fsdecode(b'bad\xff[m].csv')
NAMES = ('x[bold].csv', 'a:bug:.csv', UNDECODABLE, 'line\nbreak.csv')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the recording run.csv."""
    folder = tmp_path_factory.mktemp('terminal')
    model = DriveModel.load()
    motion = Excitation(DURATION).motion(np.arange(0.0, DURATION, 1 / RATE))
    forces = model.drive_forces(motion)
    q, q_dot = forces.mechanism.position, forces.mechanism.velocity
    noise = np.random.default_rng(0).normal(0, 0.05, q.shape)
    effort = forces.total + noise
    effort[:, 1] += VISCOUS * q_dot[:, 1]
    write_recording(folder / 'run.csv', Recording.from_arrays(
        'run', motion.time, np.round(q, 6), q_dot, effort))
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
    'compare': ('compare', 'run.csv', '--json', '{name}.json', '--report', '{name}.html'),
    'diagnose': ('diagnose', 'run.csv', '--json', '{name}.json'),
    'adopt': ('adopt', 'viscous_friction', 'run.csv', '--output', '{name}.yaml'),
    'history': ('history', 'model.yaml', '--report', '{name}.html'),
    'reproduce': ('reproduce', '--output', '{name}')}


@pytest.mark.parametrize('stream', ['ascii', 'latin-1'])
@pytest.mark.parametrize('command', ['info', 'compare', 'reproduce', 'history'])
def test_a_terminal_that_is_not_utf_8_gets_plain_characters(
    folder: Path, stream: str, command: str,
) -> None:
    arguments = [word.format(name=f'{command}-{stream}') for word in COMMANDS[command]]
    done = pprs(*arguments, cwd=folder, encoding=stream)
    assert done.returncode == 0, done.stderr
    assert_plain(done.stdout, command)


@pytest.mark.parametrize('variables', [{'LC_ALL': 'POSIX'}, {'PYTHONIOENCODING': 'ascii'}],
                         ids=' '.join)
@pytest.mark.parametrize('command', ['info', 'compare'])
def test_an_environment_that_says_so_makes_it_such_a_terminal(
    folder: Path, variables: dict[str, str], command: str,
) -> None:
    arguments = [word.format(name=f'{command}-{"".join(variables)}') for word in COMMANDS[command]]
    done = process(folder, *arguments, PYTHONUTF8='', **variables)
    assert done.returncode == 0, done.stderr
    assert_plain(done.stdout.decode('ascii'), command)


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


@pytest.mark.parametrize('command', ['diagnose', 'adopt'])
def test_work_of_seconds_is_not_lost_to_a_terminal(folder: Path, command: str) -> None:
    arguments = [word.format(name=command) for word in COMMANDS[command]]
    done = process(folder, *arguments, LC_ALL='POSIX', PYTHONUTF8='')
    assert done.returncode == 0, done.stderr
    assert '+/-' in done.stdout.decode('ascii')


def test_utf_8_terminals_keep_their_characters(folder: Path) -> None:
    for variables in ({'LC_ALL': 'C.UTF-8'}, {'LC_ALL': 'POSIX', 'PYTHONUTF8': '1'}):
        text = process(folder, 'info', 'run.csv', **variables).stdout.decode('utf-8')
        assert all(character in text for character in '┃│━…')


def test_headings_keep_their_units(folder: Path) -> None:
    info = pprs('info', 'run.csv', cwd=folder).stdout
    for heading in ('position [m]', 'velocity [m/s]', 'effort [N]'):
        assert heading in info
    compared = pprs('compare', 'run.csv', cwd=folder).stdout
    assert 'rms [N]' in compared


@pytest.mark.parametrize('redirect', ['>&-', '2>&-', '>&- 2>&-', '<&- >&- 2>&-'])
def test_closed_streams_do_not_end_the_work(folder: Path, redirect: str) -> None:
    answer = folder / 'closed.json'
    answer.unlink(missing_ok=True)
    done = process(folder, 'info', 'run.csv', '--json', answer.name, redirect=redirect)
    assert done.returncode == 0, done.stderr
    assert done.stderr == b''
    # No text of the terminal in a file that took the place of a closed stream.
    assert json.loads(answer.read_text())['recordings'][0]['name'] == 'run.csv'


@pytest.mark.parametrize('redirect', ['| head -n 1', '| true'])
def test_a_reader_that_goes_away_does_not_take_the_files_with_it(
    folder: Path, redirect: str,
) -> None:
    answer = folder / 'read.json'
    answer.unlink(missing_ok=True)
    done = process(folder, 'compare', 'run.csv', '--json', answer.name,
                redirect=f'{redirect}; test -s {answer.name}')
    assert done.returncode == 0
    assert done.stderr == b''


def test_a_full_disk_behind_the_text_is_one_sentence_and_the_files_are_there(
    folder: Path,
) -> None:
    answer = folder / 'full.json'
    done = process(folder, 'info', 'run.csv', '--json', answer.name, redirect='> /dev/full')
    assert done.returncode == 2
    assert done.stderr == b'pprs info: output: No space left on device\n'
    assert json.loads(answer.read_text())


@pytest.mark.parametrize('name', NAMES)
def test_names_of_files_are_shown_and_written_as_they_are(folder: Path, name: str) -> None:
    (folder / 'x[').mkdir(exist_ok=True)
    shown = name.replace(UNDECODABLE, 'bad\\xff[m].csv').replace('\n', '\\n')
    shutil.copy(folder / 'run.csv', folder / name)
    done = process(folder, 'info', name, '--json', 'name.json')
    assert done.returncode == 0, done.stderr
    assert f'{shown}: ' in done.stdout.decode()
    content = json.loads((folder / 'name.json').read_text(encoding='utf-8'))
    assert content['recordings'][0]['name'] == shown
    page = name.replace('.csv', '.html')
    done = process(folder, 'compare', name, '--report', page, '--json',
                name.replace('.csv', '.json'))
    assert done.returncode == 0, done.stderr
    assert f'page: {shown.replace(".csv", ".html")}' in done.stdout.decode()
    (folder / page).read_text(encoding='utf-8')


def test_a_closing_tag_in_a_path_is_no_markup(folder: Path) -> None:
    (folder / 'x[').mkdir(exist_ok=True)
    shutil.copy(folder / 'run.csv', folder / 'x[' / '].csv')
    for command in ('info', 'compare'):
        done = process(folder, command, 'x[/].csv')
        assert done.returncode == 0, done.stderr
    done = process(folder, 'info', 'x[/]none.csv')
    assert done.returncode == 2
    assert done.stderr.startswith(b'pprs info: x[/]none.csv: ')


def test_names_in_the_ledger_and_on_the_page_of_an_adoption(folder: Path) -> None:
    shutil.copy(folder / 'run.csv', folder / UNDECODABLE)
    done = process(folder, 'adopt', 'viscous_friction:slide_2', UNDECODABLE, '--output', 'bad.yaml',
                '--report', 'adopt.html', '--json', 'adopt.json')
    assert done.returncode == 0, done.stderr
    done = process(folder, 'history', 'bad.yaml', '--json', 'history.json')
    assert done.returncode == 0, done.stderr
    assert 'bad\\xff[m].csv' in done.stdout.decode()
    steps = json.loads((folder / 'history.json').read_text(encoding='utf-8'))['steps']
    assert steps[0]['recordings'] == ['bad\\xff[m].csv']


def test_a_model_file_of_an_undecodable_name(folder: Path) -> None:
    name = os.fsdecode(b'model\xfe.yaml')
    shutil.copy(folder / 'model.yaml', folder / name)
    done = process(folder, 'history', name, '--report', 'history.html')
    assert done.returncode == 0, done.stderr
    assert 'model\\xfe.yaml' in (folder / 'history.html').read_text(encoding='utf-8')
    done = process(folder, 'info', 'run.csv', '--model', os.fsdecode(b'none\xfe.yaml'))
    assert done.returncode == 2
    assert done.stderr.startswith(b'pprs info: none\\xfe.yaml: no such file')


@pytest.mark.parametrize('place', [('info', '{}.csv'), ('info', 'a.csv', '--model', '{}.yaml'),
                                   ('simulate', '--output', '{}.csv'), ('info', '--topic={}')])
def test_a_name_that_would_fill_the_screen_is_shortened(
    place: tuple[str, ...], capsys: pytest.CaptureFixture[str],
) -> None:
    from pprs_dynamics.app.commands.pprs import main

    with contextlib.suppress(SystemExit):
        assert main([part.format('a' * 5000) for part in place]) == 2
    said = capsys.readouterr().err
    assert 0 < len(said) < 900


def test_without_a_terminal_progress_is_a_line_on_stderr_from_time_to_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    from pprs_dynamics.app.report import terminal

    monkeypatch.setattr(terminal, 'LOGGED_EVERY', 0.02)
    with terminal.staged_bar(terminal.console()) as progress:
        progress('diagnosing', 0.25)
        deadline = time.monotonic() + 10.0
        said = ''
        while 'diagnosing 25%' not in said and time.monotonic() < deadline:
            said += capsys.readouterr().err
    assert re.search(r'^diagnosing 25% after \d+ s$', said, re.M)
    time.sleep(0.1)
    capsys.readouterr()
    time.sleep(0.1)
    assert capsys.readouterr().err == ''
