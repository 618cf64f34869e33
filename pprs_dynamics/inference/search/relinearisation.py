# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Gauss-Newton around the selection: the search again around a model that has what was found.

Some effects change how others show, or hold in their linear form nearby only. Where the fitted
model's exact forces differ from the linear prediction by more than the noise lets pass, columns
are computed anew around the fitted model, the error is extrapolated back to the given one, and the
search goes on from the set that was found. Costs of both searches mean the same.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.regression.base_columns import (
    ReversalShape,
    move_numbers,
    move_present,
    within,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import OperatingPoint, PlacedEffect
from pprs_dynamics.inference.residuals.reconstruction import treated_forces
from pprs_dynamics.inference.search.candidates import CandidateSet, bends
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.form import beyond_lack_of_fit
from pprs_dynamics.inference.search.scanned_sets import Place
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import build_model

# What the exact model may differ from the linear one by, in whitened squares, and the cost of a set
# after it was relinearised around, from before: less changes no cost by more than a rival's margin.
LEAST_DIFFERENCE, LEAST_CHANGE = 4.0, 2.0
MOST_SEARCHES, MOST_STEPS, MOST_HALVINGS = 5, 6, 4  # how often all of this is repeated


def around_fitted(first: Search, best: CandidateSet, decisions: Decisions,
                  report: Callable[[float], None]) -> tuple[Search, CandidateSet]:
    """Return the search around the fitted model where that matters, and its best set."""
    found = _around_fitted(first, best, decisions, report, _bending_alone)
    if _stands_out(*found) and not all(map(bends, best.candidates)):
        found = min(found, _around_fitted(first, best, decisions, report, _as_it_is,
                                          found[1].total),
                    key=lambda one: beyond_lack_of_fit(*one)[0].total)
    return found


def _around_fitted(
    search: Search, best: CandidateSet, decisions: Decisions, report: Callable[[float], None],
    first_step: Callable[[Search, CandidateSet], CandidateSet], rival: float = np.inf,
) -> tuple[Search, CandidateSet]:
    """Search again around the fitted model, until that is where columns were computed.

    `first_step` returns the set around which to expand where effects bend the columns that did
    not yet; `rival` is the cost that each search has to reach for another one.
    """
    scale = search.regression.error_scale
    costs: dict[Hashable, float] = {}
    refuted: set[Place] = set()
    for number in range(MOST_SEARCHES):
        kept, _ = beyond_lack_of_fit(search, best)
        if search.is_beyond_point:
            kept = first_step(search, best)
        try:
            last, moved = linearised(search, kept, decisions)
        except PprsError:
            break  # values that no model may have: the linear form is all there is
        if last is search or (not search.is_beyond_point
                              and abs(moved.cost - kept.cost) < LEAST_CHANGE):
            break
        starts = [one.candidates for one in dict.fromkeys((kept, best))]
        search.release()
        design, patterns = last.design, search.patterns
        del search, last, moved, kept, best  # a search of minutes holds hundreds of megabytes
        search = Search(design, decisions, scale, _share_of(
            report, 0.6 + 0.4 * number / MOST_SEARCHES, 0.4 / MOST_SEARCHES), patterns=patterns,
            refuted=frozenset(refuted))
        best = search.run(*starts)
        refuted |= _bent_in_vain(search, best)
        placed = frozenset((one.name, one.drives) for one in best.candidates)
        if best.total > rival or abs(costs.get(placed, np.inf) - best.cost) < LEAST_CHANGE:
            break  # found before: what follows would be what followed then
        costs[placed] = best.cost
    return search, best


def _bent_in_vain(search: Search, best: CandidateSet) -> set[Place]:
    """Return the effects that bent the columns of a search, if its best set bends none.

    Where others still do, the columns change with them, and what was dropped may yet pay.
    """
    point = search.design.point
    if point is None or any(map(bends, best.candidates)):
        return set()
    return {(one.effect, one.drive) for one in point.effects if one.effect.bends_columns}


def _bending_alone(search: Search, best: CandidateSet) -> CandidateSet:
    """Return the effects of a set that bend the columns, at its noise.

    What was found beside them may only make good that columns were not bent.
    """
    alone = search.rescanned(search.evaluate(tuple(filter(bends, best.candidates))))
    return search.at_noise_of(best, alone.candidates)


def _as_it_is(search: Search, best: CandidateSet) -> CandidateSet:
    """Return the whole set: without what else is strong, effects that bend are fitted wrong."""
    return best


def _stands_out(search: Search, best: CandidateSet) -> bool:
    """Return whether what will be adopted leaves a drive much more than its fit does.

    The fit has columns for what forms leave open, which a model has not.
    """
    kept, _ = beyond_lack_of_fit(search, best)
    if kept is best:
        return False
    regression = search.regression
    left = np.sqrt(np.nanmean(np.square(linear_residual(search, kept)), axis=0))
    promised = search.decisions.left_ratio * regression.left(kept.fit)
    return bool(np.any(left[list(regression.drives)] > promised))


def _share_of(report: Callable[[float], None], start: float, width: float,
              ) -> Callable[[float], None]:
    return lambda share: report(start + width * share)


def linearised(search: Search, found: CandidateSet, decisions: Decisions,
               ) -> tuple[Search, CandidateSet]:
    """Return a set around its own fitted model, and the search that holds it.

    The search given where nothing would change. Gauss-Newton steps with the set as it is, each
    halved until the exact error falls.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    for _ in range(MOST_STEPS):
        point = next_operating_point(search, found)
        if point is None:
            break
        search = Search(search.design.around(point), decisions, search.regression.error_scale,
                        with_unknown=False)
        search.evaluate(())
        found = search.refined(search.evaluate(found.candidates))
    return search, found


def next_operating_point(search: Search, found: CandidateSet) -> OperatingPoint | None:
    """Return where to expand next: towards a set's fitted model, as far as the exact error falls.

    None where the exact forces of the fitted model are those of the linear fit, and columns were
    computed with every effect that bends them.
    """
    design = search.design
    base, effects = parts_of(search, found)
    linear = linear_prediction(search, found)
    measured = search.regression.residuals.measured
    target = model_at(design, base, effects)
    exact = exact_forces(design, target)
    before = design.point
    if (squared(search, found, exact - linear) < LEAST_DIFFERENCE
            and _is_bent_by(before, effects)):
        return None
    loss = squared(search, found, measured - exact)
    known = {(one.effect, one.drive): one for one in before.effects} if before else {}
    if all((one.effect, one.drive) in known for one in effects) and before is not None:
        reached = squared(search, found, measured - design.forces)
        for _ in range(MOST_HALVINGS):
            if loss < reached:
                break
            base = (base + before.base) / 2
            effects = tuple(_between(known[one.effect, one.drive], one) for one in effects)
            target = model_at(design, base, effects)
            loss = squared(search, found, measured - exact_forces(design, target))
        else:
            return None
    return OperatingPoint(target, base, effects)


def _is_bent_by(point: OperatingPoint | None, effects: Sequence[PlacedEffect]) -> bool:
    """Return whether a point has the effects that bend columns, nearly of the same shapes."""
    known = {(one.effect, one.drive): one for one in point.effects} if point else {}
    return all((one.effect, one.drive) in known and all(
        abs(one.shape[p.name] - known[one.effect, one.drive].shape[p.name]) <= p.scale
        for p in one.effect.parameters if p.name in one.shape)
        for one in effects if one.effect.bends_columns)


def _between(a: PlacedEffect, b: PlacedEffect) -> PlacedEffect:
    return replace(b, coefficients={
        name: (a.coefficients.get(name, 0.0) + value) / 2
        for name, value in b.coefficients.items()})


def relinearised(search: Search, found: CandidateSet, decisions: Decisions,
             ) -> tuple[Search, CandidateSet]:
    """Return what `linearised` does, shapes refined until they stand still.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    search, found = linearised(search, found, decisions)
    return search, search.refined(found)


def parts_of(search: Search, found: CandidateSet) -> tuple[Array, tuple[PlacedEffect, ...]]:
    """Return coefficients of the base columns, 0 for reversals, and effects with theirs."""
    base = found.fit.coefficients[:len(search.design.base)].copy()
    base[[isinstance(column, ReversalShape) for column in search.design.base]] = 0.0
    effects = []
    for one in found.blocks:
        every = one.every(found.coefficients(one)).tolist()
        effects.append(PlacedEffect(
            one.effect, one.drive, one.parameters,
            {c.name: value for c, value in zip(one.effect.coefficients, every, strict=False)}))
    return base, tuple(effects)


def model_at(design: Design, base: Array, effects: Sequence[PlacedEffect]) -> ForceModel:
    """Return the given model with its numbers as coefficients have them, and with effects.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    values: dict[str, Any] = dict(design.given.values)
    move_numbers(values, design.base, base)
    move_present(values, design.given, design.base, base)
    names = list(values.get('effects.active', []))
    for one in effects:
        kind = one.effect
        if kind.name not in names:
            names.append(kind.name)
        every = {**kind.from_coefficients(one.coefficients), **one.shape}
        drive = '' if one.drive is None else f'{design.drives[one.drive]}.'
        for parameter in kind.parameters:
            if kind.is_of_one_place and every[parameter.name] == parameter.default:
                continue  # of all the links or joints that it is not on
            values[f'effects.{kind.name}.{drive}{parameter.name}'] = within(
                parameter, every[parameter.name])
    if names:
        values['effects.active'] = names
    return replace(build_model(values), source=design.given.source)


def fitted_model(search: Search, found: CandidateSet) -> ForceModel:
    """Return the given model with the effects of a set, and its numbers as the fit moves them.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    return model_at(search.design, *parts_of(search, found))


def squared(search: Search, found: CandidateSet, forces: Array) -> float:
    """Return the whitened squares of forces (M, D) under the noise of a set."""
    total = 0.0
    for d in search.regression.drives:
        white = search.regression.whitened(found.fit, d, np.nan_to_num(forces[:, d]))
        total += float(white @ white)
    return total


def linear_prediction(search: Search, found: CandidateSet) -> Array:
    """Return the forces that the linear fit predicts, reversals as the model has them, (M, D)."""
    design = search.design
    prediction = design.residuals.model.copy()
    for column, c in zip(design.base, found.fit.coefficients, strict=False):
        if not isinstance(column, ReversalShape):
            for d, row in column.rows.items():
                prediction[:, d] += c * row
    for candidate in found.effects:
        prediction += search.library.force(found, candidate, prediction.shape)
    return prediction


def linear_residual(search: Search, found: CandidateSet) -> Array:
    """Return measured minus what the linear fit predicts, (M, D) [N]."""
    return search.regression.residuals.measured - linear_prediction(search, found)


def linear_error(search: Search, found: CandidateSet) -> float:
    """Return the rms of `linear_residual` over all drives [N]."""
    return float(np.sqrt(np.nanmean(np.square(linear_residual(search, found)))))


def exact_forces(design: Design, model: ForceModel) -> Array:
    """Return the treated forces of a model on the recordings of a design, (M, D) [N].

    Raises
    ------
    PprsError
        Where the model cannot follow them.
    """
    return np.concatenate([treated_forces(model, one)['total']
                           for one in design.reconstructed(model)])
