# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Base models of arms from recordings, recordings in amperes, rests, and a hidden payload."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest
from made_once import diagnose
from model_recordings import with_effects
from single_axis import axis, axis_recording

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.inference.fit.base_fit import fit_base
from pprs_dynamics.inference.fit.mechanism_fit import fit_mechanism, pseudo_inertia
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import read_recording, write_recording
from pprs_dynamics.measurement.motion.rests import find_rests

NOISE = 0.2


def heavier(folder: Path) -> DriveModel:
    """Return an arm that is not as described: heavier links, rotors, friction."""
    model = DriveModel.load(arm.write_arm(folder))
    mass = np.array(model.robot.inertial)
    factors = np.array([1.2, 0.8, 1.3])[:, None]
    changed = mass * factors
    return arm.real_arm(folder, **{
        'links.mass': tuple(changed[:, 0]), 'links.moment': tuple(changed[:, 1:4].ravel()),
        'links.inertia': tuple((changed[:, 4:][:, [0, 2, 5, 1, 3, 4]]).ravel()),
        'robot.armature': (0.5, 0.3, 2.0)})


def test_a_fit_recovers_friction_and_predicts_a_motion_it_never_saw(tmp_path: Path) -> None:
    real = heavier(tmp_path)
    described = DriveModel.load(arm.write_arm(tmp_path))
    runs = [arm.record(real, arm.motion(seed=seed), NOISE, seed) for seed in (0, 1)]
    fit = fit_base(described, runs, [arm.record(real, arm.motion(seed=7), NOISE, 7)])
    for key in ('friction.viscous', 'friction.coulomb'):
        assert fit.model.values[key] == pytest.approx(arm.FRICTION[key], rel=0.03)
    assert max(fit.held_out.values()) < 1.1 * NOISE
    assert min(fit.error_before.values()) > 5 * NOISE


def test_a_slide_of_init_is_fitted_as_well_and_diagnosed_without_another_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    shutil.copy(Path(__file__).parents[2] / 'config' / 'single_axis.urdf', tmp_path / 'axis.urdf')
    runs = [str(tmp_path / f'{name}.csv') for name in ('first', 'second', 'third')]
    upright = {'robot.gravity': (0.0, 0.0, -9.81)}
    real = axis(**{'links.mass': (90.0,), **upright})
    for seed, run in enumerate(runs):
        write_recording(run, axis_recording(real, seed))
    model, base = str(tmp_path / 'axis.yaml'), str(tmp_path / 'base.yaml')
    assert main(['init', str(tmp_path / 'axis.urdf'), *runs[:1], '--output', model]) == 0
    assert main(['diagnose', runs[0], '--model', model, '--as-it-is']) == 0
    assert 'pprs fit' in capsys.readouterr().out
    assert main(['fit', *runs[:2], '--model', model, '--output', base]) == 0
    fitted = DriveModel.load(base)
    assert fitted.values['friction.viscous'] == pytest.approx((40.0,), rel=0.03)
    assert fitted.values['friction.coulomb'] == pytest.approx((6.0,), rel=0.03)
    mass = fitted.values['links.mass'][0] + fitted.values['robot.armature'][0]
    assert mass == pytest.approx(90.0, rel=0.01)
    capsys.readouterr()
    assert main(['diagnose', runs[2], '--model', base]) == 0
    assert 'pprs fit' not in capsys.readouterr().out
    # Nor where the model explains little of another machine.
    write_recording(runs[2], axis_recording(axis(**{'links.mass': (5.0,), **upright}), 3))
    assert main(['diagnose', runs[2], '--model', base, '--as-it-is']) == 0
    assert 'pprs fit' not in capsys.readouterr().out


def test_the_base_is_fitted_again_beside_an_effect_that_it_held(tmp_path: Path) -> None:
    load = {'effects.active': ['load_friction']} | {
        f'effects.load_friction.{name}.coefficient': 0.05 for name in arm.JOINTS}
    real = arm.real_arm(tmp_path, **load)
    held = arm.real_arm(tmp_path, **load, **{
        'friction.coulomb': tuple(1.3 * np.array(arm.FRICTION['friction.coulomb']))})
    runs = [arm.record(real, arm.motion(10.0, seed=seed), NOISE, seed) for seed in (0, 1)]
    again = fit_base(held, runs[:1], runs[1:])
    assert again.model.values['friction.coulomb'] == pytest.approx(
        arm.FRICTION['friction.coulomb'], rel=0.05)
    # What was adopted stays as it was.
    for key in load:
        assert again.model.values[key] == held.values[key]


def test_uncertainties_hold_the_truth(tmp_path: Path) -> None:
    real = heavier(tmp_path)
    described = DriveModel.load(arm.write_arm(tmp_path))
    inside = []
    for seed in range(4):
        runs = [arm.record(real, arm.motion(20.0, seed=seed), NOISE, seed)]
        inside += [abs(number.after - arm.FRICTION[number.key][described.drives.index(
            number.drive)]) < 2.5 * number.std for number in fit_mechanism(described, runs)[1]
            if number.key in arm.FRICTION]
    assert np.mean(inside) > 0.85


def test_what_does_not_move_stays_and_is_told(tmp_path: Path) -> None:
    real = arm.real_arm(tmp_path)
    moved = arm.motion()
    still = JointMotion(*(values * [1, 1, 0] for values in (
        moved.position, moved.velocity, moved.acceleration)), moved.time)
    described = DriveModel.load(arm.write_arm(tmp_path, friction__viscous=[1.0, 1.0, 33.0]))
    fit = fit_base(described, [arm.record(real, still, NOISE)])
    assert fit.model.values['friction.viscous'][2] == 33.0
    assert any('joints that hardly move: reach' in sentence for sentence in fit.notes)


def test_fitted_links_are_bodies(tmp_path: Path) -> None:
    described = DriveModel.load(arm.write_arm(tmp_path))
    fit = fit_base(described, [arm.record(heavier(tmp_path), arm.motion(20.0), 5.0)])
    for link in fit.model.robot.inertial:
        assert np.linalg.eigvalsh(pseudo_inertia(link)).min() > -1e-6


def write_currents(folder: Path, model: DriveModel, gain: tuple[float, ...], name: str) -> Path:
    """Write a packed CSV of currents, joints in another order, stamps that jitter."""
    run = arm.record(model, arm.motion(20.0), NOISE)
    header = ['time']
    columns = [run.time]
    for k in (2, 0, 1):
        joint = model.drives[k]
        header += [f'{joint}/current', f'{joint}/position']
        columns += [run.effort[:, k] / gain[k], run.position[:, k]]
    path = folder / name
    text = '\n'.join([','.join(header), *(','.join(map(repr, row)) for row in np.column_stack(
        columns).tolist())])
    path.write_bytes(gzip.compress(text.encode()) if name.endswith('.gz') else text.encode())
    return path


def test_currents_times_gains_are_efforts(tmp_path: Path) -> None:
    gain = (10.0, 4.0, 30.0)
    model = arm.real_arm(tmp_path, **{'robot.gain': gain})
    path = write_currents(tmp_path, model, gain, 'run.csv.gz')
    run = read_recording(path, model.recorded)
    assert run.effort == pytest.approx(arm.record(model, arm.motion(20.0), NOISE).effort)
    error = measure_residuals(model, [run])[0].error
    assert np.sqrt(np.nanmean(error ** 2)) < 1.1 * NOISE
    with pytest.raises(UnreadableFileError, match='currents of turn, swing, reach'):
        read_recording(path, model.drives)


def test_a_gain_within_its_tolerance_is_calibrated_and_leaves_the_payload_alone(
        tmp_path: Path) -> None:
    """Currents that a wrong gain made efforts of: the model with the right one explains them."""
    gain, wrong = (10.0, 4.0, 30.0), (10.0, 4.2, 30.0)
    real = arm.real_arm(tmp_path, **{'robot.gain': gain})
    path = write_currents(tmp_path, real, gain, 'run.csv')
    given = DriveModel.from_parameters(
        {**real.values, 'robot.gain': wrong, 'tolerances.robot.gain': 0.1},
                        real.source)
    run = read_recording(path, given.recorded)
    found = diagnose(given, [run])
    assert found.verdict == 'adequate'
    after = {number.key: number.after for number in found.calibrated}
    assert after['robot.gain[2]'] == pytest.approx(4.0, rel=0.01)


def test_a_joint_that_stands_does_not_count(tmp_path: Path) -> None:
    time = np.arange(0, 10, 0.01)
    position = np.where(time < 3, 0.0, np.where(time < 6, np.cos(time - 3) - 1, np.cos(3) - 1))
    rests = find_rests(position[:, None], 0.01, 0.01)[:, 0]
    assert rests[time < 2.9].all()
    assert rests[time > 6.2].all()
    assert not rests[(time > 3.3) & (time < 5.8)].any()


def test_a_reversal_is_no_rest() -> None:
    time = np.arange(0, 20, 0.01)
    assert not find_rests(0.3 * np.sin(0.8 * time)[:, None], 0.01, 0.01).any()


def test_a_fault_in_the_run_that_is_fitted_is_hidden_by_the_fit_which_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv('COLUMNS', '400')
    healthy, described = arm.real_arm(tmp_path), DriveModel.load(tmp_path / 'arm.yaml')
    loaded = with_effects(healthy, {'payload_mass': {'mass': 1.5}})
    for name, real, seed in (('healthy', healthy, 0), ('loaded', loaded, 1)):
        write_recording(tmp_path / f'{name}.csv', arm.record(real, arm.motion(20.0, seed=seed),
                                                             NOISE, seed))
    weight = float(described.robot.masses.sum())
    model, warning = str(tmp_path / 'arm.yaml'), 'the model was fitted to'
    for fitted, hides in (('loaded', True), ('healthy', False)):
        base = str(tmp_path / f'{fitted}.yaml')
        assert main(['fit', str(tmp_path / f'{fitted}.csv'), '--model', model, '--output',
                     base]) == 0
        said = capsys.readouterr().out
        assert f'{weight:.3g} kg in the description' in said
        assert 'is now part of the model' in said
        told = tmp_path / 'told.json'
        assert main(['diagnose', str(tmp_path / 'loaded.csv'), '--model', base, '--json',
                     str(told)]) == 0
        answer = json.loads(told.read_text())
        found = {effect['name'] for effect in answer['effects']}
        assert ('payload_mass' in found) != hides
        assert any(warning in text for text in answer['warnings']) == hides
        assert (warning in capsys.readouterr().out) == hides
