# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search, against an exhaustive one on small catalogues, and around effects that bend."""

from __future__ import annotations

import numpy as np
import pytest
from model_recordings import record, with_effects
from single_axis import Effects, axis, axis_recording

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_model import (
    fitted_model,
    linear_prediction,
    next_operating_point,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.table import Row, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE

MODEL = DriveModel.load()


def recording_of(effects: dict[str, dict[str, float]], noise: float = 0.08,
                 duration: float = 12.0) -> Recording:
    """Return a recording of the paper's robot with effects."""
    return record(with_effects(MODEL, effects), noise, time=np.arange(0, duration, 0.005))


def names(found: CandidateSet) -> list[str]:
    return sorted(candidate.name for candidate in found.candidates)


@pytest.mark.parametrize('effects', [
    {'homing_error': {f'{drive}.zero': 0.004 for drive in DRIVES[:2]}},
    {'time_delay': {f'{drive}.delay': 0.012 for drive in DRIVES}},
    {'base_tilt': {'x': 0.12, 'y': -0.08}},
    pytest.param({'time_delay': {f'{drive}.delay': 0.008 for drive in DRIVES},
                  'stribeck_friction': {'lift_1.force': 1.0, 'lift_1.velocity': 0.02}},
                 marks=pytest.mark.slow)], ids=lambda effects: '+'.join(effects))
def test_effects_that_bend_the_columns_are_found_alone_around_themselves(effects: dict) -> None:
    recording = recording_of(effects)
    row = tabulate(MODEL, [recording], DECISIONS).best
    found, last = row.fitted, row.fits
    assert names(found) == sorted(effects)
    # Around the last point the linear forces are those of the model that is handed on.
    exact = last.design.exact_forces(fitted_model(last, found))
    assert squared(last, found, exact - linear_prediction(last, found)) < 50


@pytest.mark.parametrize(('noise', 'effects'), [
    (0.08, {'coulomb_friction': {'slide_1.force': 0.6},
            'quadratic_friction': {'slide_2.coefficient': 20.0}}),
    (0.3, {'coulomb_friction': {f'{drive}.force': 0.8 for drive in DRIVES},
           'effort_offset': {f'{drive}.force': 0.7 for drive in DRIVES}})])
def test_two_effects_are_not_one_flexible_effect(noise: float, effects: Effects) -> None:
    found = tabulate(MODEL, [recording_of(effects, noise)], DECISIONS).best.effects
    assert {effect.name: [DRIVES[d] for d in effect.drives or ()] for effect in found} == {
        name: [key.split('.')[0] for key in values] for name, values in effects.items()}


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
    costs = [Row.exact(*pair).cost for pair in ((fits, tilted), (elsewhere, there))]
    assert costs[0] == pytest.approx(costs[1], abs=1)
    # That of the true set is below its linear cost, of which tilts by 6 degrees are no small part.
    assert costs[0] < tilted.total


def test_a_form_error_explains_nothing_where_exact_forces_leave_nothing() -> None:
    """What other columns explained of linear forces was counted on top of what exact ones do."""
    effects = {'effort_filter': {'time_constant': 0.014},
               'stribeck_friction': {'force': 2.0, 'velocity': 0.1}}
    best = tabulate(axis(), [axis_recording(axis(effects), noise=0.03)], DECISIONS).best
    assert names(best.fitted) == sorted(effects)
    assert best.fitted.terms.forms == pytest.approx(0, abs=2)


def test_a_relinearised_set_is_on_the_drives_where_it_costs_least() -> None:
    hidden = {f'{drive}.zero': 0.004 for drive in DRIVES[:2]}
    fits = FittedSets(Design.of(MODEL, [recording_of({'homing_error': hidden})]), DECISIONS)
    zeros = [Component.of(CATALOGUE['homing_error'], d, {}, CATALOGUE['homing_error'].variants[0])
             for d in range(3)]
    for drives in ((0,), (0, 1, 2)):
        found = fits.evaluate((EffectCandidate.of(zeros[d] for d in drives),))
        assert Row.exact(fits, found).fitted.effects[0].drives == (0, 1)


def test_a_small_effect_beside_a_large_one_is_the_form_error_of_that() -> None:
    """Both frictions of joints are less than a tenth of the drag, of which no form is known."""
    recording = recording_of({'tool_drag': {'coefficient': 12.0, 'rotational': 0.0},
                              'joint_friction': {'revolute.viscous': 0.02}}, 0.02, 8.0)
    table = tabulate(MODEL, [recording], DECISIONS)
    assert names(table.best.fitted) == ['tool_drag']
    assert any('joint_friction may be the form error of tool_drag' in found.barred
               for found in table.barred(DECISIONS.rival_margin))


@pytest.mark.parametrize('seed', [1, 9])
@pytest.mark.parametrize(('effects', 'changes'), [
    ({}, {'links.mass': (23.0,), 'friction.viscous': (60.0,), 'friction.coulomb': (6.6,)}),
    ({'stribeck_friction': {'force': 0.86, 'velocity': 0.064}},
     {'links.mass': (23.9,), 'friction.coulomb': (8.5,)})])
def test_an_effect_within_the_form_error_of_others_makes_no_other_effect(
    effects: Effects, changes: dict[str, tuple[float, ...]], seed: int,
) -> None:
    """Excluded as a form error, a third effect left dearer sets with a wrong gain to report."""
    table = tabulate(axis(), [axis_recording(axis(effects, **changes), seed)], DECISIONS)
    found = set(names(table.best.fitted))
    assert 'drive_inertia' in found
    assert found <= {'drive_inertia', 'viscous_friction', 'coulomb_friction', *effects}
