"""Gauss-Newton around the selection: the search again around a model that has what was found.

Some effects change how others show, or hold in their linear form nearby only. Where the fitted
model's exact forces differ from the linear prediction by more than the noise lets pass, columns
are computed anew around the fitted model, the error is extrapolated back to the given one, and the
search goes on from the set that was found. Costs of both searches mean the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.reconstruction import reconstruct, treated_forces
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.force_model import ForceModel
from pprs_dynamics.model.model_file import build_model
from pprs_dynamics.regression.base_columns import (
    ReversalShape,
    move_numbers,
    move_present,
    within,
)
from pprs_dynamics.regression.design import Design, Point
from pprs_dynamics.selection.candidates import (
    Candidate,
    CandidateSet,
    EffectCandidate,
    Placement,
)
from pprs_dynamics.selection.decisions import Decisions
from pprs_dynamics.selection.search import Search

# What the exact model may differ from the linear one by, in whitened squares, and how often the
# expansion is repeated; less changes no cost by more than a rival's margin.
LEAST_DIFFERENCE, MOST_EXPANSIONS = 4.0, 3


@dataclass(frozen=True)
class Selection:
    """The outcome of all searches.

    Parameters
    ----------
    first, last : Search
        Around the model as given, and around the last point.
    best : CandidateSet
        Of the last.
    """

    first: Search
    last: Search
    best: CandidateSet

    @property
    def ranked(self) -> list[CandidateSet]:
        """Sets of both searches by cost, the best first.

        A set belongs to the search around whose point it is linear: those with an effect that
        bends the columns to the last, the others to the first.
        """
        found = list(self.last.evaluated.values())
        if self.first is not self.last:
            def bends(one: CandidateSet) -> bool:
                return any(candidate.effect.bends_columns for candidate in one.effects)
            found = [one for one in found if bends(one)] + [
                one for one in self.first.evaluated.values() if not bends(one)]
            found = [self.best, *(one for one in found if one is not self.best)]
        return sorted(found, key=lambda one: one.cost)


def select(model: ForceModel, recordings: Sequence[Recording], decisions: Decisions,
           progress: Callable[[float], None] | None = None) -> Selection:
    """Return the best set of effects, searched around the fitted model where that matters.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    design = Design.of(model, recordings, lambda share: report(0.25 * share))
    first = search = Search(design, decisions,
                            progress=lambda share: report(0.25 + 0.35 * share))
    best = search.run()
    for number in range(MOST_EXPANSIONS):
        try:
            point = point_of(design, search, best)
            if squared_difference(search, best, point.model, recordings) < LEAST_DIFFERENCE:
                break
            around = design.around(point, recordings)
        except PprsError:
            break  # values that no model may have: the linear form is all there is
        start = 0.6 + 0.4 * number / MOST_EXPANSIONS
        search = Search(around, decisions, search.regression.error_scale,
                        lambda share, s=start: report(s + 0.4 / MOST_EXPANSIONS * share))
        best = search.run(rebuilt(search, best))
    report(1.0)
    return Selection(first, search, best)


def expanded(search: Search, found: CandidateSet, recordings: Sequence[Recording],
             decisions: Decisions) -> tuple[Search, CandidateSet]:
    """Return the same set around its own fitted model, and the search that holds it.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    for _ in range(MOST_EXPANSIONS):
        point = point_of(search.design, search, found)
        if squared_difference(search, found, point.model, recordings) < LEAST_DIFFERENCE:
            break
        around = search.design.around(point, recordings)
        search = Search(around, decisions, search.regression.error_scale, with_unknown=False)
        search.evaluate(())
        found = search.refined(search.evaluate(rebuilt(search, found)))
    return search, found


def point_of(design: Design, search: Search, found: CandidateSet) -> Point:
    """Return the fitted model with its numbers, and what it has beside the given one.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    base = found.fit.coefficients[:len(design.base)].copy()
    for k, column in enumerate(search.design.base):
        if isinstance(column, ReversalShape):
            base[k] = 0.0
    effects = []
    for candidate in found.effects:
        for placement in candidate.placements:
            every = {c.name: 0.0 for c in candidate.effect.coefficients}
            every.update(zip(placement.names, found.coefficients(placement).tolist(),
                             strict=False))
            effects.append((candidate.effect, placement.drive, placement.term.shape, every))
    return Point(fitted_model(design, found), base, tuple(effects))


def fitted_model(design: Design, found: CandidateSet) -> ForceModel:
    """Return the given model with the effects of a set, and its numbers as the fit moves them.

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    values: dict[str, Any] = dict(design.given.values)
    base = found.fit.coefficients[:len(design.base)]
    move_numbers(values, design.base, base)
    move_present(values, design.given, design.base, base)
    names = list(values.get('effects.active', []))
    for candidate in found.effects:
        if candidate.name not in names:
            names.append(candidate.name)
        for placement in candidate.placements:
            for key, value in placement_values(design, found, placement).items():
                values[f'effects.{candidate.name}.{key}'] = value
    if names:
        values['effects.active'] = names
    return replace(build_model(values), source=design.given.source)


def placement_values(design: Design, found: CandidateSet, placement: Placement) -> dict[str, float]:
    """Return the parameters of a placement under their keys in a model file."""
    effect = placement.term.effect
    prefix = '' if placement.drive is None else f'{design.drives[placement.drive]}.'
    every = {**placement.values(found.coefficients(placement)), **placement.term.shape}
    return {prefix + p.name: within(p, every[p.name]) for p in effect.parameters}


def squared_difference(search: Search, found: CandidateSet, model: ForceModel,
                       recordings: Sequence[Recording]) -> float:
    """Return the whitened squares of the exact forces of a fitted model less the linear ones."""
    regression, design = search.regression, search.design
    linear = linear_prediction(search, found)
    exact = exact_forces(design, model, recordings)
    total = 0.0
    for d in regression.drives:
        white = regression.whitened(found.fit, d, (exact - linear)[:, d])
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
        prediction += found.force(candidate, prediction.shape)
    return prediction


def exact_forces(design: Design, model: ForceModel, recordings: Sequence[Recording]) -> Array:
    """Return the treated forces of a model on the recordings of a design, (M, D) [N]."""
    same = np.array_equal(model.position_error, design.model.position_error)
    found = (design.reconstructions if same
             else [reconstruct(model, recording) for recording in recordings])
    return np.concatenate([treated_forces(model, one)['total'] for one in found])


def rebuilt(search: Search, found: CandidateSet) -> tuple[Candidate, ...]:
    """Return the candidates of another search's set with the columns of this one."""
    candidates: list[Candidate] = []
    for candidate in found.candidates:
        if isinstance(candidate, EffectCandidate):
            candidates.append(search.library.candidate(candidate.effect, [
                search.library.placed(candidate.effect, one.drive, one.term.shape, one.names)
                for one in candidate.placements]))
        else:
            candidates.append(candidate)
    return tuple(candidates)
