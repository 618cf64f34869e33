# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Dry friction that falls with the speed: (F_s + mu_s N) exp(-|q_dot / v_s|^d) sgn(q_dot).

No load changes its size, or it follows the load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter

# Tried; below it friction turns over, and Stribeck's fall cannot be told.
SLOWEST, SLOWEST_TURN = 1e-3, 1e-2  # [m/s], [rad/s]
FASTEST, FASTEST_TURN = 10.0, 100.0
EXPONENTS = (2.0, 1.0)


class StribeckFriction(DriveEffect):
    """Extra friction at low speed: boundary lubrication in greased guides and screws.

    Equation
    --------
    (F_s + mu_s N) exp(-|q_dot / v_s|^d) sgn(q_dot)

    Symptom
    -------
    A peak on either side of each reversal and wherever the drive creeps, none at speed. Over
    velocity, friction that first falls and then rises.

    Causes
    ------
    Boundary lubrication: guides or nut run dry, the wrong or aged grease, plain guides under
    load. It goes with stick-slip at creep.

    Confirmation
    ------------
    Run the drive at constant speeds from creep upwards: force must fall with speed before it
    rises. Lubricate and repeat: the peak must shrink.

    References
    ----------
    Bo and Pavelescu, The friction-speed relation and its influence on the critical velocity of
    stick-slip motion, Wear 82, 1982. Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica
    30, 1994.
    """

    name = 'stribeck_friction'
    is_friction = True
    linear = (Parameter('force', 'F_s', 'N', 'breakaway force beyond Coulomb friction', -1e6, 1e6,
                        0.0, scale=0.5),
              Parameter('coefficient', 'mu_s', '1', 'the same per load', -100.0, 100.0, 0.0,
                        scale=0.02))
    shape = (Parameter('velocity', 'v_s', 'm/s', 'Stribeck velocity', 1e-6, FASTEST, scale=0.01,
                       turning=(1e-6, FASTEST_TURN)),
             Parameter('exponent', 'd', '1', 'steepness: 2 Gaussian, 1 exponential', 0.5, 4.0,
                       default=2.0))
    variants = (('force',), ('coefficient',), ('force', 'coefficient'))

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (exp(-|q_dot / v_s|^d) sgn q_dot, and N times that)."""
        slowness = np.abs(drive.velocity / shape['velocity']) ** shape['exponent']
        peak = np.exp(-slowness) * drive.direction
        return (peak, drive.friction_load * peak)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return velocities from 1 mm/s, or 0.01 rad/s, to half the top speed.

        With either exponent.
        """
        slowest, limit = ((SLOWEST_TURN, FASTEST_TURN) if covered.turns else (SLOWEST, FASTEST))
        fastest = np.clip(covered.top_speed / 2, 1e-5, limit)
        velocities = np.geomspace(min(slowest, fastest / 10), fastest, 12)
        return [{'velocity': float(velocity), 'exponent': exponent}
                for exponent in EXPONENTS for velocity in velocities]
