# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mistake of usage is one line that names it and status 2, for every command, and no file."""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_recordings import judged, measured
from pprs_command import pprs

from pprs_dynamics.app.commands.arguments import number
from pprs_dynamics.app.commands.pprs import COMMANDS, _module, _parser, main
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import write_recording

CONFIG = Path(__file__).parents[2] / 'config'
TWICE = 'what is held out must be another recording'
ENDS = 'must end in '
# Words of the command line, and a part of the line that names what is wrong.
MISTAKES = {
    'adopt coulomb_frictoin run.csv --output x.yaml': 'did you mean coulomb_friction',
    'adopt coulomb_friction:lift_7 run.csv --output x.yaml': "unknown drive 'lift_7'",
    'adopt payload_mass:lift_1 run.csv --output x.yaml': 'must be requested without',
    'adopt payload_mass run.csv --model model.yaml --output model.yaml':
        '--output and the model at once',
    'adopt payload_mass run.csv --output none/x.yaml': 'its folder does not exist',
    'adopt payload_mass run.csv --model axis.yaml --output x.yaml': 'single axis',
    'compare empty.csv': 'empty.csv: ',
    'compare binary.csv': 'binary.csv: ',
    'diagnose': 'RECORDING',
    'diagnose run.csv --validate run.csv': TWICE,
    'diagnose run.csv --validate silent.csv': 'silent.csv: no effort of any drive',
    'diagnose run.csv --validate few.csv': 'few.csv: none of its 3 samples can be used',
    'compare silent.csv': 'silent.csv: no effort of any drive',
    'diagnose run.csv --adopt-all': '--adopt-all: no --output FILE is given',
    'diagnose run.csv --output x.yaml': '--output: it is given without --adopt-all',
    'diagnose run.csv --model nowhere.yaml': 'nowhere.yaml: no such file',
    'export --output x.txt --model model.yaml': ENDS,
    'export axis.yaml --to urdf --output single_axis.urdf':
        'single_axis.urdf: axis.yaml reads the robot from it',
    'export axis.yaml --to urdf --output x.xml': 'must end in .urdf for --to urdf',
    'export axis.yaml --to mjcf --output x.urdf': 'must end in .xml or .mjcf for --to mjcf',
    'fit nowhere.csv --output x.yaml': 'nowhere.csv: No such file',
    'history model.yaml --undo': '--undo: no --output FILE is given',
    'history model.yaml --output x.yaml': '--output: it is given without --undo',
    'history model.yaml --undo --output model.yaml': 'must be another file',
    'info': 'RECORDING',
    'info run.csv --json x.txt': ENDS + '.json',
    'init nowhere.urdf run.csv --output x.yaml': 'nowhere.urdf',
    'init single_axis.urdf model.yaml --output x.yaml': 'model.yaml: no column has numbers',
    'init single_axis.urdf run.csv --output model.yaml': 'exists already',
    'init single_axis.urdf none.csv --output x.yaml': 'none.csv',
    'init single_axis.urdf run.csv --output x.yaml --drives ,': '--drives is ,, must name joints',
    'next-experiment --output x.csv': 'no recording is given',
    'next-experiment --purpose commission --output none/x.csv': 'none/x.csv',
    'reproduce': '--output',
    'reproduce --output /dev/null/below': '/dev/null/below: Not a directory',
    'reproduce --output x --model axis.yaml': 'must be a 3-PPRS',
    'simulate --output x.csv --duration -1': 'argument --duration: ',
    'simulate --output x.csv --model axis.yaml --path helix': '--path is helix, must be excitation',
    'simulate --output x.csv --model axis.yaml --path nowhere.csv': 'must be excitation',
    'simulate --output x.csv --seed 1.5': "'1.5' must be a whole number",
    'simulate --output x.csv --model axis.yaml --effect joint_spring': 'needs a passive joint',
    'survey run.csv --output x --effects no_such_effect': 'no_such_effect',
    'trend nowhere': 'nowhere',
    'workbench --no-browser --host 0.0.0.0': 'one address',
    'workbench --no-browser --port 99999': '--port',
    'workbench --live --no-browser --ros-args -r __ns:=cell': '--ros-args: failed to initialize',
    'workbench --no-browser run.csv run.csv': 'may be given once',
    # An output that is an input, by another name or by a link.
    'compare run.csv --json twice.json --report soft.html': 'must be',
    'fit run.csv --output model.yaml --model model.yaml': 'must be',
    'fit run.csv --output soft.yaml --model model.yaml': 'must be',
    'adopt backlash run.csv --output ./model.yaml --model soft.yaml': 'must be',
    'next-experiment run.csv --output hard.csv': 'must be',
    'simulate --path run.csv --output hard.csv': 'must be',
    'survey bag --output bag': 'must be',
    # A recording that exists is never replaced.
    'simulate --duration 2 --output run.csv': 'run.csv: it exists already',
    'simulate --duration 2 --output link.csv': 'link.csv: it exists already',
    'compare run.csv --mcap old.mcap': 'old.mcap: it exists already',
    'next-experiment --purpose commission --output run.csv': 'run.csv: it exists already',
    # What was meant.
    'comapre x.csv': 'did you mean compare?',
    'compare x.csv --reprot x.html': 'did you mean --report?',
    'simulate --output x.csv --effect stribek': 'did you mean stribeck_friction?',
    'adopt stribeck_friction:slide1 x.csv --output y.yaml': 'did you mean slide_1?',
    'compare odl.mcap': 'did you mean old.mcap?',
    'info old.mcap --model wrong.yaml': 'did you mean masses.payload?',
    'info old.mcap --model arm.urdf': '`pprs init arm.urdf RECORDING',
}


@pytest.fixture(scope='module')
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('mistakes')
    write_recording(folder / 'run.csv', judged(measured(200)))
    (folder / 'empty.csv').write_text('')
    lines = (folder / 'run.csv').read_text().splitlines()
    (folder / 'few.csv').write_text('\n'.join(lines[:4]))
    write_recording(folder / 'silent.csv', replace(
        judged(measured(300)), effort=np.full((300, len(DRIVES)), np.nan)))
    (folder / 'short.csv').write_text('time,a\n1,2\n')
    (folder / 'binary.csv').write_bytes(bytes(range(256)) * 20)
    shutil.copy(CONFIG / 'paper.yaml', folder / 'model.yaml')
    shutil.copy(CONFIG / 'single_axis.yaml', folder / 'axis.yaml')
    shutil.copy(CONFIG / 'single_axis.urdf', folder / 'single_axis.urdf')
    write_recording(folder / 'bag', judged(measured(200)))
    for link, target in (('soft.yaml', 'model.yaml'), ('soft.html', 'run.csv'),
                         ('link.csv', 'run.csv')):
        (folder / link).symlink_to(target)
    os.link(folder / 'run.csv', folder / 'hard.csv')
    (folder / 'old.mcap').write_bytes(b'a measurement')
    (folder / 'arm.urdf').write_text('<robot name="arm"/>')
    (folder / 'wrong.yaml').write_text('/**:\n  ros__parameters:\n    masses: {paylod: 1.0}\n')
    return folder


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}


def test_every_command_is_tried() -> None:
    assert set(COMMANDS) <= {words.split()[0] for words in MISTAKES}


@pytest.mark.parametrize('words', MISTAKES)
def test_a_mistake_is_one_line_and_status_2(given: Path, words: str) -> None:
    before = contents(given)
    done = pprs(*words.split(), cwd=given)
    assert done.returncode == 2, done.stdout
    assert MISTAKES[words] in done.stderr
    assert done.stderr.startswith('pprs')
    assert len(done.stderr.strip().splitlines()) == 1
    assert contents(given) == before


def test_numbers_of_the_command_line_are_within_their_bounds() -> None:
    read = number(0.0, 2.0, 'N', above=True)
    assert read('1e-3') == 1e-3
    for text in ('0', '-1', '2.1', 'nan', 'inf', '1_0', '', '\uff11'):
        with pytest.raises(argparse.ArgumentTypeError, match='greater than 0 and at most 2 N'):
            read(text)


# What `pprs` says to somebody who does not know it: help, what was meant, completion.

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
