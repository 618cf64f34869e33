# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changed on a running robot: claimed on the second window that shows it, withdrawn after."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from single_axis import AXIS, axis, axis_recording

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.errors import MotionError, PprsError
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
from pprs_dynamics.inference.residuals.live import LiveComparison
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion
from pprs_dynamics.physics.mechanism.paths import Excitation

LENGTH = 20.0  # [s]
SPRING = 300.0  # [N/m] that the model lacks
SOONER = 8.0  # [s] within the second window
WORN = axis({'drive_spring': {'stiffness': SPRING, 'position': 0.01}})


def window(worn: DriveModel, number: int, begins: float = 0.0) -> Recording:
    """Return efforts of one axis before a moment [s] and of a worn one after it."""
    return axis_recording(worn, number, 1.0, axis(), begins, np.arange(0, LENGTH, 0.01))


def test_a_change_is_claimed_on_the_second_window_that_shows_it_and_withdrawn_after() -> None:
    model = axis()
    live = LiveDiagnosis(model)
    live = live.with_window(window(axis(), 0), 0.0)
    assert live.effects == ()
    live = live.with_window(window(WORN, 1, SOONER), LENGTH)
    assert live.claimed == ()  # named by one window only
    assert live.adopted() == {}
    live = live.with_window(window(WORN, 2), 2 * LENGTH)
    live = live.with_window(window(WORN, 3), 3 * LENGTH)
    assert [effect.found.name for effect in live.claimed] == ['drive_spring']
    assert live.claimed[0].since == pytest.approx(LENGTH + SOONER, abs=1.0)
    found = live.claimed[0].found.parameters['axis.stiffness']
    assert abs(found.value - SPRING) < 4 * found.std + 0.01 * SPRING
    assert live.to_dict()['confirmed'] is True
    adopted = DriveModel.from_parameters(live.adopted(), model.source)
    assert adopted.values['effects.drive_spring.axis.stiffness'] == found.value
    beside = replace(live, effects=(*live.effects, replace(live.claimed[0], confirmed=False)))
    assert beside.adopted() == {}  # the numbers were fitted together
    live = live.with_window(window(axis(), 4), 4 * LENGTH)
    assert live.claimed == ()
    assert [effect.found.name for effect in live.withdrawn] == ['drive_spring']


def test_a_robot_that_stands_is_not_diagnosed() -> None:
    model = axis()
    moving = window(WORN, 1)
    encoder = 1e-6 * np.random.default_rng(0).integers(-1, 2, moving.position.shape)
    standing = Recording.from_arrays(
        'standing', moving.time, moving.position[:1] + encoder, effort=moving.effort,
        drives=(AXIS,))
    assert share_in_motion(moving.time, moving.position) > 0.9
    assert share_in_motion(standing.time, standing.position) == 0.0
    # Samples that are missing, and where the drives were taken elsewhere, are no noise.
    half = len(moving.time) // 2
    kept = np.r_[0:half, half + 500:len(moving.time)]
    jump = moving.position + 0.2 * (np.arange(len(moving.time)) > half)[:, None]
    assert share_in_motion(moving.time[kept], jump[kept]) > 0.9
    with pytest.raises(MotionError, match='no drive moves'):
        diagnose(model, [standing])
    live = LiveDiagnosis(model).with_window(standing, 0.0)
    assert live.latest == {}
    assert 'hardly moves' in live.note


# Measured efforts against the model sample by sample, without ROS.

STEP = 0.004  # [s]
SPAN = 0.5  # [s]
OFFSET = 3.0  # [N]


def test_the_running_error_forgets_what_came_before_the_clock_was_set_back():
    model = DriveModel.load()
    time = np.arange(0, 4.0, STEP)
    forces = model.drive_forces(Excitation(4.0, seed=3).motion(time))
    comparison = LiveComparison(model, span=SPAN)
    for offset, count in ((OFFSET, len(time)), (0.0, len(time) // 2)):
        for row in range(count):
            comparison.push(time[row], forces.mechanism.position[row], forces.total[row] + offset)
            if row % 10 == 0:
                comparison.evaluate()
    assert comparison.running_error().max() < OFFSET / 20


def test_a_stream_that_slows_down_is_compared_again():
    model = DriveModel.load()
    time = np.concatenate((np.arange(0, 2.0, STEP), np.arange(2.0, 6.0, 3 * STEP)))
    forces = model.drive_forces(Excitation(6.0, seed=3).motion(time))
    comparison = LiveComparison(model, span=SPAN)
    compared = []
    for row in range(len(time)):
        comparison.push(time[row], forces.mechanism.position[row], forces.total[row] + OFFSET)
        if row % 10 == 0 and (found := comparison.evaluate()) is not None:
            compared += found.time.tolist()
    assert max(compared) > 5.5
    assert comparison.running_error() == pytest.approx(np.full(6, OFFSET), rel=0.1)
    assert comparison.gaps >= 1


def compared_with(share_lost=0.0, change=lambda effort, forces: effort, span=SPAN, rest=False):
    """Return a comparison after a motion of 4 s, some of whose samples are lost."""
    rng = np.random.default_rng(2)
    model = DriveModel.load()
    time = np.arange(0, 4.0, STEP)
    motion = Excitation(4.0, seed=3).motion(time)
    if rest:
        motion = PlatformMotion.at_rest(np.tile(motion.position[:1], (len(time), 1)))
    forces = model.drive_forces(motion)
    effort = change(forces.total.copy(), forces) + rng.normal(0.0, 0.02, forces.total.shape)
    comparison, count = LiveComparison(model, span=span), 0
    for row in range(len(time)):
        if row > 100 and rng.random() < share_lost:
            continue
        comparison.push(time[row], forces.mechanism.position[row], effort[row])
        if row % 10 == 0 and (found := comparison.evaluate()) is not None:
            count += len(found.time)
    return comparison, count


def test_single_lost_samples_cost_no_window():
    whole, all_of_them = compared_with()
    lossy, most_of_them = compared_with(0.02)
    assert lossy.bridged >= 10
    assert lossy.gaps == 0
    assert most_of_them > 0.9 * all_of_them
    assert lossy.running_error() == pytest.approx(whole.running_error(), rel=0.3)


@pytest.mark.parametrize(('change', 'told'), [
    (lambda effort, forces: effort, False),
    (lambda effort, forces: 0.6 * effort, False),  # off, but not another machine
    (lambda effort, forces: effort + 0.3 * np.sign(forces.mechanism.velocity), False),
    (lambda effort, forces: 0 * effort, True),  # hardware that mirrors a controller's zeros
    (lambda effort, forces: -effort, True),
    (lambda effort, forces: 1000 * effort, True)])  # N for kN
def test_an_error_as_large_as_the_effort_is_told(change, told):
    comparison, _ = compared_with(change=change)
    lifts = {'lift_1', 'lift_2', 'lift_3'}
    assert (lifts <= set(comparison.unexplained())) == told
    if not told:
        assert comparison.unexplained() == ()


def test_static_friction_of_a_drive_that_stands_is_no_unexplained_effort():
    def stuck(effort, forces):
        effort[:, :3] += (0.7, -0.4, 0.5)
        return effort
    assert compared_with(change=stuck, rest=True)[0].unexplained() == ()
    # What holds the weight is known at rest, too.
    zero, _ = compared_with(change=lambda effort, forces: 0 * effort, rest=True)
    assert {'lift_1', 'lift_2', 'lift_3'} <= set(zero.unexplained())


@pytest.mark.parametrize(('rate', 'jitter'), [(10, 0.05), (50, 0.01), (200, 0.0), (200, 0.05)])
def test_an_exact_model_has_no_error_at_any_rate_and_with_any_jitter(rate, jitter):
    """Samples at their stamps, whose steps are uneven by a share of them."""
    model, span = DriveModel.load(), 10.0
    rng = np.random.default_rng(0)
    time = np.arange(1, span * rate - 1)
    time = (time + jitter * rng.uniform(-1, 1, len(time))) / rate
    forces = model.drive_forces(Excitation(span, seed=3).motion(time))
    comparison, residual = LiveComparison(model), []
    for row in range(len(time)):
        comparison.push(time[row], forces.mechanism.position[row], forces.total[row])
        if row % 2 and (found := comparison.evaluate()) is not None:
            residual.append(found.residual)
    residual = np.concatenate(residual)
    assert len(residual) > 0.8 * len(time) - 12
    # At 10 Hz a window lasts a second, in which the motion is not quite a polynomial.
    assert np.sqrt(np.mean(residual ** 2)) < 0.02  # [N] of 10


def test_no_stream_of_stamps_raises():
    model = DriveModel.load()
    rng = np.random.default_rng(4)
    position = model.drive_forces(Excitation(4.0, seed=3).motion([1.0])).mechanism.position[0]
    for _ in range(100):
        steps = rng.choice([1e-9, 1e-4, 0.01, 0.05, 1.0, -0.5, 0.0], 60,
                           p=rng.dirichlet(np.full(7, 0.3)))
        comparison = LiveComparison(model)
        for row, time in enumerate(np.cumsum(steps)):
            comparison.push(time, position * (1 + 1e-6 * rng.normal(size=6)), np.zeros(6))
            if row % 5 == 0:
                with suppress(PprsError):  # noise over a nanosecond is any velocity
                    comparison.evaluate()
