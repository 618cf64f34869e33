# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The table of models on a single axis: the answer is its cheapest row, and a query on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from single_axis import AXIS, axis_values

from pprs_dynamics import DriveModel, compare
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms
from pprs_dynamics.inference.search.candidates import Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion

TIME = np.arange(0.0, 8.0, 0.005)
VALUES = axis_values(20.0, 40.0, 6.0, -2.0)
HIDDEN = {
    'nothing': {},
    'spring': {'drive_spring': {'stiffness': 60.0, 'position': 0.02}},
    'friction': {'coulomb_friction': {'force': 3.0}},
    'delay': {'time_delay': {'delay': 0.0173}},
    'two': {'drive_inertia': {'mass': 3.0}, 'viscous_friction': {'coefficient': 20.0}}}


def axis(hidden: dict[str, dict[str, float]]) -> DriveModel:
    """Return an axis with effects."""
    values = {f'effects.{name}.{AXIS}.{key}': value for name, block in hidden.items()
              for key, value in block.items()}
    model = DriveModel.from_parameters({**VALUES, 'effects.active': list(hidden), **values})
    return model


def record(hidden: dict[str, dict[str, float]], seed: int = 1, noise: float = 0.3,
           since: float = 0.0) -> Recording:
    """Return a recording of an axis with effects that are there from a time on [s]."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.array([0.21, 0.57, 1.13])[:, None]
    phase = omega * TIME + rng.uniform(0, 2 * np.pi, (3, 1))
    size = np.array([0.08, 0.04, 0.015])[:, None]
    motion = JointMotion(*(rows.sum(0)[:, None] for rows in (
        size * np.sin(phase), size * omega * np.cos(phase), -size * omega ** 2 * np.sin(phase))),
        TIME)
    before, after = (model.measured(model.drive_forces(motion)).total
                     for model in (axis({}), axis(hidden)))
    force = np.where(TIME[:, None] < since, before, after)
    return Recording.from_arrays('run', TIME, motion.position, motion.velocity,
                                 force + noise * rng.normal(size=force.shape), (AXIS,))


def table_of(found: Diagnosis) -> ModelTable:
    assert found.selection is not None
    return found.selection


@pytest.fixture(scope='module', params=HIDDEN)
def found(request: pytest.FixtureRequest) -> Diagnosis:
    return diagnose(axis({}), [record(HIDDEN[request.param])])


def test_the_reported_set_is_the_row_of_least_cost(found: Diagnosis) -> None:
    table = table_of(found)
    assert table.best.cost == min(row.cost for row in table.rows)
    assert {effect.name for effect in (*found.effects, *found.unconfirmed)} == {
        candidate.name for candidate in table.best.effects}
    assert {name for name, _ in found.sets[0].names} == {
        candidate.name for candidate in table.best.fitted.candidates}


@pytest.mark.parametrize('name', ['spring', 'friction', 'delay'])
def test_values_are_the_hidden_ones_within_their_uncertainty(name: str) -> None:
    effect, = diagnose(axis({}), [record(HIDDEN[name])]).effects
    for key, value in HIDDEN[name][effect.name].items():
        found = effect.parameters[f'{AXIS}.{key}']
        assert abs(found.value - value) < 4 * found.std < 0.3 * abs(value)


def test_friction_has_the_sign_of_friction_and_is_alike_in_both_directions() -> None:
    table = table_of(diagnose(axis({}), [record(HIDDEN['friction'])]))
    # The prior has its probability on one side, but for the odds of a wrong sign.
    assert table.best.terms.signs == pytest.approx(
        -2 * np.log(2 * (1 - DECISIONS.wrong_sign_odds)), abs=1e-3)
    assert any('asymmetric_friction may be the form error of friction that is the same' in
               fitted.barred for fitted in table.barred(1e3))


def test_two_effects_that_a_gain_imitates_are_the_reported_ones() -> None:
    found = diagnose(axis({}), [record(HIDDEN['two'])])
    assert {effect.name for effect in found.effects} == set(HIDDEN['two'])


def test_evidence_is_a_difference_of_two_rows(found: Diagnosis) -> None:
    table = table_of(found)
    for effect in found.effects:
        without = min(row.cost for row in table.rows
                      if effect.name not in {candidate.name for candidate in row.effects})
        assert effect.evidence == pytest.approx(without - table.best.cost)
        assert effect.evidence > 0


def test_costs_do_not_depend_on_the_order_of_recordings_or_of_fits() -> None:
    runs = [record(HIDDEN['two'], seed) for seed in (1, 2)]
    design = [Design.of(axis({}), order) for order in (runs, runs[::-1])]
    candidates = tuple(EffectCandidate.of([Component.of(CATALOGUE[name], 0, {}, CATALOGUE[
        name].variants[0])]) for name in HIDDEN['two'])
    forth, back = (FittedSets(one, DECISIONS) for one in design)
    costs = [forth.evaluate(candidates).cost, back.evaluate(candidates[::-1]).cost]
    assert costs[0] == pytest.approx(costs[1], abs=1e-3)
    back.evaluate(candidates[:1])
    again = FittedSets(design[1], DECISIONS)
    again.evaluate(candidates[1:])
    assert again.evaluate(candidates).cost == pytest.approx(costs[1], abs=1e-6)


def test_an_effect_that_raises_the_error_of_held_out_recordings_is_unknown() -> None:
    found = diagnose(axis({}), [record(HIDDEN['friction'])], [record({}, 2)])
    assert found.verdict == 'unknown'
    assert found.effects == ()
    (refuted,) = found.unconfirmed
    assert refuted.name == 'coulomb_friction'
    assert refuted.held_out_after > refuted.held_out_before
    assert refuted.certainty < -2


@pytest.mark.parametrize('is_there', [True, False])
def test_held_out_recordings_count_for_effects_that_begin(is_there: bool) -> None:
    begun = record(HIDDEN['friction'], since=4.0)
    other = record(HIDDEN['friction'] if is_there else {}, 2)
    found = diagnose(axis({}), [begun], [other])
    (effect,) = found.effects if is_there else found.unconfirmed
    assert found.verdict == ('effect' if is_there else 'unknown')
    assert effect.course is not None
    assert effect.course.begin == pytest.approx(4.0, abs=0.1)
    before = rms(measure_residuals(axis({}), [other])[0])
    assert (effect.held_out_after < before) is is_there
    assert effect.held_out_before == pytest.approx(before, rel=0.05)


def test_an_onset_is_a_row_beside_the_constant_effect() -> None:
    table = table_of(diagnose(axis({}), [record(HIDDEN['friction'], since=4.0)]))
    assert table.best.fitted.is_dated
    constant = next(row for row in table.rows
                    if row.effects and not row.fitted.is_dated)
    assert constant.cost > table.best.cost + DECISIONS.rival_margin


@pytest.mark.parametrize('name', ['nothing', 'spring', 'friction', 'two'])
def test_compare_and_diagnose_print_the_same_noise(name: str) -> None:
    run = record(HIDDEN[name])
    compared = compare(axis({}), run).comparison.drives[AXIS].noise_floor
    assert compared == pytest.approx(diagnose(axis({}), [run]).noise_floors[AXIS], rel=1e-6)
    # White noise of 0.3 N in means over 10 ms, of two samples each.
    assert compared == pytest.approx(0.3 / 2 ** 0.5, rel=0.05)


def test_a_residual_of_five_times_the_noise_is_never_an_effect() -> None:
    """A spring whose force bends by a sixth of itself, far above the noise."""
    run = record({'drive_spring': {'stiffness': 3000.0, 'position': 0.0}}, noise=0.3)
    q = run.position
    bent = replace(run, effort=run.effort + 3000.0 * 0.25 * np.abs(q) * q / np.abs(q).max())
    found = diagnose(axis({}), [bent])
    ratio = float(np.nanstd(found.remaining)) / found.noise_floors[AXIS]
    assert ratio < 5 or found.verdict == 'unknown'
