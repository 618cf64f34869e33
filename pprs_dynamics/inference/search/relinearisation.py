# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Gauss-Newton over sets: each ranked by the exact forces of its own fitted model.

Some effects change how others show, or hold in their linear form nearby only. Where the fitted
model's exact forces differ from the linear prediction by more than the noise lets pass, columns
are computed anew around the fitted model, and the error is extrapolated back to the given one:
costs around all points mean the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.regression.terms import OperatingPoint, PlacedEffect
from pprs_dynamics.inference.search.candidates import CandidateSet, PlacedNames
from pprs_dynamics.inference.search.fitted_model import (
    exact_forces,
    fitted_model,
    linear_prediction,
    model_at,
    parts_of,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.neighbours import of_same_names
from pprs_dynamics.inference.search.reversal_widths import estimate_widths, with_widths
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.physics.model.force_model import ForceModel

# What the exact model may differ from the linear one by, in whitened squares, and the cost of a set
# after it was relinearised around, from before: less changes no cost by more than a rival's margin.
LEAST_DIFFERENCE, LEAST_CHANGE = 4.0, 2.0
MOST_SEARCHES, MOST_STEPS, MOST_HALVINGS = 2, 6, 4  # how often all of this is repeated
SHORTLIST = 4  # sets of different effects of a search that are ranked by exact forces


@dataclass(frozen=True)
class ExactSet:
    """A set around its own fitted model, moved to where it costs least there.

    Parameters
    ----------
    fitted : CandidateSet
    point : OperatingPoint, optional
        Around which it is linear; None: the given model.
    effects : tuple of PlacedEffect
        Its effects with their coefficients.
    cost : float
        J_exact = J + |exact - linear|^2, whitened, by the exact forces of its fitted model.
        However the set was come by, it costs the same. Infinite where its values are no model's.
    """

    fitted: CandidateSet
    point: OperatingPoint | None
    effects: tuple[PlacedEffect, ...]
    cost: float

    @classmethod
    def of(cls, fits: FittedSets, fitted: CandidateSet) -> ExactSet:
        """Return a set of some fits around its own model."""
        around, moved = fits, fitted
        try:
            for _ in range(MOST_STEPS):
                around, moved = linearised(around, moved, alone=True)
                before, moved = moved, of_same_names(around, moved)
                if moved is before:
                    break
            exact = exact_forces(around.design, fitted_model(around, moved))
        except PprsError:
            return cls(fitted, fits.design.point, parts_of(fits, fitted)[1], np.inf)
        nonlinear = exact - linear_prediction(around, moved)
        return cls(moved, around.design.point, parts_of(around, moved)[1],
                   moved.cost + squared(around, moved, nonlinear))


def search_around_fitted(first: Search, report: Callable[[float], None],
                         ) -> tuple[Search, CandidateSet, Mapping[PlacedNames, float]]:
    """Return the search around the best set's own model, that set, and costs by exact forces.

    Gauss-Newton over sets: what is cheapest around the point of a search is relinearised, each set
    by itself; the next search is around the one that costs least so, until none costs less. Only
    exact costs, which do not depend on where a search was, decide between sets.
    """
    search, exact_sets, reached = first, dict[PlacedNames, ExactSet](), None
    search.run(until_nonlinear=True)
    for number in range(MOST_SEARCHES):
        for listed in _shortlist(search.fits, first.fits.decisions.rival_margin):
            known = exact_sets.get(listed.placed_names)
            if known is None or listed.cost < known.cost - LEAST_CHANGE:
                new = ExactSet.of(search.fits if listed.is_nonlinear else first.fits, listed)
                exact_sets[listed.placed_names] = (
                    new if known is None else min(known, new, key=_cost))
        best = min(exact_sets.values(), key=_cost)
        if best is reached or _is_where(search, best):
            break
        reached, point = best, best.point
        search.release()
        if point is None:
            search = first
        else:
            fits = FittedSets(first.fits.design.around(point), first.fits.decisions,
                              first.fits.regression.error_scale)
            search = Search(fits, [pattern.around(fits.regression) for pattern in first.patterns],
                            _share_of(report, 0.6 + 0.4 * number / MOST_SEARCHES,
                                                     0.4 / MOST_SEARCHES))
        search.run(best.fitted.candidates)
    return (search, search.fits.evaluate(best.fitted.candidates),
            {names: exact_set.cost for names, exact_set in exact_sets.items()})


def _cost(ranked: CandidateSet | ExactSet) -> float:
    return ranked.cost


def _shortlist(fits: FittedSets, margin: float) -> list[CandidateSet]:
    """Return the cheapest set of each choice of effects that may be the best once costs are exact.

    Within a margin; where the best set is nonlinear and the point is not its own, any nonlinear
    one: tilts, wrenches and offsets of a payload look nearly alike there.
    """
    best, near = fits.best, dict[PlacedNames, CandidateSet]()
    is_beyond = not _has_nonlinear(fits.design.point, parts_of(fits, best)[1])
    for fitted in sorted(fits.sets, key=_cost):
        if fitted.cost <= best.cost + margin or (
                is_beyond and fitted.is_nonlinear and fitted.is_admissible):
            near.setdefault(fitted.placed_names, fitted)
    return list(near.values())[:SHORTLIST]


def _is_where(search: Search, best: ExactSet) -> bool:
    """Return whether a search was to its end around the model of a set, as nearly as matters."""
    there = search.fits.evaluate(best.fitted.candidates)
    return (search.is_ended and abs(there.total - best.fitted.total) < LEAST_CHANGE
            and _has_nonlinear(search.fits.design.point, best.effects))


def _share_of(report: Callable[[float], None], start: float, width: float,
              ) -> Callable[[float], None]:
    return lambda share: report(start + width * share)


def linearised(fits: FittedSets, fitted: CandidateSet, alone: bool = False,
               ) -> tuple[FittedSets, CandidateSet]:
    """Return a set around its own fitted model, and the fitted sets that it is of.

    Those given where nothing would change. Gauss-Newton steps with the set as it is, each
    halved until the exact error falls; where none does, the set stays where columns
    hold. `alone`: nothing is to be added, see `Design.around`.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    for _ in range(MOST_STEPS):
        point = next_operating_point(fits, fitted)
        if point is None:
            break
        if point is fits.design.point:
            return fits, _held_at(fits, fitted, point)
        fits = FittedSets(fits.design.around(point, alone), fits.decisions,
                          fits.regression.error_scale)
        fitted = fits.refined(fits.evaluate(fitted.candidates))
    return fits, fitted


def next_operating_point(fits: FittedSets, fitted: CandidateSet) -> OperatingPoint | None:
    """Return where to expand next: towards a set's fitted model, as far as the exact error falls.

    None where the exact forces of the fitted model are those of the linear fit, and columns were
    computed with every nonlinear effect; the point where columns hold where no step from it
    lowers the exact error.
    """
    design = fits.design
    base, effects = parts_of(fits, fitted)
    linear = linear_prediction(fits, fitted)
    measured = fits.regression.residuals.measured
    target = model_at(design, base, effects)
    exact = exact_forces(design, target)
    before = design.point
    if (squared(fits, fitted, exact - linear) < LEAST_DIFFERENCE
            and _has_nonlinear(before, effects)):
        return None
    loss = squared(fits, fitted, measured - exact)
    known = {(effect.effect, effect.drive): effect for effect in before.effects} if before else {}
    if all((effect.effect, effect.drive) in known for effect in effects) and before is not None:
        reached = squared(fits, fitted, measured - design.forces)
        for _ in range(MOST_HALVINGS):
            if loss < reached:
                break
            base = (base + before.base) / 2
            effects = tuple(_between(known[effect.effect, effect.drive], effect)
                            for effect in effects)
            target = model_at(design, base, effects)
            loss = squared(fits, fitted, measured - exact_forces(design, target))
        else:
            return before
    return OperatingPoint(target, base, effects)


def _held_at(fits: FittedSets, fitted: CandidateSet, point: OperatingPoint) -> CandidateSet:
    """Return a set with the numbers and coefficients of a point, all else fitted beside them."""
    known = {(effect.effect, effect.drive): effect.coefficients for effect in point.effects}
    index = [np.flatnonzero([column.in_model for column in fits.design.base])]
    values = [point.base[index[0]]]
    for component, block in fitted.blocks.items():
        names = component.names or [c.name for c in component.effect.coefficients]
        index.append(fitted.fit.index_of([block])[:len(names)])
        values.append(np.array([known[component.effect, component.drive].get(name, 0.0)
                                for name in names]))
    at, wanted = np.concatenate(index), np.concatenate(values)
    moves = wanted != fitted.fit.coefficients[at]  # numbers that are certain do not
    return fits.held(fitted, at[moves], wanted[moves])


def _has_nonlinear(point: OperatingPoint | None, effects: Sequence[PlacedEffect]) -> bool:
    """Return whether a point has the nonlinear ones of some effects, nearly of the same shapes."""
    known = {(effect.effect, effect.drive): effect for effect in point.effects} if point else {}
    return all((effect.effect, effect.drive) in known and all(
        abs(effect.shape[p.name] - known[effect.effect, effect.drive].shape[p.name]) <= p.scale
        for p in effect.effect.parameters if p.name in effect.shape)
        for effect in effects if effect.effect.nonlinear)


def _between(a: PlacedEffect, b: PlacedEffect) -> PlacedEffect:
    return replace(b, coefficients={
        name: (a.coefficients.get(name, 0.0) + value) / 2
        for name, value in b.coefficients.items()})


def relinearised(fits: FittedSets, fitted: CandidateSet) -> tuple[FittedSets, CandidateSet]:
    """Return what `linearised` does of a set whose shapes were refined until they stand still.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    return linearised(fits, fits.refined(fitted), alone=True)


@dataclass(frozen=True)
class SettledSet:
    """A set around its own fitted model, in which friction turns over in widths of its own.

    Parameters
    ----------
    fits : FittedSets
    fitted : CandidateSet
    widths : mapping of drive to float
        That differ from the given model's for certain [m/s].
    """

    fits: FittedSets
    fitted: CandidateSet
    widths: Mapping[int, float]

    @property
    def model(self) -> ForceModel:
        """The fitted model.

        Raises
        ------
        ModelError
            For values that no model may have.
        """
        return with_widths(fitted_model(self.fits, self.fitted), self.fits.design, self.widths)


def settled(fits: FittedSets, fitted: CandidateSet) -> SettledSet:
    """Return a set around its fitted model, fitted widths of reversal included.

    Columns for widths are linear about the model's; far from it, what they leave over looks like
    a delay. The set as it is where the exact error rises by more than the cost falls.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    if fitted.key not in fits.settled:
        fits.settled[fitted.key] = _settled(fits, fitted)
    kept: SettledSet = fits.settled[fitted.key]
    return kept


def _settled(fits: FittedSets, fitted: CandidateSet) -> SettledSet:
    before = SettledSet(fits, fitted, estimate_widths(fits, fitted))
    if not (before.widths and fitted.effects):
        return before
    base, effects = parts_of(fits, fitted)
    point = OperatingPoint(before.model, base, effects)
    around = FittedSets(fits.design.around(point, alone=True), fits.decisions,
                        fits.regression.error_scale)
    after = SettledSet(around, around.refined(around.evaluate(fitted.candidates)), before.widths)

    def loss(settled_set: SettledSet) -> float:
        left = fits.regression.residuals.measured - exact_forces(fits.design, settled_set.model)
        return settled_set.fitted.total + squared(fits, fitted, left)
    return min(before, after, key=loss)
