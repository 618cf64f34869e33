# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hidden forces in drives whose form is off by 5 to 15 %, as those of a machine are.

The force is multiplied by 1 + s g(q, v), with g two waves, over position and velocity, of rms 1.
"""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.simulation.injected_effect import DriveForce, DriveMoment
from pprs_dynamics.simulation.injected_effects import IN_CATALOGUE
from pprs_dynamics.simulation.injected_forces import effort_offset, gear_efficiency

OFF = (0.05, 0.15)  # s
WAVELENGTHS = (0.05, 0.3)  # [m]
WAVES_OF_VELOCITY = (0.05, 0.3)  # [m/s]
CAN_BE_OFF = tuple(name for name, effect in IN_CATALOGUE.items()
                   if issubclass(effect, DriveForce)
                   # A constant; and what came after the public problems were drawn.
                   and effect not in (effort_offset, gear_efficiency))


def off_form(effect: DriveForce, rng: np.random.Generator) -> DriveForce:
    """Return the effect with a form of its own in all drives that have it."""
    share = rng.uniform(*OFF)
    length, wave = np.exp(rng.uniform(*np.log((WAVELENGTHS, WAVES_OF_VELOCITY)).T))
    phases = rng.uniform(0, 2 * np.pi, 2)
    kind = type(effect)

    def force(self: DriveForce, moment: DriveMoment) -> Array:
        own: Array = kind.force(self, moment)
        return own * (1 + share * (np.cos(2 * np.pi * moment.position / length + phases[0])
                                   + np.cos(2 * np.pi * moment.velocity / wave + phases[1])))

    effect.__class__ = type(kind.__name__, (kind,), {
        'force': force, 'form': f'({kind.form}) (1 + {share:.2f} g(q, v))'})
    return effect
