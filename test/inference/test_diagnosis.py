# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnosis: columns against the model itself, and hidden effects that must be found or told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_once import diagnose
from model_recordings import TIME, record, with_effects
from single_axis import axis, axis_recording

from benchmarks.hidden.recordings import Case, Scene, make_case
from pprs_dynamics import DriveModel, Recording
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.regression.base_columns import ModelNumber
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.sensitivities import BY_FRICTION, Sensitivities
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.laws.time_delay import TimeDelay
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointSeries
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import HOME, Excitation

MODEL = DriveModel.load()
TOLERANCES = {'tolerances.masses.payload': 0.05, 'tolerances.masses.slides': 0.05,
              'tolerances.friction.drives.coulomb': 0.05}


@pytest.fixture(scope='module')
def design() -> Design:
    return Design.of(DriveModel.from_parameters({**MODEL.values, **TOLERANCES}), [record(MODEL)])


def change(design: Design, effect: str, values: dict[str, float], drive: str = '') -> np.ndarray:
    """Return what an effect changes in the model's treated effort on the same recording."""
    model = with_effects(MODEL, {effect: {
        f'{drive}.{key}' if drive else key: value for key, value in values.items()}})
    with_it, _ = measure_residuals(model, [record(MODEL)])
    return with_it.model - design.residuals.model


@pytest.mark.parametrize('name', sorted(
    name for name, effect in CATALOGUE.items()
    if issubclass(effect, StructureEffect) and MODEL.offers(effect)))
def test_columns_of_the_structure_are_what_the_model_with_the_effect_says(
        name: str, design: Design) -> None:
    effect = MODEL.bound(CATALOGUE[name])
    assert issubclass(effect, StructureEffect)
    term = next(t for t in design.structure if t.effect is effect)
    for k, coefficient in enumerate(effect.coefficients):
        if name == 'joint_spring' and coefficient.name.endswith('moment'):
            continue  # belongs to no angle
        # A small one: friction is not linear in loads.
        size = 1e-3 * coefficient.scale
        found = change(design, name, effect.at({coefficient.name: size}).values)
        column = np.stack([term.rows[d][k] for d in range(6)], axis=1) * size
        assert np.abs(column).max() > 0, 'a candidate that changes nothing'
        np.testing.assert_allclose(found, column, atol=1e-3 * np.abs(column).max())


@pytest.mark.parametrize(('name', 'values'), [
    ('coulomb_friction', {'force': 0.3}), ('viscous_friction', {'coefficient': 4.0}),
    ('stribeck_friction', {'force': 0.3, 'velocity': 0.02}),
    ('hysteresis', {'force': 0.3, 'distance': 0.0005}),
    ('friction_drift', {'force': 0.3, 'time': 5.0}),
    ('drive_spring', {'stiffness': 12.0, 'position': 0.05}),
    ('force_ripple', {'force': 0.3, 'phase': 0.4, 'pitch': 0.011}),
    ('drive_inertia', {'mass': 0.3}), ('load_friction', {'coefficient': 0.03}),
    ('effort_gain', {'gain': 0.05}), ('time_delay', {'delay': 0.006}),
    ('asymmetric_friction', {'viscous_forward': 3.0, 'force_backward': 0.2})])
def test_columns_of_drives_are_what_the_model_with_the_effect_says(
        name: str, values: dict[str, float], design: Design) -> None:
    effect = CATALOGUE[name]
    assert issubclass(effect, DriveEffect)
    shape = {p.name: values.get(p.name, p.default) for p in effect.shape}
    rows = design.drive_rows(effect, 4, shape)
    every = {p.name: values.get(p.name, p.default or 0.0) for p in effect.parameters}
    c = effect.to_coefficients(every)
    weights = np.array([c[coefficient.name] for coefficient in effect.coefficients] or [1.0])
    found = change(design, name, values, DRIVES[4])
    expected = weights @ rows
    np.testing.assert_allclose(found[:, 4], expected, atol=1e-3 * np.abs(expected).max())
    assert np.abs(found[:, [0, 1, 2, 3, 5]]).max() < 1e-12


def test_friction_that_follows_its_own_loads_is_a_column_and_no_effect() -> None:
    """The engine's friction of passive joints is in the loads that friction follows."""
    scene = Scene(5, width=1.0, duration=4.0)
    model = DriveModel.from_parameters({**scene.model.values, **scene.robot})
    forces, samples = model.drive_forces(scene.platform), len(scene.platform)
    columns = Sensitivities(model, model).columns(forces, Treatment(np.arange(samples), samples))
    wanted = scene.plain.effort - forces.total
    assert np.abs(wanted).max() > 0.01
    np.testing.assert_allclose(columns[BY_FRICTION][:, 0], wanted, atol=2e-4)


@pytest.mark.parametrize('late', [0.0, -0.11])
def test_delays_are_tried_around_the_one_that_the_efforts_show(late: float) -> None:
    run = record(MODEL)
    step = float(np.median(np.diff(run.time)))
    effort = np.stack([np.interp(run.time - late, run.time, row) for row in run.effort.T], axis=1)
    found = Design.of(MODEL, [replace(run, effort=effort)]).covered[2]
    assert found.delay == pytest.approx(late, abs=2 * step)
    tried = np.array([trial['delay'] for trial in TimeDelay.trials(found)])
    assert np.all(tried)  # none is no delay
    assert tried.min() < late < tried.max()
    assert np.abs(tried[tried != 0] - late).min() <= 0.001


def test_a_wrong_zero_is_felt_by_all_drives(design: Design) -> None:
    found = change(design, 'homing_error', {'zero': 1e-4}, 'slide_2')
    term = design.term(CATALOGUE['homing_error'], 1, {})
    column = np.stack([term.rows[d][0] for d in range(6)], axis=1) * 1e-4
    np.testing.assert_allclose(found, column, atol=0.03 * np.abs(column).max())
    assert np.all(np.abs(column).max(axis=0) > 1e-4)


def test_numbers_within_tolerances_move_the_prediction_as_the_model_does(design: Design) -> None:
    found = {column.number.label: column for column in design.base
             if isinstance(column, ModelNumber)}
    assert set(found) >= {'masses.payload', 'masses.slides[2]', 'friction.drives.coulomb[5]'}
    for label, key, element in (('masses.payload', 'masses.payload', None),
                                ('masses.slides[2]', 'masses.slides', 1),
                                ('friction.drives.coulomb[5]', 'friction.drives.coulomb', 4)):
        number = found[label].number
        value = MODEL.values[key]
        moved = (value + number.deviation if element is None else tuple(
            x + number.deviation * (k == element) for k, x in enumerate(value)))
        with_it, _ = measure_residuals(DriveModel.from_parameters(
            {**MODEL.values, key: moved}), [record(MODEL)])
        expected = with_it.model - design.residuals.model
        for d in range(6):
            np.testing.assert_allclose(found[label].rows.get(d, np.zeros(len(expected))),
                                       expected[:, d], atol=0.02 * np.abs(expected).max())


def test_a_tilted_base_is_no_friction_on_drives_that_stand() -> None:
    true = with_effects(MODEL, {'base_tilt': {'x': 0.045, 'y': -0.048}})
    up_and_down = JointSeries(np.outer((0.0, 0.0, 1.0), (0.03, -0.02, 0.04)), np.array(HOME),
                              TIME[-1], 3)
    found = diagnose(MODEL, [record(true, 0.08, motion=lambda time: PlatformMotion.from_poses(
        time, up_and_down.motion(time).position, np.eye(4)[[3] * len(time)]))])
    assert [effect.name for effect in found.effects] == ['base_tilt']
    assert found.effects[0].parameters['x'].value == pytest.approx(0.045, abs=5e-4)
    assert found.effects[0].parameters['y'].value == pytest.approx(-0.048, abs=5e-4)
    assert any('slide_1, slide_2 and slide_3 hardly moved' in warning for warning in found.warnings)
    assert not any('independent samples' in warning for warning in found.warnings)


def test_friction_fades_from_the_start_of_the_recording_not_of_what_is_kept() -> None:
    tau, force = 1.0, 1.5
    true = with_effects(MODEL, {'friction_drift': {
        f'{d}.{key}': value for d in DRIVES for key, value in (('force', force), ('time', tau))}})
    recording = record(true)
    design = Design.of(MODEL, [recording])
    # A window of smoothing is dropped before the first sample: the clock has run by then.
    began = design.recordings[0].time[0] - recording.time[0]
    assert began > 0.01
    column = design.drive_rows(CATALOGUE['friction_drift'], 3, {'time': tau})[0]
    error = design.residuals.error[:, 3]
    assert float(column @ error / (column @ column)) == pytest.approx(force, rel=0.003)
    exact, _ = measure_residuals(true, [recording])
    assert np.sqrt(np.mean(exact.error ** 2)) < 0.01 * np.sqrt(np.mean(error ** 2))


# Hidden physics in forms of its own, from the physics engine; `make score` has the whole table.

def case(row: str, *effects: str, seed: int = 3, snr: float = 1.0, noise: float | str = 0.9,
         ) -> tuple[Diagnosis, dict]:
    model, recording, truth = make_case(Case(row, effects, seed, snr, noise, duration=12.0))
    return diagnose(model, [recording]), truth


@pytest.mark.parametrize('noise', ['1/f', *(
    pytest.param(noise, marks=pytest.mark.slow) for noise in (0.0, 0.98, 0.999))])
def test_nothing_is_claimed_where_nothing_is_missing(noise: float | str) -> None:
    found, _ = case('nothing', noise=noise)
    assert found.verdict == 'adequate'
    assert found.effects == ()


@pytest.mark.parametrize(('name', 'variable'), [
    ('vibration', 'frequency'),
    pytest.param('drive_coupling', 'velocity of', marks=pytest.mark.slow)])
def test_what_no_effect_explains_is_told_with_its_variable(name: str, variable: str) -> None:
    found, truth = case('unknown', name)
    assert found.verdict == 'unknown'
    assert found.depends_on[0].drive in truth['effects'][0]['drives']
    assert found.depends_on[0].variable.startswith(variable)


def test_a_drive_that_reverses_in_another_width_hides_no_friction() -> None:
    true = with_effects(DriveModel.from_parameters({
        **MODEL.values, 'friction.reversal_velocities': (0.0015, 0.0, 0.0, 0.0, 0.0, 0.0)}), {
        'stribeck_friction': {'slide_1.force': 0.8, 'slide_1.velocity': 0.02}})
    recording = record(true, noise=0.05)
    other = record(true, noise=0.05, seed=1, motion=Excitation(seed=2).motion)
    found = diagnose(MODEL, [recording], [other])
    (effect_found,) = found.effects
    assert (found.verdict, effect_found.drives) == ('effect', ('slide_1',))
    # The model that is judged on the other motion is the one that is adopted.
    assert effect_found.held_out_after == pytest.approx(
        np.sqrt(np.nanmean(measure_residuals(found.adopted, [other])[0].error ** 2)), rel=1e-6)
    assert effect_found.held_out_after < 0.5 * effect_found.held_out_before
    # The width stays as in the model, which the answer says.
    assert any('slide_1 seems to reverse' in warning for warning in found.warnings)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('late', [0.06, -0.06])
def test_efforts_that_belong_to_motion_in_a_gap_do_not_count(late: float) -> None:
    run = axis_recording(axis({'time_delay': {'delay': late}}))
    kept = np.all([np.abs(run.time - gap) > 0.15 for gap in (2.0, 3.7, 6.1)], axis=0)
    found = diagnose(axis(), [Recording.from_arrays(
        'cut', run.time[kept], run.position[kept], None, run.effort[kept], run.drives)])
    assert found.verdict == 'effect'
    (effect,) = found.effects
    assert effect.name == 'time_delay'
    assert effect.parameters['axis.delay'].value == pytest.approx(late, abs=0.001)
    assert np.nanmax(np.abs(found.remaining)) < 5 * found.noise_floor


def test_a_drive_that_was_never_measured_takes_no_part_behind_a_delay_either() -> None:
    late = with_effects(MODEL, {
        'time_delay': {f'{drive}.delay': 0.008 for drive in DRIVES},
        'viscous_friction': {'slide_2.coefficient': 12.0}})
    recording = record(late, 0.05)
    recording.effort[:, 2] = np.nan
    found = diagnose(MODEL, [recording])
    assert {effect.name for effect in found.effects} == {'time_delay', 'viscous_friction'}
    assert 'slide_3' not in {drive for effect in found.effects for drive in effect.drives}
    np.testing.assert_array_equal(np.isnan(found.after.error), np.isnan(found.residuals.error))
    # One controller is one delay: it costs one number, and is known as well as all drives tell it.
    delays = next(effect for effect in found.effects if effect.name == 'time_delay').parameters
    (value,), stds = {delay.value for delay in delays.values()}, [
        delay.std for delay in delays.values()]
    assert value == pytest.approx(0.008, abs=3 * stds[0])
    assert stds == pytest.approx([stds[0]] * 5)
