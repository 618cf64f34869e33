# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""All terms that the catalogue offers for a design, and what each would gain beside a fit."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.effects.drive_effect import DriveEffect, MeasurementEffect
from pprs_dynamics.effects.effect import CatalogueEffect
from pprs_dynamics.regression.design import Design, searched_in_drives
from pprs_dynamics.regression.joint_fit import JointFit, Regression
from pprs_dynamics.regression.normal_equations import Block, term_gains
from pprs_dynamics.regression.open_form import open_rows
from pprs_dynamics.regression.terms import Term
from pprs_dynamics.selection.candidates import Candidate, EffectCandidate, Placement, Prices


@dataclass(frozen=True)
class ScannedTerm:
    """A term and variant that a scan proposes.

    Parameters
    ----------
    term : Term
    names : tuple of str
    gain : float
        By which the deviance falls at the noise of the fit.
    """

    term: Term
    names: tuple[str, ...]
    gain: float


@dataclass(frozen=True)
class _Group:
    """Terms on one drive with equally many rows in the scan.

    Parameters
    ----------
    terms : list of n (Term, names)
    rows : (n, k) int array
        Places in the drive's rows.
    gram : (n, k, k, B) array
        Band sums.
    precision : (n, k, k) array
    is_fixed : bool
    """

    terms: list[tuple[Term, tuple[str, ...]]]
    rows: np.typing.NDArray[np.int_]
    gram: Array
    precision: Array
    is_fixed: bool


class DriveLibrary:
    """Terms on one drive alone, in every shape tried.

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
        self.effects = [effect for effect in searched_in_drives(design)
                        if design.acts_on(effect, d) and not _is_felt_everywhere(effect)]
        self.trials = {effect.name: len(effect.trials(design.covered[d]))
                       for effect in self.effects}
        self._crosses: dict[Block, Array] = {}

    @cached_property
    def terms(self) -> list[Term]:
        """Every effect in every shape tried; computed when a scan asks for them."""
        covered = self.design.covered[self.d]
        return [term for effect in self.effects for term in self.design.trial_terms(
            effect, self.d, effect.trials(covered))]

    @cached_property
    def rows(self) -> Array:
        """All rows, transformed, in single precision, (R, n)."""
        stacked = np.concatenate([term.rows[self.d][:, self.series.index] for term in self.terms])
        return self.series.transform(stacked.astype(np.float32))

    @cached_property
    def groups(self) -> list[_Group]:
        """Terms in all variants that the rows of a scan suffice for."""
        found: dict[tuple[int, bool], list[tuple[Term, tuple[str, ...], list[int]]]] = {}
        first = 0
        for term in self.terms:
            count = len(term.rows[self.d])
            if term.is_fixed:
                found.setdefault((1, True), []).append((term, (), [first]))
            else:
                for names in term.effect.variants:
                    if set(names) <= set(term.effect.scanned):
                        places = [first + term.names.index(name) for name in names]
                        found.setdefault((len(places), False), []).append((term, names, places))
            first += count
        scale = len(self.series) * max(self.regression.error_scale[self.d], 1e-12) ** 2
        groups = []
        for (size, is_fixed), listed in found.items():
            rows = np.array([places for _, _, places in listed])
            gram = np.empty((len(listed), size, size, len(self.series.bands)))
            for i in range(size):
                for j in range(i, size):
                    gram[:, i, j] = gram[:, j, i] = self.series.sums(
                        self.rows[rows[:, i]] * self.rows[rows[:, j]])
            precision = gram.sum(axis=-1) / scale
            trace = np.einsum('nkk->n', precision)[:, None, None] / size
            precision += (1e-9 * trace + 1e-300) * np.eye(size)
            groups.append(_Group([(term, names) for term, names, _ in listed], rows, gram,
                                 precision, is_fixed))
        return groups

    def _cross(self, block: Block | None) -> Array:
        """Return band sums of all rows with a block's, or with base and error, (B, R, k)."""
        key = block or _BASE
        if key not in self._crosses:
            if len(self._crosses) > 60:
                self._crosses = {_BASE: self._crosses[_BASE]}
            other = self.regression.base[self.d] if block is None else block.rows[self.d]
            self._crosses[key] = self.series.products(
                self.rows, other.astype(np.float32)).astype(np.float32)
        return self._crosses[key]

    def offers(self, fit: JointFit) -> dict[str, ScannedTerm]:
        """Return the best shape and variant of every effect, by name, at the noise of a fit."""
        if not self.terms:
            return {}
        weights = self.regression.weights(fit, self.d)
        index, felt = self.regression.local(fit, self.d)
        narrow = weights.astype(np.float32)

        def weighted(block: Block | None) -> Array:
            cross = self._cross(block)
            return (narrow @ cross.reshape(len(narrow), -1)).reshape(cross.shape[1:]).astype(float)

        with_base = weighted(None)
        known = np.concatenate([with_base[:, :-1], *(weighted(block) for block in felt)], axis=1)
        side = with_base[:, -1] - known @ fit.coefficients[index]
        for block in fit.blocks:
            if block.is_fixed and self.d in block.rows:
                side -= weighted(block)[:, 0]
        spread = known @ fit.covariance[np.ix_(index, index)]
        best: dict[str, ScannedTerm] = {}
        for group in self.groups:
            S = group.gram @ weights - spread[group.rows] @ known[group.rows].transpose(0, 2, 1)
            gains = term_gains(S, side[group.rows], group.precision, group.is_fixed)
            for at in np.argsort(-gains):
                term, names = group.terms[at]
                name = term.effect.name
                if name not in best or best[name].gain < gains[at]:
                    best[name] = ScannedTerm(term, names, float(gains[at]))
        return best


_BASE = Block({}, np.zeros((0, 0)))


class Library:
    """All candidates of a design.

    Parameters
    ----------
    design : Design
    regression : Regression
        Of its residuals and base columns.
    prices : Prices
    """

    def __init__(self, design: Design, regression: Regression, prices: Prices) -> None:
        self.design, self.regression, self.prices = design, regression, prices
        self._placements: dict[Hashable, Placement] = {}
        self._open: dict[Placement, Array | None] = {}
        self.local = {d: DriveLibrary(design, regression, d) for d in regression.drives}
        felt = [effect for effect in searched_in_drives(design) if _is_felt_everywhere(effect)]
        self.spanning = [self.placement(design.term(effect, d, {}), names)
                         for effect in felt for d in regression.drives
                         if design.acts_on(effect, d) for names in effect.variants]
        self.structure = [self.placement(term, names) for term in design.structure
                          for names in term.effect.variants
                          if any(np.any(rows[[term.names.index(name) for name in names]])
                                 for rows in term.rows.values())]

    def placement(self, term: Term, names: tuple[str, ...]) -> Placement:
        """Return a term with the coefficients that are to be fitted."""
        key = (term.effect, term.drive, names, tuple(sorted(term.shape.items())))
        if key not in self._placements:
            self._placements[key] = self._placed(term, names)
        return self._placements[key]

    def placed(self, effect: type[CatalogueEffect], drive: int | None, shape: Mapping[str, float],
               names: tuple[str, ...]) -> Placement:
        """Return an effect on a drive or in the structure, of one shape."""
        key = (effect, drive, names, tuple(sorted(shape.items())))
        found = self._placements.get(key)
        return found or self.placement(
            self.design.find_term(effect, drive, shape), names)

    def open_rows(self, placement: Placement) -> Array | None:
        """Return what its form leaves open, by its coefficients, (k, w, n); None for nothing.

        How friction turns over where it knows no past, and the effect's own deviations.
        """
        if placement not in self._open:
            self._open[placement] = self._open_rows(placement)
        return self._open[placement]

    def _open_rows(self, placement: Placement) -> Array | None:
        design, term, d = self.design, placement.term, placement.drive
        if d is None or term.is_fixed:
            return None
        units = np.eye(len(term.names))[[term.names.index(name) for name in placement.names]]
        rows = np.stack([open_rows(design, term, unit) for unit in units])
        return self.regression.series[d].transform(rows) if np.any(rows) else None

    def _placed(self, term: Term, names: tuple[str, ...]) -> Placement:
        regression = self.regression
        chosen = [0] if term.is_fixed else [term.names.index(name) for name in names]
        rows = {d: values[chosen] for d, values in term.rows.items()}
        block = regression.block(rows, term.is_fixed,
                                 np.zeros((0, 0)) if term.is_fixed else None)
        bare = None
        if term.bare is not None:
            bare = {d: regression.series[d].transform(values[chosen] - rows[d])
                    for d, values in term.bare.items() if d in regression.series}
        tried = (self.local[term.drive].trials.get(term.effect.name, 1)
                 if term.drive is not None else 1)
        return Placement(term, () if term.is_fixed else names, block,
                         self.prices.of_placement(term.effect, tried), bare)

    def full(self, offer: ScannedTerm) -> Placement:
        """Return the placement of an offer, with the rows of the exact term."""
        term = offer.term
        return self.placed(term.effect, term.drive, term.shape, offer.names)

    def candidate(self, effect: type[CatalogueEffect],
                  placements: Sequence[Placement]) -> EffectCandidate:
        """Return an effect with the price of its name and drives.

        With other coefficients on other drives it is more than one hypothesis: asymmetric
        friction that is dry on one drive and viscous on another is two.
        """
        ordered = tuple(sorted(placements, key=lambda one: -1 if one.drive is None else one.drive))
        price = len({one.names for one in ordered}) * self.prices.of_name()
        if ordered[0].drive is not None:
            price += self.prices.of_drives(len(ordered))
        return EffectCandidate(effect, ordered, price)

    def rebuilt(self, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Return the candidates of another library with the columns of this one."""
        return tuple(self.candidate(one.effect, [
            self.placed(one.effect, placement.drive, placement.term.shape, placement.names)
            for placement in one.placements]) if isinstance(one, EffectCandidate) else one
            for one in candidates)



def _is_felt_everywhere(effect: type[DriveEffect]) -> bool:
    return issubclass(effect, MeasurementEffect) and effect.shifts_positions()
