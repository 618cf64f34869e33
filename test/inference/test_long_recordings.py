# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of hours: what a fit takes of them, and that its bar moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from made_up_recordings import the_one

from pprs_dynamics import DriveModel, JointMotion, Recording, compare, diagnose
from pprs_dynamics.inference.residuals.long_recordings import (
    MOST_BLOCKS,
    STRETCHES,
    excerpts_within_memory,
)

RATE = 100.0  # [Hz]: every sample is a block


def axis(**effects: Any) -> DriveModel:
    model = DriveModel.load('config/single_axis.yaml')
    changed = DriveModel.from_parameters({**model.values, **{key.replace('__', '.'): value
                                                             for key, value in effects.items()}})
    return changed


def record(model: DriveModel, duration: float, moves_in: slice = slice(0, 60)) -> Recording:
    """Return an axis that swings in a part of every minute, and stands in the rest."""
    t = np.arange(0, duration, 1 / RATE)
    minute = t % 60
    moving = (minute >= moves_in.start) & (minute < moves_in.stop)
    phase = np.cumsum(moving) / RATE
    q, v, a = np.zeros((3, len(t)))
    for w, size in ((1.1, 0.05), (2.7, 0.03), (4.3, 0.02)):
        q += size * np.sin(w * phase)
        v += size * w * np.cos(w * phase) * moving
        a -= size * w ** 2 * np.sin(w * phase) * moving
    forces = model.drive_forces(JointMotion(*(values[:, None] for values in (q, v, a)), t))
    random = np.random.default_rng(0)
    return Recording.from_arrays('hours', t, q[:, None] + 1e-7 * random.normal(size=(len(t), 1)),
                                 None, forces.total + 0.5 * random.normal(size=(len(t), 1)),
                                 ('axis',))


def test_of_an_hour_stretches_from_all_over_it_are_taken_and_told() -> None:
    model, whole = axis(), record(axis(), 3600.0)
    found, = excerpts_within_memory(model, [whole])
    used = sum(part.stop - part.start for part in found.segments)
    assert used == pytest.approx(MOST_BLOCKS, rel=0.1)
    twelfths = {part.start * STRETCHES // len(whole.time) for part in found.segments}
    assert twelfths == set(range(STRETCHES))
    finding = the_one(found, 'too_long')
    assert finding.count == len(whole.time) - used
    assert '3600 s at 100 Hz' in finding.text
    assert f'{STRETCHES} stretches' in finding.text
    assert excerpts_within_memory(model, [found]) == [found]
    assert found.time is whole.time


def test_where_a_robot_stands_most_of_the_time_stretches_are_where_it_moves() -> None:
    whole = record(axis(), 3600.0, slice(20, 35))
    found, = excerpts_within_memory(axis(), [whole])
    minute = np.concatenate([whole.time[part] for part in found.segments]) % 60
    assert np.mean((minute >= 20) & (minute < 35)) > 0.7


def test_an_hour_is_diagnosed_from_excerpts_and_compared_as_a_whole() -> None:
    given = DriveModel.load('config/single_axis.yaml')
    whole = record(axis(friction__viscous=[given.values['friction.viscous'][0] + 20.0]), 3600.0)
    shares: list[float] = []
    answer = diagnose(given, whole, progress=lambda what, share: shares.append(share))
    assert answer.verdict == 'effect'
    assert [effect.name for effect in answer.effects] == ['viscous_friction']
    found = answer.effects[0].parameters['axis.coefficient']
    assert abs(found.value - 20.0) < 3 * found.std
    assert len(answer.diagnosis.residuals) < 1.1 * MOST_BLOCKS
    # A bar that stands looks like a command that hangs.
    assert len(np.unique(np.round(shares, 3))) > 30
    assert len(compare(given, whole).residuals) > 0.99 * len(whole.time)
