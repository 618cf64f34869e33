# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stops along the path of a trajectory, against the path's closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pprs_dynamics.physics.mechanism.joint_motion import DrivePath

TIME = np.arange(0.0, 1.001, 0.02)


def circle(time: np.ndarray) -> np.ndarray:
    return np.column_stack((np.cos(2 * time), np.sin(2 * time)))


def speed(time: np.ndarray) -> np.ndarray:
    return 2 * np.column_stack((-np.sin(2 * time), np.cos(2 * time)))


PATH = DrivePath(TIME, circle(TIME), speed(TIME))


def test_between_its_points_the_path_is_the_curve() -> None:
    moments = np.linspace(0.0, 1.0, 333)
    found = PATH.at(moments)
    np.testing.assert_allclose(found.position, circle(moments), atol=1e-7)
    np.testing.assert_allclose(found.velocity, speed(moments), atol=1e-4)
    np.testing.assert_allclose(found.acceleration, -4 * circle(moments), atol=0.01)


def test_before_the_first_point_it_stands_and_beyond_the_last_it_goes_on() -> None:
    found = PATH.at(np.array([-1.0, 1.5]))
    np.testing.assert_allclose(found.position[0], circle(TIME[:1])[0])
    np.testing.assert_allclose(
        found.position[1], circle(TIME[-1:])[0] + 0.5 * speed(TIME[-1:])[0])


@pytest.mark.parametrize('start', [0.0, 0.37, 0.95, 1.0])
def test_a_stop_follows_the_path_and_its_derivatives_belong_together(start: float) -> None:
    duration = 0.3
    stop = PATH.stop(start, duration)
    assert np.all(np.diff(stop.time) > 0)
    assert stop.time[-1] == pytest.approx(duration)
    assert not stop.velocity[-1].any()
    assert not stop.acceleration[-1].any()
    # On the path, or on the straight line from its last point.
    radius = np.linalg.norm(stop.position, axis=1)
    inside = start + duration / 3 <= 1.0
    assert (np.abs(radius - 1) < 1e-6).all() == inside
    # Integrated between its points, velocity gives position: the rule of Simpson over pairs.
    h = duration / 10
    for k in (1, 3, 5, 7):
        way = h / 3 * (stop.velocity[k - 1] + 4 * stop.velocity[k] + stop.velocity[k + 1])
        np.testing.assert_allclose(stop.position[k + 1] - stop.position[k - 1], way, atol=2e-3)
