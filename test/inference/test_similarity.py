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

from pprs_dynamics import AxisModel, AxisMotion
from pprs_dynamics.inference.diagnosis.diagnose import Diagnosis, diagnose
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.three_pprs.robot import AXIS

# Powers of s and k by which a unit scales.
POWERS = {'1': (0, 0), 'm': (1, 0), 'm/s': (0.5, 0), 'N': (0, 1), 'kg': (0, 1), 's': (0.5, 0),
          'N s/m': (-0.5, 1), 'N s^2/m^2': (-1, 1), 'N/m': (-1, 1), 'rad': (0, 0)}
AXIS_VALUES = {'axis.mass': 20.0, 'axis.viscous': 40.0, 'axis.coulomb': 6.0, 'axis.offset': -2.0,
               'friction.reversal_velocity': 0.001, 'tolerances.axis.mass': 0.02}
UNITS = {'axis.mass': 'kg', 'axis.viscous': 'N s/m', 'axis.coulomb': 'N', 'axis.offset': 'N',
         'friction.reversal_velocity': 'm/s', 'tolerances.axis.mass': '1'}
HIDDEN: dict[str, dict[str, Mapping[str, float]]] = {
    'nothing': {},
    'spring and mass': {'drive_spring': {'stiffness': 30.0, 'position': 0.02},
                        'drive_inertia': {'mass': 3.0}},
    'stribeck': {'stribeck_friction': {'force': 1.5, 'velocity': 0.02}},
    'ripple': {'force_ripple': {'force': 0.8, 'pitch': 0.02, 'phase': 0.5}},
    'bump': {},
}
SCALES = [(0.2, 0.01), (5.0, 100.0), (0.2, 100.0), (5.0, 0.01)]


def factor(unit: str, s: float, k: float) -> float:
    """Return the factor by which a value in a unit scales."""
    of_length, of_force = POWERS[unit]
    return float(s ** of_length * k ** of_force)


@cache
def diagnosed(name: str, s: float, k: float) -> Diagnosis:
    """Return the diagnosis of an axis with something hidden, scaled."""
    hidden = HIDDEN[name]
    values = {f'effects.{effect}.{AXIS}.{key}': value for effect, block in hidden.items()
              for key, value in block.items()}
    true = build_model({**AXIS_VALUES, 'effects.active': list(hidden), **values})
    assert isinstance(true, AxisModel)
    time = np.arange(0, 20, 0.002)
    omega = 2 * np.pi * np.array([0.21, 0.37, 0.83])[:, None]
    size = np.array([0.08, 0.04, 0.015])[:, None]
    phase = omega * time + np.array([0.3, 1.9, 4.0])[:, None]
    q = (size * np.sin(phase)).sum(0)[:, None]
    motion = AxisMotion(q, (size * omega * np.cos(phase)).sum(0)[:, None],
                        -(size * omega ** 2 * np.sin(phase)).sum(0)[:, None], time=time)
    force = true.drive_forces(motion).total
    if name == 'bump':
        force = force + 1.5 * np.exp(-0.5 * ((q - 0.03) / 0.008) ** 2)
    noise = 0.3 * np.random.default_rng(4).normal(size=force.shape)
    model = build_model({key: value * factor(UNITS[key], s, k)
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
    usual, scaled = diagnosed(name, 1.0, 1.0), diagnosed(name, s, k)
    assert said(scaled) == said(usual)
    assert said(usual)['effects'] == sorted((effect, (AXIS,)) for effect in HIDDEN[name])
    for one, other in zip(usual.effects, scaled.effects, strict=True):
        for key, estimate in one.parameters.items():
            by = factor(estimate.unit, s, k)
            again = other.parameters[key]
            assert again.value == pytest.approx(by * estimate.value, abs=2 * by * estimate.std)
            # Both sides are means over 10 ms, of 2 to 11 samples here: reversals are smeared by
            # another share, which tells widths and what falls off with speed better or worse.
            assert again.std == pytest.approx(by * estimate.std, rel=0.4)
