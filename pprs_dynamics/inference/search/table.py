# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The table of models: one row for every choice of effects that was fitted, with its cost.

The answer of a diagnosis is the row of least cost. Evidence, rivals and suspects are queries.
Costs of rows within a margin of the least are those of exact forces. Costs of other rows are those
of linear forces, around the input model or around the model of the last search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.regression.base_columns import CarriedOver
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.candidates import (
    DURING,
    Candidates,
    CandidateSet,
    CostTerms,
    EffectCandidate,
    RowKey,
)
from pprs_dynamics.inference.search.courses import fit_courses, fit_curves
from pprs_dynamics.inference.search.decisions import Decisions, outside_cost
from pprs_dynamics.inference.search.fitted_model import (
    LEAST_CHANGE,
    fitted_model,
    has_nonlinear,
    linear_prediction,
    linearised,
    squared,
)
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.noise_floors import noise_floors
from pprs_dynamics.inference.search.search import (
    RECOVERED,
    Search,
    exchanged,
    of_same_names,
    patterns_of,
)
from pprs_dynamics.inference.search.unknown import DrivePatterns
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

MOST_STEPS = 6  # of relinearisation of one row
MOST_SEARCHES = 5  # each around the best model of the one before: three are rare
MOST_EXACT = 4  # rows of one search that get exact costs
# Of cost above the best row, from which a row is left in the variants and on the drives that it
# has: odds of exp(500) to 1 need no better bound.
REMOTE = 1000.0


@dataclass(frozen=True, eq=False)
class Row:
    """A choice of effects, at its best.

    Parameters
    ----------
    fits : FittedSets
        With the columns of the fit.
    fitted : CandidateSet
    linearisation : float or None
        Whitened square by which exact forces differ from the linear fit; None: not computed.
    """

    fits: FittedSets = field(repr=False)
    fitted: CandidateSet
    linearisation: float | None = None

    @classmethod
    def exact(cls, fits: FittedSets, fitted: CandidateSet, best: float = inf,
              form: Candidates = ()) -> Row:
        """Return a set around its own model, with the cost of exact forces.

        Of a row that is not nearly as good as one of cost `best`, an upper bound of it. It costs no
        more than with `form`, where that is its form error.
        """
        around, moved = fits, fitted
        try:
            for _ in range(MOST_STEPS):
                around, moved = linearised(around, moved, best + REMOTE, form)
                if moved.total > best + REMOTE:
                    break
                before, moved = moved, of_same_names(around, moved)
                if moved is before:
                    break
            exact = around.design.exact_forces(fitted_model(around, moved))
        except PprsError:
            return cls(fits, replace(fitted, barred='no model can have its values'), 0.0)
        if form:
            around.evaluate((*moved.candidates, *form))
            moved = around.evaluate(moved.candidates)
        return cls(around, moved, squared(around, moved, exact - linear_prediction(around, moved)))

    @property
    def terms(self) -> CostTerms:
        """Terms of the cost; they add up to it."""
        return self.fitted.terms + CostTerms(linearisation=self.linearisation or 0.0)

    @cached_property
    def cost(self) -> float:
        """The cost, infinite for an inadmissible row."""
        return self.fitted.cost + (self.linearisation or 0.0)

    @property
    def is_exact(self) -> bool:
        """Whether the cost is that of exact forces, as far as there are any."""
        return self.linearisation is not None or self.fitted.is_dated

    @property
    def effects(self) -> tuple[EffectCandidate, ...]:
        """Effects of the catalogue that the row claims, without what passes."""
        return tuple(candidate for candidate in self.fitted.effects
                     if candidate.course is None or candidate.course.kind != DURING)

    @property
    def placed_names(self) -> frozenset[str]:
        """Names of the effects, with their link or joint where they are on one."""
        return frozenset(candidate.placed_name for candidate in self.effects)

    def has(self, candidate: EffectCandidate) -> bool:
        """Return whether the row claims an effect, on whatever drives and in whatever shape."""
        return candidate.placed_name in self.placed_names


@dataclass(frozen=True)
class Rival:
    """A row that claims other effects than the reported row at nearly the same cost.

    Parameters
    ----------
    row : Row
    missing, instead : tuple of str
        Names of reported effects that it lacks, and names that it has in their place. A reported
        effect on another link or joint is `NAME:PLACE`.
    """

    row: Row
    missing: tuple[str, ...]
    instead: tuple[str, ...]


@dataclass(frozen=True)
class ModelTable:
    """All choices of effects that were fitted, the cheapest first.

    Parameters
    ----------
    first, last : FittedSets
        Around the input model, and around the model of the last search.
    patterns : tuple of DrivePatterns
        Patterns of no catalogue around the last.
    exact : mapping of RowKey to Row
        Rows with exact costs, in place of the linear rows of these names.
    """

    first: FittedSets = field(repr=False)
    last: FittedSets = field(repr=False)
    patterns: tuple[DrivePatterns, ...] = field(default=(), repr=False)
    exact: Mapping[RowKey, Row] = field(default_factory=dict, repr=False)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """One row for each choice of effects, the cheapest first.

        Sets with a nonlinear effect are those of the last search, others those of the first.
        """
        found = dict(self.exact)
        for fits in dict.fromkeys((self.last, self.first)):
            for fitted in sorted(fits.sets, key=lambda fitted: fitted.cost):
                if fitted.is_admissible and (self.first is self.last
                                             or fitted.is_nonlinear is (fits is self.last)):
                    found.setdefault(fitted.row_key, Row(fits, fitted))
        by_cost = sorted(found.values(), key=lambda row: row.cost)
        return tuple({row.fitted.row_key: row for row in reversed(by_cost)}.values())[::-1]

    @property
    def best(self) -> Row:
        """The row of least cost, which is reported."""
        return self.rows[0]

    @cached_property
    def reported(self) -> CandidateSet:
        """The reported set in the last search, for what compares sets there."""
        return self.last.evaluate(self.best.fitted.candidates)

    @cached_property
    def noise_floors(self) -> dict[str, float]:
        """The rms of the noise of each drive [N], where the recordings determine it."""
        return noise_floors(self.first, reported=self.reported.fit)

    def without(self, candidate: EffectCandidate) -> Row:
        """Return the cheapest row that lacks an effect."""
        return next(row for row in self.rows if not row.has(candidate))

    def evidence(self, candidate: EffectCandidate) -> float:
        """Return by how much the cheapest row without an effect costs more than the least."""
        return self.without(candidate).cost - self.best.cost

    def barred(self, margin: float) -> tuple[CandidateSet, ...]:
        """Return inadmissible sets that would cost less than a margin above the least."""
        found = [fitted for fits in dict.fromkeys((self.last, self.first)) for fitted in fits.sets
                 if fitted.barred and fitted.total < self.best.cost + margin]
        return tuple(sorted(found, key=lambda fitted: fitted.total))

    @property
    def alone(self) -> dict[str, CandidateSet]:
        """The cheapest set of each effect as the only one, around the input model, by name."""
        found: dict[str, CandidateSet] = {}
        for fitted in sorted(self.first.sets, key=lambda fitted: fitted.cost):
            if len(fitted.candidates) == len(fitted.effects) == 1 and (
                    fitted.is_admissible and not fitted.is_dated):
                found.setdefault(fitted.effects[0].name, fitted)
        return found

    def near(self, margin: float) -> list[tuple[float, CandidateSet]]:
        """Return other sets of the last search, and what each costs above the reported set."""
        return sorted(((fitted.cost - self.reported.cost, fitted) for fitted in self.last.sets
                       if fitted is not self.reported
                       and fitted.cost < self.reported.cost + margin), key=lambda pair: pair[0])

    @outside_cost('friction that differs by direction is no rival of friction that does not')
    def rivals(self, margin: float) -> list[Rival]:
        """Return the rows within a margin of the least that claim other effects.

        Friction that differs by direction claims no other than the same both ways, but more of it.
        """
        mine = {candidate.placed_name: candidate.name for candidate in self.best.effects}
        rivals = []
        for row in self.rows[1:]:
            if row.cost > self.best.cost + margin:
                break
            theirs = {candidate.placed_name: candidate.name for candidate in row.effects}
            more = {name for candidate in row.effects
                    for name in candidate.effect.symmetric.values()}
            missing = sorted(name for place, name in mine.items()
                             if place not in theirs and name not in more)
            instead = sorted(place if name in mine.values() else name
                             for place, name in theirs.items() if place not in mine)
            if missing and instead:
                rivals.append(Rival(row, tuple(missing), tuple(instead)))
        return rivals

    def suspects(self, margin: float) -> list[tuple[EffectCandidate, Row]]:
        """Return effects that, as one more, cost less than a margin above the least."""
        mine = {candidate.key for candidate in self.best.fitted.candidates}
        found: dict[str, tuple[EffectCandidate, Row]] = {}
        for row in self.rows[1:]:
            more = [c for c in row.effects if c.placed_name not in self.best.placed_names]
            if row.cost < self.best.cost + margin and len(more) == 1 and (
                    len(row.fitted.candidates) == len(mine) + 1
                    and self.best.placed_names < row.placed_names):
                found.setdefault(more[0].name, (more[0], row))
        return list(found.values())


def tabulate(model: DriveModel, recordings: Sequence[Recording], decisions: Decisions,
             progress: Callable[[float], None] | None = None,
             carry_over: Callable[[Design], CarriedOver] | None = None) -> ModelTable:
    """Return the table of all choices of effects that a search fits to recordings.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
    decisions : Decisions
    progress : callable, optional
        Called with the share of the work that is done.
    carry_over : callable, optional
        Returns what a reference run knows of the recordings.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    design = Design.of(model, recordings, lambda share: report(0.25 * share))
    design = design.beside(carry_over and carry_over(design))
    first = FittedSets(design, decisions)
    patterns, exact, best = patterns_of(first), dict[RowKey, Row](), Row(first, first.evaluate(()))
    left = 0.65  # of the work: each search has half of what is left

    def searched(share: float) -> None:
        report(0.9 - left * (1 - share / 2))

    for number in range(MOST_SEARCHES):
        point = best.fits.design.point
        fits = first if point is None else first.around(point)
        search = Search(fits, patterns if fits is first else patterns_of(fits), searched)
        search.run(best.fitted.candidates)
        exact, before = _with_exact_costs(search, first, exact), best
        best = min(exact.values(), key=lambda row: row.cost)
        if best is before:
            break  # the next search would be this one once more
        if search.is_ended and (number or (not best.fitted.is_nonlinear and abs(
                first.evaluate(best.fitted.candidates).total - best.fitted.total) < LEAST_CHANGE)):
            break
        left /= 2
    table = with_exact_best(ModelTable(first, search.fits, search.patterns, exact))
    fit_courses(table.last, table.reported, list(table.alone.values()),
                None if first is search.fits else first)
    table = with_exact_best(table)
    if fit_curves(first, table.last, table.best.fitted):
        table = with_exact_best(table)
    report(1.0)
    return table


def input_model_alone(model: DriveModel, recordings: Sequence[Recording], decisions: Decisions,
                      progress: Callable[[float], None]) -> ModelTable:
    """Return the table of the row without any effect; errors as `measure_residuals`."""
    fits = FittedSets(Design.of(model, recordings, progress), decisions)
    fits.evaluate(())
    return ModelTable(fits, fits)


def _with_exact_costs(search: Search, first: FittedSets, known: dict[RowKey, Row],
                      ) -> dict[RowKey, Row]:
    """Return the exact rows, with those that may be the best of a search."""
    fits, exact = search.fits, dict(known)
    for fitted in _shortlist(fits):
        row = exact.get(fitted.row_key)
        if row is None or fitted.cost < row.cost - LEAST_CHANGE:
            best = min((known.cost for known in exact.values()), default=inf)
            exact = _with(exact, first, fits, fitted, best)
    return exact


def _with(exact: Mapping[RowKey, Row], first: FittedSets, fits: FittedSets, fitted: CandidateSet,
          best: float = inf) -> dict[RowKey, Row]:
    """Return exact rows with that of a set; of the same names the cheapest one.

    Where a set is inadmissible by its exact forces, also with that of its best part, from where
    that is in it: by itself an effect takes the place of others, too, and may end far from there.
    `best` is as in `Row.exact`.
    """
    found = dict(exact)
    of_row = fits if fitted.is_nonlinear else first
    row = Row.exact(of_row, of_row.evaluate(fitted.candidates), best, fitted.form)
    key, part = row.fitted.row_key, row.fits.best
    found[key] = min(found.get(key, row), row, key=lambda row: row.cost)
    is_part = row.fitted.barred and part.row_key < key and part.candidates
    return _with(found, first, row.fits, part, best) if is_part else found


def with_exact_best(table: ModelTable) -> ModelTable:
    """Return a table in which the rows that may be the best have exact costs.

    Those within the margin of rivals, the best row without one of its effects, and the one with
    another nonlinear effect in the place of one: around the model of a nonlinear set the linear
    costs of these say little.
    """
    margin, table = table.last.decisions.rival_margin, replace(table)
    for _ in range(MOST_EXACT):
        best = table.best
        near = [row for row in table.rows if row.cost < best.cost + margin]
        if best.fitted.is_nonlinear and not best.fitted.is_dated:
            near += _exchanged(table)
            if len(best.effects) > 1:
                near += [Row(best.fits, best.fits.evaluate(best.fitted.without(effect)))
                         for effect in best.effects]
        row = next((row for row in near if not row.is_exact
                    and row.fitted.row_key not in table.exact), None)
        if row is None:
            break
        table = replace(table, exact=_with(table.exact, table.first, row.fits, row.fitted,
                                           best.cost))
    return table


def _exchanged(table: ModelTable) -> list[Row]:
    """Return the best row with another nonlinear effect in the place of one.

    Of those that by themselves explain nearly as much.
    """
    fitted, fits = table.best.fitted, table.last
    known = {effect.name for effect in fitted.effects}
    alone = {name: other for name, other in table.alone.items() if other.is_nonlinear}
    none = table.first.evaluate(()).cost
    return [Row(fits, fits.evaluate(exchanged(fitted, effect, other.candidates[0])))
            for effect in fitted.effects if effect.name in alone
            for name, other in alone.items() if name not in known
            and none - other.cost > RECOVERED * (none - alone[effect.name].cost)]


def _shortlist(fits: FittedSets) -> Iterable[CandidateSet]:
    """Return a set of each choice of effects that may be the best by exact costs.

    Of choices within the margin of rivals, and any nonlinear one where the cheapest set is
    nonlinear and the columns are not around its model. Of sets that cost alike the one whose
    bodies are where their columns are.
    """
    best, near = fits.best, dict[RowKey, list[CandidateSet]]()
    is_far = not has_nonlinear(fits, best)
    for fitted in sorted(fits.sets, key=lambda fitted: fitted.cost):
        if fitted.cost <= best.cost + fits.decisions.rival_margin or (
                is_far and fitted.is_nonlinear and fitted.is_admissible):
            alike = near.setdefault(fitted.row_key, [])
            if not alike or fitted.cost < alike[0].cost + LEAST_CHANGE:
                alike.append(fitted)
    return [min(alike, key=fits.off_centre) for alike in near.values()][:MOST_EXACT]
