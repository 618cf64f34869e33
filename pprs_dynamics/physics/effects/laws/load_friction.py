# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A friction coefficient of the guide that is not the model's: dmu N sgn(q_dot)."""

from __future__ import annotations

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import (
    DriveEffect,
    DriveRange,
    DriveSamples,
    other_exponent,
)
from pprs_dynamics.physics.effects.effect import Parameter


class LoadFriction(DriveEffect):
    """Force against the motion in proportion to the guide's load: mu is not what was assumed.

    Equation
    --------
    dmu N sgn(q_dot), N the load of the guide or gear

    Symptom
    -------
    A step at each reversal, like coulomb_friction, but higher where guide or gear carry more:
    with payload, at full reach, while the load accelerates.

    Causes
    ------
    A friction coefficient from a catalogue, dry, worn or dirty guides, plain guides where
    rolling ones were assumed. Teeth and bearings of every gear rub in proportion to what they
    transmit: more than before means wear or lack of grease.

    Confirmation
    ------------
    Run the drive slowly to and fro without payload, then with it, or with the arm hanging down
    and stretched out. The step at reversal must grow with the load (if it does not:
    coulomb_friction). Clean and lubricate, and repeat.

    References
    ----------
    Hamon, Gautier, Garrec, Dynamic identification of robots with a dry friction model
    depending on load and velocity, IROS, 2010.
    """

    name = 'load_friction'
    is_friction = True
    at_one_load = 'coulomb_friction'
    linear = (Parameter('coefficient', 'dmu', '1', "friction coefficient beyond the model's",
                        -100.0, 100.0, scale=0.02),)

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (N sgn q_dot,)."""
        return (drive.friction_load * drive.direction,)

    @classmethod
    def may_show(cls, covered: DriveRange) -> bool:
        """Return whether the guide carries anything that is known."""
        return covered.is_loaded

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return the change by another exponent of the load: 2/3 in Hertzian contacts."""
        return (tuple(other_exponent(drive.friction_load, row) for row in cls.columns(drive)),)
