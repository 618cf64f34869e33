# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Presliding: a friction force that builds up over a distance after each reversal (Dahl).

The Dahl state z in [-1, 1] follows dz = (s - z) / x_d |dq|, s = sgn(dq). From a reversal at q_r,
z_r on, the solution is z = s + (z_r - s) exp(-|q - q_r| / x_d). The effect adds
(F + mu N) (z - sgn q_dot): the difference of presliding from the Coulomb friction of the model,
which is constant or proportional to the guide's load N. A motion that reverses within a sample is
not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter

# Distances that are tried: give of guides, nuts and seals; of gears and their bearings.
PUSHED, TURNED = (3e-5, 5e-3), (2e-4, 5e-2)  # [m], [rad]


class Hysteresis(DriveEffect):
    """Elastic give of the contacts before they slide: preloaded ball guides, seals, belts.

    Equation
    --------
    (F + mu N) (z - sgn q_dot), dz/dq = (1 - z sgn q_dot) / x_d

    Symptom
    -------
    A spike after each reversal, where the model already asks for full friction and the drive
    does not yet need it. It decays with the distance moved, not with time or speed, and over
    position the force draws loops.

    Causes
    ------
    Elastic give of preloaded ball guides, nuts, seals and wipers before they slide. A toothed
    belt. Play has a similar look, but a dead zone instead of a slope.

    Confirmation
    ------------
    Move the drive to and fro by less than a millimetre, slowly, and draw force over position:
    a loop with rounded flanks, the same at half the speed. Reduce the preload and repeat: it
    must shrink.

    References
    ----------
    Dahl, A solid friction model, The Aerospace Corporation TOR-0158(3107-18)-1, 1968. Canudas
    de Wit, Olsson, Astrom, Lischinsky, A new model for control of systems with friction, IEEE
    Trans. Automatic Control 40, 1995.
    """

    name = 'hysteresis'
    assumed_at_start = 'the contacts are relaxed, friction builds up first'
    is_friction = True
    linear = (Parameter('force', 'F', 'N', 'friction force that builds up', -1e6, 1e6, 0.0, 0.5),
              Parameter('coefficient', 'mu', '1', 'friction per guide load that builds up', -1e3,
                        1e3, 0.0, 0.05))
    variants = (('force',), ('coefficient',), ('force', 'coefficient'))
    shape = (Parameter('distance', 'x_d', 'm', 'distance over which it builds up', 1e-7, 0.1,
                       scale=1e-4, turning=(1e-6, 1.0)),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return z - sgn q_dot alone and times N, and advance the memory to the last sample."""
        change = presliding(drive.position, shape['distance'], drive.memory) - drive.direction
        return (change, drive.friction_load * change)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return distances from 0.03 to 5 mm, of a drive that turns from 0.01 to 3 degrees."""
        shortest, longest = TURNED if covered.turns else PUSHED
        return [{'distance': float(x_d)} for x_d in np.geomspace(shortest, longest, 12)]

    @classmethod
    def drive_memory(cls, start: float | None = None) -> Any:
        """Return the last position, None before the first, and where the drive last reversed."""
        return {'position': None, 'side': 0.0, 'q_r': 0.0, 'z_r': 0.0}


def presliding(q: Array, x_d: float, memory: Any = None) -> Array:
    """Return the Dahl state z at positions q (N,), from z = 0 or where `memory` left off."""
    if memory is None:
        memory = Hysteresis.drive_memory()
    if memory['position'] is None:
        memory['position'] = memory['q_r'] = float(q[0])
    before = np.concatenate(([memory['position']], q[:-1]))
    # A standstill keeps the side from which it was reached.
    moved = np.concatenate(([memory['side']], np.sign(q - before)))
    moving = np.maximum.accumulate(np.where(moved != 0, np.arange(len(moved)), 0))
    side = moved[moving]
    turned = side[1:] != side[:-1]
    run, turns = np.cumsum(turned), np.flatnonzero(turned)
    # By monotonic run, the one that the memory left off in first.
    s = np.concatenate(([memory['side']], side[1:][turns]))
    q_r = np.concatenate(([memory['q_r']], before[turns]))
    grown = np.exp(-np.abs(np.diff(q_r, append=q_r[-1])) / x_d)
    last = memory['z_r']
    z_r = [last]
    for direction, left in zip(s[:-1].tolist(), grown[:-1].tolist(), strict=True):
        last = direction + (last - direction) * left
        z_r.append(last)
    z: Array = s[run] + (np.array(z_r) - s)[run] * np.exp(-np.abs(q - q_r[run]) / x_d)
    memory.update(position=float(q[-1]), side=float(s[-1]), q_r=float(q_r[-1]), z_r=last)
    return z
