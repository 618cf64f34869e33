# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`make demo`: the whole story with real commands, and what it says when there is no answer."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import diagnosis_demo
import numpy as np
import pytest
from before_after import draw_before_after
from diagnosis_demo import REFUSED, Story
from pprs_command import pprs
from rich.console import Console

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.measurement.files.recording import read_recording

pytestmark = pytest.mark.slow

DEMO = Path(diagnosis_demo.__file__)
SEED, DURATION = 26, 8.0  # [s]
REVEALED = 'What was hidden'


def error_on(model: DriveModel, recording: Path) -> float:
    error = measure_residuals(model, [read_recording(recording)])[0].error
    return float(np.sqrt(np.mean(error ** 2)))


def test_the_error_falls_and_the_secret_is_told_last(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(DEMO), str(tmp_path), '--seed', str(SEED), '--duration',
         str(DURATION)], capture_output=True, text=True, env={**os.environ, 'COLUMNS': '160'})
    assert done.returncode == 0, done.stdout + done.stderr
    hidden, = json.loads((tmp_path / 'truth.json').read_text())['effects']
    before, after = done.stdout.split(REVEALED)
    assert hidden['name'] not in before.split('pprs diagnose')[0]
    assert f'{hidden["name"]} was hidden, and {hidden["name"]} was found.' in after
    for command in ('simulate', 'compare', 'diagnose', f'adopt {hidden["name"]}', 'history'):
        assert f'$ pprs {command}' in before
    opens = shlex.split(next(line for line in after.splitlines() if ' workbench ' in line))
    assert opens[2:] == ['workbench', str(tmp_path / 'run.mcap'), '--validate',
                         str(tmp_path / 'other.mcap')]
    assert Path(opens[1]).exists()
    assert f'--seed {SEED}' in after
    # On the motion that was never fitted, evaluated here again: the error falls to the noise,
    # which is that of the same robot on the same motion with nothing hidden.
    assert pprs('simulate', '--output', tmp_path / 'clean.mcap', '--seed', SEED, '--path-seed', 1,
                '--duration', DURATION).returncode == 0
    paper, adopted = (DriveModel.load(model)
                      for model in ('config/paper.yaml', tmp_path / 'adopted.yaml'))
    noise = error_on(paper, tmp_path / 'clean.mcap')
    assert error_on(paper, tmp_path / 'other.mcap') > 1.2 * noise
    assert error_on(adopted, tmp_path / 'other.mcap') < 1.05 * noise
    for file in ('demo.png', 'before.html', 'why.html', 'after.html'):
        assert (tmp_path / file).stat().st_size > 10_000


def test_nothing_is_claimed_where_nothing_is_hidden(tmp_path: Path) -> None:
    # Sampling does not resolve the simulated robot's reversals: what that leaves is no delay.
    run, answer = tmp_path / 'run.mcap', tmp_path / 'why.json'
    for arguments in (['simulate', '--output', run, '--seed', '1', '--duration', '40'],
                      ['diagnose', run, '--json', answer]):
        assert pprs(*arguments).returncode == 0
    said = json.loads(answer.read_text())
    assert (said['verdict'], said['effects']) == ('adequate', [])


HIDDEN: dict[str, Any] = {'name': 'viscous_friction', 'drives': ['lift_1']}
FOREIGN = {'name': 'vibration', 'drives': ['lift_1']}


def answer(verdict: str, *effects: str, rivals: list[list[str]] | None = None,
           suspects: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the keys of why.json that the story reads."""
    return {'verdict': verdict,
            'effects': [{'name': name, 'drives': ['lift_1']} for name in effects],
            'indistinguishable': rivals or [], 'suspects': [{'name': name} for name in suspects]}


@pytest.mark.parametrize(('hidden', 'diagnosis', 'said'), [
    (HIDDEN, answer('effect', 'viscous_friction'), 'and viscous_friction was found.'),
    (HIDDEN, answer('effect', 'viscous_friction', 'base_tilt'),
     'base_tilt beside it is not in the robot.'),
    ({**HIDDEN, 'drives': ['lift_1', 'lift_2']}, answer('effect', 'viscous_friction'),
     'but on lift_1 instead of lift_1, lift_2.'),
    (HIDDEN, answer('unknown', 'viscous_friction'), 'that something unknown remains is wrong.'),
    (HIDDEN, answer('ambiguous', 'tool_drag', rivals=[['tool_drag', 'viscous_friction']]),
     'among those that this motion cannot tell apart'),
    (HIDDEN, answer('effect', 'tool_drag'), 'tool_drag was named: that is wrong'),
    (HIDDEN, answer('adequate'), 'too weak'),
    (HIDDEN, answer('adequate', suspects=('viscous_friction',)), 'was suspected only'),
    (HIDDEN, answer('unknown'), 'something unknown remains'),
    (FOREIGN, answer('unknown'), 'and unknown was the answer.'),
    (FOREIGN, answer('unknown', 'base_tilt'), 'base_tilt, which was added, is not in the robot'),
    (FOREIGN, answer('effect', 'base_tilt'), 'base_tilt was named: that is wrong'),
])
def test_the_verdict_on_the_diagnosis_is_honest(
    hidden: dict[str, Any], diagnosis: dict[str, Any], said: str,
) -> None:
    assert said in diagnosis_demo._judged(hidden, diagnosis)


@pytest.fixture
def story(tmp_path: Path) -> Story:
    return Story(Console(record=True, width=100, file=(tmp_path / 'said').open('w')), tmp_path)


@pytest.mark.parametrize(('verdict', 'said'), [
    ('adequate', 'the model is adequate'), ('unknown', 'no effect of the catalogue')])
def test_with_nothing_found_nothing_is_added(story: Story, verdict: str, said: str) -> None:
    assert diagnosis_demo.adopt(story, answer(verdict)) is False
    assert said in story.console.export_text()


def test_a_refusal_is_told_and_the_model_stays(
    story: Story, monkeypatch: pytest.MonkeyPatch,
) -> None:
    commands: list[str] = []

    def refuse(*arguments: str, accepted: tuple[int, ...] = (0,)) -> int:
        commands.append(arguments[0])
        assert REFUSED in accepted
        return REFUSED

    monkeypatch.setattr(story, 'run', refuse)
    assert diagnosis_demo.adopt(story, answer('effect', 'viscous_friction')) is False
    assert commands == ['adopt']
    assert 'Refused' in story.console.export_text()


def test_a_command_that_fails_ends_the_story(story: Story) -> None:
    with pytest.raises(SystemExit, match='status 2'):
        story.run('compare', str(story.folder / 'none.mcap'))


def test_the_picture_stands_without_an_added_effect(tmp_path: Path) -> None:
    time = np.arange(0, 3.0, 0.01)
    measured = np.random.default_rng(0).normal(0, 1, (len(time), len(DRIVES)))
    residuals = Residuals(DRIVES, time, np.zeros(len(time), int), measured, 0 * measured)
    picture = draw_before_after(tmp_path / 'demo.png', residuals, None, 0.1, 'a sentence')
    assert picture.stat().st_size > 10_000
