# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Limits of drives: what is within passes untouched, and the first that is not is named."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import LimitError, WorkspaceError
from pprs_dynamics.physics.model.forces import DriveLimits

PAPER = DriveModel.from_parameters({
    **DriveModel.load().values, 'limits.slide_stroke': [-0.3, 0.2],
    'limits.lift_stroke': [-0.1, 0.8], 'limits.effort': [10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
}).limits
ARM = DriveLimits(('elbow', 'rail'), (DriveUnits(True), DriveUnits()), np.array([-2.0, 0.0]),
                  np.array([1.0, 0.5]), np.array([7.0, 300.0]), ('its range',) * 2, 'the URDF')
EACH = pytest.mark.parametrize('limits', [PAPER, ARM], ids=['3-PPRS', 'arm'])


def middle(limits: DriveLimits, samples: int = 4) -> np.ndarray:
    """Return positions within all strokes, (N, D)."""
    lower, upper = limits.lower, limits.upper
    return np.tile((lower + upper) / 2, (samples, 1))


@EACH
def test_efforts_are_moved_to_the_limit_where_they_are_over_it(limits: DriveLimits) -> None:
    efforts = limits.efforts
    given = np.array([0.5, -0.5, 1.0, -1.0, 1.5, -1.5])[:, None] * efforts
    wanted = np.array([0.5, -0.5, 1.0, -1.0, 1.0, -1.0])[:, None] * efforts
    assert np.array_equal(limits.clamped(given), wanted)


@EACH
def test_the_first_position_outside_its_stroke_is_named(limits: DriveLimits) -> None:
    lower, upper = limits.lower, limits.upper
    edges = middle(limits)
    edges[0], edges[1] = lower, upper
    limits.check_strokes(edges)
    for drive, name in enumerate(limits.drives):
        for end, out in ((lower, -0.01), (upper, 0.01)):
            bad = middle(limits)
            bad[2:, drive] = end[drive] + out
            with pytest.raises(WorkspaceError) as caught:
                limits.check_strokes(bad)
            assert caught.value.sample == 2
            unit = limits.units[drive].position
            text = str(caught.value)
            assert f'{name} would have to be at {end[drive] + out:.6g} {unit}' in text
            assert (f'{limits.sources[drive]} is [{lower[drive]:g}, {upper[drive]:g}] {unit}'
                    ) in text
    bad = middle(limits)
    bad[1, 0] = np.nan
    with pytest.raises(WorkspaceError):
        limits.check_strokes(bad)


@EACH
def test_the_first_effort_over_its_limit_is_named(limits: DriveLimits) -> None:
    efforts = np.tile(limits.efforts, (4, 1)) * np.array([1.0, -1.0, 0.0, 1.0])[:, None]
    limits.check_efforts(efforts)
    for drive, name in enumerate(limits.drives):
        for wrong in (1.01 * limits.efforts[drive], -1.01 * limits.efforts[drive], np.nan):
            bad = efforts.copy()
            bad[2:, drive] = wrong
            with pytest.raises(LimitError) as caught:
                limits.check_efforts(bad)
            assert caught.value.sample == 2
            assert name in str(caught.value)
            assert f'{limits.efforts[drive]:g} {limits.units[drive].effort}' in str(caught.value)
            assert limits.effort_source in str(caught.value)


def test_the_smaller_of_two_limits_counts() -> None:
    assert ARM.with_efforts([100.0, 100.0]).efforts.tolist() == [7.0, 100.0]
