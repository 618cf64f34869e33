# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot with hidden friction that adoption is tested on, with short recordings."""

from __future__ import annotations

from dataclasses import dataclass

from cached import cached

from benchmarks.scores import adoption
from pprs_dynamics import DriveModel
from pprs_dynamics.measurement.files.recording import Recording


@dataclass(frozen=True)
class HiddenFriction:
    """A robot's model, its noise [N], and recordings of two motions with and without friction."""

    model: DriveModel
    noise: float
    recordings: tuple[Recording, Recording]
    healthy: tuple[Recording, Recording]


def hidden_friction() -> HiddenFriction:
    """Return the robot with hidden Coulomb friction that adoption is tested on."""
    found: HiddenFriction = cached(record_hidden_friction, 'coulomb_friction', 7, 15.0)
    return found


def record_hidden_friction(effect: str, seed: int, duration: float) -> HiddenFriction:
    robot = adoption.Robot(adoption.Case(
        'effects', (effect,), seed, 3.0, width=1.0, duration=duration))
    recordings = robot.recordings()
    robot.effects = []
    return HiddenFriction(robot.model, robot.noise, recordings, robot.recordings())
