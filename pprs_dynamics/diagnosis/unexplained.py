"""What no effect of the catalogue explains: where it lies, and whether it makes effects needless.

The search of `localisation` goes over what the adopted effects leave. A catalogue effect is an
idealisation, so a small remainder on the same drive is its form; and what a free curve along one
variable explains far better than the effect adopted for it, was never that effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.form import form_allowance, friction_allowance
from pprs_dynamics.diagnosis.joint_fit import Active, Columns, Regression
from pprs_dynamics.diagnosis.judging import MARGIN, Judged, actives_of
from pprs_dynamics.diagnosis.localisation import Localisation, localise
from pprs_dynamics.diagnosis.regression import orthonormal
from pprs_dynamics.diagnosis.selection import Selection, Selector
from pprs_dynamics.diagnosis.wording import Statement
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.regression.design import Design

# A free curve explains this much more than an effect: then it is not that effect.
BETTER = 1.3
MOST_LEFT = 0.4  # of a drive's mean square, beside an effect that explains poorly


@dataclass(frozen=True)
class Unexplained:
    """What remains beside adopted effects.

    Parameters
    ----------
    statements : tuple of Statement
        Ranked by evidence.
    of_form : tuple of Statement
        Remainders that are small against an adopted effect, or the model's own friction, on the
        same drive.
    where : Localisation
        The search that found them.
    remaining : (M, D) array
        What all fits leave [N]; NaN where not measured.
    """

    statements: tuple[Statement, ...]
    of_form: tuple[Statement, ...]
    where: Localisation
    remaining: Array


def find_unexplained(selector: Selector, selection: Selection, allowed: Array,
                     ) -> Unexplained:
    """Return what remains, after dropping effects that a remainder explains better.

    Parameters
    ----------
    selector : Selector
    selection : Selection
        From which effects are dropped.
    allowed : (D,) array
        Mean square that the form of effects in the model may leave on each drive [N^2].
    """
    regression = selector.regression
    found = _search(regression, selection, allowed)
    while True:
        # One at a time, the weakest first: without it, others may no longer look needless.
        dropped = next((one for one in sorted(selection.adopted, key=lambda one: one.evidence) if (
            found.statements and _is_needless(one, selector, selection, found.statements,
                                              found.where))
            or _is_stopgap(one, selector, selection)), None)
        if dropped is None:
            return found
        selection.adopted.remove(dropped)
        active = actives_of(selection.adopted)
        selection.fit = regression.fit(active, selection.fit.noises)
        selection.rivals.pop(dropped.candidate.name, None)
        found = _search(regression, selection, allowed, found.where,
                        dropped.candidate.drives or tuple(regression.series))


def allowed_by_model(design: Design) -> Array:
    """Return the mean square that the form of effects in the model may leave, (D,) [N^2]."""
    squares = np.zeros(len(design.drives))
    for effect in design.model.effects:
        force = design.residuals.parts.get(effect.name)
        if force is not None and isinstance(effect, CatalogueEffect):
            squares += form_allowance(type(effect), force)
        elif force is not None and effect.name.endswith('friction'):
            squares += friction_allowance(force)
    return squares


def _search(regression: Regression, selection: Selection, before: Array,
            known: Localisation | None = None, changed: Sequence[int] = ()) -> Unexplained:
    residuals = regression.design.residuals
    remaining = np.full(residuals.measured.shape, np.nan)
    for d, series in regression.series.items():
        remaining[series.index, d] = np.where(series.known, selection.fit.rest[d], np.nan)
    where = localise(replace(residuals, measured=residuals.model + remaining, parts={}),
                     known=known, changed=[residuals.drives[d] for d in changed])
    allowed = before + _allowed(regression, selection)
    statements: list[Statement] = []
    of_form: list[Statement] = []
    for statement in where.statements:
        d = residuals.drives.index(statement.drive)
        small = statement.mean_square < allowed[d]
        (of_form if small else statements).append(statement)
    return Unexplained(tuple(statements), tuple(of_form), where, remaining)


def _allowed(regression: Regression, selection: Selection) -> Array:
    """Return the mean square that the form of adopted effects may leave on each drive [N^2]."""
    squares = np.zeros(len(regression.design.drives))
    place = len(regression.design.base)
    for one in selection.fit.active:
        assert isinstance(one, Active)
        for d in regression.series:
            rows = regression.rows(one, d)
            if rows is not None:
                squares[d] += form_allowance(one.term.effect, rows[0] if one.fixed else (
                    selection.fit.coefficients[place:place + one.size] @ rows))
        place += one.size
    return squares


def _is_stopgap(one: Judged, selector: Selector, selection: Selection) -> bool:
    """Return whether most of its drives' error is left with an effect, and not with a free curve.

    The noise beside a poor explanation swallows the rest of the error. So the search goes over the
    error as it was before the effect. Where all adopted effects together leave little of a drive's
    error, none of them is a stopgap, however little each adds to the others.
    """
    regression, residuals = selector.regression, selector.regression.design.residuals
    others = tuple(a for other in selection.adopted if other is not one
                   for a in other.candidate.active)
    before = regression.at(others, selection.start.noises)
    poor = [d for d in one.candidate.drives or () if float(np.mean(
        selection.fit.rest[d] ** 2)) > MOST_LEFT * float(np.mean(selection.start.rest[d] ** 2))]
    if not poor:
        return False
    measured = np.full(residuals.measured.shape, np.nan)
    for d in poor:
        series = regression.series[d]
        measured[series.index, d] = residuals.model[series.index, d] + np.where(
            series.known, before.rest[d], np.nan)
    where = localise(replace(residuals, measured=measured, parts={}))
    return bool(where.statements) and _is_needless(
        one, selector, selection, where.statements, where)


def _is_needless(one: Judged, selector: Selector, selection: Selection,
                 statements: tuple[Statement, ...], where: Localisation) -> bool:
    """Return whether free curves on the drives of an effect explain much more than it does."""
    regression = selector.regression
    drives = one.candidate.drives or tuple(regression.series)
    stated = {statement.drive for statement in statements}
    curves = []
    for d in drives:
        name = regression.design.drives[d]
        if name in stated:
            findings = where.drives[name]
            rows = np.zeros((len(findings.columns), len(regression.design.residuals)))
            if findings.columns.shape[1] == len(findings.index) and (
                    findings.index.max(initial=0) < rows.shape[1]):
                rows[:, findings.index] = findings.columns
                curves.append(Columns({d: orthonormal(rows)}))
    if not curves:
        return False
    others: tuple[Active, ...] = tuple(
        a for other in selection.adopted if other is not one for a in other.candidate.active)
    noises = selection.fit.noises
    without = regression.fit(others, noises)
    with_curves = regression.fit((*others, *curves), noises)
    by_effect = without.deviance - selection.fit.deviance
    price = float(np.log(regression.samples)) * sum(curve.size for curve in curves)
    by_curves = without.deviance - with_curves.deviance - price
    if by_curves > BETTER * by_effect:
        return True
    both = regression.fit((*others, *one.candidate.active, *curves), noises)
    return with_curves.deviance - both.deviance < one.candidate.penalty + MARGIN and (
        by_curves > by_effect)
