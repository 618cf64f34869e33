# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""All terms that the catalogue offers for a design, and what each would gain beside a fit."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design, searched_in_drives
from pprs_dynamics.inference.regression.joint_fit import CERTAIN, JointFit, Regression
from pprs_dynamics.inference.regression.open_form import open_rows
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.search.candidates import Candidate, EffectCandidate, Placement, Prices
from pprs_dynamics.inference.search.scan import Entry, Scan
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect


class Trial(NamedTuple):
    """An effect on a drive in one of the shapes tried, with some of its coefficients."""

    effect: type[DriveEffect]
    shape: Mapping[str, float]
    names: tuple[str, ...]


@dataclass(frozen=True)
class ScannedTrial:
    """A trial that a scan proposes.

    Parameters
    ----------
    trial : Trial
    gain : float
        By which the deviance falls at the noise of the fit.
    """

    trial: Trial
    gain: float


class DriveLibrary:
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
        self.effects = [effect for effect in searched_in_drives(design)
                        if design.acts_on(effect, d) and not _is_felt_everywhere(effect)]
        self.trials = {effect.name: len(effect.trials(design.covered[d]))
                       for effect in self.effects}

    @cached_property
    def scan(self) -> Scan[Trial]:
        """All shapes in all variants that the rows of a scan suffice for; computed when asked for.
        """
        entries: list[Entry[Trial]] = []
        parts: list[Array] = [np.zeros((0, len(self.series)), dtype=np.float32)]
        first = 0
        for effect in self.effects:
            terms = self.design.trial_terms(effect, self.d,
                                            effect.trials(self.design.covered[self.d]))
            for term in terms:
                if not term.names:
                    entries.append(Entry(Trial(effect, term.shape, ()), (first,),
                                         CERTAIN * np.eye(1), np.ones(1)))
                entries += [Entry(Trial(effect, term.shape, names),
                                  tuple(first + term.names.index(name) for name in names))
                            for names in effect.variants
                            if names and set(names) <= set(effect.scanned)]
                first += len(term.rows[self.d])
            # In single precision and in frequency alone: there are hundreds of them.
            rows = np.concatenate([term.rows[self.d][:, self.series.index] for term in terms])
            parts.append(self.series.transform(rows.astype(np.float32)))
        return Scan(self.regression, {self.d: np.concatenate(parts)}, entries)

    def offers(self, fit: JointFit) -> dict[str, ScannedTrial]:
        """Return the best shape and variant of every effect, by name, at the noise of a fit."""
        best: dict[str, ScannedTrial] = {}
        for labels, gains in self.scan.gains(fit):
            for at in np.argsort(-gains):
                name = labels[at].effect.name
                if name not in best or best[name].gain < gains[at]:
                    best[name] = ScannedTrial(labels[at], float(gains[at]))
        return best


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

    @cached_property
    def _scan(self) -> Scan[Placement]:
        """Of all that more than one drive feels."""
        placements = [*self.structure, *self.spanning]
        series = self.regression.series
        entries, parts, first = [], [], 0
        for one in placements:
            rows = one.block.rows
            size = max((len(values) for values in rows.values()), default=0)
            entries.append(Entry(one, tuple(range(first, first + size)), one.block.precision,
                                 one.block.mean))
            parts.append({d: rows[d] if d in rows else np.zeros((size, len(series[d])))
                          for d in series})
            first += size
        return Scan(self.regression, {
            d: np.concatenate([part[d] for part in parts]).astype(np.float32) for d in series},
            entries)

    def shared_offers(self, fit: JointFit) -> list[tuple[Placement, float]]:
        """Return what more than one drive feels, with its gains at the noise of a fit."""
        if not self.structure and not self.spanning:
            return []
        return [(one, float(gain)) for placements, gains in self._scan.gains(fit)
                for one, gain in zip(placements, gains, strict=True)]

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
        if d is None or not term.names:
            return None
        units = np.eye(len(term.names))[[term.names.index(name) for name in placement.names]]
        rows = np.stack([open_rows(design, term, unit) for unit in units])
        return self.regression.series[d].transform(rows) if np.any(rows) else None

    def _placed(self, term: Term, names: tuple[str, ...]) -> Placement:
        regression = self.regression
        bare = None
        if term.bare is not None:
            chosen = [term.names.index(name) for name in names]
            bare = {d: regression.series[d].transform((values - term.rows[d])[chosen])
                    for d, values in term.bare.items() if d in regression.series}
        tried = (self.local[term.drive].trials.get(term.effect.name, 1)
                 if term.drive is not None else 1)
        return Placement(term, names if term.names else (), regression.term_block(term, names),
                         self.prices.of_placement(term.effect, tried), bare)

    def full(self, offer: ScannedTrial, d: int) -> Placement:
        """Return the placement of an offer on a drive, with the rows of the exact term."""
        return self.placed(offer.trial.effect, d, offer.trial.shape, offer.trial.names)

    def release(self) -> None:
        """Let go of what scans need; it is computed again if it is asked for."""
        vars(self).pop('_scan', None)
        for local in self.local.values():
            vars(local).pop('scan', None)

    def candidate(self, effect: type[CatalogueEffect],
                  placements: Sequence[Placement]) -> EffectCandidate:
        """Return an effect with the price of its name and drives.

        With other coefficients, on other drives or on one, it may be more than one hypothesis:
        asymmetric friction that is dry and viscous is two.
        """
        ordered = tuple(sorted(placements, key=lambda one: -1 if one.drive is None else one.drive))
        hypotheses = frozenset[Hashable]().union(*(effect.hypotheses(one.names)
                                                   for one in ordered))
        price = len(hypotheses) * self.prices.of_name()
        if ordered[0].drive is not None:
            price += self.prices.of_drives(len(ordered))
        return EffectCandidate(effect, ordered, price, hypotheses)

    def rebuilt(self, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Return the candidates of another library with the columns of this one."""
        return tuple(self.candidate(one.effect, [
            self.placed(one.effect, placement.drive, placement.term.shape, placement.names)
            for placement in one.placements]) if isinstance(one, EffectCandidate) else one
            for one in candidates)



def _is_felt_everywhere(effect: type[DriveEffect]) -> bool:
    return issubclass(effect, MeasurementEffect) and effect.shifts_positions()
