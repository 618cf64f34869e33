# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What has changed since a reference run, on an arm whose healthy friction is of no catalogue."""

from __future__ import annotations

import json
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest

import pprs_dynamics as pprs
from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import ModelError, UnreadableFileError
from pprs_dynamics.inference.diagnosis.diagnosis import SinceReference
from pprs_dynamics.inference.diagnosis.sentences import (
    Sentences,
    word_reference,
)
from pprs_dynamics.inference.fit.reference import Reference, ReferenceRunError
from pprs_dynamics.inference.fit.reference_runs import read_reference
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.model_writer import write_model

NOISE = 0.2
SIZE = np.array([2.0, 1.5, 2.5])  # of what no effect of the catalogue explains


def healthy(moved: JointMotion) -> Array:
    """Return the forces of cables and worn guides: by places, and by directions at places."""
    q, v = moved.position, np.tanh(moved.velocity / 0.05)
    force: Array = SIZE * (np.tanh(3 * np.sin(4 * q + 1)) + 0.7 * v * np.cos(5 * q))
    return force


def run(model: DriveModel, seed: int, noise: int, change: float = 0.0, day: float = 0.0,
        ) -> Recording:
    """Return a recording of a motion, with Coulomb friction of `swing` otherwise.

    On another day what no effect explains differs by a share of itself, from place to place.
    """
    moved = arm.motion(20.0, seed=seed)
    clean = arm.record(model, moved, NOISE, noise)
    shifted = JointMotion(moved.position + 0.7, moved.velocity, moved.acceleration, moved.time)
    effort = clean.effort + healthy(moved) + day * healthy(shifted)
    effort[:, 1] += change * np.tanh(moved.velocity[:, 1] / 0.002)
    return Recording.from_arrays(f'run_{seed}_{noise}', clean.time, clean.position,
                                 clean.velocity, effort, clean.drives)


@pytest.fixture(scope='module')
def machine(tmp_path_factory: pytest.TempPathFactory) -> tuple[DriveModel, Reference]:
    model = arm.real_arm(tmp_path_factory.mktemp('arm'))
    return model, Reference.of(model, [run(model, 0, 1)])


def test_what_was_in_the_reference_has_not_changed(machine: tuple[DriveModel, Reference]) -> None:
    model, _ = machine
    again = run(model, 0, 2)
    found = pprs.diagnose(model, again, reference=run(model, 0, 1))
    assert found.verdict == 'adequate'
    assert found.to_dict()['reference']['recordings'] == ['run_0_1']
    assert found.to_dict()['reference']['covered'] > 0.95
    assert min(found.to_dict()['reference']['explained'].values()) > 0.9
    assert found.effects == ()
    # The model lacks much all the same.
    assert min(rms_by_drive(measure_residuals(model, [again])[0]).values()) > 5 * NOISE
    assert max(found.diagnosis.noise_floors.values()) < 2 * NOISE


@pytest.mark.parametrize(('pace', 'is_told'), [
    (1.1, False), (2.0, True)])
def test_another_speed_than_the_references_is_told(
    machine: tuple[DriveModel, Reference], pace: float, is_told: bool,
) -> None:
    model, reference = machine
    moved = arm.motion(20.0, seed=0)
    other = JointMotion(moved.position, pace * moved.velocity, pace ** 2 * moved.acceleration,
                        moved.time / pace)
    clean = arm.record(model, other, NOISE, 6)
    design = Design.of(model, [clean])
    since = SinceReference.of(reference, design.beside(reference.carried_over(design)))
    assert since.pace == pytest.approx(pace, rel=0.05)
    told = [line for line in word_reference(since) if 'times the speed of the reference' in line]
    assert bool(told) == is_told


def test_a_change_of_friction_is_told_alone(machine: tuple[DriveModel, Reference]) -> None:
    model, _ = machine
    found = pprs.diagnose(model, run(model, 0, 3, change=0.4), reference=run(model, 0, 1))
    assert [effect.name for effect in found.effects] == ['coulomb_friction']
    assert found.effects[0].drives == ('swing',)
    value = found.effects[0].parameters['swing.force']
    assert abs(value.value - 0.4) < 2 * value.std < 0.2
    assert Sentences(found.diagnosis).headline.startswith('Since run_0_1: ')


def test_a_reference_of_another_motion_does_not_date_an_effect(
        machine: tuple[DriveModel, Reference]) -> None:
    model, _ = machine
    found = pprs.diagnose(model, run(model, 5, 3, change=0.4), reference=run(model, 0, 1))
    assert found.to_dict()['reference']['covered'] < 0.5
    words = Sentences(found.diagnosis)
    assert 'Since' not in words.headline
    assert any('may be older than the reference' in line for line in words.reference)


def finer(moved: JointMotion) -> Array:
    """Return ripple, and what friction that builds up by three springs lacks after reversals."""
    q = moved.position
    ripple = 0.5 * np.sin(120 * q + [0.3, 1.0, 2.0]) + 0.1 * np.sin(240 * q)
    lost = np.zeros_like(q)
    for share in (0.004, 0.012, 0.02):
        stretched = np.zeros(3)
        for k, step in enumerate(np.diff(q, axis=0, prepend=q[:1])):
            stretched = np.clip(stretched + step / share, -1.0, 1.0)
            lost[k] += stretched / 3
    return ripple + 0.8 * (lost - np.tanh(moved.velocity / 0.01))


@pytest.mark.parametrize('change', [0.0, 0.4])
def test_ripple_and_reversals_of_the_reference_are_no_change(
        machine: tuple[DriveModel, Reference], change: float) -> None:
    # Of both the noise of a single run hides a part from sample to sample: forms tell it.
    model, _ = machine
    moved = arm.motion(20.0, seed=0)

    def worn(noise: int, change: float = 0.0) -> Recording:
        plain = run(model, 0, noise, change)
        return Recording.from_arrays(plain.name, plain.time, plain.position, plain.velocity,
                                     plain.effort + finer(moved), plain.drives)

    found = pprs.diagnose(model, worn(6, change), reference=worn(7))
    assert [effect.name for effect in found.effects] == (['coulomb_friction'] if change else [])


def test_wrong_numbers_of_the_base_are_carried_over_to_another_path(
    machine: tuple[DriveModel, Reference],
) -> None:
    """Where the reference was not, theta alone says what wrong masses and friction need."""
    model, _ = machine
    wrong = DriveModel.from_parameters({
        **model.values, 'links.mass': tuple(1.1 * np.array(model.robot.inertial)[:, 0]),
        'friction.viscous': tuple(0.8 * np.array(model.values['friction.viscous']))}, model.source)
    runs = [arm.record(model, arm.motion(20.0, seed=seed), NOISE, seed) for seed in (0, 5)]
    assert pprs.diagnose(wrong, runs[1]).verdict != 'adequate'
    assert pprs.diagnose(wrong, runs[1], reference=runs[0]).verdict == 'adequate'
    design = Design.of(wrong, runs[1:])
    carried = Reference.of(wrong, runs[:1]).carried_over(design)
    error = design.residuals.error
    left = error - carried.of_base
    assert np.nanstd(left) < 0.3 * np.nanstd(error)


@pytest.mark.parametrize(('path', 'day'), [(0, 0.1), (5, 0.0)])
def test_what_a_reference_leaves_open_is_no_change(
        machine: tuple[DriveModel, Reference], path: int, day: float) -> None:
    model, _ = machine
    found = pprs.diagnose(model, run(model, path, 5, day=day), reference=run(model, 0, 1))
    assert found.verdict == 'adequate'


@pytest.mark.parametrize(('exchanged', 'where'), [
    ('drives', 'later'), ('positions', 'before'), ('efforts', 'later')])
def test_exchanged_columns_of_two_joints_are_named_beside_a_reference(
        exchanged: str, where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, order = arm.real_arm(tmp_path), [1, 0, 2]
    write_model(tmp_path / 'model.yaml', model.values)
    for name, made in (('before', run(model, 0, 1)), ('later', run(model, 5, 2, change=0.6))):
        if name == where:
            made = Recording.from_arrays(
                name, made.time, made.position[:, order if exchanged != 'efforts' else [0, 1, 2]],
                None, made.effort[:, order if exchanged != 'positions' else [0, 1, 2]], made.drives)
        write_recording(tmp_path / f'{name}.csv', made)
    before, later = (str(tmp_path / f'{name}.csv') for name in ('before', 'later'))
    assert main(['diagnose', later, '--reference', before, '--model',
                 str(tmp_path / 'model.yaml')]) == 1
    said = capsys.readouterr().err
    assert f'{where}.csv: the {exchanged} look recorded in another order' in said
    assert 'swing like turn, turn like swing: if so, write into the model file' in said


def test_a_fit_names_its_runs_and_a_diagnosis_takes_them(tmp_path: Path) -> None:
    model = arm.real_arm(tmp_path)
    for name, recording in (('free', run(model, 0, 1)), ('later', run(model, 0, 2, change=0.6))):
        write_recording(tmp_path / f'{name}.csv', recording)
    (tmp_path / 'models').mkdir()
    base = tmp_path / 'models' / 'base.yaml'
    free, later = (str(tmp_path / f'{name}.csv') for name in ('free', 'later'))
    assert main(['fit', free, '--model', str(tmp_path / 'arm.yaml'), '--output', str(base)]) == 0
    values = DriveModel.load(base).values
    assert list(values['reference']) == ['../free.csv']
    assert base.stat().st_size < 50_000
    said = tmp_path / 'said.json'
    assert main(['diagnose', later, '--model', str(base), '--reference', '--json', str(said)]) == 0
    content = json.loads(said.read_text())
    assert [effect['name'] for effect in content['effects']] == ['coulomb_friction']
    # What is written elsewhere names it from there.
    write_model(tmp_path / 'new.yaml', values, base)
    assert list(DriveModel.load(tmp_path / 'new.yaml').values['reference']) == ['free.csv']
    with pytest.raises(UnreadableFileError, match='a reference must be another run'):
        pprs.diagnose(base, free, reference=())
    with (tmp_path / 'free.csv').open('a') as file:
        file.write('\n')
    with pytest.raises(UnreadableFileError, match='SHA-256'):
        read_reference(DriveModel.load(base))
    (tmp_path / 'free.csv').unlink()
    with pytest.raises(UnreadableFileError, match='is not there'):
        read_reference(DriveModel.load(base))


def test_what_is_no_reference_is_refused(machine: tuple[DriveModel, Reference]) -> None:
    model, _ = machine
    whole = run(model, 0, 1)
    with pytest.raises(ReferenceRunError, match='names no reference run'):
        read_reference(model)
    with pytest.raises(ReferenceRunError, match='too short'):
        read_reference(model, [Recording.from_arrays(
            'short', whole.time[:150], whole.position[:150], None, whole.effort[:150],
            whole.drives)])
    other = np.random.default_rng(0).normal(size=whole.effort.shape)
    with pytest.raises(ReferenceRunError, match='must explain half'):
        read_reference(model, [Recording.from_arrays(
            'other', whole.time, whole.position, None,
            30 * np.cumsum(other, axis=0) / 40, whole.drives)])
    with pytest.raises(ModelError, match='SHA-256'):
        DriveModel.from_parameters({**model.values, 'reference': ['free.csv']}, model.source)
