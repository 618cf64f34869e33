# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A mistake of usage is one line that names it and status 2, for every command, and no file."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_recordings import judged, measured
from pprs_command import pprs

from pprs_dynamics.app.commands.pprs import COMMANDS
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import write_recording

CONFIG = Path(__file__).parents[2] / 'config'
TWICE = 'what is held out must be another recording'
ENDS = 'must end in '
# Words of the command line, and a part of the line that names what is wrong.
MISTAKES = {
    'adopt coulomb_frictoin run.csv --output x.yaml': 'did you mean coulomb_friction',
    'adopt coulomb_friction:lift_7 run.csv --output x.yaml': "unknown drive 'lift_7'",
    'adopt payload_mass:lift_1 run.csv --output x.yaml': 'must stand alone',
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
    'diagnose run.csv --adopt-all --output x.yaml --refit --reference':
        '--refit: it is given with --reference',
    'diagnose run.csv --model nowhere.yaml': 'nowhere.yaml: no such file',
    'export --output x.txt --model model.yaml': ENDS,
    'fit nowhere.csv --output x.yaml': 'nowhere.csv: No such file',
    'history model.yaml --undo': '--undo: no --output FILE is given',
    'history model.yaml --output x.yaml': '--output: it is given without --undo',
    'history model.yaml --undo --output model.yaml': 'must be another file',
    'info run.csv --json x.txt': ENDS + '.json',
    'init nowhere.urdf run.csv --output x.yaml': 'nowhere.urdf',
    'next-experiment --output x.csv': 'no recording is given',
    'next-experiment --purpose commission --output none/x.csv': 'none/x.csv',
    'reproduce': '--output',
    'reproduce --output /dev/null/below': '/dev/null/below: cannot be a folder',
    'reproduce --output x --model axis.yaml': 'must be a 3-PPRS',
    'simulate --output x.csv --noise -1': 'argument --noise: ',
    'simulate --output x.csv --seed 1.5': "'1.5' must be a whole number",
    'survey run.csv --output x --effects no_such_effect': 'no_such_effect',
    'trend nowhere': 'nowhere',
    'workbench --no-browser --host 0.0.0.0': 'one address',
    'workbench --no-browser --port 99999': '--port',
    'workbench --no-browser run.csv run.csv': 'may be given once',
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
    return folder


def test_every_command_is_tried() -> None:
    assert {words.split()[0] for words in MISTAKES} == set(COMMANDS)


@pytest.mark.parametrize('words', MISTAKES)
def test_a_mistake_is_one_line_and_status_2(given: Path, words: str) -> None:
    before = {path: path.read_bytes() for path in given.iterdir()}
    done = pprs(*words.split(), cwd=given)
    assert done.returncode == 2, done.stdout
    assert MISTAKES[words] in done.stderr
    assert done.stderr.startswith('pprs')
    assert len(done.stderr.strip().splitlines()) == 1
    assert {path: path.read_bytes() for path in given.iterdir()} == before
