# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Robots as points and lines: links keep their lengths, drives have their own."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.physics.model.skeleton import Skeleton


def lengths(drawn: Skeleton, are_drives: bool) -> dict[str, np.ndarray]:
    """Return the lengths of lines that are drives, or are not, (F,), by name [m]."""
    return {line.name: np.linalg.norm(drawn.points[:, line.start] - drawn.points[:, line.end],
                                      axis=1)
            for line in drawn.lines if (line.drive >= 0) is are_drives}


def about_home(model: DriveModel) -> JointMotion:
    """Return random states about home, at rest."""
    middle, room = model.robot.structure.room(1.0)
    q = middle + 0.3 * room * np.random.default_rng(1).uniform(-1, 1, (7, len(middle)))
    return JointMotion(q, np.zeros_like(q), np.zeros_like(q))


def test_a_hexapods_legs_are_as_long_as_its_drives_say() -> None:
    model = DriveModel.load('config/hexapod.yaml')
    motion = about_home(model)
    drawn = Skeleton.of(model, motion)
    legs = [line for line in drawn.lines if line.drive >= 0]
    assert [line.drive for line in legs] == list(range(6))
    for d, length in enumerate(lengths(drawn, True).values()):
        assert length == pytest.approx(motion.position[:, d], abs=1e-12)
    assert set(drawn.labels) == set(model.drives)
    # Six corners in their order: the way round is shorter than any way across.
    corners = drawn.points[0, list(drawn.face)]
    around = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum()
    mixed = corners[[0, 2, 4, 1, 3, 5]]
    assert len(corners) == 6
    assert around < np.linalg.norm(mixed - np.roll(mixed, 1, axis=0), axis=1).sum()


def test_the_3_pprs_is_drawn_by_its_chains() -> None:
    model = DriveModel.load()
    motion = HelicalPath().motion(np.linspace(0.0, 4.0, 9))
    drawn = Skeleton.of(model, motion)
    assert sorted(line.drive for line in drawn.lines if line.drive >= 0) == list(range(6))
    for rod in lengths(drawn, False).values():
        assert rod == pytest.approx(np.full(9, model.robot.geometry.rod_length), abs=1e-12)
    lifts = model.drive_forces(motion).mechanism.position[:, 3:]
    for i, name in enumerate(('lift_1', 'lift_2', 'lift_3')):
        assert lengths(drawn, True)[name] == pytest.approx(np.abs(lifts[:, i]), abs=1e-12)
    assert drawn.points[:, list(drawn.face)].mean(axis=1) == pytest.approx(motion.position)
