# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The search on spaces of random columns whose truth is known, against an exhaustive one.

No recording, no robot: seven effects, some in the structure and some on three drives, each a
random curve. What is found must be the best of all sets; costs must not depend on what was fitted
before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.base_columns import BaseColumn
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search import candidates as candidates_module
from pprs_dynamics.inference.search import components as components_module
from pprs_dynamics.inference.search.candidates import (
    Candidates,
    CandidateSet,
    Component,
    EffectCandidate,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.fitted_model import linear_residual
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.held_out import hold_out
from pprs_dynamics.inference.search.search import Search, simplified
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter
from pprs_dynamics.physics.effects.structure_effect import StructureEffect

SAMPLES, PERIOD = 700, 0.01
DRIVES = ('a', 'b', 'c')
MODEL = DriveModel.load()
SIZE = (Parameter('size', 's', 'N', 'size', -1e3, 1e3),)
IN_STRUCTURE = [type(f'Structure{k}', (StructureEffect,), {
    'name': f'structure_{k}', 'linear': SIZE, 'idealised': False}) for k in range(5)]
ON_DRIVES = [type(f'Drive{k}', (DriveEffect,), {
    'name': f'drive_{k}', 'linear': SIZE, 'idealised': False}) for k in range(2)]
EVERY = [*IN_STRUCTURE, *ON_DRIVES]


@dataclass
class RandomDesign(Design):
    """A design whose columns are given."""

    columns: Mapping[tuple[str, int | None], Mapping[int, Array]] = field(default_factory=dict)

    @property
    def covered(self) -> tuple[DriveRange, ...]:  # type: ignore[override]
        return tuple(DriveRange(SAMPLES * PERIOD, PERIOD, 1.0, 1.0) for _ in DRIVES)

    def moves(self, drive: int) -> bool:
        return True

    def acts_on(self, effect: type[CatalogueEffect], drive: int) -> bool:
        return effect in ON_DRIVES

    def term(self, effect: type[DriveEffect], drive: int, shape: Mapping[str, float]) -> Term:
        return Term(effect, drive, {}, self.columns[effect.name, drive])

    def trial_terms(self, effect: type[DriveEffect], drive: int,
                    shapes: Sequence[Mapping[str, float]]) -> list[Term]:
        return [self.term(effect, drive, {})]


@pytest.fixture(autouse=True)
def catalogue_of_random_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    every = {effect.name: effect for effect in EVERY}
    monkeypatch.setattr(candidates_module, 'catalogue', lambda: every)
    monkeypatch.setattr(components_module, 'searched_in_drives', lambda design: list(ON_DRIVES))
    # Nothing of it knows loads or turns over.
    for kind in ('reversal_rows', 'deviation_rows'):
        monkeypatch.setattr(components_module, kind, lambda design, term, units: np.zeros(
            (len(units), 0, SAMPLES)))


def random_design(truth: Mapping[tuple[str, int | None], float], seed: int) -> RandomDesign:
    """Return a design with noise that has a slow part, and some effects of given sizes [noise]."""
    rng = np.random.default_rng(seed)
    slow = np.cumsum(rng.normal(size=(SAMPLES, len(DRIVES))), axis=0) * 0.05
    error = rng.normal(size=(SAMPLES, len(DRIVES))) + slow - slow.mean(axis=0)
    # Smooth curves: neighbours of one another, and like slow noise.
    smooth = np.exp(-0.5 * (np.arange(-60, 61) / 15) ** 2)

    def curve(count: int) -> Array:
        rows = np.array([np.convolve(rng.normal(size=SAMPLES + 120), smooth, 'valid')
                         for _ in range(count)])
        return rows / rows.std(axis=1, keepdims=True)
    columns: dict[tuple[str, int | None], dict[int, Array]] = {}
    for effect in IN_STRUCTURE:
        columns[effect.name, None] = {d: curve(1) for d in range(len(DRIVES))}
    # One that is nearly the sum of two others: what a greedy search takes first.
    first, second, both = (columns[f'structure_{k}', None] for k in range(3))
    for d in both:
        both[d] = (first[d] + second[d] + 0.7 * both[d]) / 1.6
    for effect in ON_DRIVES:
        for d in range(len(DRIVES)):
            columns[effect.name, d] = {d: curve(1)}
    for key, size in truth.items():
        for d, rows in columns[key].items():
            error[:, d] += size * rows[0]
    residuals = Residuals(DRIVES, PERIOD * np.arange(SAMPLES), np.zeros(SAMPLES, dtype=int),
                          error, np.zeros_like(error), {}, {}, PERIOD)
    base = (BaseColumn({d: curve(1)[0] for d in range(len(DRIVES))}, 1.0),)
    structure = tuple(Term(effect, None, {}, columns[effect.name, None])
                      for effect in IN_STRUCTURE)
    return RandomDesign(MODEL, MODEL, residuals, (), base, structure, (), (), error,
                        columns=columns)


def everything() -> list[EffectCandidate]:
    """Return every effect on every choice of drives."""
    found = [EffectCandidate.of([Component(effect, None, ('size',))]) for effect in IN_STRUCTURE]
    for effect in ON_DRIVES:
        for count in (1, 2, 3):
            found += [EffectCandidate.of(Component(effect, d, ('size',)) for d in chosen)
                      for chosen in combinations(range(len(DRIVES)), count)]
    return found


def sets_of(found: CandidateSet) -> set[tuple[str, tuple[int, ...] | None]]:
    return {(effect.name, effect.drives) for effect in found.effects}


SPACES = [
    {}, {('structure_4', None): 1.5}, {('structure_0', None): 1.0, ('structure_1', None): 1.0},
    {('drive_1', 0): 1.2, ('drive_1', 2): 0.8},
    {('structure_2', None): 1.2, ('drive_0', 1): 1.5},
    {('structure_3', None): 1.0, ('structure_4', None): -0.8, ('drive_1', 0): 1.2},
]


@pytest.mark.parametrize(('number', 'truth'), list(enumerate(SPACES)))
def test_the_search_ends_at_the_best_of_all_sets(
        number: int, truth: dict[tuple[str, int | None], float]) -> None:
    design = random_design(truth, number)
    search = Search(FittedSets(design, DECISIONS))
    found = search.run()
    exhaustive = FittedSets(design, DECISIONS)
    every = everything()
    best = exhaustive.evaluate(())
    for size in range(1, max(len(truth), 2) + 1):
        for chosen in combinations(every, size):
            if len({candidate.name for candidate in chosen}) == size:
                best = min(best, exhaustive.evaluate(chosen), key=lambda fitted: fitted.cost)
    assert found.cost <= best.cost + 1e-6
    assert sets_of(found) == sets_of(best)
    assert {name for name, _ in sets_of(found)} == {name for name, _ in truth}
    assert found.cost == pytest.approx(exhaustive.evaluate(found.candidates).cost, abs=1e-6)


def test_a_search_from_the_best_set_alone_would_end_at_a_dearer_one() -> None:
    truth = {('structure_0', None): -1.5, ('structure_1', None): -1.4, ('drive_0', 2): 0.6,
             ('drive_1', 0): 1.4, ('drive_1', 2): 1.3}
    found = Search(FittedSets(random_design(truth, 924), DECISIONS)).run()
    assert {name for name, _ in sets_of(found)} == {name for name, _ in truth}


def test_what_is_superfluous_is_dropped() -> None:
    fits = FittedSets(random_design({('structure_3', None): 1.5}, 5), DECISIONS)
    other, right = (everything()[number] for number in (0, 3))
    assert simplified(fits, fits.evaluate((other, right))).candidates == (right,)


def test_costs_do_not_depend_on_what_was_fitted_before() -> None:
    design = random_design(SPACES[-1], 11)
    search = Search(FittedSets(design, DECISIONS))
    search.run()
    visited = list(search.fits.sets)
    assert len(visited) > 15
    rng = np.random.default_rng(0)
    for _ in range(3):
        other = FittedSets(design, DECISIONS)
        for k in rng.permutation(len(visited)):
            fitted = visited[k]
            order = rng.permutation(len(fitted.candidates))
            again = other.evaluate(tuple(fitted.candidates[place] for place in order))
            assert again.cost == pytest.approx(fitted.cost, abs=1e-9, rel=1e-12)


@pytest.mark.parametrize('number', range(4))
def test_an_effect_alone_is_on_the_drives_where_it_costs_least(number: int) -> None:
    """Otherwise it would be no rival of what is found in its place."""
    rng = np.random.default_rng(number)
    truth = {('structure_4', None): 1.0, **{('drive_1', d): rng.normal() for d in range(3)}}
    search = Search(FittedSets(random_design(truth, 20 + number), DECISIONS))
    search.run()
    for effect in ON_DRIVES:
        alone = [fitted.cost for fitted in search.fits.sets
                 if len(fitted.candidates) == 1 and fitted.effects[0].effect is effect]
        exhaustive = [search.fits.evaluate((candidate,)).cost for candidate in everything()
                      if candidate.effect is effect]
        # A tenth of what rivals may differ by.
        assert not alone or min(alone) <= min(exhaustive) + DECISIONS.rival_margin / 10


def test_the_terms_of_a_cost_add_up_to_the_likelihood_and_the_prior_costs() -> None:
    design = random_design({('structure_0', None): 0.4, ('drive_1', 1): -0.5}, 12)
    fits = FittedSets(design, DECISIONS)
    structure, on_drives = everything()[0], next(
        c for c in everything() if c.name == 'drive_1' and c.drives == (0, 2))
    for candidates in ((), (structure,), (structure, on_drives)):
        found = fits.evaluate(candidates)
        terms = vars(found.terms)
        assert sum(terms.values()) == pytest.approx(found.total) == found.cost
        assert terms['fit'] + terms['coefficients'] == pytest.approx(found.fit.deviance)
        # Seven names at odds of 1 : 10; two of three drives, as one of three kinds of choice.
        assert terms['names'] == pytest.approx(len(candidates) * 2 * np.log(7 * 10))
        assert terms['drives'] == pytest.approx(
            2 * np.log(3) + 2 * np.log(3) if on_drives in candidates else 0)
        assert all(terms[name] == 0 for name in ('shapes', 'signs', 'feasibility'))


# Queries of the table, against their definitions over all sets of up to two effects.

Costs = dict[frozenset[str], float]  # of the cheapest admissible set, by names
TWO = {('structure_4', None): 0.25, ('drive_1', 0): 0.35}


def tabulated(number: int, barred: str = '') -> tuple[ModelTable, Costs]:
    """Return a table in which sets with an effect are inadmissible, and its costs by names."""
    fits = FittedSets(random_design(TWO, number), DECISIONS)
    fits.form_errors = SimpleNamespace(  # type: ignore[assignment]
        reason=lambda fitted, covariance: (
            'form' * (barred in {effect.name for effect in fitted.effects}), None))
    costs: Costs = {}
    for size in range(3):
        for chosen in combinations(everything(), size):
            names = frozenset(candidate.name for candidate in chosen)
            if len(names) == size:
                fitted = fits.evaluate(chosen)
                if barred not in names:
                    costs[names] = min(costs.get(names, np.inf), fitted.total)
    return ModelTable(fits, fits), costs


def named(table: ModelTable) -> frozenset[str]:
    return frozenset(effect.name for effect in table.best.effects)


@pytest.mark.parametrize('number', [0, 2, 3])
def test_the_table_has_one_row_for_each_choice_of_effects(number: int) -> None:
    table, costs = tabulated(number, 'structure_3')
    assert [row.cost for row in table.rows] == sorted(costs.values())
    assert {frozenset(row.placed_names): row.cost for row in table.rows} == costs
    best = named(table)
    assert best
    for effect in table.best.effects:
        without = min(cost for names, cost in costs.items() if effect.name not in names)
        assert table.evidence(effect) == pytest.approx(without - costs[best])
        assert effect.name not in table.without(effect).placed_names
    assert {name: row.cost for name, row in table.alone.items()} == {
        name: cost for names, cost in costs.items() if len(names) == 1 for name in names}


@pytest.mark.parametrize('margin', [2.0, 10.0, 200.0])
@pytest.mark.parametrize('number', range(3))
def test_rivals_and_suspects_are_rows_within_a_margin(number: int, margin: float) -> None:
    table, costs = tabulated(number)
    best = named(table)
    near = {names: cost - costs[best] for names, cost in costs.items()
            if names != best and cost <= costs[best] + margin}
    rivals = {frozenset(rival.row.placed_names): (set(rival.missing), set(rival.instead))
              for rival in table.rivals(margin)}
    assert rivals == {names: (set(best - names), set(names - best)) for names in near
                      if best - names and names - best}
    assert {suspect.name for suspect, _ in table.suspects(margin)} == {
        name for names in near if best < names and len(names) == len(best) + 1
        for name in names - best}


@pytest.mark.parametrize('number', range(3))
def test_inadmissible_sets_near_the_best_are_listed_and_never_rows(number: int) -> None:
    barred, (strongest, _) = {}, TWO
    table, costs = tabulated(number, strongest[0])
    for fitted in table.first.sets:
        if strongest[0] in {effect.name for effect in fitted.effects}:
            barred[fitted] = fitted.total - min(costs.values())
    for margin in (-20.0, 0.0, 10.0):
        found = table.barred(margin)
        assert set(found) == {fitted for fitted, above in barred.items() if above < margin}
        assert [fitted.total for fitted in found] == sorted(fitted.total for fitted in found)
    assert any(0 < above < 10 for above in barred.values())
    assert not any(strongest[0] in row.placed_names for row in table.rows)


def test_sets_with_a_nonlinear_effect_are_those_of_the_last_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(IN_STRUCTURE[2], 'nonlinear', True, raising=False)
    first, last = (tabulated(number)[0].first for number in (0, 1))
    for row in ModelTable(first, last).rows:
        assert row.fits is (last if 'structure_2' in row.placed_names else first)


@pytest.mark.parametrize('number', range(2))
def test_a_set_costs_no_more_than_with_its_form_error(number: int) -> None:
    """Where structure_4 can only be a form error, no set has it.

    The set of a larger effect costs as with it, and that of a smaller one as without it.
    """
    fits, free = (FittedSets(random_design({
        ('structure_3', None): 1.5, ('structure_4', None): 1.0}, number), DECISIONS)
        for _ in range(2))

    def reason(fitted: CandidateSet, covariance: Array) -> tuple[str, Candidates | None]:
        form = next((effect for effect in fitted.effects if effect.name == 'structure_4'), None)
        return ('form', fitted.without(form)) if form else ('', None)
    fits.form_errors = SimpleNamespace(reason=reason)  # type: ignore[assignment]
    found = Search(fits).run()
    assert found.is_admissible
    assert 'structure_4' not in {name for name, _ in sets_of(found)}
    form, larger, smaller = (next(c for c in everything() if c.name == name) for name in (
        'structure_4', 'structure_3', 'drive_1'))
    for other in (larger, smaller):
        fits.evaluate((other, form))
    with_it = free.evaluate((larger, form)).cost
    assert with_it < free.evaluate((larger,)).cost
    assert fits.evaluate((larger,)).cost == pytest.approx(with_it)
    assert fits.evaluate((smaller,)).cost == pytest.approx(free.evaluate((smaller,)).cost)


def test_blocks_are_predicted_worse_than_they_are_fitted() -> None:
    fits = FittedSets(random_design(TWO, 3), DECISIONS)
    fitted = fits.evaluate(tuple(everything()[:5]))
    residual = linear_residual(fits, fitted)
    assert hold_out(fits, fitted).error > 1.001 * np.sqrt(np.nanmean(residual ** 2))
