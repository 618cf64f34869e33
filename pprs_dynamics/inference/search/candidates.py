# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What may be missing: effects on drives, in the structure, and their prices."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import comb, inf, log
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.regression.terms import Term
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.patterns import Family, Pattern
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.effect import CatalogueEffect


@dataclass(frozen=True, eq=False)
class Placement:
    """A term of an effect with the coefficients of it that are fitted.

    Parameters
    ----------
    term : Term
    names : tuple of str
        Coefficients; none where the shape says it all.
    block : Block
    price : float
        Of the choice among its variants and shapes.
    bare : mapping of drive to (k, n) array, optional
        Change of the block's rows if friction did not follow the effect's loads.
    """

    term: Term
    names: tuple[str, ...]
    block: Block
    price: float
    bare: Mapping[int, Array] | None = None

    @property
    def drive(self) -> int | None:
        """On which it sits."""
        return self.term.drive

    @cached_property
    def key(self) -> Hashable:
        """What makes it differ from others of the same effect."""
        return (self.drive, self.names, tuple(sorted(self.term.shape.items())))

    @property
    def rows(self) -> dict[int, Array]:
        """Rows in time of the coefficients that are fitted, (k, M) by drive [N]."""
        if not self.names:
            return dict(self.term.rows)
        every = list(self.term.names)
        chosen = [every.index(name) for name in self.names]
        return {d: rows[chosen] for d, rows in self.term.rows.items()}

    def force(self, coefficients: Array) -> dict[int, Array]:
        """Return what it contributes to each drive, (M,) [N]."""
        return {d: coefficients @ rows for d, rows in self.rows.items()}

    def values(self, coefficients: Array) -> dict[str, float]:
        """Return all linear parameters of the effect."""
        effect = self.term.effect
        every = {c.name: 0.0 for c in effect.coefficients}
        every.update(zip(self.names, (float(c) for c in coefficients), strict=False))
        return {name: float(value) for name, value in effect.from_coefficients(every).items()}


@dataclass(frozen=True)
class EffectCandidate:
    """An effect on some drives, or in the structure.

    Parameters
    ----------
    effect : type of CatalogueEffect
    placements : tuple of Placement
        One for each drive, ascending, or one.
    price : float
        Of its hypotheses and its drives.
    hypotheses : frozenset
        That it claims, each priced as a name.
    """

    effect: type[CatalogueEffect]
    placements: tuple[Placement, ...]
    price: float
    hypotheses: frozenset[Hashable]

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.effect.name

    @property
    def rank(self) -> tuple[Any, ...]:
        """Place in a set: that of the catalogue, before patterns of no catalogue."""
        return (0, list(catalogue()).index(self.name), self.drives or ())

    @property
    def drives(self) -> tuple[int, ...] | None:
        """Drives on which it sits; None for the structure."""
        drives = [placement.drive for placement in self.placements]
        return None if drives[0] is None else tuple(d for d in drives if d is not None)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Of its placements."""
        return tuple(placement.block for placement in self.placements)

    @property
    def total_price(self) -> float:
        """Of everything that was chosen."""
        return self.price + sum(placement.price for placement in self.placements)

    @cached_property
    def key(self) -> Hashable:
        """What makes it differ from other candidates."""
        return (self.name, tuple(placement.key for placement in self.placements))


@dataclass(frozen=True, eq=False)
class UnknownCandidate:
    """A pattern of the error that belongs to no effect of the catalogue.

    Along a variable that all drives share it may be on several drives, with a size on each.

    Parameters
    ----------
    family : Family
    pattern : Pattern
    rows : mapping of drive to (1 or 2, M) array
        In time [1].
    parts : mapping of drive to Block
    price : float
    """

    family: Family
    pattern: Pattern
    rows: Mapping[int, Array] = field(repr=False)
    parts: Mapping[int, Block] = field(repr=False)
    price: float

    @property
    def name(self) -> str:
        """What stands for it among the names of effects."""
        return f'unknown, {self.family.variable}'

    @property
    def rank(self) -> tuple[Any, ...]:
        """Place in a set."""
        return (1, self.family.variable, self.drives, repr(self.pattern))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """One for each drive."""
        return tuple(self.parts.values())

    @property
    def drives(self) -> tuple[int, ...]:
        """On which it is."""
        return tuple(self.parts)

    @property
    def total_price(self) -> float:
        """Of everything that was chosen."""
        return self.price

    @cached_property
    def key(self) -> Hashable:
        """What makes it differ from other candidates."""
        return (self.drives, self.family.variable, self.pattern)


Candidate = EffectCandidate | UnknownCandidate


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """A set of candidates, fitted.

    Parameters
    ----------
    candidates : tuple of Candidate
    fit : JointFit
    total : float
        Penalised deviance with all prices.
    doubtful : mapping of Placement to tuple of Block
        Columns for what the placements leave open, fitted with them.
    is_admissible : bool
        False where a pattern may be the lack of fit of the effects beside it.
    """

    candidates: tuple[Candidate, ...]
    fit: JointFit
    total: float
    doubtful: Mapping[Placement, tuple[Block, ...]] = field(default_factory=dict, repr=False)
    is_admissible: bool = True

    @property
    def cost(self) -> float:
        """What the search makes as low as possible: infinite for a set that may not be."""
        return self.total if self.is_admissible else inf

    @cached_property
    def key(self) -> Hashable:
        """The same for sets of the same candidates."""
        return set_key(self.candidates)

    @property
    def effects(self) -> tuple[EffectCandidate, ...]:
        """Those of the catalogue."""
        return tuple(c for c in self.candidates if isinstance(c, EffectCandidate))

    @property
    def unknowns(self) -> tuple[UnknownCandidate, ...]:
        """Those of no catalogue."""
        return tuple(c for c in self.candidates if isinstance(c, UnknownCandidate))

    def coefficients(self, placement: Placement) -> Array:
        """Return the coefficients of a placement."""
        return self.fit.of(placement.block)

    def force(self, candidate: Candidate, shape: tuple[int, ...]) -> Array:
        """Return what a candidate contributes, in the shape (M, D) [N]."""
        force = np.zeros(shape)
        if isinstance(candidate, UnknownCandidate):
            for d, block in candidate.parts.items():
                force[:, d] = self.fit.of(block) @ candidate.rows[d]
            return force
        for placement in candidate.placements:
            for d, values in placement.force(self.coefficients(placement)).items():
                force[:, d] += values
        return force


def bends(candidate: Candidate) -> bool:
    """Return whether a candidate changes how others show."""
    return isinstance(candidate, EffectCandidate) and candidate.effect.bends_columns


def set_key(candidates: tuple[Candidate, ...]) -> Hashable:
    """Return the same for sets of the same candidates."""
    return frozenset(candidate.key for candidate in candidates)


@dataclass(frozen=True)
class Prices:
    """Twice the logarithms of prior odds, for everything that is chosen.

    Parameters
    ----------
    names : int
        Effects in the catalogue.
    drives : int
    samples : int
        Of a drive.
    decisions : Decisions
    """

    names: int
    drives: int
    samples: int
    decisions: Decisions

    @classmethod
    def of(cls, regression: Regression, decisions: Decisions) -> Prices:
        """Return the prices for the drives and samples of a regression."""
        return cls(len(catalogue()), len(regression.drives), regression.samples, decisions)

    def of_name(self) -> float:
        """Return the price of one more effect, whichever."""
        return 2 * log(self.names) - 2 * log(self.decisions.effect_odds)

    def of_drives(self, count: int) -> float:
        """Return the price of a choice of drives: how many, and which."""
        return 2 * log(self.drives) + 2 * log(comb(self.drives, count))

    def of_placement(self, effect: type[CatalogueEffect], tried: int) -> float:
        """Return the price of a variant and of a shape among those tried.

        A shape is worth at least what a coefficient of weak prior is.
        """
        price = 2 * log(len(effect.variants))
        if effect.shape:
            price += max(len(effect.shape) * log(self.samples), 2 * log(max(tried, 1)))
        return price

    def of_width(self, tried: int) -> float:
        """Return the price of a width of reversal that is another than the model's, on a drive."""
        return (2 * log(self.drives) - 2 * log(self.decisions.effect_odds)
                + max(log(self.samples), 2 * log(tried)))

    def of_pattern(self, families: int, patterns: int, drives: int) -> float:
        """Return the price of an unknown pattern among those tried on each drive."""
        return (self.of_name() + self.of_drives(drives) + 2 * log(families) + 2 * log(patterns)
                - 2 * log(self.decisions.unknown_odds))

    def of_signs(self, effect: type[CatalogueEffect], values: Mapping[str, Any]) -> float:
        """Return the price of parameters that are unphysical by their sign."""
        wrong = any(values.get(name, bound) < bound
                    for name, bound in effect.unphysical_below.items())
        return -2 * log(self.decisions.wrong_sign_odds) if wrong else 0.0
