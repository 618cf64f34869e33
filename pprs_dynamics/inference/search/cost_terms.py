# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What the cost of a set is made of, so that a difference of two can be told."""

from __future__ import annotations

from dataclasses import dataclass
from operator import add, sub


@dataclass(frozen=True)
class CostTerms:
    """Terms of a cost, each -2 ln of a probability but for a constant; they add up to it.

    Parameters
    ----------
    fit : float
        What is left in units of its noise, and ln of the noise.
    coefficients : float
        The prior of the coefficients: how far they are from its mean, and how much narrower than
        it they are known.
    names : float
        Of what is claimed, with the odds of one more effect, of a zero, a gain or a pattern.
    drives : float
        How many, and which.
    shapes : float
        Variants and shapes, among those tried.
    signs : float
        Less than nothing for physical ones.
    feasibility : float
        By how much possible bodies, and friction and inertia that are not negative, fit worse
        than those of the least squares.
    linearisation : float
        By how much the exact forces of its own fitted model fit worse than the linear ones; 0
        where that was not computed.
    """

    fit: float = 0.0
    coefficients: float = 0.0
    names: float = 0.0
    drives: float = 0.0
    shapes: float = 0.0
    signs: float = 0.0
    feasibility: float = 0.0
    linearisation: float = 0.0

    @property
    def total(self) -> float:
        """The cost."""
        return float(sum(vars(self).values()))

    def __add__(self, other: CostTerms) -> CostTerms:
        return CostTerms(*map(add, vars(self).values(), vars(other).values()))

    def __sub__(self, other: CostTerms) -> CostTerms:
        return CostTerms(*map(sub, vars(self).values(), vars(other).values()))

    def to_dict(self) -> dict[str, float]:
        """Return the terms by name."""
        return dict(vars(self))
