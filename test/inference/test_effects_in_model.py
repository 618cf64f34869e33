# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects that a model has: they hold within their uncertainty, or it is told that they do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_once import diagnose
from model_recordings import record, with_effects
from single_axis import AXIS, axis, axis_recording

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.adopt import adopt
from pprs_dynamics.inference.adoption.adoption import LedgerBook, RecordingEntry
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.sentences import Sentences
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.ledger import without_last_step
from pprs_dynamics.physics.model.model_writer import write_model

MODEL = DriveModel.load()
AXIS_MODEL = axis()
NOISE = 0.06  # [N]
Effects = dict[str, dict[str, float]]
STRIBECK: Effects = {'stribeck_friction': {'axis.force': 1.2, 'axis.velocity': 0.02}}


# What the model has, and what is true: of another size, of another shape, or not there at all.
WRONG: dict[str, tuple[Effects, Effects]] = {
    'a payload that is not there': ({'payload_mass': {'mass': 0.3}}, {}),
    'another Stribeck velocity': (
        {'stribeck_friction': {'axis.force': 3.0, 'axis.velocity': 0.05}},
        {'stribeck_friction': {'axis.force': 3.0, 'axis.velocity': 0.02}}),
    'another delay on one of two drives': (
        {'time_delay': {'slide_1.delay': 0.004, 'lift_1.delay': 0.004}},
        {'time_delay': {'slide_1.delay': 0.012, 'lift_1.delay': 0.004}}),
    'a zero that is not off': ({'homing_error': {'slide_1.zero': 0.004}}, {}),
}


def given_and_recorded(there: Effects, true: Effects, seed: int = 0,
                       ) -> tuple[DriveModel, Recording]:
    """Return a model with effects, and a recording of a robot of other effects.

    It is the single axis where the parameters are of its drive, else the paper's robot.
    """
    keys = {key for block in (there | true).values() for key in block}
    if any(key.startswith(f'{AXIS}.') for key in keys):
        run = axis_recording(with_effects(AXIS_MODEL, true), seed, NOISE)
        return with_effects(AXIS_MODEL, there), run
    return with_effects(MODEL, there), record(with_effects(MODEL, true), NOISE, seed,
                                              Excitation(seed=seed).motion)


def booked(adoption: object, recording: Recording) -> DriveModel:
    entry = RecordingEntry(recording)
    model = LedgerBook((entry,), ()).entered(adoption)  # type: ignore[arg-type]
    return model


@pytest.mark.parametrize('case', WRONG)
def test_an_effect_that_does_not_hold_is_a_finding_with_both_values(case: str) -> None:
    there, true = WRONG[case]
    (name, given), = there.items()
    model, recording = given_and_recorded(there, true)
    found = diagnose(model, [recording])
    assert found.verdict in ('effect', 'ambiguous')
    (effect,) = found.effects
    assert effect.name == name
    # Only where it is otherwise, and what the recording says is what is true, not a difference.
    truth = true.get(name, dict.fromkeys(given, 0.0))
    wrong = {key for key, value in given.items() if truth[key] != value}
    told = {key for key in effect.in_model if key in wrong}
    assert told == wrong
    drives = {key.partition('.')[0] for key in wrong}
    assert effect.drives is None or set(effect.drives) == drives
    for key in wrong:
        assert effect.in_model[key] == given[key]
        estimate = effect.parameters[key]
        assert abs(estimate.value - truth[key]) < 4 * estimate.std < 0.3 * abs(
            given[key] - truth[key])
    assert effect.to_dict()['in_model'] == dict(effect.in_model)
    headline = Sentences(found).headline
    assert f'{name}' in headline
    assert 'is in the model with' in headline
    assert 'lacks' not in headline or found.indistinguishable
    # What is handed on explains the recording to the noise.
    assert rms(measure_residuals(found.adopted, [recording])[0]) < 1.03 * found.noise_floor


RIGHT: Effects = {'stribeck_friction': {'lift_1.force': 0.6, 'lift_1.velocity': 0.02},
                  'payload_mass': {'mass': 0.25},
                  'time_delay': {'slide_1.delay': 0.004}, 'base_tilt': {'x': 0.02, 'y': -0.01},
                  'effort_gain': {'lift_2.gain': 0.03}}


def test_effects_that_hold_are_adequate_as_they_are() -> None:
    model = with_effects(MODEL, RIGHT)
    found = diagnose(model, [record(model, NOISE)])
    assert (found.verdict, found.effects, found.unconfirmed) == ('adequate', (), ())


def test_what_lies_within_its_uncertainty_is_no_finding_and_beyond_it_is_one() -> None:
    """The same difference, of what is known to 0.3 N, to 1 mN, and of what is taken as exact."""
    there, true = ({'coulomb_friction': {'axis.force': force}} for force in (1.0, 1.4))
    _, recording = given_and_recorded(there, true)

    def verdict(std: float | None) -> str:
        known = {} if std is None else {'coulomb_friction': {'axis.force': std}}
        return diagnose(with_effects(AXIS_MODEL, there, known), [recording]).verdict
    assert verdict(0.3) == 'adequate'
    assert verdict(0.001) == 'effect'
    assert verdict(None) == 'effect'


@pytest.mark.parametrize('true', [
    {'payload_mass': {'mass': 0.3}}, STRIBECK, {'time_delay': {'axis.delay': 0.006}}], ids=list)
def test_what_adopt_wrote_holds_on_the_same_and_on_other_recordings(
    true: Effects, tmp_path: Path,
) -> None:
    (name, truth), = true.items()
    given, first = given_and_recorded({}, true)
    adoption = adopt(given, EffectRequest(CATALOGUE[name]), [first])
    assert adoption.adopted
    model = booked(adoption, first)
    # The file says how well the effect is known.
    path = tmp_path / 'better.yaml'
    write_model(path, model.values)
    read = DriveModel.load(path)
    for key in truth:
        assert 0 < read.values[f'uncertainties.{name}.{key}'] < 0.1 * truth[key]
    for recording in (first, given_and_recorded({}, true, 1)[1]):
        found = diagnose(read, [recording])
        assert (found.verdict, [effect.name for effect in found.effects]) == ('adequate', [])


def test_adopt_sets_what_is_otherwise_and_the_way_back_is_exact() -> None:
    given, recording = given_and_recorded(*WRONG['another Stribeck velocity'])
    adoption = adopt(given, EffectRequest(CATALOGUE['stribeck_friction']), [recording])
    assert adoption.adopted
    after = booked(adoption, recording)
    assert after.values['effects.stribeck_friction.axis.velocity'] == pytest.approx(0.02, rel=0.1)
    assert diagnose(after, [recording]).verdict == 'adequate'
    assert without_last_step(after.values)[0] == given.values


def test_adopt_retains_what_the_recording_shows_though_no_single_parameter_is_sure() -> None:
    """A few samples are slow enough: force and velocity are known together only."""
    given = axis({'stribeck_friction': {'force': 3.0, 'velocity': 0.05}})
    recording = axis_recording(axis({'stribeck_friction': {'force': 1.2, 'velocity': 0.01}}))
    adoption = adopt(given, EffectRequest(CATALOGUE['stribeck_friction']), [recording])
    assert adoption.adopted
    assert adoption.parameters['axis.force'].value < 2 * adoption.parameters['axis.force'].std
    force, width, exponent = (adoption.after.values[f'effects.stribeck_friction.axis.{name}']
                              for name in ('force', 'velocity', 'exponent'))
    for speed in (0.01, 0.015):  # at which it is measured
        assert force * np.exp(-(speed / width) ** exponent) == pytest.approx(
            1.2 * np.exp(-(speed / 0.01) ** 2), rel=0.1)
    assert not any('removed' in remark for remark in adoption.remarks)


def test_adopt_takes_out_what_nothing_is_left_of() -> None:
    """One of two drives, then the effect; not what another effect of the model is."""
    there: Effects = {'coulomb_friction': {'slide_2.force': 0.4, 'lift_1.force': 0.3},
                      'payload_mass': {'mass': 0.3}}
    true: Effects = {'coulomb_friction': {'lift_1.force': 0.3}, 'payload_mass': {'mass': 0.3}}
    given, recording = given_and_recorded(there, true)
    adoption = adopt(given, EffectRequest(CATALOGUE['coulomb_friction'], ('slide_2',)), [recording])
    assert adoption.adopted
    assert any('removed from the model' in remark for remark in adoption.remarks)
    less = booked(adoption, recording)
    assert 'effects.coulomb_friction.slide_2.force' not in less.values
    assert less.values['effects.coulomb_friction.lift_1.force'] == pytest.approx(0.3, abs=0.02)
    assert less.values['effects.active'] == ['coulomb_friction', 'payload_mass']
    assert without_last_step(less.values)[0] == given.values
    _, recording = given_and_recorded({}, {'payload_mass': {'mass': 0.3}})
    adoption = adopt(less, EffectRequest(CATALOGUE['coulomb_friction']), [recording])
    assert adoption.adopted
    none = booked(adoption, recording)
    assert none.values['effects.active'] == ['payload_mass']
    assert not [key for key in none.values if '.coulomb_friction.' in key
                and key.startswith(('effects.', 'uncertainties.'))]


@pytest.mark.parametrize(('key', 'value', 'rule'), [
    ('uncertainties.payload_mas.mass', 0.1, 'unknown key'),
    ('uncertainties.payload_mass.mas', 0.1, 'belong to effects.payload_mass.mas'),
    ('uncertainties.payload_mass.mass', -0.1, 'standard deviation'),
    ('uncertainties.payload_mass.mass', np.nan, 'standard deviation')])
def test_an_uncertainty_of_nothing_is_refused(key: str, value: float, rule: str) -> None:
    with pytest.raises(ModelError, match=rule):
        DriveModel.from_parameters(
            {**with_effects(MODEL, {'payload_mass': {'mass': 0.3}}).values, key: value})
