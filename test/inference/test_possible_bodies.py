# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bodies that a fit proposes can be: what is added, what is taken away, and what is left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_arm import real_arm

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.search.body_centres import REACH
from pprs_dynamics.inference.search.candidates import Component
from pprs_dynamics.inference.search.possible_bodies import nearest_possible
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.mechanism.description import pseudo_inertia
from pprs_dynamics.physics.mechanism.mechanism import Mechanism

SPREAD = np.array([0.05, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02])


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Mechanism:
    return real_arm(tmp_path_factory.mktemp('arm')).robot


def payload(robot: Mechanism, variant: int) -> Component:
    effect = CATALOGUE['payload_mass'].bound(robot)
    return Component.of(effect, None, {}, effect.variants[variant])


def least_extents(robot: Mechanism, component: Component, c: Array) -> tuple[float, float]:
    """Return the least eigenvalues of what is added, or taken, and of what then hangs there.

    By the pseudo-inertia of the mechanism that the effect makes, not by its coefficients.
    """
    effect = component.effect.at(dict(zip(  # type: ignore[attr-defined]
        component.names, c, strict=True)))
    after, before = (pseudo_inertia(one.inertial[one.carrier])
                     for one in (effect.changed(robot), robot))
    added = np.sign(c[0]) * (after - before)
    return float(np.linalg.eigvalsh(added)[0]), float(np.linalg.eigvalsh(after)[0])


@pytest.mark.parametrize('variant', [0, 1, 2, 3])
@pytest.mark.parametrize('mass', [1.5, 0.02, -0.2, -50.0])
def test_what_is_proposed_can_be(robot: Mechanism, variant: int, mass: float) -> None:
    component = payload(robot, variant)
    random = np.random.default_rng(variant)
    count = len(component.names)
    c = np.concatenate(([mass], 0.05 * random.standard_normal(9)))[:count]
    found = nearest_possible(robot, component, c, np.diag(SPREAD[:count] ** 2))
    assert found is not None
    added, left = least_extents(robot, component, found)
    size = abs(float(found[0])) + float(robot.masses[robot.carrier])
    assert added > -1e-6 * size
    assert left > -1e-6 * size


def test_a_body_that_can_be_stays_as_it_was_fitted(robot: Mechanism) -> None:
    component = payload(robot, 3)
    c = np.array([1.0, 0.02, 0.0, 0.05, 0.01, 0.012, 0.008, 0.001, 0.0, 0.001])
    assert nearest_possible(robot, component, c, np.diag(SPREAD ** 2)) is c


def test_an_impossible_inertia_moves_no_further_than_it_must(robot: Mechanism) -> None:
    # Of moments (a, b, c) each is at most the sum of the others; (0, 1, 2) / 100 breaks that by
    # 0.01: the nearest within it, all three known alike, is 0.01 / 3 off in each.
    component = payload(robot, 2)
    c = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.02])
    found = nearest_possible(robot, component, c, np.diag(SPREAD[:7] ** 2))
    assert found is not None
    np.testing.assert_allclose(found[4:], [0.01 / 3, 0.04 / 3, 0.05 / 3], atol=1e-5)
    np.testing.assert_allclose(found[:4], c[:4], atol=1e-6)


def test_a_moment_has_a_mass_within_reach(robot: Mechanism, tmp_path: Path) -> None:
    component = payload(robot, 1)
    found = nearest_possible(robot, component, np.array([0.0, 0.5, 0.0, 0.0]),
                             np.diag([1.0, 0.01, 0.01, 0.01]) ** 2)
    assert found is not None
    assert np.linalg.norm(found[1:]) <= REACH * robot.structure.size * found[0] * (1 + 1e-9)
    assert found[0] > 0.1


@pytest.mark.filterwarnings('error')
def test_a_body_of_which_the_fit_says_nothing_is_any(robot: Mechanism) -> None:
    """As of a stretch of four samples: its steps overflowed."""
    component = payload(robot, 3)
    assert len(component.names) == 10
    unknown = np.diag([11.5 ** 2, *[1e300] * 9])
    found = nearest_possible(robot, component, np.zeros(10), unknown)
    assert found is not None
    added, left = least_extents(robot, component, found)
    assert added > -1e-6
    assert left > -1e-6
