# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Coefficients of a fit satisfy all constraints at once, at the least rise of the cost."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_arm import real_arm

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.constrained import (
    Inequalities,
    conditioned,
    constrained,
    nearest,
)
from pprs_dynamics.inference.search.body_centres import REACH
from pprs_dynamics.inference.search.candidates import Component
from pprs_dynamics.inference.search.constraints import DOUBTED, body_planes
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.description import pseudo_inertia
from pprs_dynamics.physics.mechanism.mechanism import Mechanism

SPREAD = np.array([0.05, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02])


def covariance_of(random: np.random.Generator, size: int) -> Array:
    root = random.normal(size=(size, size)) * 10.0 ** random.uniform(-2, 2, (size, 1))
    found: Array = root @ root.T + 1e-9 * np.diag(np.diag(root @ root.T))
    return found


@pytest.mark.parametrize('seed', range(5))
def test_a_constrained_mode_satisfies_the_conditions_of_karush_kuhn_and_tucker(seed: int) -> None:
    random = np.random.default_rng(seed)
    size, count = int(random.integers(2, 8)), int(random.integers(1, 12))
    mean, covariance = random.normal(size=size), covariance_of(random, size)
    A = random.normal(size=(count, size))
    b = A @ random.normal(size=size) - random.uniform(0, 1, count)  # a point satisfies them
    found = constrained(mean, covariance, Inequalities(A, b))
    assert found is not None
    c = found.coefficients
    size_of_rows = np.sqrt(np.einsum('ij,jk,ik->i', A, covariance, A))
    assert np.all((A @ c - b) / size_of_rows > -1e-7)
    # Stationary: the gradient is a sum of active rows with multipliers that are not negative.
    away = c - mean
    active = np.abs(A @ c - b) < 1e-6 * size_of_rows
    side = A[active] @ away
    multipliers = np.linalg.lstsq(A[active] @ covariance @ A[active].T, side, rcond=None)[0]
    np.testing.assert_allclose(covariance @ A[active].T @ multipliers, away,
                               atol=1e-6 * np.sqrt(np.diag(covariance)).max())
    assert np.all(multipliers * size_of_rows[active] > -1e-5)
    assert found.rise == pytest.approx(side @ multipliers, rel=1e-5, abs=1e-6)


def test_inequalities_that_contradict_each_other_have_no_solution() -> None:
    both = Inequalities(np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 0.0]))
    assert constrained(np.zeros(2), np.eye(2), both) is None


def test_a_convex_set_is_reached_by_its_tangent_planes() -> None:
    """The unit ball: the nearest point to a mean is the mean over its norm."""
    def planes(c: Array) -> Inequalities:
        size = float(np.linalg.norm(c))
        return Inequalities(-c[None] / size, np.array([-1.0])) if size > 1 + 1e-9 else (
            Inequalities.none(len(c)))

    mean = np.array([3.0, -2.0, 0.5])
    found = nearest(mean, np.eye(3), Inequalities.none(3), planes)
    assert found is not None
    np.testing.assert_allclose(found.coefficients, mean / np.linalg.norm(mean), atol=1e-6)


def test_a_conditioned_gaussian_is_that_of_the_textbook() -> None:
    random = np.random.default_rng(3)
    mean, covariance = random.normal(size=4), covariance_of(random, 4)
    found = conditioned(mean, covariance,
                        Inequalities(np.eye(4)[:2], np.array([1.0, -1.0])))
    gain = covariance[2:, :2] @ np.linalg.inv(covariance[:2, :2])
    np.testing.assert_allclose(found.coefficients[2:], mean[2:] + gain @ ([1.0, -1.0] - mean[:2]),
                               rtol=1e-6)
    np.testing.assert_allclose(found.covariance[2:, 2:], covariance[2:, 2:]
                               - gain @ covariance[:2, 2:], rtol=1e-5,
                               atol=1e-8 * np.diag(covariance).max())


# Bodies.

@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Mechanism:
    return real_arm(tmp_path_factory.mktemp('arm')).robot


def payload(robot: Mechanism, variant: int) -> Component:
    effect = CATALOGUE['payload_mass'].bound(robot)
    return Component.of(effect, None, {}, effect.variants[variant])


def nearest_body(robot: Mechanism, component: Component, c: Array, covariance: Array,
                 ) -> tuple[Array, float]:
    """Return the nearest body that can be, of either sign where that is in doubt, and its rise."""
    sign = 1.0 if c[0] >= 0 else -1.0
    doubted = abs(c[0]) < DOUBTED * covariance[0, 0] ** 0.5
    found = [nearest(c, covariance, Inequalities.none(len(c)),
                     body_planes(robot, component, side))
             for side in ((sign, -sign) if doubted else (sign,))]
    best = min((n for n in found if n is not None), key=lambda n: n.rise)
    return best.coefficients, best.rise


def least_extents(robot: Mechanism, component: Component, c: Array) -> tuple[float, float]:
    """Return the least eigenvalues of what is added, or taken, and of what then hangs there.

    By the pseudo-inertia of the mechanism that the effect makes, not by its coefficients.
    """
    effect = component.effect.at(dict(zip(  # type: ignore[attr-defined]
        component.names, c, strict=True)))
    after, before = (pseudo_inertia(robot_.inertial[robot_.carrier])
                     for robot_ in (effect.changed(robot), robot))
    added = np.sign(c[0]) * (after - before)
    return float(np.linalg.eigvalsh(added)[0]), float(np.linalg.eigvalsh(after)[0])


@pytest.mark.parametrize('variant', [0, 1, 2, 3])
def test_a_hundred_impossible_bodies_become_possible(robot: Mechanism, variant: int) -> None:
    component = payload(robot, variant)
    random = np.random.default_rng(variant)
    count = len(component.names)
    for _ in range(25):
        mass = random.choice([1.5, 0.02, -0.02, -0.2, -50.0]) * random.uniform(0.5, 2)
        c = np.concatenate(([mass], 0.05 * random.standard_normal(9)))[:count]
        root = SPREAD[:count, None] * random.normal(size=(count, count))
        covariance = root @ root.T + 0.01 * np.diag(SPREAD[:count] ** 2)
        found, _ = nearest_body(robot, component, c, covariance)
        added, remaining = least_extents(robot, component, found)
        size = abs(float(found[0])) + float(robot.masses[robot.carrier])
        assert added > -1e-6 * size
        assert remaining > -1e-6 * size


def test_an_impossible_inertia_moves_no_further_than_it_must(robot: Mechanism) -> None:
    # Of moments (a, b, c) each is at most the sum of the others; (0, 1, 2) / 100 breaks that by
    # 0.01: the nearest within it, all three known alike, is 0.01 / 3 off in each.
    component = payload(robot, 2)
    c = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.02])
    found, rise = nearest_body(robot, component, c, np.diag(SPREAD[:7] ** 2))
    np.testing.assert_allclose(found[4:], [0.01 / 3, 0.04 / 3, 0.05 / 3], atol=2e-5)
    np.testing.assert_allclose(found[:4], c[:4], atol=1e-6)
    # Planes are 1e-3 of its size inside the set.
    assert rise == pytest.approx(3 * (0.01 / 3 / 0.02) ** 2, rel=1e-2)


def test_moments_that_no_motion_shows_hide_no_impossible_body(robot: Mechanism) -> None:
    """As of a planar arm: planes differ by 1e-6 of their length, yet the body costs 10^2."""
    c, std = np.array([2.6, 0.0, 0.0, 0.0, 0.0, -0.2, 0.0]), np.array([*[0.02] * 4, 1e4, 0.02, 1e4])
    found, rise = nearest_body(robot, payload(robot, 2), c, np.diag(std ** 2))
    assert least_extents(robot, payload(robot, 2), found)[0] > -1e-9
    assert rise == pytest.approx((0.2 / 0.02) ** 2, rel=0.02)


def test_a_moment_has_a_mass_within_reach(robot: Mechanism) -> None:
    component = payload(robot, 1)
    found, _ = nearest_body(robot, component, np.array([0.0, 0.5, 0.0, 0.0]),
                            np.diag([1.0, 0.01, 0.01, 0.01]) ** 2)
    assert np.linalg.norm(found[1:]) <= REACH * robot.structure.size * found[0] * (1 + 1e-9)
    assert found[0] > 0.1


@pytest.mark.filterwarnings('error')
def test_a_body_of_which_the_fit_says_nothing_is_any(robot: Mechanism) -> None:
    """As of a stretch of four samples: steps of another solver overflowed."""
    component = payload(robot, 3)
    found, _ = nearest_body(robot, component, np.zeros(10), np.diag([11.5 ** 2, *[1e300] * 9]))
    added, remaining = least_extents(robot, component, found)
    assert added > -1e-6
    assert remaining > -1e-6
