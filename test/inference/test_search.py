# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search, against an exhaustive one on small catalogues, and around effects that bend."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, combinations, repeat

import numpy as np
import pytest

from pprs_dynamics import DriveModel, MechanismModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.regression import design as design_module
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search import relinearisation
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.inference.search.fitted_model import (
    exact_forces,
    fitted_model,
    linear_prediction,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.ranking import select
from pprs_dynamics.inference.search.relinearisation import (
    ExactSet,
    linearised,
    next_operating_point,
    search_around_fitted,
)
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.model.robot_block import AXIS

AXIS_VALUES = {'axis.mass': 20.0, 'axis.viscous': 40.0, 'axis.coulomb': 6.0, 'axis.offset': -2.0,
               'friction.reversal_velocity': 0.001}
SMALL = ('coulomb_friction', 'viscous_friction', 'quadratic_friction', 'effort_offset',
         'drive_spring', 'drive_inertia', 'effort_gain')
MODEL = DriveModel.load()
TIME = np.arange(6000) * 0.002


def axis_recording(hidden: dict[str, dict[str, float]], seed: int, noise: float = 0.3,
                   ) -> Recording:
    """Return a recording of an axis that has some effects which its model has not."""
    values = {f'effects.{name}.{AXIS}.{key}': value for name, block in hidden.items()
              for key, value in block.items()}
    model = build_model({**AXIS_VALUES, 'effects.active': list(hidden), **values})
    assert isinstance(model, MechanismModel)
    rng = np.random.default_rng(seed)
    time = np.arange(0, 20, 0.002)
    omega = 2 * np.pi * np.array([0.21, 0.37, 0.83])[:, None]
    phase = omega * time + rng.uniform(0, 2 * np.pi, (3, 1))
    size = np.array([0.08, 0.04, 0.015])[:, None]
    q = (size * np.sin(phase)).sum(0)[:, None]
    from pprs_dynamics import JointMotion
    motion = JointMotion(q, (size * omega * np.cos(phase)).sum(0)[:, None],
                         -(size * omega ** 2 * np.sin(phase)).sum(0)[:, None], time=time)
    force = model.measured(model.drive_forces(motion)).total
    return Recording.from_arrays('axis', time, q, None,
                                 force + noise * rng.normal(size=force.shape), (AXIS,))


@pytest.fixture
def small_catalogue(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design_module, 'catalogue', lambda: {
        name: CATALOGUE[name] for name in SMALL})


@pytest.mark.usefixtures('small_catalogue')
@pytest.mark.parametrize(('hidden', 'seed'), [
    ({}, 0), ({'drive_spring': {'stiffness': 30.0, 'position': 0.02}}, 1),
    ({'coulomb_friction': {'force': 0.6}, 'drive_inertia': {'mass': 1.0}}, 2),
    ({'viscous_friction': {'coefficient': 6.0}, 'effort_offset': {'force': 0.5},
      'effort_gain': {'gain': 0.05}}, 3),
    ({'quadratic_friction': {'coefficient': 30.0}, 'drive_spring': {
        'stiffness': 20.0, 'position': -0.05}}, 4)])
def test_the_search_ends_at_the_best_of_all_sets(hidden: dict, seed: int) -> None:
    design = Design.of(build_model(AXIS_VALUES), [axis_recording(hidden, seed)])
    search = Search(FittedSets(design, DECISIONS))
    found = search.run()
    exhaustive = FittedSets(design, DECISIONS)
    best = exhaustive.evaluate(())
    every: list[EffectCandidate] = []
    for name in SMALL:
        effect = CATALOGUE[name]
        assert issubclass(effect, DriveEffect)
        if design.acts_on(effect, 0):
            every += [EffectCandidate.of([Component.of(effect, 0, {}, names)])
                      for names in effect.variants]
    for size in (1, 2, 3, 4):
        for chosen in combinations(every, size):
            if len({one.name for one in chosen}) == size:
                best = min(best, exhaustive.evaluate(chosen), key=lambda one: one.cost)
    assert found.cost < best.cost + 0.2
    assert {one.name for one in found.effects} == {one.name for one in best.effects}
    assert {one.name for one in found.effects} == set(hidden)


@pytest.mark.usefixtures('small_catalogue')
def test_what_does_not_pay_in_a_set_is_pruned() -> None:
    recording = axis_recording({'drive_spring': {'stiffness': 30.0, 'position': 0.02}}, 1)
    fits = FittedSets(Design.of(build_model(AXIS_VALUES), [recording]), DECISIONS)
    spring, drag, gain = (EffectCandidate.of([Component.of(
        CATALOGUE[name], 0, {}, CATALOGUE[name].variants[0])])
        for name in ('drive_spring', 'quadratic_friction', 'effort_gain'))
    assert names(fits.pruned(fits.evaluate((spring, drag, gain)))) == ['drive_spring']
    assert fits.pruned(fits.evaluate(())).candidates == ()


def recording_of(effects: dict[str, dict], noise: float = 0.08, seed: int = 0) -> Recording:
    """Return a recording of the paper's robot with effects, {name: {drive or key: ...}}."""
    values = {}
    for name, block in effects.items():
        for key, value in block.items():
            if isinstance(value, dict):
                values |= {f'effects.{name}.{key}.{p}': v for p, v in value.items()}
            else:
                values[f'effects.{name}.{key}'] = value
    model = build_model({**MODEL.values, 'effects.active': list(effects), **values})
    forces = model.drive_forces(Excitation().motion(TIME).with_time(TIME))
    said = model.measured(forces)
    rng = np.random.default_rng(seed)
    return Recording.from_arrays('made', TIME, forces.mechanism.position
                                 + model.position_error(forces.mechanism.position),
                                 effort=said.total + noise * rng.normal(size=said.total.shape))


def names(found: CandidateSet) -> list[str]:
    return sorted(candidate.name for candidate in found.candidates)


@pytest.mark.parametrize('effects', [
    {'homing_error': {drive: {'zero': 0.004} for drive in DRIVES[:2]}},
    {'time_delay': {drive: {'delay': 0.012} for drive in DRIVES}},
    {'base_tilt': {'x': 0.12, 'y': -0.08}}, {'payload_offset': {'x': 0.03, 'y': 0.0, 'z': 0.02}},
    {'time_delay': {drive: {'delay': 0.008} for drive in DRIVES},
     'stribeck_friction': {'lift_1': {'force': 1.0, 'velocity': 0.02}}}],
    ids=lambda effects: '+'.join(effects))
def test_effects_that_bend_the_columns_are_found_alone_around_themselves(effects: dict) -> None:
    recording = recording_of(effects)
    ranking = select(MODEL, [recording], DECISIONS)
    found, last = ranking.reported, ranking.last
    assert names(found) == sorted(effects)
    # Around the last point the linear forces are those of the model that is handed on.
    exact = exact_forces(last.design, fitted_model(last, found))
    assert squared(last, found, exact - linear_prediction(last, found)) < 50


@pytest.mark.slow
def test_without_an_effect_that_bent_the_columns_the_search_begins_again() -> None:
    """What else was found may only have made good what that one did."""
    delayed = {drive: {'delay': 0.01} for drive in DRIVES}
    ranking = select(MODEL, [recording_of({
        'time_delay': delayed, 'stribeck_friction': {'lift_1': {'force': 1.0, 'velocity': 0.02}}})],
        DECISIONS)
    delay, stribeck = (next(one for one in ranking.reported.effects if one.name == name)
                       for name in ('time_delay', 'stribeck_friction'))
    without = ranking.less(delay)
    assert without.refuted == {(delay.effect, d) for d in range(6)}
    assert 'time_delay' not in {name for found in without.sets for name in names(found)}
    # As if it had never been found.
    assert without.nothing.cost == pytest.approx(ranking.nothing.cost)
    assert without.last is not ranking.last
    # A linear one takes along what paid beside it, and the search stands.
    simpler = ranking.less(stribeck)
    assert simpler.last is ranking.last
    assert names(simpler.reported) == ['time_delay']


TILTED = EffectCandidate.of([Component.of(CATALOGUE['base_tilt'], None, {}, ('x', 'y'))])


def test_what_a_set_costs_by_its_exact_forces_does_not_depend_on_where_it_was_found() -> None:
    fits = FittedSets(Design.of(MODEL, [recording_of({'base_tilt': {'x': 0.1, 'y': -0.05}})]),
                      DECISIONS)
    tilted = fits.evaluate((TILTED,))
    # Around a model with a wrench and a delay, the linear cost is another.
    point = next_operating_point(fits, fits.evaluate(tuple(
        EffectCandidate.of([Component.of(CATALOGUE[name], drive, shape, coefficients)])
        for name, drive, shape, coefficients in (
            ('external_wrench', None, {}, CATALOGUE['external_wrench'].variants[-1]),
            ('time_delay', 0, {'delay': 0.01}, ())))))
    assert point is not None
    elsewhere = FittedSets(fits.design.around(point), DECISIONS, fits.regression.error_scale)
    there = elsewhere.evaluate((TILTED,))
    assert abs(there.total - tilted.total) > 3
    costs = [ExactSet.of(*one).cost for one in ((fits, tilted), (elsewhere, there))]
    assert costs[0] == pytest.approx(costs[1], abs=1)
    # That of the true set is below its linear cost, of which tilts by 6 degrees are no small part.
    assert costs[0] < tilted.total


def test_a_set_of_which_no_step_lowers_the_exact_error_stands_for_the_best_model_so_far(
        monkeypatch: pytest.MonkeyPatch) -> None:
    fits = FittedSets(Design.of(MODEL, [recording_of({'base_tilt': {'x': 0.1, 'y': -0.05}})]),
                      DECISIONS)
    point = next_operating_point(fits, fits.evaluate((TILTED,)))
    assert point is not None
    around = FittedSets(fits.design.around(point), DECISIONS, fits.regression.error_scale)
    free = around.evaluate((TILTED,))
    # Far from linear, and every step leaves more than the point does.
    losses = chain([100.0, 100.0, 0.0], repeat(100.0))
    monkeypatch.setattr(relinearisation, 'squared', lambda *given: next(losses))
    last, held = linearised(around, free)
    assert last is around
    assert not np.allclose(exact_forces(fits.design, fitted_model(around, free)),
                           around.design.forces, atol=1e-3)
    np.testing.assert_allclose(exact_forces(fits.design, fitted_model(around, held)),
                               around.design.forces, atol=1e-6)
    assert held.total > free.total


def test_a_relinearised_set_is_on_the_drives_where_it_costs_least() -> None:
    hidden = {drive: {'zero': 0.004} for drive in DRIVES[:2]}
    fits = FittedSets(Design.of(MODEL, [recording_of({'homing_error': hidden})]), DECISIONS)
    zeros = [Component.of(CATALOGUE['homing_error'], d, {}, CATALOGUE['homing_error'].variants[0])
             for d in range(3)]
    for drives in ((0,), (0, 1, 2)):
        found = fits.evaluate((EffectCandidate.of(zeros[d] for d in drives),))
        assert ExactSet.of(fits, found).fitted.effects[0].drives == (0, 1)


def test_what_costs_least_by_exact_forces_is_the_best_whatever_its_linear_cost(
        monkeypatch: pytest.MonkeyPatch) -> None:
    recording = recording_of({'base_tilt': {'x': 0.05, 'y': 0.0}})
    first = Search(FittedSets(Design.of(MODEL, [recording]), DECISIONS))
    search, found, _ = search_around_fitted(first, lambda share: None)
    assert search is not first
    assert names(found) == ['base_tilt']
    # Were all but the empty set dear by their exact forces, nothing would be found.
    made = ExactSet.of
    monkeypatch.setattr(ExactSet, 'of', lambda fits, found: replace(
        made(fits, found), cost=float(len(found.candidates))))
    monkeypatch.setattr(relinearisation, '_shortlist', lambda fits, margin: [
        fits.evaluate(()), fits.evaluate((TILTED,))])
    first = Search(FittedSets(Design.of(MODEL, [recording]), DECISIONS))
    search, found, exact = search_around_fitted(first, lambda share: None)
    assert names(found) == []
    assert search is first
    assert exact == {frozenset(): 0.0, frozenset({'base_tilt'}): 1.0}


@pytest.mark.parametrize(('viscous', 'stands_out'), [(0.02, False), (0.08, True)])
def test_what_may_be_lack_of_fit_is_told_once_it_stands_out_of_the_noise(
        viscous: float, stands_out: bool) -> None:
    # Both are less than a tenth of what the drag is.
    recording = recording_of({'tool_drag': {'coefficient': 12.0, 'rotational': 0.0},
                              'joint_friction': {'revolute.viscous': viscous}}, 0.02)
    ranking = select(MODEL, [recording], DECISIONS)
    assert names(ranking.map_set) == ['joint_friction', 'tool_drag']
    assert ('joint_friction' in names(ranking.reported)) is stands_out
    assert [one.candidate.name for one in ranking.absorbed] == [
        'joint_friction'] * (not stands_out)


def wrench_on_guides(follows: bool, seed: int) -> list[str]:
    """Return what is reported of a wrench whose load friction follows, or does not."""
    wrench = {'force_x': 6.0, 'force_y': -4.0, 'force_z': 5.0, 'moment_x': 0.1, 'moment_y': 0.1,
              'moment_z': 0.0}
    model = build_model({**MODEL.values, 'effects.active': ['external_wrench'],
                         **{f'effects.external_wrench.{k}': v for k, v in wrench.items()}})
    forces = model.drive_forces(Excitation().motion(TIME).with_time(TIME))
    plain = MODEL.drive_forces(Excitation().motion(TIME).with_time(TIME))
    total = forces.total if follows else plain.total + forces.parts['external_wrench']
    noise = 0.05 * np.random.default_rng(seed).normal(size=total.shape)
    recording = Recording.from_arrays('made', TIME, forces.mechanism.position, effort=total + noise)
    return names(select(MODEL, [recording], DECISIONS).reported)


def test_a_wrench_on_guides_that_feel_it_hides_no_effect_and_makes_none() -> None:
    assert wrench_on_guides(True, 3) == ['external_wrench']


@pytest.mark.slow
def test_a_wrench_on_preloaded_guides_is_mostly_told_alone() -> None:
    """Friction as if the wrench did not load the guides: a preload is all they feel.

    It is told alone in 8 of 12 draws of the noise; else Coulomb friction, friction by load or
    what imitates both stands beside it, or in its place.
    """
    found = [wrench_on_guides(False, seed) for seed in range(100, 106)]
    assert sum(each == ['external_wrench'] for each in found) >= 3, found


def test_coulomb_and_viscous_friction_are_two_and_not_one_that_is_asymmetric() -> None:
    hidden = {'coulomb_friction': {'lift_1': {'force': 0.5}},
              'viscous_friction': {'lift_1': {'coefficient': 6.0}}}
    found = select(MODEL, [recording_of(hidden)], DECISIONS)
    assert names(found.map_set) == ['coulomb_friction', 'viscous_friction']
    assert found.rivals(DECISIONS.rival_margin) == []
    # One that is both is told with its cost.
    assert found.sets[0] is found.map_set
    both = next(one for one in found.sets if names(one) == ['asymmetric_friction'])
    assert both.cost > found.map_set.cost


def test_a_freer_form_of_what_was_found_is_no_rival() -> None:
    found = select(MODEL, [recording_of({'viscous_friction': {'slide_3': {'coefficient': 6.0}}})],
                   DECISIONS)
    assert names(found.reported) == ['viscous_friction']
    # It is among the sets, near or not, and never told as another explanation.
    assert any(names(one) == ['asymmetric_friction'] for one in found.sets)
    assert 'asymmetric_friction' not in {
        name for rival in found.rivals(1e6) for name in rival.instead
        if names(rival.fitted) == ['asymmetric_friction']}


def test_one_cause_wins_over_several_that_imitate_it() -> None:
    found = select(MODEL, [recording_of({'link_mass': {'rods.mass': 0.12}})], DECISIONS).map_set
    assert names(found) == ['link_mass']


def test_a_line_on_one_drive_is_unknown_at_its_frequency() -> None:
    recording = recording_of({}, 0.05)
    effort = recording.effort.copy()
    effort[:, 3] += 0.9 * np.sin(2 * np.pi * 6.1 * TIME)
    found = select(MODEL, [Recording.from_arrays('made', TIME, recording.position, effort=effort)],
                   DECISIONS).map_set
    assert not found.effects
    assert [c.drives for c in found.unknowns] == [(3,)]
    assert found.unknowns[0].pattern.scale == pytest.approx(6.1, rel=0.001)


def test_every_decision_has_a_unit_and_a_reason() -> None:
    table = DECISIONS.table()
    for name, _, unit, decides, reason in table:
        assert unit, name
        assert decides, name
        assert len(reason) > 5 or reason == '95 %' or reason == 'the same', name
    assert {name: value for name, value, *_ in table if name in vars(Decisions())} == vars(
        Decisions())
