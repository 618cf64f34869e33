# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Paths and motions: poses, twists and accelerations belong to one curve, in `base`."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import MotionError
from pprs_dynamics.physics.mechanism.joint_motion import DrivePath
from pprs_dynamics.physics.mechanism.paths import HOME, Excitation, HelicalPath, with_lead_in

STEP = 1e-4  # [s]
# Central differences over 0.1 ms of motions below 1 Hz: truncation near 1e-8, and the rounding of
# rotations near 1e-11 rad over the step near 1e-7.
RATE_TOLERANCE = 2e-6


def tilted_poses(time: np.ndarray) -> PlatformMotion:
    """Return a motion that tilts far, so that `base` and `platform` rates differ."""
    turn = np.stack((0.9 * np.sin(time), 0.8 * np.cos(1.3 * time), 0.7 * time / 4), axis=1)
    position = np.stack((0.05 * np.sin(time), 0.04 * np.cos(time), 0.5 + 0.01 * time), axis=1)
    return PlatformMotion.from_poses(time, position, Rotation.from_rotvec(turn).as_quat())


def motions() -> dict[str, PlatformMotion]:
    # Middles and their neighbours on both sides, 0.1 ms apart.
    moments = np.linspace(0.5, 3.5, 31)
    grid = (moments[:, None] + np.array([-STEP, 0.0, STEP])).ravel()
    poses = tilted_poses(np.linspace(0, 4, 200))
    lead = with_lead_in(Excitation(4.0, seed=2, tilt=0.4).motion(np.arange(0, 4, STEP)), 1.0,
                        1 / STEP)
    inside = np.searchsorted(lead.time, np.linspace(0.1, 4.9, 31))
    return {
        'poses': PlatformMotion.from_poses(poses.time, poses.position, poses.orientation, at=grid),
        'excitation': Excitation(4.0, seed=1, tilt=0.5).motion(grid),
        'helix': HelicalPath().motion(grid),
        'lead-in': lead[(inside[:, None] + np.array([-1, 0, 1])).ravel()]}


@pytest.mark.parametrize('name', motions())
def test_twists_and_accelerations_are_derivatives_in_base(name: str) -> None:
    motion = motions()[name]
    before, middle, after = (motion[k::3] for k in range(3))
    velocity = (after.position - before.position) / (2 * STEP)
    np.testing.assert_allclose(middle.linear_velocity, velocity, rtol=0, atol=RATE_TOLERANCE)
    turned = Rotation.from_quat(after.orientation) * Rotation.from_quat(before.orientation).inv()
    np.testing.assert_allclose(middle.angular_velocity, turned.as_rotvec() / (2 * STEP),
                               rtol=0, atol=RATE_TOLERANCE)
    for rate, gain in (('linear_velocity', 'linear_acceleration'),
                       ('angular_velocity', 'angular_acceleration')):
        difference = (getattr(after, rate) - getattr(before, rate)) / (2 * STEP)
        np.testing.assert_allclose(getattr(middle, gain), difference, rtol=0, atol=3e-3)


def test_the_helix_is_the_papers() -> None:
    path = HelicalPath()
    ends = path.motion([0.0, path.duration])
    np.testing.assert_allclose(ends.position, [[0.15, 0, 0.5], [0.15, 0, 0.6]], atol=1e-12)
    np.testing.assert_allclose(ends.linear_velocity, 0, atol=1e-12)
    # lambda(pi/2) = pi/2 and lambda(pi) = 3 pi/2, with a rate of 2 rad/s between.
    middle = path.motion([np.pi / 2, 3 * np.pi / 4, np.pi])
    np.testing.assert_allclose(middle.position[:, :2], [[0, 0.15], [-0.15, 0], [0, -0.15]],
                               atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(middle.linear_velocity[:, :2], axis=1), 0.3)


@pytest.mark.parametrize('seed', range(5))
def test_an_excitation_starts_and_ends_at_rest_at_home_and_stays_within_the_limits(
    seed: int,
) -> None:
    path, model = Excitation(12.0, seed=seed), DriveModel.load()
    motion = path.motion(np.linspace(0, path.duration, 2001))
    for end in (motion[:1], motion[-1:]):
        np.testing.assert_allclose(end.position, [HOME], atol=1e-12)
        for name in ('linear_velocity', 'angular_velocity', 'linear_acceleration'):
            np.testing.assert_allclose(getattr(end, name), 0, atol=1e-6)
    forces = model.drive_forces(motion)
    model.limits.check_strokes(forces.mechanism.position)
    model.limits.check_efforts(forces.total)
    assert np.abs(motion.position - HOME).max() == pytest.approx(path.amplitude, rel=1e-3)


def test_a_lead_in_ends_where_the_path_starts_and_leaves_it_as_it_is() -> None:
    path = HelicalPath().motion(np.arange(0, HelicalPath.duration, 0.01))
    whole = with_lead_in(path, 2.0, 100.0)
    assert len(whole) == len(path) + 200
    np.testing.assert_array_equal(whole.position[200:], path.position)
    np.testing.assert_allclose(whole.position[0], HOME)
    assert np.abs(np.diff(whole.position, axis=0)).max() < 0.005


@pytest.mark.parametrize(('change', 'message'), [
    ({'position': [[0, 0, np.nan]]}, 'position: sample 0 is .*must be finite'),
    ({'orientation': [[0, 0, 0, 1.01]]}, 'orientation: the quaternion of sample 0 has length 1.01'),
    ({'orientation': [[0, 0, 0, 0]]}, 'length 0, must be 1 within 0.001'),
    ({'linear_velocity': [[0, 0]]}, r'linear_velocity: its shape is \(1, 2\)'),
    ({'angular_velocity': np.zeros((2, 3))}, 'angular_velocity: it has 2 samples.*have 1'),
    ({'time': [np.inf]}, 'time: sample 0 is not finite'),
    ({'position': 'left'}, 'position: .*left.* array of numbers'),
])
def test_what_is_no_motion_is_told(change: dict[str, object], message: str) -> None:
    zero = np.zeros((1, 3))
    good = {'position': [HOME], 'orientation': [[0, 0, 0, 1]], 'linear_velocity': zero,
            'angular_velocity': zero, 'linear_acceleration': zero, 'angular_acceleration': zero}
    with pytest.raises(MotionError, match=message):
        PlatformMotion(**{**good, **change})


# Stops along the path of a trajectory, against the path's closed form.

POINTS = np.arange(0.0, 1.001, 0.02)


def circle(time: np.ndarray) -> np.ndarray:
    return np.column_stack((np.cos(2 * time), np.sin(2 * time)))


def speed(time: np.ndarray) -> np.ndarray:
    return 2 * np.column_stack((-np.sin(2 * time), np.cos(2 * time)))


PATH = DrivePath(POINTS, circle(POINTS), speed(POINTS))


def test_between_its_points_the_path_is_the_curve() -> None:
    moments = np.linspace(0.0, 1.0, 333)
    found = PATH.at(moments)
    np.testing.assert_allclose(found.position, circle(moments), atol=1e-7)
    np.testing.assert_allclose(found.velocity, speed(moments), atol=1e-4)
    np.testing.assert_allclose(found.acceleration, -4 * circle(moments), atol=0.01)


def test_before_the_first_point_it_stands_and_beyond_the_last_it_goes_on() -> None:
    found = PATH.at(np.array([-1.0, 1.5]))
    np.testing.assert_allclose(found.position[0], circle(POINTS[:1])[0])
    np.testing.assert_allclose(
        found.position[1], circle(POINTS[-1:])[0] + 0.5 * speed(POINTS[-1:])[0])


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


def test_a_stop_before_the_first_point_does_not_move() -> None:
    """A message may be stamped ahead: drives are not yet at its first point, which moves."""
    stop = PATH.stop(float(POINTS[0]) - 1.0, 0.25)
    np.testing.assert_allclose(stop.position, np.broadcast_to(PATH.position[0], (
        len(stop), PATH.position.shape[1])))
    assert not stop.velocity.any()
    assert not stop.acceleration.any()
