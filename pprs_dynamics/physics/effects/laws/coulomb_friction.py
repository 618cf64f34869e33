# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Dry friction of a drive that does not depend on its guide's load: F sgn(q_dot)."""

from __future__ import annotations

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter


class CoulombFriction(DriveEffect):
    """Force of constant size against the motion: seals, preloaded nuts and bearings.

    Equation
    --------
    F sgn(q_dot)

    Symptom
    -------
    A square wave: one level while the drive moves forwards, its negative backwards, a step at
    each reversal. The same at every speed and load.

    Causes
    ------
    Preload of guides, nut or bearings, wipers and seals, a brake that drags.

    Confirmation
    ------------
    Run the drive slowly to and fro, with and without payload: half the step at reversal is F,
    and the payload must not change it (if it does: load_friction). Loosen preload or wiper and
    repeat.

    References
    ----------
    Armstrong-Helouvry, Dupont, Canudas de Wit, A survey of models, analysis tools and
    compensation methods for the control of machines with friction, Automatica 30, 1994.
    """

    name = 'coulomb_friction'
    is_friction = True
    at_one_load = 'load_friction'
    linear = (Parameter('force', 'F', 'N', 'size of the friction force', -1e6, 1e6, scale=0.5),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (sgn q_dot,)."""
        return (drive.direction,)
