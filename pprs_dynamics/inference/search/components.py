# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Terms of all effects of the catalogue in a design, and the gain in likelihood of each."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design, searched_in_drives
from pprs_dynamics.inference.regression.joint_fit import CERTAIN, JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.regression.nuisance_columns import (
    deviation_rows,
    form_rows,
    joint_reversal_rows,
    reversal_rows,
)
from pprs_dynamics.inference.regression.sensitivities import DEVIATIONS
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.search.body_centres import about_centre, find_centre, has_centre
from pprs_dynamics.inference.search.candidates import (
    FORM,
    REVERSAL,
    WAVES,
    Candidate,
    CandidateSet,
    Component,
    CostTerms,
    Course,
    PriorCosts,
    UnknownCandidate,
)
from pprs_dynamics.inference.search.score_test import Entry, ScoreTest
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, MeasurementEffect, Windup
from pprs_dynamics.physics.effects.effect import CatalogueEffect


def placed(design: Design, effect: type[CatalogueEffect], drive: int | None,
           shape: Mapping[str, float], names: tuple[str, ...]) -> Component:
    """Return an effect on a drive or in the structure, with what the given model has of it."""
    found = Component.of(effect, drive, shape, names)
    values = design.present(effect, drive)
    if values is None:
        return found
    known = effect.to_coefficients(values)
    return replace(found, given=tuple(known[c.name] for c in effect.coefficients))


def shapes_of(design: Design, effect: type[DriveEffect], drive: int,
              ) -> Sequence[Mapping[str, float]]:
    """Return the shapes in which an effect is tried on a drive, the given model's among them."""
    trials = effect.trials(design.covered[drive])
    values = design.present(effect, drive)
    return trials if values is None or not effect.shape else [
        *trials, {p.name: values[p.name] for p in effect.shape}]


class DriveComponents:
    """Effects on one drive alone, in every shape tried.

    Parameters
    ----------
    design : Design
    regression : Regression
    d : int
    """

    def __init__(self, design: Design, regression: Regression, d: int) -> None:
        self.regression, self.d = regression, d
        self.series = regression.series[d]
        self.design = design
        self._places: dict[type[DriveEffect], slice] = {}

    @cached_property
    def effects(self) -> list[type[DriveEffect]]:
        """Effects that the drive may have, without those that all drives feel."""
        return [effect for effect in searched_in_drives(self.design)
                if self.design.acts_on(effect, self.d) and not effect.shifts_positions()]

    @cached_property
    def score_test(self) -> ScoreTest[Component]:
        """All shapes in all variants that the rows of a scan suffice for."""
        entries: list[Entry[Component]] = []
        parts: list[Array] = [np.zeros((0, len(self.series)), dtype=np.float32)]
        first = 0
        for effect in self.effects:
            found, rows = self._tried(effect)
            for term, known, at in found:
                entries += self._entries(term, first + at, known)
            self._places[effect] = slice(first, first + len(rows))
            first += len(rows)
            parts.append(rows)
        return ScoreTest(self.regression, {self.d: np.concatenate(parts)}, entries)

    def rows_of(self, effect: type[DriveEffect]) -> Array:
        """Return the transformed columns of an effect in all shapes tried, (k, n)."""
        if 'score_test' not in vars(self):  # which has variants and products as well
            return self._tried(effect)[1]
        return self.score_test.rows[self.d][self._places[effect]]

    def _tried(self, effect: type[DriveEffect]) -> tuple[list[tuple[Term, int, int]], Array]:
        """Return an effect's terms, each with its rows known and its first row, and all rows."""
        found, rows, count = list[tuple[Term, int, int]](), list[Array](), 0
        for term in self.design.trial_terms(effect, self.d,
                                            shapes_of(self.design, effect, self.d)):
            known = self.design.known_change(term)
            found.append((term, len(known), count))
            more = ([term.rows[self.d] + known[self.d]] if known and not term.names
                    else [term.rows[self.d], *(row[None] for row in known.values())])
            rows += more
            count += sum(map(len, more))
        # In single precision and in frequency alone: there are hundreds of them.
        return found, self.series.transform(np.concatenate(
            rows, dtype=np.float32, casting='same_kind'))

    def _entries(self, term: Term, first: int, known: int) -> list[Entry[Component]]:
        """Return the variants of a term whose rows begin at a place; what is known of it last."""
        effect = term.effect
        if not term.names:
            return [Entry(placed(self.design, effect, self.d, term.shape, ()), (first,),
                          CERTAIN * np.eye(1), np.ones(1))]
        found = []
        for names in term.variants():
            if not set(names) <= set(effect.scanned):
                continue
            at = [term.names.index(name) for name in names]
            chosen = self.series.transform(term.rows[self.d][at]) if known else None
            precision = None if chosen is None else block_diag(
                self.regression.g_prior({self.d: chosen @ chosen.T}), np.array([[CERTAIN]]))
            found.append(Entry(
                placed(self.design, effect, self.d, term.shape, names),
                (*(first + k for k in at), *[first + len(term.rows[self.d])] * known), precision,
                np.append(np.zeros(len(at)), 1.0) if known else None))
        return found

    def best_shapes(self, fit: JointFit, like: Component, count: int) -> list[Component]:
        """Return a component in the tried shapes that gain most at the noise of a fit."""
        found = [(float(gain), component) for components, gains in self.score_test.gains(fit)
                 for component, gain in zip(components, gains, strict=True)
                 if component.effect is like.effect and component.names == like.names]
        found.sort(key=lambda pair: -pair[0])
        return [replace(like, shape=component.shape, is_shared=False)
                for _, component in found[:count]]

    def offers(self, fit: JointFit) -> dict[str, tuple[Component, float]]:
        """Return the best shape and variant of every effect, by name, with its gain at a noise."""
        best: dict[str, tuple[Component, float]] = {}
        for labels, gains in self.score_test.gains(fit):
            for at in np.argsort(-gains):
                name = labels[at].effect.name
                if name not in best or best[name][1] < gains[at]:
                    best[name] = labels[at], float(gains[at])
        return best


class Components:
    """Columns and prior costs of the components of a design.

    Parameters
    ----------
    design : Design
    regression : Regression
        Of its residuals and base columns.
    prior_costs : PriorCosts
    """

    def __init__(self, design: Design, regression: Regression, prior_costs: PriorCosts) -> None:
        self.design, self.regression, self.prior_costs = design, regression, prior_costs
        self._terms: dict[Hashable, Term] = {}
        self._centres: dict[Hashable, tuple[float, ...]] = {}
        self._blocks: dict[Component, Block] = {}
        self._nuisance: dict[Component, Mapping[str, dict[int, Array]]] = {}
        self._prior_costs: dict[Component, CostTerms] = {}
        self.local = {d: DriveComponents(design, regression, d) for d in regression.drives}

    @cached_property
    def structure(self) -> list[Component]:
        """Effects outside the drives, as additions."""
        return [self._placed(term, names) for term in self.design.structure
                for names in term.variants()]

    @cached_property
    def spanning(self) -> list[Component]:
        """Effects on a drive that all drives feel, as additions."""
        design = self.design
        return [placed(design, effect, d, shape, names)
                for effect in searched_in_drives(design) if effect.shifts_positions()
                for d in self.regression.drives if design.acts_on(effect, d)
                for shape in shapes_of(design, effect, d) for names in effect.variants]

    def _placed(self, term: Term, names: tuple[str, ...]) -> Component:
        """Return an effect in the structure, a body where it is most likely to be."""
        found = placed(self.design, term.effect, None, {}, names)
        if found.given or not has_centre(term.effect, names):
            return found
        key = (term.effect, names[0])
        if key not in self._centres:
            self._centres[key] = find_centre(term, names[0], self.design.residuals.error,
                                             self.regression.error_scale, self.design.given)
        return replace(found, centre=self._centres[key])

    def variants(self, component: Component) -> list[Component]:
        """Return a component with each choice of coefficients of its effect that do something."""
        return [self.variant(component, names) for names in self.term(component).variants()]

    def variant(self, component: Component, names: tuple[str, ...]) -> Component:
        """Return a component with other coefficients; a body where it is most likely to be."""
        if component.drive is None:
            return self._placed(self.design.find_term(component.effect, None, {}), names)
        return replace(component, names=names)

    @cached_property
    def score_test(self) -> ScoreTest[Component]:
        """All that more than one drive feels; computed when asked for."""
        shared = [*self.structure, *self.spanning]
        return ScoreTest.of_blocks(self.regression, shared, list(map(self.block, shared)))

    def shared_offers(self, fit: JointFit) -> list[tuple[Component, float]]:
        """Return what more than one drive feels, with its gains at the noise of a fit."""
        if not self.structure and not self.spanning:
            return []
        return [(component, float(gain)) for components, gains in self.score_test.gains(fit)
                for component, gain in zip(components, gains, strict=True)]

    def term(self, component: Component) -> Term:
        """Return the rows in time of a component, of all of its effect's coefficients."""
        if component.course is not None:
            return self.term(replace(component, course=None)).following(
                self._weight(component.course))
        key = (component.effect, component.drive, component.shape, component.centre)
        if key not in self._terms:
            term = self.design.find_term(component.effect, component.drive, component.parameters)
            self._terms[key] = (about_centre(term, component.names[0], component.centre)
                                if component.centre else term)
        return self._terms[key]

    def _weight(self, course: Course) -> Array:
        """Return the present share of an effect with a course, (M,)."""
        residuals = self.design.residuals
        return course.weight(residuals.time, residuals.period)

    def block(self, component: Component) -> Block:
        """Return the columns of a component, transformed, with their prior."""
        if component.is_shared:
            component = replace(component, is_shared=False)
        if component not in self._blocks:
            term = self.term(component)
            block = self.regression.term_block(term, component.names)
            block = replace(block, precision=block.precision + self._expected(component))
            known = self.design.known_change(term)
            if known and not component.names:
                block = replace(self.regression.term_block(replace(term, rows={
                    d: rows + known[d] for d, rows in term.rows.items()}), ()))
            elif known:
                change = self.regression.block(known, CERTAIN * np.eye(1))
                block = Block(
                    {d: np.concatenate([rows, change.rows[d]]) for d, rows in block.rows.items()},
                    block_diag(block.precision, np.array([[CERTAIN]])),
                    np.append(np.zeros(block.size), 1.0))
            self._blocks[component] = block
        return self._blocks[component]

    def _expected(self, component: Component) -> Array:
        """Return the precision of coefficients that are usually small, (k, k)."""
        precision = np.zeros(max(len(component.names), 1))
        given = self.design.given
        known = {c.name: c for c in component.effect.coefficients}
        seen = self._seen(component)
        for k, name in enumerate(component.names):
            expected = known[name].expected
            if expected is not None:
                limit = given.values.get(f'tolerances.{component.effect.name}.{name}')
                # A second encoder sees a joint that is softer than joints usually are.
                usual = max(seen.get(name, 0.0), expected[
                    component.drive is not None and given.units[component.drive].turns])
                precision[k] = (limit / DEVIATIONS if limit else usual) ** -2
        return np.diag(precision)

    @cached_property
    def windups(self) -> dict[int, Windup]:
        """Wind-up of the drives whose second encoder shows that it follows their load."""
        return {d: windup for d, windup in self.design.second_encoders.windups.items()
                if windup.explained > self.prior_costs.decisions.explained}

    def _seen(self, component: Component) -> Mapping[str, float]:
        """Return sizes of coefficients that a further sensor shows, by name."""
        effect, d = component.effect, component.drive
        if d is None or d not in self.windups or not issubclass(effect, MeasurementEffect):
            return {}
        return effect.sizes_seen(self.windups[d])

    def at_edge(self, component: Component, share: float) -> list[str]:
        """Return the shape parameters at the edge of what is tried, `share` of it or nearer."""
        found = []
        for name, value in component.shape:
            tried = self.tried(component, name)
            lowest, highest = tried[0], tried[-1]
            if len(tried) > 2 and not (lowest + share * abs(lowest) < value
                                       < highest - share * abs(highest)):
                found.append(name)
        return found

    def trials(self, component: Component) -> Sequence[Mapping[str, float]]:
        """Return the shapes in which a component is tried."""
        effect, d = component.effect, component.drive
        return (shapes_of(self.design, effect, d)
                if d is not None and issubclass(effect, DriveEffect) else ({},))

    def tried(self, component: Component, name: str) -> list[float]:
        """Return the values of a shape parameter that are tried, in order."""
        return sorted({trial[name] for trial in self.trials(component)})

    def nuisance_rows(self, component: Component) -> Mapping[str, dict[int, Array]]:
        """Return the uncertainty of its form by kind and drive, (k, w, n) for k coefficients.

        How friction without a memory reverses, and how real forms of the effect deviate.
        """
        if component not in self._nuisance:
            term, d = self.term(component), component.drive
            units = np.stack([component.every(unit)
                              for unit in np.eye(max(len(component.names), 1))])
            kinds = {REVERSAL: joint_reversal_rows(self.design, term, component.names)} if (
                d is None) else {
                    REVERSAL: {d: reversal_rows(self.design, term, units)},
                    FORM: {d: deviation_rows(self.design, term, units)},
                    WAVES: {d: form_rows(self.design, term, units,
                                         self.prior_costs.decisions.form_share)}}
            weight = 1.0 if component.course is None else self._weight(component.course)
            self._nuisance[component] = {kind: transformed for kind, rows in kinds.items() if (
                transformed := {
                    d: self.regression.series[d].transform(values * weight)
                    for d, values in rows.items()
                    if np.any(values) and d in self.regression.series})}
        return self._nuisance[component]

    def prior_cost(self, candidate: Candidate) -> CostTerms:
        """Return the prior cost of everything that was chosen."""
        return self.prior_costs.of_candidate(candidate, self.component_prior_cost)

    def component_prior_cost(self, component: Component) -> CostTerms:
        """Return the prior cost of a component without that of its hypotheses and drives.

        That an effect is usually small makes large values unlikely, and small ones no likelier:
        it costs by how much that narrows the prior, and the odds that it is otherwise at all, which
        a further sensor settles.
        """
        if component not in self._prior_costs:
            usual, narrowed, odds = self._expected(component), 0.0, 0.0
            if np.any(usual):
                decisions, both = self.prior_costs.decisions, self.block(component).precision
                both = both[:len(usual), :len(usual)]
                narrowed = float(np.linalg.slogdet(both)[1] - np.linalg.slogdet(both - usual)[1])
                if component.drive is not None and not self._seen(component):
                    odds = -2 * float(np.log(
                        decisions.zero_odds if component.effect.shifts_positions()
                        else decisions.gain_odds))
            self._prior_costs[component] = CostTerms(
                coefficients=narrowed, names=odds, shapes=self.prior_costs.of_component(
                    component.effect, len(self.trials(component))))
        return self._prior_costs[component]

    def force(self, fitted: CandidateSet, candidate: Candidate, shape: tuple[int, ...]) -> Array:
        """Return the force of a candidate of a set, (M, D) [N]."""
        force = np.zeros(shape)
        if isinstance(candidate, UnknownCandidate):
            force[:, candidate.drive] = fitted.fit.of(candidate.block) @ candidate.rows
            return force
        for component in candidate.components:
            c = component.every(fitted.coefficients(component))
            term = self.term(component)
            for d, rows in term.rows.items():
                force[:, d] += c @ rows
            for d, row in self.design.known_change(term).items():
                force[:, d] += row
        return force
