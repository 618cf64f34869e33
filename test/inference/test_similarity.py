# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""No number of the diagnosis knows how large a robot is.

Lengths times s, times times sqrt(s), forces and masses times k: gravity stays (Froude's
similarity), and with model file and recording scaled alike the answer must be the same, scaled.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from single_axis import AXIS, axis_values

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.measurement.files.recording import Recording

pytestmark = pytest.mark.slow

# Powers of s and k by which base units scale.
POWERS = {'1': (0.0, 0.0), 'rad': (0.0, 0.0), 'm': (1.0, 0.0), 's': (0.5, 0.0), 'N': (0.0, 1.0),
          'kg': (0.0, 1.0)}
AXIS_VALUES = {**axis_values(20.0, 40.0, 6.0, -2.0), 'tolerances.links.mass': 0.02}
UNITS = {'links.mass': 'kg', 'friction.viscous': 'N s/m', 'friction.coulomb': 'N',
         'friction.offset': 'N',
         'friction.reversal_velocity': 'm/s', 'tolerances.links.mass': '1'}
HIDDEN: dict[str, dict[str, Mapping[str, float]]] = {
    'nothing': {},
    'spring and mass': {'drive_spring': {'stiffness': 30.0, 'position': 0.02},
                        'drive_inertia': {'mass': 3.0}},
    'stribeck': {'stribeck_friction': {'force': 1.5, 'velocity': 0.02}},
    'ripple': {'force_ripple': {'force': 0.8, 'pitch': 0.02, 'phase': 0.5}},
    'bump': {},
}
SCALES = [(0.2, 0.01), (5.0, 100.0)]


def factor(unit: str, s: float, k: float) -> float:
    """Return the factor by which a value in a unit scales."""
    found = 1.0
    for number, part in enumerate((unit or '1').split('/')):
        for one in part.split():
            base, _, power = one.partition('^')
            of_length, of_force = POWERS[base]
            sign = (-1 if number else 1) * int(power or 1)
            found *= (s ** of_length * k ** of_force) ** sign
    return found


@cache
def diagnosed(name: str, s: float, k: float) -> Diagnosis:
    """Return the diagnosis of an axis with something hidden, scaled."""
    hidden = HIDDEN[name]
    values = {f'effects.{effect}.{AXIS}.{key}': value for effect, block in hidden.items()
              for key, value in block.items()}
    true = DriveModel.from_parameters({**AXIS_VALUES, 'effects.active': list(hidden), **values})
    time = np.arange(0, 20, 0.002)
    omega = 2 * np.pi * np.array([0.21, 0.37, 0.83])[:, None]
    size = np.array([0.08, 0.04, 0.015])[:, None]
    phase = omega * time + np.array([0.3, 1.9, 4.0])[:, None]
    q = (size * np.sin(phase)).sum(0)[:, None]
    motion = JointMotion(q, (size * omega * np.cos(phase)).sum(0)[:, None],
                         -(size * omega ** 2 * np.sin(phase)).sum(0)[:, None], time=time)
    force = true.drive_forces(motion).total
    if name == 'bump':
        force = force + 1.5 * np.exp(-0.5 * ((q - 0.03) / 0.008) ** 2)
    noise = 0.3 * np.random.default_rng(4).normal(size=force.shape)
    model = DriveModel.from_parameters({key: value * factor(UNITS[key], s, k)
                         for key, value in AXIS_VALUES.items()})
    recording = Recording.from_arrays('axis', np.sqrt(s) * time, s * q, None,
                                      k * (force + noise), (AXIS,))
    return diagnose(model, [recording])


def said(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what has no unit in an answer."""
    return {'verdict': diagnosis.verdict,
            'effects': sorted((one.name, one.drives) for one in diagnosis.effects),
            'rivals': sorted(diagnosis.indistinguishable),
            'depends': sorted({(one.drive, one.variable) for one in diagnosis.depends_on})}


@pytest.mark.parametrize('name', HIDDEN)
@pytest.mark.parametrize(('s', 'k'), SCALES)
def test_a_scaled_robot_has_the_same_diagnosis(name: str, s: float, k: float) -> None:
    usual = diagnosed(name, 1.0, 1.0)
    assert said(usual)['effects'] == sorted((effect, (AXIS,)) for effect in HIDDEN[name])
    assert_alike(usual, diagnosed(name, s, k), s, k)


def assert_alike(usual: Diagnosis, other: Diagnosis, s: float, k: float) -> None:
    """Assert that a scaled robot's diagnosis says the same, with scaled values."""
    assert said(other) == said(usual)
    for one, again in zip(usual.effects, other.effects, strict=True):
        for key, estimate in one.parameters.items():
            by = factor(estimate.unit, s, k)
            value = again.parameters[key]
            assert value.value == pytest.approx(by * estimate.value, abs=2 * by * estimate.std)
            # Both sides are means over 10 ms, of 2 to 11 samples here: reversals are smeared by
            # another share, which tells widths and what falls off with speed better or worse.
            assert value.std == pytest.approx(by * estimate.std, rel=0.4)
