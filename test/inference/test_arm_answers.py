# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Answers about a planar arm whose efforts come from Lagrange's equations, written out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from planar_arm import planar_arm

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.next_step import GivenFiles, next_step
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel

MASS, LENGTH, CENTRE, INERTIA = 0.6, 0.5, 0.25, 0.01  # of each rod
TIME = np.arange(0.0, 10.0, 0.005)
NOISE = 0.02  # [N m]


@pytest.fixture
def arm(tmp_path: Path) -> DriveModel:
    return planar_arm(tmp_path, 2)


def recorded(gravity: tuple[float, float] = (0.0, -9.81), force: tuple[float, float] = (0.0, 0.0),
             forward: float = 0.0, backward: float = 0.0, seed: int = 1) -> Recording:
    """Return a recording of the arm with gravity and a force at the elbow, (x, z), and friction."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.array([[0.2, 0.47, 0.9], [0.31, 0.63, 1.1]])
    size, phase = np.array([1.2, 0.5, 0.1]), rng.uniform(0, 2 * np.pi, (2, 3))
    angle = omega[..., None] * TIME + phase[..., None]
    q = np.einsum('k,jkm->mj', size, np.sin(angle)) + np.array([0.5, 0.4])
    v = np.einsum('k,jk,jkm->mj', size, omega, np.cos(angle))
    a = -np.einsum('k,jk,jkm->mj', size, omega ** 2, np.sin(angle))
    effort = _lagrange(q, v, a, gravity) + 0.1 * v + 0.3 * np.tanh(v / 0.01)
    s, c = np.sin(q[:, 0]), np.cos(q[:, 0])
    effort[:, 0] += LENGTH * (force[1] * s - force[0] * c)
    effort[:, 0] += np.where(v[:, 0] > 0, forward, backward) * np.tanh(v[:, 0] / 0.01)
    return Recording.from_arrays('run', TIME, q, v, effort + NOISE * rng.normal(size=q.shape),
                                 ('j1', 'j2'))


def _lagrange(q: Array, v: Array, a: Array, gravity: tuple[float, float]) -> Array:
    """Return the torques of two rods that hang from axes along y."""
    s1, c1, s2, c2 = np.sin(q[:, 0]), np.cos(q[:, 0]), np.sin(q[:, 1]), np.cos(q[:, 1])
    s12, c12 = np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))
    elbow = INERTIA + MASS * CENTRE ** 2
    cross = elbow + MASS * LENGTH * CENTRE * c2
    first = 2 * elbow + MASS * LENGTH ** 2 + 2 * MASS * LENGTH * CENTRE * c2
    h = -MASS * LENGTH * CENTRE * s2
    x, z = gravity
    lower = -MASS * CENTRE * (z * s12 - x * c12)
    upper = lower - MASS * (CENTRE + LENGTH) * (z * s1 - x * c1)
    return np.stack((
        first * a[:, 0] + cross * a[:, 1] + h * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2) + upper,
        cross * a[:, 0] + elbow * a[:, 1] - h * v[:, 0] ** 2 + lower), axis=1)


def test_where_nothing_is_hidden_nothing_is_reported(arm: DriveModel) -> None:
    assert diagnose(arm, [recorded()]).verdict == 'adequate'


@pytest.mark.parametrize(('force', 'forward', 'backward'), [
    ((3.0, 4.0), 0.5, 0.1), ((3.0, 4.0), 0.9, 0.3), ((8.0, 10.0), 0.9, 0.3)])
def test_a_wrench_with_asymmetric_friction_is_the_reported_set(
    arm: DriveModel, force: tuple[float, float], forward: float, backward: float,
) -> None:
    found = diagnose(arm, [recorded(force=force, forward=forward, backward=backward)])
    assert {effect.name for effect in found.effects} == {'external_wrench', 'asymmetric_friction'}
    assert found.verdict == 'effect'


@pytest.mark.parametrize(('x', 'z'), [(0.0, 9.81), (-6.9, -6.9)])
def test_another_mounting_is_named_with_the_line_of_the_model_file(
    arm: DriveModel, x: float, z: float,
) -> None:
    found = diagnose(arm, [recorded((x, z))])
    assert (found.verdict, found.effects) == ('unknown', ())
    assert {looks.kind for looks in found.effort_looks_like.values()} == {'mounting'}
    line = f'robot: {{gravity: [{x:.1f}, 0.0, {z:.1f}]}}'
    assert line in next_step(found, GivenFiles())[0]
