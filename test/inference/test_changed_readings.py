# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Efforts without a sign, exchanged drives and changed units of positions are reported as that."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pprs_dynamics import DriveModel, Recording
from pprs_dynamics.inference.readings.check import find_mistakes
from pprs_dynamics.inference.readings.evidence import forces_of
from pprs_dynamics.inference.readings.findings import OtherReading
from pprs_dynamics.inference.residuals.excerpt import excerpt_of
from pprs_dynamics.physics.mechanism.paths import Excitation

MODEL = DriveModel.load()
TIME = np.arange(10_000) * 0.002
AFTER = (TIME > 12.0)[:, None]
# Effects that the model lacks are no other unit.
REAL = DriveModel.from_parameters(
    {**MODEL.values, 'effects.active': ['stribeck_friction', 'viscous_friction'],
     'effects.stribeck_friction.lift_1.force': 1.2,
     'effects.stribeck_friction.lift_1.velocity': 0.02,
     'effects.viscous_friction.slide_2.coefficient': 12.0})
FORCES = REAL.drive_forces(Excitation(20.0, 1).motion(TIME))
NOISE = 0.05 * np.random.default_rng(0).normal(size=FORCES.total.shape)
POSITION, EFFORT = FORCES.mechanism.position, FORCES.total + NOISE


def told(position: Any = POSITION, effort: Any = EFFORT) -> list[OtherReading]:
    found = find_mistakes(MODEL, Recording.from_arrays('r', TIME, position, None, effort))
    return [finding for finding in found if isinstance(finding, OtherReading)]


def test_efforts_without_a_sign_are_told() -> None:
    finding, = told(effort=np.abs(EFFORT))
    assert finding.kind == 'effort_absolute'
    assert 'absolute value' in finding.text


def test_positions_that_change_to_millimetres_are_in_another_unit() -> None:
    assert any('millimetres' in finding.text for finding in told(position=POSITION * np.where(
        AFTER, 1e3, 1.0)))


def test_a_drive_that_is_held_for_a_while_is_in_no_other_unit() -> None:
    """As axis 4 of a KR 300: next to nothing is asked of it at first, and a brake pushes."""
    held = 4000
    position, effort = POSITION.copy(), EFFORT.copy()
    position[:held] = position[held]
    excerpt = excerpt_of(Recording.from_arrays('r', TIME, position, None, effort), 3)
    assert excerpt is not None
    force = forces_of(MODEL, excerpt.motion, excerpt.time).sum(axis=0)
    effort[:held] = force[excerpt.time < TIME[held // 2]][-1]
    effort[:held, 1] = 20.0
    assert told(position, effort) == []


@pytest.mark.parametrize('exchanged', ['efforts', 'positions', 'drives'])
@pytest.mark.parametrize('pair', [(0, 1), (3, 4)])
def test_exchanged_drives_are_told_where_all_others_fit(exchanged: str, pair: tuple[int, int],
                                                        ) -> None:
    """The four drives that fit, or the strongest, do not hide the two that do not."""
    order = [*range(6)]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    position = POSITION if exchanged == 'efforts' else POSITION[:, order]
    found, = told(position, EFFORT if exchanged == 'positions' else EFFORT[:, order])
    first, second = (MODEL.drives[place] for place in pair)
    assert found.kind == 'drive_order'
    assert f'the {exchanged} look recorded in another order: {second} like {first}' in found.text
