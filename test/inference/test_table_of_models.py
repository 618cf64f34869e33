# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a table of models says of rivals, suspects and residuals, where costs of rows are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from single_axis import AXIS, Effects, axis, axis_recording

from pprs_dynamics.inference.diagnosis.answer import Answer, objection, rival_effects
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.candidates import (
    Candidate,
    Component,
    CostTerms,
    EffectCandidate,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.estimates import estimate
from pprs_dynamics.inference.search.form_error import SHAPES
from pprs_dynamics.inference.search.held_out import BLOCKS, HeldOut, PredictiveGain
from pprs_dynamics.inference.search.table import ModelTable, Row, with_exact_best
from pprs_dynamics.inference.search.unknown import best_patterns
from pprs_dynamics.physics.effects.catalogue import CATALOGUE

TWO: Effects = {'drive_inertia': {'mass': 3.0}, 'viscous_friction': {'coefficient': 20.0}}
MARGIN = DECISIONS.rival_margin


@cache
def table_of(*names: str) -> ModelTable:
    """Return the table of an axis with effects of `TWO`."""
    run = axis_recording(axis({name: TWO[name] for name in names}))
    table = diagnose(axis(), [run]).selection
    assert table is not None
    assert {effect.name for effect in table.best.effects} == set(names)
    return table


def effect(name: str, variant: int = 0) -> EffectCandidate:
    kind = CATALOGUE[name]
    return EffectCandidate.of([Component.of(kind, 0, {}, kind.variants[variant])])


def with_rows(table: ModelTable, costs: Mapping[tuple[Candidate, ...], float]) -> ModelTable:
    """Return a table in which only the best row and these are near, at costs above the best."""
    exact = {table.best.fitted.row_key: table.best}
    for candidates, above in costs.items():
        fitted = replace(table.last.evaluate(candidates), barred='')
        exact[fitted.row_key] = Row(table.last, fitted, table.best.cost + above - fitted.total)
    return replace(table, exact={**table.exact, **exact})


VISCOUS, INERTIA, SPRING, DRY = map(effect, (
    'viscous_friction', 'drive_inertia', 'drive_spring', 'coulomb_friction'))


def test_one_effect_in_the_place_of_two_is_a_rival_of_both() -> None:
    table = with_rows(table_of(*TWO), {(SPRING,): 1.0})
    assert set(Answer(table, table.best, ()).diagnosis().indistinguishable) >= {
        (name, 'drive_spring') for name in TWO}


def test_the_row_of_least_cost_has_the_cost_of_exact_forces() -> None:
    """Exact forces are dear for all rows that were the best: another row takes their place."""
    table = table_of('viscous_friction')
    dear = replace(table, exact={key: replace(row, linearisation=1e6)
                                 for key, row in table.exact.items()})
    assert not dear.best.is_exact
    assert with_exact_best(dear).best.is_exact


def test_an_effect_that_claims_two_things_pays_for_two() -> None:
    costs, name = table_of('viscous_friction').last.prior_costs, 'asymmetric_friction'
    forms = (effect(name, variant) for variant in range(len(CATALOGUE[name].variants)))
    pays = {len(form.hypotheses): costs.of_candidate(form, lambda component: CostTerms()).names
            for form in forms}
    assert 1 < pays[1] == pytest.approx(pays[2] / 2)


def test_a_rival_is_taken_from_a_row_without_the_effect_that_it_replaces() -> None:
    table = with_rows(table_of(*TWO), {(VISCOUS, INERTIA, SPRING): 1.0, (VISCOUS, SPRING): 2.0})
    rival, = (rival for rival in rival_effects(Answer(table, table.best, ()).diagnosis())
              if rival.found.name == 'drive_spring')
    assert rival.of == 'drive_inertia'
    assert rival.cost == pytest.approx(2.0)


def test_a_suspect_is_one_more_effect_beside_all_that_is_reported() -> None:
    table = table_of('viscous_friction')
    pattern = best_patterns(table.patterns, table.last.evaluate(()).fit, 1)[0]
    found = with_rows(table, {(INERTIA, pattern): 1.0, (VISCOUS, SPRING): 2.0})
    assert [candidate.name for candidate, _ in found.suspects(5.0)] == ['drive_spring']


@pytest.mark.parametrize(('present', 'missing', 'low', 'high', 'verdict'), [
    # Beyond what the form of a small force may leave, and within what that of a large one may.
    ({'coulomb_friction': {'force': 0.3}}, {'drive_spring': {'stiffness': 4.0, 'position': 0.0}},
     1.5, 5.0, 'unknown'),
    ({'coulomb_friction': {'force': 12.0}}, {'drive_inertia': {'mass': 1.0}}, -1, 1, 'effect')])
def test_what_no_form_explains_is_above_the_noise(
    present: Effects, missing: Effects, low: float, high: float, verdict: str,
) -> None:
    table = diagnose(axis(), [axis_recording(axis({**present, **missing}))]).selection
    assert table is not None
    fits = table.best.fits
    fitted = fits.evaluate(tuple(c for c in table.best.fitted.candidates if c.name in present))
    found = Answer(table, Row(fits, fitted, 0.0), ()).diagnosis()
    assert {e.name for e in found.effects} == set(present)
    assert low < found.above_noise.get(AXIS, 0.0) < high
    assert found.verdict == verdict


def test_one_form_error_of_a_hundred_is_too_large() -> None:
    errors = DECISIONS.form_share * np.random.default_rng(4).normal(size=(200_000, SHAPES))
    share = np.mean(np.sqrt(np.mean(errors ** 2, axis=1)) > DECISIONS.most_form_share)
    assert share == pytest.approx(0.01, abs=0.001)


def test_an_effect_within_the_form_error_of_the_models_friction_is_not_reported() -> None:
    """Of 40 N s/m, 1.5 % is the form error beside another effect."""
    small: Effects = {'viscous_friction': {'coefficient': 0.3}}
    found = diagnose(axis(), [axis_recording(axis({'drive_inertia': {'mass': 3.0}, **small}))])
    assert 'viscous_friction' not in {e.name for e in found.effects}
    alone = diagnose(axis(), [axis_recording(axis(small), noise=0.05)])
    assert [e.name for e in alone.effects] == ['viscous_friction']


def test_an_uncertainty_is_that_of_all_near_sets_with_the_effect() -> None:
    """About the reported value, weighed by exp(-cost / 2): whether 30 g are missing is in doubt."""
    table = diagnose(axis(), [axis_recording(axis(
        {'viscous_friction': {'coefficient': 12.0}, 'drive_inertia': {'mass': 0.03}}))]).selection
    assert table is not None
    key, answer = f'{AXIS}.coefficient', Answer(table, table.best, ())
    found = next(e for e in answer.effects if e.name == 'viscous_friction').parameters[key]
    values, weights = [], []
    for cost, fitted in [(0.0, table.reported), *table.near(MARGIN)]:
        for friction in (c for c in fitted.effects if c.name == 'viscous_friction'):
            values.append(estimate(table.last, fitted, friction).parameters[key])
            weights.append(np.exp(-cost / 2))
    assert len(values) > 2
    squares = [v.std ** 2 + (v.value - found.value) ** 2 for v in values]
    assert found.std ** 2 == pytest.approx(np.average(squares, weights=weights), rel=1e-3)
    assert found.std > 1.01 * values[0].std


def gain(*in_errors: float) -> PredictiveGain:
    """Return gains of drives that are so many of their standard errors."""
    spread = 10 * np.tile([-1.0, 1.0], 5)[:, None]
    return PredictiveGain(tuple('abcdef'[:len(in_errors)]), spread + np.array(in_errors)
                          * spread.std(ddof=1) / 10 ** 0.5, np.full((10, len(in_errors)), 1e-3))


@pytest.mark.parametrize(('ratio', 'found', 'words'), [
    (2.0, gain(9.0), ''), (1.01, gain(9.0), ''), (1.0, gain(9.0), 'the error does not fall'),
    (2.0, None, 'cannot confirm it'), (2.0, gain(np.nan), 'cannot confirm it'),
    (2.0, gain(-3.0), 'predicted worse with it, by 3 standard errors'), (2.0, gain(-1.0), ''),
    (2.0, gain(4.0, -4.0), 'of b are predicted worse'), (2.0, gain(90.0, -4.0), '')])
def test_data_object_to_an_effect_that_raises_the_error(
    ratio: float, found: PredictiveGain | None, words: str,
) -> None:
    said = objection(ratio, found, DECISIONS)
    assert words in said
    assert bool(said) is bool(words)


def test_a_fit_pays_for_the_numbers_that_it_moves() -> None:
    residuals, _ = measure_residuals(axis(), [axis_recording(axis())])
    free, moved = (HeldOut(1.0, np.full(BLOCKS, penalty), residuals) for penalty in (0.0, 3.0))
    assert free.gain(moved).gains.sum() == pytest.approx(-3.0 * BLOCKS / BLOCKS)


# What is said would have been seen is seen, and what is much smaller is not.

# What each adds per unit of its one number.
NUMBERS = {'coulomb_friction': 'force', 'viscous_friction': 'coefficient', 'drive_inertia': 'mass',
           'effort_offset': 'force'}


def told(seed: int, name: str = '', size: float = 0.0, noise: float = 0.3) -> Diagnosis:
    robot = axis({name: {NUMBERS[name]: size}} if name else {})
    return diagnose(axis(), [axis_recording(robot, seed, noise)])


@pytest.fixture(scope='module')
def adequate() -> Diagnosis:
    found = told(1)
    assert found.verdict == 'adequate'
    return found


@pytest.mark.parametrize('name', [
    'coulomb_friction', 'drive_inertia', *(pytest.param(name, marks=pytest.mark.slow) for name in (
        'viscous_friction', 'effort_offset'))])
def test_an_effect_of_twice_the_size_is_seen_and_one_of_a_quarter_is_not(
        name: str, adequate: Diagnosis) -> None:
    size = next(limit.size for limit in adequate.detectable if limit.name == name)
    for seed in (2, 3):
        assert told(seed, name, 2 * size).verdict != 'adequate'
        assert told(seed, name, size / 4).verdict == 'adequate'


def test_more_noise_hides_more(adequate: Diagnosis) -> None:
    loud = {limit.name: limit.size for limit in told(5, noise=0.7).detectable}
    quiet = {limit.name: limit.size for limit in adequate.detectable}
    for name in ('drive_inertia', 'coulomb_friction'):
        assert loud[name] > 1.5 * quiet[name]


def test_what_was_found_or_is_in_the_model_is_not_listed(adequate: Diagnosis) -> None:
    size = next(d.size for d in adequate.detectable if d.name == 'viscous_friction')
    found = told(2, 'viscous_friction', 20 * size)
    assert [e.name for e in found.effects] == ['viscous_friction']
    names = {limit.name for limit in found.detectable}
    assert 'viscous_friction' not in names
    assert 'drive_inertia' in names
