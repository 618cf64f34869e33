# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Encoders that are not where the link is: clearances that loads or reversals cross."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up_arm
import numpy as np
import pytest
from planar_arm import planar_arm

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.lost_motion import LostMotion, behind_play
from pprs_dynamics.physics.model.drive_model import DriveModel

SWING = 1  # the joint that carries weight
TIME = np.arange(0, 12, 0.005)
NOISE = 0.05  # [N m]


def recorded(model: DriveModel, position: Array, effort: Array, time: Array) -> Recording:
    noise = NOISE * np.random.default_rng(3).normal(size=effort.shape)
    grain = 1e-5 * np.random.default_rng(4).normal(size=position.shape)
    return Recording.from_arrays('run', time, position + grain, None, effort + noise, model.drives)


def with_play(model: DriveModel, play: float, width: float = 0.05) -> Recording:
    """Record a motor that crosses a play while the link turns over: faster than the link."""
    moved = made_up_arm.motion(20.0)
    position = moved.position.copy()
    position[:, SWING] += play / 2 * np.tanh(moved.velocity[:, SWING] / width)
    return recorded(model, position, model.drive_forces(moved).total, moved.time)


def with_backlash(model: Any, backlash: float) -> Recording:
    """Record a motor that moves smoothly while the link falls to the side of its load."""
    moved = made_up_arm.motion(20.0)
    load = model.drive_forces(moved).mechanism.transmitted[:, SWING]
    position = moved.position.copy()
    position[:, SWING] -= backlash / 2 * np.sign(load)
    forces = model.drive_forces(replace(moved, position=position)).total
    return recorded(model, moved.position, forces, moved.time)


def found_on(model: DriveModel, recording: Recording) -> tuple[Diagnosis, list[object]]:
    found = diagnose(model, [recording])
    return found, [(one.name, one.drives) for one in found.effects]


@pytest.mark.parametrize('play', [0.02])
def test_behind_a_play_is_the_link(play: float) -> None:
    """The encoder leads by tanh; the law knows neither the tanh nor how fast it turns over."""
    link, speed = 0.4 * np.sin(2 * TIME), 0.8 * np.cos(2 * TIME)
    encoder = link + play / 2 * np.tanh(speed / 0.05)
    found = behind_play(encoder, play)
    assert np.abs(encoder - link).max() == pytest.approx(play / 2, rel=1e-3)
    inside = slice(100, -100)
    assert np.abs(found - link)[inside].max() < 0.2 * play
    before, after = (np.gradient(one - link, TIME)[inside] for one in (encoder, found))
    assert np.abs(after).max() < 0.25 * np.abs(before).max()


def test_loads_choose_the_flank() -> None:
    effect = LostMotion({'lift_1': {'backlash': 0.004, 'play': 0.01}})
    load = np.array([[5.0, -30.0], [5.0, 10.0]])
    error = effect.loaded_position_error(('slide_1', 'lift_1'), load)
    np.testing.assert_allclose(error, [[0.0, -0.002], [0.0, 0.002]], rtol=1e-12)


@pytest.mark.parametrize('size', [0.008, pytest.param(0.03, marks=pytest.mark.slow)])
def test_play_at_reversals_is_lost_motion(tmp_path: Path, size: float) -> None:
    model = made_up_arm.real_arm(tmp_path)
    found, named = found_on(model, with_play(model, size))
    assert named[0] == ('lost_motion', ('swing',))
    assert found.effects[0].parameters['swing.play'].value == pytest.approx(size, rel=0.15)


def test_backlash_by_the_side_of_the_load_is_lost_motion(tmp_path: Path) -> None:
    model = planar_arm(tmp_path, 3)  # it hangs: loads change sign
    found, named = found_on(model, with_backlash(model, 0.03))
    assert named[0] == ('lost_motion', ('j2',))
    assert found.effects[0].parameters['j2.backlash'].value == pytest.approx(0.03, rel=0.15)


@pytest.mark.parametrize(('name', 'values'), [
    ('homing_error', {'zero': 0.015}),
    ('hysteresis', {'force': 2.0, 'coefficient': 0.0, 'distance': 0.02})])
def test_what_it_is_taken_for_stays_what_it_is(tmp_path: Path, name: str,
                                               values: dict[str, float]) -> None:
    model = made_up_arm.real_arm(tmp_path)
    other = DriveModel.from_parameters({**model.values, 'effects.active': [name],
                         **{f'effects.{name}.swing.{key}': one for key, one in values.items()}},
                        model.source)
    moved = made_up_arm.motion(20.0)
    forces = other.measured(other.drive_forces(moved)).total
    recording = recorded(model, moved.position + other.position_error(moved.position), forces,
                         moved.time)
    _, named = found_on(model, recording)
    assert (name, ('swing',)) in named
    assert 'lost_motion' not in [one for one, _ in named]
