# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""An offset that begins within a recording is dated, and what has a place is no event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_once import diagnose
from single_axis import axis, axis_recording

from pprs_dynamics import DriveModel, Recording
from pprs_dynamics.physics.mechanism.paths import Excitation


@pytest.mark.parametrize('since', [1.005, 7.995])
def test_an_offset_that_begins_is_no_slow_noise_and_no_pattern_of_time(since: float) -> None:
    model, time = DriveModel.load(), np.arange(1000) * 0.01
    forces = model.drive_forces(Excitation(10.0, seed=4).motion(time))
    effort = forces.total + 0.05 * np.random.default_rng(1).normal(size=forces.total.shape)
    effort[since < time, 3] += 0.5  # [N]
    found = diagnose(model, [Recording.from_arrays(
        'changing', time, forces.mechanism.position, None, effort)])
    assert found.verdict in ('effect', 'ambiguous')
    effect, = found.effects
    assert (effect.name, effect.drives) == ('effort_offset', ('lift_1',))
    assert found.to_dict()['effects'][0]['since'] == pytest.approx(since, abs=0.02)


def test_an_offset_that_begins_is_no_friction_with_more_coefficients() -> None:
    """The scan of onsets finds other effects first, and their times."""
    run = axis_recording(axis(), seed=4)
    late = replace(run, effort=run.effort + 6.0 * (run.time > 5.5)[:, None])
    effect, = diagnose(axis(), [late]).effects
    assert (effect.name, effect.when) == ('effort_offset', ' since 5.5 s')


def test_friction_that_depends_on_the_position_is_no_passing_event() -> None:
    """At 0.12 m the axis is three times, for 0.3 s each: the error looked like contacts then."""
    run = axis_recording(axis(), seed=4)
    sign = np.tanh(np.gradient(run.position, run.time, axis=0) / 0.001)
    dirt = 3.0 * np.exp(-((run.position - 0.12) / 0.02) ** 2) * sign
    found = diagnose(axis(), [replace(run, effort=run.effort + dirt)])
    assert found.verdict == 'unknown'
    assert {statement.variable for statement in found.depends_on} == {'position'}
    assert not any(effect.course for effect in found.effects)
