# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Prior costs are -2 ln of prior probabilities: they add up to one over what a robot can have."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics.inference.search.candidates import (
    COURSE_TIMES,
    DRIFT,
    DURING,
    SINCE,
    Component,
    Course,
    PriorCosts,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect

COSTS = PriorCosts(25, 6, 4000, DECISIONS)
SIGNED = [effect for effect in CATALOGUE.values() if effect.unphysical_below]


def test_the_penalty_of_a_sign_is_the_integral_over_its_prior() -> None:
    """By quadrature: prior density 2 (1 - e) of a wide Gaussian on one side, 2 e on the other."""
    e, std = DECISIONS.wrong_sign_odds, 0.7
    points = np.linspace(-40, 40, 800001)
    for deviations in (-4.0, -1.0, -0.001, 0.0, 0.001, 1.0, 4.0):
        posterior = np.exp(-(points / std - deviations) ** 2 / 2) / (std * np.sqrt(2 * np.pi))
        factor = np.where(points > 0, 2 * (1 - e), np.where(points < 0, 2 * e, 1.0))
        integral = np.trapezoid(posterior * factor, points)
        assert COSTS.of_sign(deviations) == pytest.approx(-2 * np.log(integral), abs=1e-6)


def test_the_penalty_of_a_sign_has_no_step() -> None:
    steps = np.diff([COSTS.of_sign(z) for z in np.linspace(-6, 6, 1201)])
    assert np.all(steps < 0)
    assert np.all(steps > -0.05)


def test_only_a_wrong_sign_in_doubt_is_cheap() -> None:
    """Far on one side the penalty is that of the prior probability of that side."""
    odds = [np.exp(-COSTS.of_sign(z) / 2) / 2 for z in (40.0, -40.0)]
    assert odds[1] == pytest.approx(DECISIONS.wrong_sign_odds)
    assert sum(odds) == pytest.approx(1.0)


@pytest.mark.parametrize('effect', SIGNED, ids=lambda one: one.name)
def test_signed_parameters_are_coefficients(effect: type[CatalogueEffect]) -> None:
    names = tuple(c.name for c in effect.coefficients)
    component = Component(effect, 0 if issubclass(effect, DriveEffect) else None, names)
    assert set(component.signed) == set(effect.unphysical_below)


@pytest.mark.parametrize(('kind', 'count'), [
    (SINCE, COURSE_TIMES), (DURING, COURSE_TIMES ** 2), (DRIFT, 1)])
def test_all_changes_of_a_kind_share_the_odds_of_a_change(kind: str, count: int) -> None:
    cost = COSTS.of_course(Course(kind, 1.0, 2.0))
    assert count * np.exp(-cost / 2) == pytest.approx(DECISIONS.onset_odds)


def test_asymmetric_friction_claims_dry_and_viscous_friction_apart() -> None:
    effect = CATALOGUE['asymmetric_friction']
    dry, viscous = (effect.hypotheses((name,)) for name in ('force_forward', 'viscous_backward'))
    assert len(dry) == len(viscous) == 1
    assert effect.hypotheses(('force_forward', 'force_backward')) == dry
    assert effect.hypotheses(('force_backward', 'viscous_forward')) == dry | viscous
    # What claims one thing only claims as many as it has sets of coefficients.
    spring = CATALOGUE['hysteresis']
    assert len(spring.hypotheses(('force',)) | spring.hypotheses(('coefficient',))) == 2
