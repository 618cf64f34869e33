# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Times that go back: every effect begins anew, and no force grows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pprs_dynamics import DriveModel, PlatformMotion
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.mechanism.paths import HelicalPath
from pprs_dynamics.physics.model.forces import ModelState

PAPER = DriveModel.load()
STEPS = 0.01 * np.arange(40)
MOTION = HelicalPath().motion(1.0 + STEPS)


def with_effect(name: str) -> DriveModel:
    """Return the paper's robot with an effect on its first drive, or on the platform."""
    effect = PAPER.bound(CATALOGUE[name])
    if name == 'measured_curve':
        own = {'variable': 'position', 'from': -1.0, 'to': 1.0, 'values': [0.0, 1.0, 2.0]}
    else:
        own = {each.name: float(np.clip(
            0.3 if math.isinf(each.upper) or each.upper > 1 else each.upper / 2,
            each.lower, each.upper)) for each in effect.parameters}
    place = f'effects.{name}.{DRIVES[0]}' if issubclass(effect, DriveEffect) or name == (
        'measured_curve') else f'effects.{name}'
    model = DriveModel.from_parameters({**PAPER.values, 'effects.active': [name],
                         **{f'{place}.{key}': value for key, value in own.items()}})
    return model


def efforts(model: DriveModel, state: ModelState, start: float, motion: PlatformMotion,
            step: int = 1) -> np.ndarray:
    """Return measured efforts of a stream of samples from a time on, so many at a time."""
    found = []
    for k in range(0, len(motion), step):
        piece = motion[k:k + step].with_time(start + STEPS[k:k + step])
        forces = model.drive_forces(piece, state)
        found.append(model.measured(forces, state).total)
    return np.concatenate(found)


# Of other robots, and without a memory.
ELSEWHERE = {'counterbalance', 'coupled_drives', 'eccentric_encoder'}


def test_every_effect_with_a_memory_is_tried() -> None:
    for name in ELSEWHERE:
        effect = CATALOGUE[name]
        assert not (issubclass(effect, DriveEffect) and effect.drive_memory())


@pytest.mark.parametrize('name', [name for name in CATALOGUE if name not in ELSEWHERE])
@pytest.mark.parametrize('start', [5.0])
def test_an_effect_begins_anew_and_gives_what_it_gave_at_first(name: str, start: float) -> None:
    model = with_effect(name)
    state, fresh = model.initial_state(), model.initial_state()
    efforts(model, state, 1000.0, MOTION)
    again = efforts(model, state, start, MOTION)
    assert np.isfinite(again).all()
    np.testing.assert_array_equal(again, efforts(model, fresh, start, MOTION))


def test_a_stream_that_goes_on_remembers() -> None:
    model = with_effect('hysteresis')
    state = model.initial_state()
    efforts(model, state, 1000.0, MOTION)
    later = efforts(model, state, 1000.0 + len(STEPS) * 0.01, MOTION)
    assert np.abs(later - efforts(model, model.initial_state(), 0.0, MOTION)).max() > 0.01
