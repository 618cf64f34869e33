# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What goes out around a change, at an end, and at rest: without ROS, by direct calls."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from model_recordings import with_effects

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.ros.force_command import Feedforward, warn_without_limits
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import Timing, TrajectoryRequest

OWN = {'feedforward_scale': 1.0, 'effort_limits': (), 'limit_policy': 'reject',
       'missing_derivatives': 'reject', 'ramp_time': 0.0}
MODEL = DriveModel.load()
REMEMBERS = with_effects(MODEL, {
    'hysteresis': {'slide_1.force': 3.0, 'slide_1.distance': 0.005},
    'friction_drift': {'slide_1.force': 5.0, 'slide_1.time': 0.1}})
HEAVY = DriveModel.from_parameters({**MODEL.values, 'masses.payload': 3.0})
STEP = 10_000_000  # [ns]


class Clock:
    now = 7.0

    def __call__(self) -> float:
        return self.now


def request(first: float = 1.0, points: int = 1) -> TrajectoryRequest:
    motion = HelicalPath().motion(first + 0.01 * np.arange(points))
    return TrajectoryRequest(motion, 0, STEP * np.arange(points))


def test_a_change_of_model_and_scale_is_gone_over_to_in_its_time() -> None:
    clock = Clock()
    own: dict[str, Any] = {**OWN, 'ramp_time': 2.0}
    node = Feedforward(MODEL, own, clock)
    asked = request()
    before = node.answer(asked).effort[0]
    np.testing.assert_array_equal(before, MODEL.drive_forces(asked.motion).total[0])
    after = 0.5 * HEAVY.drive_forces(asked.motion).total[0]
    node.use(HEAVY, {**own, 'feedforward_scale': 0.5})
    for passed in (0.0, 0.5, 1.0, 1.9, 2.0, 30.0):
        clock.now = 7.0 + passed
        share = min(passed / 2.0, 1.0)
        np.testing.assert_allclose(
            node.answer(asked).effort[0], (1 - share) * before + share * after, atol=1e-12)


def test_no_step_of_a_ramp_is_larger_than_its_share() -> None:
    """Along a path, efforts with a ramp differ from those without one by what is left of it."""
    clock = Clock()
    own = {**OWN, 'ramp_time': 1.0}
    node = Feedforward(MODEL, own, clock)
    node.answer(request(0.0))
    node.use(HEAVY, own)
    for k in range(1, 101):
        clock.now = 7.0 + 0.01 * k
        asked = request(0.01 * k, 5)
        found = node.answer(asked).effort
        old, new = (model.drive_forces(asked.motion).total for model in (MODEL, HEAVY))
        # The points of a trajectory are due later, when more of the way is gone.
        share = np.minimum(0.01 * (k + np.arange(5)), 1.0)[:, None]
        np.testing.assert_allclose(found, old + share * (new - old), atol=1e-12)


def test_a_change_during_a_ramp_goes_on_from_where_that_is() -> None:
    clock = Clock()
    own: dict[str, Any] = {**OWN, 'ramp_time': 2.0}
    node = Feedforward(MODEL, own, clock)
    asked = request()
    node.answer(asked)
    node.use(HEAVY, own)
    clock.now += 1.0
    half_way = node.answer(asked).effort
    assert np.abs(half_way - HEAVY.drive_forces(asked.motion).total).max() > 1.0
    node.use(DriveModel.from_parameters(dict(HEAVY.values)), {**own, 'limit_policy': 'clamp'})
    np.testing.assert_allclose(node.answer(asked).effort, half_way, atol=1e-12)  # no other model
    node.use(MODEL, own)
    np.testing.assert_allclose(node.answer(asked).effort, half_way, atol=1e-12)
    clock.now += 2.0
    np.testing.assert_array_equal(node.answer(asked).effort, MODEL.drive_forces(asked.motion).total)


@pytest.mark.parametrize(('before', 'after'), [(MODEL, HEAVY), (HEAVY, MODEL)])
def test_what_is_gone_over_stays_within_the_limits(before: DriveModel, after: DriveModel) -> None:
    """Also where the model that comes would be within them by itself."""
    asked = request()
    limit = (np.abs(MODEL.drive_forces(asked.motion).total[0]) * 1.01).tolist()
    own = {**OWN, 'ramp_time': 2.0, 'limit_policy': 'clamp'}
    clock = Clock()
    node = Feedforward(before, own, clock)
    node.answer(asked)
    node.use(after, {**own, 'effort_limits': limit})
    clock.now += 1.0
    assert (np.abs(node.answer(asked).effort[0]) <= limit).all()


def test_a_piece_of_a_path_comes_to_rest_if_nothing_follows() -> None:
    node = Feedforward(MODEL, OWN)
    answer = node.answer(request(1.0, 4))
    duration = 0.1
    found = node.ending_at_rest(answer, duration)
    q, v, a = found.drive_motion
    assert np.diff(found.offsets).tolist() == [STEP, STEP, STEP, round(1e9 * duration)]
    assert np.abs(v[-2]).max() > 0.01
    assert not v[-1].any()
    assert not a[-1].any()
    # A constant deceleration takes half the way that the last speed would have gone.
    np.testing.assert_allclose(q[-1] - q[-2], v[-2] * duration / 2, atol=1e-15)
    gravity = MODEL.drive_forces(answer.request.motion.held()).parts['rigid_body']
    np.testing.assert_allclose(found.effort[-1], gravity[0], atol=1e-12)
    # What comes before is as it was.
    for given, kept in zip(answer.forces.drive_motion, found.drive_motion, strict=True):
        np.testing.assert_array_equal(given, kept[:-1])


def test_only_a_path_that_ends_at_rest_and_a_time_of_0_get_no_point_more() -> None:
    node = Feedforward(MODEL, OWN)
    moving = node.answer(request(1.0, 3))
    for at_once in (0.0, 1e-10):  # in less than 1 ns two points would be at one time
        assert len(node.ending_at_rest(moving, at_once).offsets) == 3
    still = HelicalPath().motion([1.0]).held()
    zero = np.zeros((1, 3))
    falling = PlatformMotion(still.position, still.orientation, zero, zero, zero - 1.0, zero)
    for motion, points in ((still, 1), (falling, 2)):
        answer = node.answer(TrajectoryRequest(motion, 0, np.array([0])))
        assert len(node.ending_at_rest(answer, 0.1).offsets) == points


def test_a_stop_never_leads_beyond_a_stroke() -> None:
    asked = request(1.0, 2)
    lifts = MODEL.drive_forces(asked.motion).mechanism.position[-1, 3:]
    narrow = DriveModel.from_parameters({**MODEL.values, 'limits.lift_stroke': [
        float(lifts.min() - 1e-4), float(lifts.max() + 1e-4)]})
    node = Feedforward(narrow, OWN)
    node.answer(request(1.0, 1))
    answer = node.answer(TrajectoryRequest(HelicalPath().motion([1.01]), 0, np.array([0])))
    q = node.ending_at_rest(answer, 2.0).drive_motion[0]
    lower, upper = narrow.limits.lower, narrow.limits.upper
    assert ((q[-1] >= lower) & (q[-1] <= upper)).all()


def test_of_a_piece_the_first_point_is_remembered_and_what_is_foreseen_is_not() -> None:
    """Pieces that overlap, as a planner sends them, come to what their first points alone do."""
    pieces, points = Feedforward(REMEMBERS, OWN), Feedforward(REMEMBERS, OWN)
    start = 5_000_000_000
    for k in range(40):
        begin = start + k * STEP
        piece, point = (TrajectoryRequest(request(1.0 + 0.01 * k, count).motion, begin,
                                          STEP * np.arange(count)) for count in (6, 1))
        np.testing.assert_array_equal(pieces.answer(piece).effort[:1], points.answer(point).effort)


@pytest.mark.parametrize('moment', [0.0, 1.3, 3.0])
def test_drives_are_held_where_they_are_with_their_gravity(moment: float) -> None:
    motion = HelicalPath().motion([moment])
    pose = MODEL.drive_forces(motion.held())
    found = Feedforward(MODEL, {**OWN, 'feedforward_scale': 0.5}).hold_at(
        pose.mechanism.position[0])
    np.testing.assert_allclose(found.effort[0], 0.5 * pose.total[0], atol=1e-8)
    np.testing.assert_allclose(found.forces.mechanism.position, pose.mechanism.position, atol=1e-9)


def test_a_path_has_come_to_rest_at_its_end_and_not_where_it_breaks_off() -> None:
    node = Feedforward(MODEL, OWN)
    assert not node.has_come_to_rest
    for last, rests in ((1.0, False), (HelicalPath.duration, True)):
        motion = HelicalPath().motion(np.linspace(last - 0.1, last, 11))
        node.answer(TrajectoryRequest(motion, 0, STEP * np.arange(11)))
        assert node.has_come_to_rest is rests


def test_a_clock_that_is_set_back_multiplies_no_effect() -> None:
    """Friction that fades with time would grow without bound before its start."""
    node = Feedforward(REMEMBERS, OWN)
    for start in (5_000, 5_600, 4_400, 10):
        at = start * 1_000_000_000
        found = [node.answer(TrajectoryRequest(request(1.0 + 0.01 * k).motion, at + k * STEP,
                                               np.array([0]))).effort[0] for k in range(3)]
        if start < 5_000:
            fresh = Feedforward(REMEMBERS, OWN).answer(TrajectoryRequest(
                request(1.0).motion, at, np.array([0])))
            np.testing.assert_allclose(found[0], fresh.effort[0], atol=1e-9)


def test_an_effort_that_is_not_finite_is_refused_where_nothing_limits_it() -> None:
    node = Feedforward(MODEL, {**OWN, 'feedforward_scale': np.nan})
    with pytest.raises(Rejection, match='an effort that is not finite'):
        node.answer(request())


def test_drives_that_nothing_limits_are_warned_of() -> None:
    free = DriveModel.load('config/single_axis.yaml')
    for model, limits, warned in (
            (free, (), True), (free, (80.0,), False), (MODEL, (), False)):
        node = Mock()
        warn_without_limits(node, model, {'effort_limits': limits})
        calls = node.get_logger().warning.call_args_list
        assert [('no limit' in str(call), 'axis' in str(call)) for call in calls] == (
            [(True, True)] if warned else [])


def test_a_pose_beyond_a_stroke_is_refused() -> None:
    lifts = MODEL.drive_forces(request().motion).mechanism.position[0, 3:]
    narrow = DriveModel.from_parameters({**MODEL.values, 'limits.lift_stroke': [
        float(lifts.min()) + 0.01, float(lifts.max()) + 0.02]})
    with pytest.raises(WorkspaceError, match='lift_'):
        Feedforward(narrow, OWN).answer(request())


@pytest.mark.parametrize(('timing', 'start'), [
    (Timing(max_age=0.1), -0.2), (Timing(max_ahead=0.1), 0.2), (Timing(max_duration=0.01), 0.0)])
def test_what_is_too_old_too_early_or_too_long_is_refused(timing: Timing, start: float) -> None:
    now = 5_000_000_000
    asked = TrajectoryRequest(request(1.0, 3).motion, now + round(1e9 * start), STEP * np.arange(3))
    with pytest.raises(Rejection, match=timing._fields[np.flatnonzero(timing)[0]]):
        timing.check(asked, now)
    Timing(*(10.0 * value for value in timing)).check(asked, now)
