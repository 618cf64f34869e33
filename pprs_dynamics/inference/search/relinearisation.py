# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Gauss-Newton around the selection: the search again around a model that has what was found.

Some effects change how others show, or hold in their linear form nearby only. Where the fitted
model's exact forces differ from the linear prediction by more than the noise lets pass, columns
are computed anew around the fitted model, the error is extrapolated back to the given one, and the
search goes on from the set that was found. Costs of both searches mean the same.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.terms import OperatingPoint, PlacedEffect
from pprs_dynamics.inference.search.candidates import (
    CandidateSet,
    EffectCandidate,
    bends,
)
from pprs_dynamics.inference.search.fitted_model import (
    exact_forces,
    fitted_model,
    linear_prediction,
    linear_residual,
    model_at,
    parts_of,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.form import beyond_lack_of_fit
from pprs_dynamics.inference.search.reversal_widths import estimate_widths, with_widths
from pprs_dynamics.inference.search.scan import Place
from pprs_dynamics.inference.search.search import Search
from pprs_dynamics.physics.model.force_model import ForceModel

# What the exact model may differ from the linear one by, in whitened squares, and the cost of a set
# after it was relinearised around, from before: less changes no cost by more than a rival's margin.
LEAST_DIFFERENCE, LEAST_CHANGE = 4.0, 2.0
MOST_SEARCHES, MOST_STEPS, MOST_HALVINGS = 5, 6, 4  # how often all of this is repeated


def around_fitted(first: Search, best: CandidateSet, report: Callable[[float], None],
                  ) -> tuple[Search, CandidateSet]:
    """Return the search around the fitted model where that matters, and its best set."""
    found = _around_fitted(first, best, report, _bending_alone)
    search, after = found
    if ((search.is_beyond_point or _stands_out(search.fits, after))
            and not all(map(bends, best.candidates))):
        found = min(found, _around_fitted(first, best, report, _as_it_is, after.total),
                    key=lambda one: _exact_total(one[0].fits, one[1]))
    return found


def _around_fitted(
    first: Search, at_first: CandidateSet, report: Callable[[float], None],
    first_step: Callable[[Search, CandidateSet], CandidateSet], rival: float = np.inf,
) -> tuple[Search, CandidateSet]:
    """Search again around the fitted model, until that is where columns were computed.

    `first_step` returns the set around which to expand where effects bend the columns that did
    not yet; `rival` is the cost that each search has to reach for another one. A search whose
    set is far from where its columns hold is gone on from only if the set costs less around itself.
    """
    search, best = first, at_first
    costs: dict[Hashable, float] = {}
    refuted = first.refuted

    def around(design: Design, number: int) -> Search:
        fits = FittedSets(design, first.fits.decisions, first.fits.regression.error_scale)
        return Search(fits, [one.around(fits.regression) for one in first.patterns], refuted,
                      _share_of(report, 0.6 + 0.4 * number / MOST_SEARCHES, 0.4 / MOST_SEARCHES))

    for number in range(MOST_SEARCHES):
        kept, _ = beyond_lack_of_fit(search.fits, best)
        if search.is_beyond_point:
            kept = first_step(search, best)
        try:
            last, moved = linearised(search.fits, kept)
        except PprsError:
            break  # values that no model may have: the linear form is all there is
        if last is search.fits or (not search.is_beyond_point
                                   and abs(moved.cost - kept.cost) < LEAST_CHANGE):
            break
        starts = [one.candidates for one in dict.fromkeys((kept, best))]
        search.release()
        design, before, accepted = last.design, search.fits.design.point, best.candidates
        reached = moved.total
        del search, last, moved, kept, best  # a search of minutes holds hundreds of megabytes
        search = around(design, number)
        best = search.run(*starts)
        if _is_far(search.fits, best) and not _holds_around_itself(search.fits, best, reached):
            if before is None:
                return first, at_first
            search = around(first.fits.design.around(before), number)  # the one before, again
            return search, search.run(accepted)
        refuted |= _bent_in_vain(search, best)
        placed = frozenset((one.name, one.drives) for one in best.candidates)
        if best.total > rival or abs(costs.get(placed, np.inf) - best.cost) < LEAST_CHANGE:
            break  # found before: what follows would be what followed then
        costs[placed] = best.cost
    return search, best


def _exact_total(fits: FittedSets, best: CandidateSet) -> float:
    """Return the cost, by its exact forces, of what will be adopted of a set."""
    kept, _ = beyond_lack_of_fit(fits, best)
    try:
        return _by_exact_forces(fits, kept, fitted_model(fits, kept))
    except PprsError:
        return np.inf


def _bent_in_vain(search: Search, best: CandidateSet) -> set[Place]:
    """Return the effects that bent the columns of a search, if its best set bends none.

    Where others still do, the columns change with them, and what was dropped may yet pay.
    """
    point = search.fits.design.point
    if point is None or any(map(bends, best.candidates)):
        return set()
    return {(one.effect, one.drive) for one in point.effects if one.effect.bends_columns}


def _bending_alone(search: Search, best: CandidateSet) -> CandidateSet:
    """Return the effects of a set that bend the columns, at its noise.

    What was found beside them may only make good that columns were not bent.
    """
    best = _rebent(search.fits, best)
    alone = search.rescanned(search.fits.evaluate(tuple(filter(bends, best.candidates))))
    return search.fits.at_noise_of(best, alone.candidates)


def _rebent(fits: FittedSets, best: CandidateSet) -> CandidateSet:
    """Return a set with that effect on the structure which costs least around its own model.

    Tilts, wrenches and offsets of a payload look nearly alike where columns are not bent by them.
    """
    own = [one for one in best.effects if _bends_structure(one)]
    if len(own) != 1:
        return best
    rivals: dict[str, CandidateSet] = {}
    for one in sorted(fits.sets, key=lambda one: one.cost):
        if len(one.effects) == len(one.candidates) == 1 and _bends_structure(one.effects[0]):
            rivals.setdefault(one.effects[0].name, one)
    rivals.pop(own[0].name, None)

    def around_itself(found: CandidateSet) -> float:
        try:
            return linearised(fits, found)[1].total
        except PprsError:
            return np.inf
    rest = best.without(*own)
    others = [fits.evaluate((*rest, *one.candidates)) for one in rivals.values()]
    return min((best, *others), key=around_itself) if others else best


def _bends_structure(candidate: EffectCandidate) -> bool:
    return bends(candidate) and candidate.drives is None


def _as_it_is(search: Search, best: CandidateSet) -> CandidateSet:
    """Return the whole set: without what else is strong, effects that bend are fitted wrong."""
    return best


def _is_far(fits: FittedSets, best: CandidateSet) -> bool:
    """Return whether exact forces leave a drive much more than what will be adopted promises."""
    kept, _ = beyond_lack_of_fit(fits, best)
    try:
        forces = exact_forces(fits.design, fitted_model(fits, kept))
    except PprsError:
        return True  # values that no model may have
    left, promised = (_rms_by_drive(fits, error) for error in (
        fits.regression.residuals.measured - forces, linear_residual(fits, kept)))
    return bool(np.any(left > fits.decisions.left_ratio * promised))


def _holds_around_itself(fits: FittedSets, best: CandidateSet, cost: float) -> bool:
    """Return whether a set costs less, and holds, where columns are computed around it."""
    kept, _ = beyond_lack_of_fit(fits, best)
    try:
        last, moved = linearised(fits, kept)
    except PprsError:
        return False
    return moved.total < cost and not _is_far(last, moved)


def _rms_by_drive(fits: FittedSets, error: Array) -> Array:
    return np.array([root_mean_square(error[:, d]) for d in fits.regression.drives])


def _stands_out(fits: FittedSets, best: CandidateSet) -> bool:
    """Return whether what will be adopted leaves a drive much more than its fit does.

    The fit has columns for what forms leave open, which a model has not.
    """
    kept, _ = beyond_lack_of_fit(fits, best)
    if kept is best:
        return False
    left = _rms_by_drive(fits, linear_residual(fits, kept))
    return bool(np.any(left > fits.decisions.left_ratio * fits.regression.left(kept.fit)))


def _share_of(report: Callable[[float], None], start: float, width: float,
              ) -> Callable[[float], None]:
    return lambda share: report(start + width * share)


def linearised(fits: FittedSets, found: CandidateSet, alone: bool = False,
               ) -> tuple[FittedSets, CandidateSet]:
    """Return a set around its own fitted model, and the fitted sets that it is of.

    Those given where nothing would change. Gauss-Newton steps with the set as it is, each
    halved until the exact error falls. `alone`: nothing is to be added, see `Design.around`.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    for _ in range(MOST_STEPS):
        point = next_operating_point(fits, found)
        if point is None:
            break
        fits = FittedSets(fits.design.around(point, alone), fits.decisions,
                          fits.regression.error_scale)
        found = fits.refined(fits.evaluate(found.candidates))
    return fits, found


def next_operating_point(fits: FittedSets, found: CandidateSet) -> OperatingPoint | None:
    """Return where to expand next: towards a set's fitted model, as far as the exact error falls.

    None where the exact forces of the fitted model are those of the linear fit, and columns were
    computed with every effect that bends them.
    """
    design = fits.design
    base, effects = parts_of(fits, found)
    linear = linear_prediction(fits, found)
    measured = fits.regression.residuals.measured
    target = model_at(design, base, effects)
    exact = exact_forces(design, target)
    before = design.point
    if (squared(fits, found, exact - linear) < LEAST_DIFFERENCE
            and _is_bent_by(before, effects)):
        return None
    loss = squared(fits, found, measured - exact)
    known = {(one.effect, one.drive): one for one in before.effects} if before else {}
    if all((one.effect, one.drive) in known for one in effects) and before is not None:
        reached = squared(fits, found, measured - design.forces)
        for _ in range(MOST_HALVINGS):
            if loss < reached:
                break
            base = (base + before.base) / 2
            effects = tuple(_between(known[one.effect, one.drive], one) for one in effects)
            target = model_at(design, base, effects)
            loss = squared(fits, found, measured - exact_forces(design, target))
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


def relinearised(fits: FittedSets, found: CandidateSet) -> tuple[FittedSets, CandidateSet]:
    """Return what `linearised` does, shapes refined until they stand still.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    fits, found = linearised(fits, found, alone=True)
    return fits, fits.refined(found)


@dataclass(frozen=True)
class SettledSet:
    """A set around its own fitted model, in which friction turns over in widths of its own.

    Parameters
    ----------
    fits : FittedSets
    found : CandidateSet
    widths : mapping of drive to float
        That differ from the given model's for certain [m/s].
    """

    fits: FittedSets
    found: CandidateSet
    widths: Mapping[int, float]

    @property
    def model(self) -> ForceModel:
        """The fitted model.

        Raises
        ------
        ModelError
            For values that no model may have.
        """
        return with_widths(fitted_model(self.fits, self.found), self.fits.design, self.widths)


def settled(fits: FittedSets, found: CandidateSet) -> SettledSet:
    """Return a set around its fitted model, fitted widths of reversal included.

    Columns for widths are linear about the model's; far from it, what they leave over looks like
    a delay. The set as it is where the exact error rises by more than the cost falls.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    before = SettledSet(fits, found, estimate_widths(fits, found))
    if not (before.widths and found.effects):
        return before
    base, effects = parts_of(fits, found)
    point = OperatingPoint(before.model, base, effects)
    around = FittedSets(fits.design.around(point, alone=True), fits.decisions,
                        fits.regression.error_scale)
    after = SettledSet(around, around.refined(around.evaluate(found.candidates)), before.widths)

    def loss(one: SettledSet) -> float:
        left = fits.regression.residuals.measured - exact_forces(fits.design, one.model)
        return one.found.total + squared(fits, found, left)
    return min(before, after, key=loss)


def exact_cost(fits: FittedSets, found: CandidateSet) -> float:
    """Return what a set costs around its own fitted model, by that model's exact forces.

    J_exact = J + |exact - linear|^2, whitened. However a set was come by, it costs the same;
    infinite where its values are those of no model.
    """
    try:
        fits, found = linearised(fits, found, alone=True)
        one = settled(fits, found)
        # Widths that are not settled are columns yet, and not the model's.
        model = fitted_model(fits, found) if one.fits is fits else one.model
        return (_by_exact_forces(one.fits, one.found, model) if one.found.is_admissible
                else np.inf)
    except PprsError:
        return np.inf


def _by_exact_forces(fits: FittedSets, found: CandidateSet, model: ForceModel) -> float:
    """Return J + |exact - linear|^2 of a set, whitened, with the exact forces of its model.

    Raises
    ------
    PprsError
        Where the model cannot follow the recordings.
    """
    return found.total + squared(
        fits, found, exact_forces(fits.design, model) - linear_prediction(fits, found))
