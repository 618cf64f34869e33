# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fitted sets of candidates: their cost, with shapes at its minimum."""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.regression.base_columns import units_of
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.regression.terms import OperatingPoint
from pprs_dynamics.inference.search.body_centres import centre_of
from pprs_dynamics.inference.search.candidates import (
    WAVES,
    Candidates,
    CandidateSet,
    Component,
    CostTerms,
    EffectCandidate,
    PriorCosts,
    UnknownCandidate,
    set_key,
)
from pprs_dynamics.inference.search.components import Components
from pprs_dynamics.inference.search.constraints import Constraints
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.form_error import FormErrors
from pprs_dynamics.physics.effects.effect import CatalogueEffect

SHAPE_ROUNDS = 4  # of Gauss-Newton steps in the shapes
# Shapes are rounded to a power of ten, of at most this share of their standard deviation given the
# other shapes: a cost changes by less than the least improvement.
SHAPE_ROUNDING = 0.5
NEAR = 1e-3  # [m], within which a body is where its columns are
LEAST_IMPROVEMENT = 0.1  # in cost, for which a step is taken
ROUNDING = 1e-12  # of correlations

SIZE_STEP = 0.2  # in the logarithm of a coefficient in proportion to which friction is in doubt

Nuisance = Mapping[Component, Mapping[str, Block]]


class FittedSets:
    """Fitted sets of one design, each fitted once.

    Parameters
    ----------
    design : Design
    decisions : Decisions
    error_scale : mapping of drive to float, optional
        See `Regression`.

    Attributes
    ----------
    stepped : callable
        Called for each set that is fitted and each drive that is scanned: work is done.
    """

    def __init__(self, design: Design, decisions: Decisions,
                 error_scale: Mapping[int, float] | None = None) -> None:
        self.design, self.decisions = design, decisions
        self.stepped: Callable[[], None] = lambda: None
        self.regression = Regression(
            design.residuals, design.base, error_scale=error_scale,
            open_forces={} if design.carried is None else design.carried.open_forces)
        self.prior_costs = PriorCosts.of(self.regression, decisions, design.given)
        self.components = Components(design, self.regression, self.prior_costs)
        self.form_errors = FormErrors(design, self.regression, decisions)
        self.constraints = Constraints(design)
        self._evaluated: dict[Hashable, CandidateSet] = {}
        self._best: CandidateSet | None = None
        self._nuisance: dict[Hashable, Mapping[str, Block]] = {}

    def around(self, point: OperatingPoint,
               effects: Container[type[CatalogueEffect]] | None = None) -> FittedSets:
        """Return sets of the same recordings around another operating point, none fitted yet.

        See `Design.around`.
        """
        return FittedSets(self.design.around(point, effects), self.decisions,
                          self.regression.error_scale)

    @property
    def sets(self) -> tuple[CandidateSet, ...]:
        """All that were fitted so far."""
        return tuple(self._evaluated.values())

    def has(self, candidates: Candidates) -> bool:
        """Return whether a set was fitted."""
        return set_key(candidates) in self._evaluated

    @property
    def best(self) -> CandidateSet:
        """The set of lowest cost so far."""
        return self._best or self.evaluate(())

    def evaluate(self, candidates: Candidates) -> CandidateSet:
        """Return a set, fitted; one that was fitted before is not fitted again.

        The fit is a function of the set alone: it does not matter when it is made, nor after what.
        """
        key = set_key(candidates)
        if key not in self._evaluated:
            fitted = self._fitted(tuple(sorted(candidates, key=lambda c: c.rank)))
            self._keep(fitted)
            self.stepped()
            if fitted.form_of is not None:
                self._explain(fitted, fitted.form_of)
        return self._evaluated[key]

    def _keep(self, fitted: CandidateSet) -> None:
        self._evaluated[fitted.key] = fitted
        if self._best is None or fitted.cost < self._best.cost or fitted.key == self._best.key:
            self._best = fitted

    def _explain(self, fitted: CandidateSet, form_of: Candidates) -> None:
        """Let the set of which a candidate is a form error cost no more than with it.

        It must explain more than the candidate alone, which else is no error of its form.
        """
        less, form = self.evaluate(form_of), tuple(
            c for c in fitted.candidates if c not in form_of)
        if fitted.plain < less.total and (form == fitted.candidates
                                          or less.plain < self.evaluate(form).plain):
            self._keep(replace(less, with_form=fitted, terms=replace(
                less.terms, forms=fitted.plain - less.plain)))

    def _fitted(self, candidates: Candidates) -> CandidateSet:
        if not candidates:
            fit = self.regression.fit(())
            return CandidateSet((), fit, self._terms(fit))
        start = self.evaluate(()).fit
        nuisance: Nuisance = {}
        if any(self.components.nuisance_rows(component) for c in candidates
               for component in c.components):
            # The size of its forces, in proportion to which friction is in doubt, need not be
            # exact: the noise of the empty set does, and steps of it, whose columns are kept.
            nuisance = self._nuisance_blocks(candidates, self.regression.at(
                self.blocks(candidates), start))
        exact = {component: {kind: block for kind, block in blocks.items() if kind != WAVES}
                 for component, blocks in nuisance.items()}
        fit = self.regression.fit(self.blocks(candidates, exact), start)
        # The form of a friction is the catalogue's or off, by equal odds: the likelier one.
        nuisance = {component: blocks if WAVES in blocks and self.regression.gain(
            fit, blocks[WAVES]) > 0 else exact[component] for component, blocks in nuisance.items()}
        if nuisance != exact:
            fit = self.regression.fit(self.blocks(candidates, nuisance), fit)
        fitted = self._set(candidates, fit, nuisance)
        possible = self.constraints.applied(self.regression, fit, fitted.blocks)
        if possible is None:
            return replace(fitted, barred='no possible values come near')
        if possible is not fit:
            # The rise of the cost is a term of its own, not a worse fit.
            feasible = CostTerms(feasibility=possible.deviance - fit.deviance)
            moved = replace(fitted, fit=possible)
            signs = CostTerms(signs=self._signs(moved, fit.covariance) - fitted.terms.signs)
            fitted = replace(moved, terms=fitted.terms + signs + feasible)
        barred, form_of = self.form_errors.reason(fitted, fit.covariance)
        return replace(fitted, barred=barred, form_of=form_of)

    def pruned(self, fitted: CandidateSet) -> CandidateSet:
        """Return a set without the candidates that do not pay in it."""
        while fitted.candidates:
            less = min((self.evaluate(fitted.without(gone)) for gone in fitted.candidates),
                       key=lambda fitted: fitted.total)
            if less.total > fitted.total:
                break
            fitted = less
        return fitted

    def blocks(self, candidates: Candidates, nuisance: Nuisance = MappingProxyType({}),
               ) -> list[Block]:
        """Return the columns of candidates, then those of what they leave open."""
        return [*(block for c in candidates for block in (
            (c.block,) if isinstance(c, UnknownCandidate)
            else map(self.components.block, c.components))),
            *(block for of_component in nuisance.values() for block in of_component.values())]

    def _set(self, candidates: Candidates, fit: JointFit, nuisance: Nuisance) -> CandidateSet:
        blocks = {component: self.components.block(component) for c in candidates
                  for component in c.components}
        found = CandidateSet(candidates, fit, self._terms(fit), blocks, nuisance)
        return replace(found, terms=found.terms + self.prior_cost(found))

    def _terms(self, fit: JointFit) -> CostTerms:
        left = self.regression.misfit(fit)
        return CostTerms(fit=left, coefficients=fit.deviance - left)

    def _nuisance_blocks(self, candidates: Candidates, fit: JointFit) -> Nuisance:
        """Return columns for what effects leave open, in proportion to their fitted force.

        How friction turns over, and how real forms depart from the catalogue's. Each has a
        coefficient of unit prior.
        """
        found = {}
        for component in (component for c in candidates for component in c.components):
            size = _stepped(fit.of(self.components.block(component))[:max(len(component.names), 1)])
            key = (component, tuple(size.tolist()))
            if key not in self._nuisance:
                self._nuisance[key] = self._nuisance_of(component, size)
            if self._nuisance[key]:
                found[component] = self._nuisance[key]
        return found

    def _nuisance_of(self, component: Component, c: Array) -> Mapping[str, Block]:
        """Return the columns of one component, for its coefficients (k,)."""
        rows = {kind: {d: np.tensordot(c, values, 1) for d, values in by_drive.items()}
                for kind, by_drive in self.components.nuisance_rows(component).items()}
        return {kind: Block(by_drive, np.eye(len(next(iter(by_drive.values())))))
                for kind, by_drive in rows.items()}

    def at_noise_of(self, fitted: CandidateSet, candidates: Candidates) -> CandidateSet:
        """Return a smaller set under the noise of a larger one: what a replacement starts from."""
        kept = {component for c in candidates for component in c.components}
        nuisance = {component: blocks for component, blocks in fitted.nuisance.items()
                    if component in kept}
        fit = self.regression.at(self.blocks(candidates, nuisance), fitted.fit)
        return self._set(candidates, fit, nuisance)

    def prior_cost(self, fitted: CandidateSet) -> CostTerms:
        """Return the prior penalties of a set: of all that was chosen, and of signs."""
        return sum(map(self.components.prior_cost, fitted.candidates),
                   CostTerms(signs=self._signs(fitted, fitted.fit.covariance)))

    def _signs(self, fitted: CandidateSet, covariance: Array) -> float:
        """Return the penalty of the signs of a set's coefficients, given their covariance."""
        cost = 0.0
        for component, block in fitted.blocks.items():
            values = component.values(fitted.coefficients(component))
            for name in component.signed:
                at = fitted.fit.places[block].start + component.names.index(name)
                cost += self.prior_costs.of_sign(
                    (values[name] - component.effect.unphysical_below[name])
                    / max(float(covariance[at, at]) ** 0.5, 1e-300))
        return cost

    def drop_cost(self, fitted: CandidateSet, component: Component) -> float:
        """Return by how much the deviance rises without a component, at the noise of a fit.

        By the Savage-Dickey ratio of prior and posterior density at 0.
        """
        block = fitted.blocks[component]
        if block.mean is not None:  # without it the shape goes, too
            return np.inf
        fit = self.free(fitted)  # constraints say nothing of the density at 0
        place = fit.places[block]
        # Moments of a body that a motion does not show are far less certain than its mass.
        size, alike = _correlation(fit.covariance[place, place])
        c = fit.coefficients[place] / size
        return float(c @ np.linalg.solve(alike, c) + np.linalg.slogdet(alike)[1]
                     + 2 * np.log(size).sum() + np.linalg.slogdet(block.precision)[1])

    def free(self, fitted: CandidateSet) -> JointFit:
        """Return the fit of a set without constraints, at its noise."""
        return (fitted.fit if fitted.terms.feasibility == 0
                else self.regression.at(fitted.fit.blocks, fitted.fit))

    def refused(self, fitted: CandidateSet) -> list[Component]:
        """Return the components that no machine has in the values that fit best."""
        return self.constraints.refused(self.free(fitted), fitted.fit, fitted.blocks,
                                        self.decisions.sure)

    def held(self, fitted: CandidateSet, index: Integers, values: Array) -> CandidateSet:
        """Return a set with some coefficients (k,) as given, all else fitted with them.

        At the noise of the set, so that a bad value cannot hide in it.
        """
        fit = self.regression.held(fitted.fit, index, values)
        return replace(fitted, fit=fit, terms=fitted.terms + CostTerms(
            fit=fit.deviance - fitted.fit.deviance))

    def refined(self, fitted: CandidateSet) -> CandidateSet:
        """Return the set with all shapes moved by Gauss-Newton steps that lower the cost.

        Each may be twice as long as the one before.
        """
        for number in range(SHAPE_ROUNDS):
            moved = self._moved(fitted, 2.0 ** number)
            if moved is None:
                return fitted
            after = self.evaluate(moved)
            if not after.cost < fitted.cost - LEAST_IMPROVEMENT:
                return fitted
            fitted = after
        return fitted

    def _moved(self, fitted: CandidateSet, longest: float) -> Candidates | None:
        """Return candidates after a Gauss-Newton step in shapes, of `longest` reaches at most."""
        slopes = self.slopes(fitted)
        moved: dict[Component, Component] = {}
        for component, centre in self._centres(fitted):
            if _distance(centre, component.centre) > NEAR:
                moved[component] = replace(component, centre=centre)
        if not slopes and not moved:
            return None
        blocks = dict.fromkeys(slopes.values())
        fit = self.regression.at((*fitted.fit.blocks, *blocks), fitted.fit)
        if not moved and _gain(fit, list(blocks)) < LEAST_IMPROVEMENT:
            return None
        index, known = fit.index_of(list(blocks)), np.zeros(len(fit.coefficients))
        size, alike = _correlation(fit.covariance[np.ix_(index, index)])
        known[index] = size * np.diag(np.linalg.inv(alike)) ** -0.5
        shapes: dict[Block, dict[str, float]] = {}
        for component, block in slopes.items():
            if block in shapes:
                moved[component] = replace(component, shape=tuple(sorted(shapes[block].items())))
                continue
            effect, shape, reach = component.effect, component.parameters, self._reach(component)
            for parameter, step, std in zip(effect.shape, fit.of(block), known[fit.places[block]],
                                            strict=True):
                limit = longest * reach[parameter.name]
                value = parameter.moved(shape[parameter.name], float(np.clip(step, -limit, limit)))
                bounded = parameter.of(units_of(self.design.given, component.drive).turns)
                # Rounded, so that the same optimum is one set, from wherever it was reached.
                decimals = -int(np.floor(np.log10(SHAPE_ROUNDING * parameter.spread(std, value))))
                shape[parameter.name] = float(np.clip(
                    round(value, decimals), bounded.lower, bounded.upper))
            shapes[block] = shape
            moved[component] = replace(component, shape=tuple(sorted(shape.items())))
        return tuple(
            EffectCandidate.of(moved.get(component, component) for component in c.components)
            if isinstance(c, EffectCandidate) else c for c in fitted.candidates)

    def _centres(self, fitted: CandidateSet) -> list[tuple[Component, tuple[float, ...]]]:
        return [(component, centre_of(component.effect, component.names,
                                      fitted.coefficients(component), self.design.given))
                for component in fitted.blocks if component.centre]

    def off_centre(self, fitted: CandidateSet) -> float:
        """Return how far the bodies of a set are from where their columns are [m]."""
        return max((_distance(centre, component.centre)
                    for component, centre in self._centres(fitted)), default=0.0)

    def slopes(self, fitted: CandidateSet) -> dict[Component, Block]:
        """Return derivatives by the shapes of a set, of unit prior, for the components with any.

        Components that share a shape share a block.
        """
        slopes: dict[Component, Block] = {}
        for candidate in fitted.effects:
            groups: dict[Component | None, list[Component]] = {}
            for component in candidate.components if candidate.effect.shape else ():
                groups.setdefault(None if component.is_shared else component, []).append(component)
            for group in groups.values():
                rows: dict[int, Array] = {}
                for component in group:
                    for d, row in self.design.slope_rows(
                            self.components.term(component),
                            component.total(fitted.coefficients(component))).items():
                        rows[d] = rows.get(d, 0.0) + row
                slopes |= dict.fromkeys(group, self.regression.block(
                    rows, np.eye(len(candidate.effect.shape))))
        return slopes

    def of_one_shape(self, fitted: CandidateSet, candidate: EffectCandidate) -> EffectCandidate:
        """Return an effect of a set with the mean of its shapes, by precision, on all drives."""
        slopes = self.slopes(fitted)
        blocks = list(dict.fromkeys(slopes.values()))
        fit = self.regression.at((*fitted.fit.blocks, *blocks), fitted.fit)
        weights = 1 / np.array([np.diag(fit.covariance)[fit.index_of([slopes[component]])]
                                for component in candidate.components])
        shapes = np.array([[component.parameters[p.name] for p in candidate.effect.shape]
                           for component in candidate.components])
        mean = (weights * shapes).sum(axis=0) / weights.sum(axis=0)
        shape = dict(zip((p.name for p in candidate.effect.shape), mean.tolist(), strict=True))
        return EffectCandidate.of(
            replace(component, shape=tuple(sorted(shape.items())), is_shared=True)
            for component in candidate.components)

    def _reach(self, component: Component) -> dict[str, float]:
        """Return how far each shape parameter may move at once: half the way between trials."""
        reach = {}
        for parameter in component.effect.shape:
            value = component.parameters[parameter.name]
            known = self.components.tried(component, parameter.name)
            if len(known) < 2:
                reach[parameter.name] = 0.5
                continue
            at = int(np.clip(np.searchsorted(known, value), 1, len(known) - 1))
            gap = known[at] - known[at - 1]
            reach[parameter.name] = max(0.5 * parameter.amount(gap, value), 1e-3)
        return reach


def _distance(first: Sequence[float], other: Sequence[float]) -> float:
    return max(abs(a - b) for a, b in zip(first, other, strict=True))


def _gain(fit: JointFit, blocks: Sequence[Block]) -> float:
    """Return by how much some columns lower the deviance, at the noise of the fit."""
    places = fit.index_of(blocks)
    c = fit.coefficients[places]
    return float(c @ np.linalg.solve(fit.covariance[np.ix_(places, places)], c))


def _correlation(covariance: Array) -> tuple[Array, Array]:
    """Return standard deviations and correlations, invertible, of a covariance (k, k)."""
    size = np.sqrt(np.diag(covariance))
    return size, covariance / np.outer(size, size) + ROUNDING * np.eye(len(size))


def _stepped(coefficients: Array) -> Array:
    """Return coefficients rounded to steps of their logarithm."""
    size = np.abs(coefficients)
    steps = np.round(np.log(np.where(size > 0, size, 1.0)) / SIZE_STEP)
    stepped: Array = np.sign(coefficients) * np.where(size > 0, np.exp(SIZE_STEP * steps), 0.0)
    return stepped
