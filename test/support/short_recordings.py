# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's recordings with hidden effects, shorter than it makes them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from cached import cached

from benchmarks.hidden import recordings
from benchmarks.scores import adoption
from pprs_dynamics import DriveModel
from pprs_dynamics.measurement.files.recording import Recording


@contextmanager
def short_recordings(duration: float) -> Iterator[None]:
    """Let recordings last that long [s]; what was prepared for others is forgotten."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recordings, 'DURATION', duration)
        forget()
        yield
    forget()


def forget() -> None:
    """Empty the caches of scenes and motions."""
    recordings.scene.cache_clear()
    recordings._motion.cache_clear()


def hidden_friction() -> HiddenFriction:
    """Return the robot with hidden Coulomb friction that adoption is tested on."""
    found: HiddenFriction = cached(record_hidden_friction, 'coulomb_friction', 7, 15.0)
    return found


@dataclass(frozen=True)
class HiddenFriction:
    """A robot's model, its noise [N], and recordings of two motions with and without friction."""

    model: DriveModel
    noise: float
    recordings: tuple[Recording, Recording]
    healthy: tuple[Recording, Recording]


def record_hidden_friction(effect: str, seed: int, duration: float) -> HiddenFriction:
    with short_recordings(duration):
        robot = adoption.Robot(adoption.Case('effects', (effect,), seed, 3.0, width=1.0))
        recordings = robot.recordings()
        robot.effects = []
        return HiddenFriction(robot.model, robot.noise, recordings, robot.recordings())
