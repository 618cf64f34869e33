# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding an effect: files in, files out, through the commands; and what is refused, and why."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_recordings import record
from pprs_command import pprs
from single_axis import axis, axis_recording

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.inference.adoption import adopt as adopting
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.adoption import Adoption, LedgerBook, RecordingEntry
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model
from pprs_dynamics.physics.model.parameter_file import default_parameters, read_parameters

HIDDEN, WRONG = 'coulomb_friction', 'drive_spring'
DURATION = 10.0  # [s]
NOISE = 0.05  # [N]


@dataclass
class Files:
    """A robot with hidden friction: its model, two recordings, and what adopt said of them."""

    folder: Path
    model: Path
    first: Path
    second: Path
    other_robot: Recording
    new: Path
    answer: dict[str, Any]
    text: str
    recordings: tuple[Recording, Recording]
    diagnosis: Diagnosis


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp('adopt')
    robot = axis({HIDDEN: {'force': 1.2}})
    recordings = axis_recording(robot, 1), axis_recording(robot, 2)
    for name, recording in zip(('first', 'second'), recordings, strict=True):
        write_recording(folder / f'{name}.csv', recording)
    model, new = folder / 'model.yaml', folder / 'new.yaml'
    write_model(model, axis().values, 'config/single_axis.yaml')
    made: list[Diagnosis] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(adopting, 'diagnose', lambda *arguments, **options: made.append(
            diagnose(*arguments, **options)) or made[0])
        done = pprs('adopt', HIDDEN, folder / 'first.csv', '--validate', folder / 'second.csv',
                    '--model', model, '--output', new, '--json', folder / 'answer.json',
                    '--report', folder / 'page.html')
    assert done.returncode == 0, done.stdout + done.stderr
    return Files(folder, model, folder / 'first.csv', folder / 'second.csv',
                 axis_recording(axis(), 2), new, json.loads((folder / 'answer.json').read_text()),
                 done.stdout, recordings, *made)


def error_on(model: Path, recording: Recording) -> float:
    error = measure_residuals(DriveModel.load(model), [recording])[0].error
    return float(np.sqrt(np.nanmean(error ** 2)))


def test_the_effect_is_added_and_the_error_falls_on_data_that_was_not_fitted(files: Files) -> None:
    answer = files.answer
    assert answer['adopted'] is True
    assert answer['held_out_after'] < 0.5 * answer['held_out_before']
    assert answer['error_after'] < 1.1 * answer['noise_floor']
    # What was promised is what the written file does.
    for file, before_or_after in ((files.model, 'before'), (files.new, 'after')):
        for recording, what in zip(files.recordings, ('error', 'held_out'), strict=True):
            assert answer[f'{what}_{before_or_after}'] == pytest.approx(
                error_on(file, recording), rel=1e-3)
    assert HIDDEN in files.text
    assert 'adopted' in files.text
    assert 'plotly' in (files.folder / 'page.html').read_text()


def test_the_ledger_says_what_from_which_data_and_how_sure(files: Files) -> None:
    step, = read_steps(read_parameters(files.new))
    assert step.effect == HIDDEN
    assert step.sha256 == (fingerprint(files.first),)
    assert step.validation == ('second.csv',)
    assert (step.error_before, step.held_out_after) == pytest.approx(
        (files.answer['error_before'], files.answer['held_out_after']), rel=1e-5)
    assert not step.forced
    for name, value, std in zip(step.parameters, step.values, step.std, strict=True):
        assert read_parameters(files.new)[f'effects.{HIDDEN}.{name}'] == value
        assert 0 < std < abs(value)


def requested(files: Files, text: str, *validation: Recording, **options: Any) -> Adoption:
    model = DriveModel.load(files.model)
    return adopt(model, EffectRequest.of(text, model), files.recordings[:1], validation,
                 diagnosis=files.diagnosis, **options)


@pytest.mark.parametrize('effect', [WRONG, 'drive_inertia'])
def test_a_wrong_effect_is_refused_and_the_right_one_named(files: Files, effect: str) -> None:
    answer = requested(files, effect)
    assert not answer.adopted
    assert f'{HIDDEN} on' in answer.reason
    assert 'explains these recordings better' in answer.reason


def test_an_effect_that_makes_another_recording_worse_is_refused(files: Files) -> None:
    answer = requested(files, HIDDEN, files.other_robot)
    assert not answer.adopted
    assert 'on the validation recordings does not fall' in answer.reason
    assert answer.held_out_after > answer.held_out_before


def test_blocks_of_the_same_recording_are_told_as_weak_evidence(files: Files) -> None:
    answer = requested(files, HIDDEN)
    assert answer.adopted
    assert answer.held_out_on == 'blocks'
    assert any('weak evidence' in remark and '--validate' in remark
               for remark in answer.remarks)


def test_force_overrides_and_is_recorded(files: Files) -> None:
    answer = requested(files, f'{WRONG}:axis', force=True)
    assert answer.adopted
    step, = read_steps(LedgerBook((RecordingEntry(files.recordings[0]),), ()).entered(
        answer).values)
    assert step.forced
    assert 'explains these recordings better' in ' '.join(step.objections)


def synthetic(values: dict[str, Any], **recorded: Any) -> tuple[DriveModel, Recording]:
    """Return a model and a recording of a robot that differs from it."""
    model, robot = (DriveModel.from_parameters({**default_parameters(), **changes})
                    for changes in (values, recorded))
    return model, record(robot, NOISE, 8, Excitation(DURATION, seed=5).motion,
                         np.arange(0, DURATION, 0.005))


def test_the_right_effect_on_a_wrong_drive_is_refused() -> None:
    model, recording = synthetic({}, **{
        'effects.active': [HIDDEN], f'effects.{HIDDEN}.slide_1.force': 0.4})
    answer = adopt(model, EffectRequest.of(f'{HIDDEN}:lift_2', model), [recording])
    assert not answer.adopted
    assert f'the recordings show {HIDDEN} on slide_1, not on lift_2' in answer.reason


LESS = {f'effects.load_friction.lift_{k}.coefficient': -0.1 for k in (1, 2, 3)}


@pytest.mark.slow
def test_friction_that_would_push_is_refused_and_less_friction_is_not() -> None:
    hidden = {'effects.active': ['load_friction'], **LESS}
    model, recording = synthetic({}, **hidden)
    answer = adopt(model, EffectRequest.of('load_friction', model), [recording])
    assert not answer.adopted
    assert 'more is taken away than the model has' in answer.reason
    rough = {'friction.drives.coulomb': [0.05, 0.05, 0.05, 0.2, 0.2, 0.2]}
    model, recording = synthetic(rough, **rough, **hidden)
    answer = adopt(model, EffectRequest.of('load_friction', model), [recording])
    assert answer.adopted, answer.reason
    assert answer.parameters['lift_1.coefficient'].value == pytest.approx(-0.1, rel=0.05)


@pytest.mark.parametrize(('name', 'other'), [
    ('viscous_friction', 'drive_spring'), ('drive_spring', 'viscous_friction')])
def test_held_out_errors_are_those_with_the_added_effect_alone(name: str, other: str) -> None:
    """The new model lacks the other effect, whose force decides neither for nor against it."""
    model, robot = axis(), axis({'viscous_friction': {'coefficient': 30.0},
                                 'drive_spring': {'stiffness': 80.0, 'position': 0.0}})
    answer = adopt(model, EffectRequest.of(name, model), [axis_recording(robot)])
    assert answer.adopted, answer.reason
    assert other in ' '.join(answer.remarks)
    assert answer.held_out_before == pytest.approx(answer.error_before, rel=0.1)
    assert answer.held_out_after == pytest.approx(answer.error_after, rel=0.1)


def test_a_recording_in_pieces_has_a_fingerprint_of_its_own(tmp_path: Path) -> None:
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'a.db3').write_bytes(b'one')
    first = fingerprint(tmp_path / 'bag')
    (tmp_path / 'bag' / 'a.db3').rename(tmp_path / 'bag' / 'b.db3')
    assert fingerprint(tmp_path / 'bag') != first
    assert len(first) == 64


def test_friction_on_a_drive_that_stands_is_refused_in_one_sentence() -> None:
    model, time = DriveModel.load(), np.arange(2000) * 0.004
    up_and_down = np.tile([0.0, 0.0, 0.5], (2000, 1))
    up_and_down[:, 2] += 0.04 * np.sin(2 * np.pi * time / 4) * np.sin(np.pi * time / 8) ** 2
    motion = PlatformMotion.from_poses(time, up_and_down, np.tile([0.0, 0, 0, 1], (2000, 1)))
    recording = record(model, 0.05, motion=lambda _: motion, time=time)
    found = diagnose(model, [recording])
    for text, named in (('coulomb_friction:slide_1,lift_1', 'slide_1'),
                        ('viscous_friction:slide_2', 'slide_2')):
        answer = adopt(model, EffectRequest.of(text, model), [recording], diagnosis=found)
        assert not answer.adopted
        assert f'{named} hardly moved in the recordings' in answer.reason
