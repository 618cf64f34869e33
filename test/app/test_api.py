# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`from pprs_dynamics import …`: the loop in Python, and that the commands say the same."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from documents import checked
from model_recordings import record, with_effects
from pprs_command import pprs
from single_axis import axis, axis_recording

import pprs_dynamics
from pprs_dynamics import (
    DriveModel,
    Excitation,
    PprsError,
    Recording,
    UnreadableFileError,
    adopt,
    compare,
    write_recording,
)
from pprs_dynamics.app.commands.pprs import main

ROOT = Path(__file__).parents[2]
VISCOUS = 12.0  # [N s/m], on slide_2; the model lacks it
HEAVY = {'numpy', 'scipy', 'pandas', 'rich', 'matplotlib', 'plotly', 'rclpy', 'sensor_msgs'}


def recorded(name: str, seed: int, seconds: float = 8.0) -> Recording:
    robot = with_effects(DriveModel.load(), {'viscous_friction': {'slide_2.coefficient': VISCOUS}})
    made = record(robot, 0.05, seed, Excitation(seconds, seed).motion, np.arange(0, seconds, 0.005))
    return replace(made, name=name)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('door')
    write_recording(folder / 'run.csv', recorded('run', 1))
    write_recording(folder / 'other.csv', recorded('other', 2))
    return folder


def modules_after(code: str) -> set[str]:
    said = subprocess.run([sys.executable, '-c', f'import sys\n{code}\nprint(*sys.modules)'],
                          capture_output=True, text=True, check=True, timeout=120)
    return {name.split('.')[0] for name in said.stdout.split()}


@pytest.mark.parametrize(('code', 'unwanted'), [
    ('from pprs_dynamics import PprsError, ModelError', HEAVY),
    ('import pprs_dynamics; pprs_dynamics.DriveModel.load()', HEAVY - {'numpy', 'scipy'})])
def test_importing_the_package_imports_nothing_heavy(code: str, unwanted: set[str]) -> None:
    assert not modules_after(code) & unwanted


def test_the_command_writes_the_dictionary_and_prints_the_text(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    compared = compare('config/paper.yaml', folder / 'run.csv')
    monkeypatch.setenv('COLUMNS', '100')
    assert main(['compare', str(folder / 'run.csv'), '--json', str(folder / 'run.json')]) == 0
    assert checked((folder / 'run.json').read_text(), 'compare') == json.loads(
        json.dumps(compared.to_dict()))
    printed = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert printed[:8] == [line.strip() for line in str(compared).splitlines()[:8]]


def test_what_cannot_be_read_or_is_given_twice_is_refused(folder: Path) -> None:
    run = folder / 'run.csv'
    for given, validate in (([run, run], ()), ([run], [run])):
        with pytest.raises(UnreadableFileError, match=r'run\.csv'):
            pprs_dynamics.diagnose('config/paper.yaml', given, validate)
    with pytest.raises(PprsError, match='no recording is given'):
        compare('config/paper.yaml', [])
    with pytest.raises(PprsError, match=r'nothing\.csv'):
        compare('config/paper.yaml', folder / 'nothing.csv')
    with pytest.raises(PprsError, match='viscous_friction'):
        adopt('config/paper.yaml', 'viscous_fricton', run)


@pytest.mark.parametrize('call', [compare, pprs_dynamics.diagnose, pprs_dynamics.fit])
def test_what_is_no_model_and_no_recording_is_refused_in_a_sentence(
    call: Callable[..., Any], folder: Path,
) -> None:
    for model in (None, 3, {}):
        with pytest.raises(PprsError, match=type(model).__name__):
            call(model, folder / 'run.csv')
    for recordings in (None, 3, [None], pd.DataFrame({'time': [0.0]}), np.zeros((3, 2))):
        with pytest.raises(PprsError, match='must be a path or a Recording'):
            call('config/paper.yaml', recordings)


def test_an_effect_of_an_axis_is_found_adopted_and_the_error_falls() -> None:
    """The whole loop in Python, quickly; the notebook of the robot runs before a release."""
    model, robot = axis(), axis({'drive_spring': {'stiffness': 300.0, 'position': 0.01}})
    runs = [axis_recording(robot, seed) for seed in (1, 2)]
    found = pprs_dynamics.diagnose(model, runs[0])
    assert [effect.name for effect in found.effects] == ['drive_spring']
    answer = adopt(model, 'drive_spring', runs[0], runs[1])
    assert answer.adopted
    before, after = (compare(tried, runs[1]).rms for tried in (model, answer.model))
    assert after < 0.3 * before
    for result, schema in ((found, 'diagnose'), (answer, 'adopt')):
        assert len(result.table())
        checked(json.dumps(result.to_dict()), schema)


@pytest.mark.slow
def test_the_notebook_finds_what_was_hidden_and_the_error_falls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    notebook = json.loads((ROOT / 'docs/loop.ipynb').read_text(encoding='utf-8'))
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {'__name__': '__main__'}
    for cell in notebook['cells']:
        if cell['cell_type'] == 'code':
            exec(compile(''.join(cell['source']), cell['id'], 'exec'), names)
    (hidden,) = names['run'].effects
    assert [(effect.name, list(effect.drives)) for effect in names['found'].effects] == [
        (hidden['name'], hidden['drives'])]
    assert names['answer'].adopted
    assert names['after'].rms < 0.7 * names['before'].rms
    assert DriveModel.load('better.yaml').values == names['answer'].model.values


# The command-line tool: what it writes, and how it ends.

def png_size(file: Path) -> tuple[int, int]:
    header = file.read_bytes()[:24]
    assert header[:8] == b'\x89PNG\r\n\x1a\n'
    return struct.unpack('>II', header[16:24])


@pytest.fixture(scope='module')
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('reproduce')
    done = pprs('reproduce', '--output', str(folder / 'new' / 'output'), '--json',
                str(folder / 'result.json'), cwd=folder)
    assert done.returncode == 0, done.stderr
    assert 'reproduced' in done.stdout
    return folder


def test_reproduce_writes_figures_curves_and_claims(reproduced: Path) -> None:
    output = reproduced / 'new' / 'output'
    for name in ('figure_8.png', 'figure_9.png'):
        assert min(png_size(output / name)) > 400
    content = checked((reproduced / 'result.json').read_text(), 'reproduce')
    assert content == json.loads((output / 'claims.json').read_text())
    for claim in content['claims']:
        assert set(claim) == {'claim', 'paper', 'found', 'reproduced'}
        assert isinstance(claim['reproduced'], bool)


def test_reproduce_is_honest_about_what_does_not_come_out(reproduced: Path) -> None:
    claims = json.loads((reproduced / 'result.json').read_text())['claims']
    verdicts = [claim['reproduced'] for claim in claims]
    assert verdicts == [True, True, False, False, True, True]
    # The checked figures: 24 to 28 % printed, active 0.93 N, passive 0.13 N exact and 0.00 N.
    assert 'motor 1: 29.1 %' in claims[0]['found']
    assert '0.93 N rms active, 0.13 N rms passive' in claims[1]['found']
    assert '0.000 N rms by the second' in claims[2]['found']
    assert '48.2 to 109.5 degrees' in claims[4]['found']
