# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""This package without one of its parts each: what every part is worth.

Nothing of the package knows of this: a part is replaced by a plainer one for the time of a call.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from math import log
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.naming.entrants.pprs import pprs
from benchmarks.naming.problems import Answer, Problem
from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.residuals.noise import NoiseShapes
from pprs_dynamics.inference.search import fitted_sets, search
from pprs_dynamics.inference.search.candidates import (
    DURING,
    SINCE,
    CandidateSet,
    CostTerms,
    Course,
    PriorCosts,
)
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.table import Row
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel

COLOURED = 1e-9  # share of the noise's power that is left to each of its slower shapes


def _without(problem: Problem, *parts: tuple[Any, str, Any]) -> Answer:
    with ExitStack() as stack:
        for owner, name, instead in parts:
            stack.enter_context(patch.object(owner, name, instead))
        return pprs(problem)


def white_noise(problem: Problem) -> Answer:
    """Return the diagnosis by a spectrum that is the same at all frequencies."""
    def fitted(self: NoiseShapes, amplitudes: Array, squares: Array, counts: Array,
               leverage: Array, steps: int = 0) -> Array:
        free = np.maximum(counts - leverage, 0.02 * counts)[:, 1:].sum(axis=1)
        found = np.full(amplitudes.shape, COLOURED)
        found[:, 0] = 1.0
        return np.asarray(found * (squares[:, 1:].sum(axis=1) / free)[:, None])
    return _without(problem, (NoiseShapes, 'fitted', fitted))


class BayesianInformation(PriorCosts):
    """Half of ln n for each number that is fitted, and nothing for what is chosen."""

    @classmethod
    def of(cls, regression: Regression, decisions: Decisions,
           model: DriveModel | None = None) -> BayesianInformation:
        """Return them for the drives and samples of a regression."""
        even = replace(decisions, zero_odds=1.0, gain_odds=1.0)
        return cls(0, len(regression.drives), regression.samples, even)

    def of_name(self) -> float:
        """Return 0: all effects are alike, and a second as likely as the first."""
        return 0.0

    def of_drives(self, count: int) -> float:
        """Return 0: any choice of drives."""
        return 0.0

    def of_component(self, effect: type[CatalogueEffect], tried: int) -> float:
        """Return ln n for each number of a shape; coefficients have theirs elsewhere."""
        return len(effect.shape) * log(self.samples)

    def of_course(self, course: Course) -> float:
        """Return ln n for each time of a change."""
        return {SINCE: 1, DURING: 2}.get(course.kind, 0) * log(self.samples)

    def of_pattern(self, families: int, patterns: int) -> CostTerms:
        """Return 0: patterns are effects like others."""
        return CostTerms()

    def of_sign(self, deviations: float) -> float:
        """Return 0."""
        return 0.0


def without_prices(problem: Problem) -> Answer:
    """Return the diagnosis by fit and ln n alone."""
    return _without(problem, (fitted_sets, 'PriorCosts', BayesianInformation))


def greedy(problem: Problem) -> Answer:
    """Return the diagnosis with effects added and dropped one by one, and none exchanged."""
    return _without(problem, (search.Search, '_replacements', lambda self, best: ()),
                    (search, 'BEAM', 1))


def given_model(problem: Problem) -> Answer:
    """Return the diagnosis by columns around the given model alone, never around a fitted one."""
    def linear(cls: type[Row], fits: FittedSets, fitted: CandidateSet) -> Row:
        return cls(fits, fitted, 0.0)  # as if exact forces were those of the columns
    return _without(problem, (Row, 'exact', classmethod(linear)))
