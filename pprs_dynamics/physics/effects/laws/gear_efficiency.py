# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Loss of a gear or screw in two quadrants: mu_d |tau| driving, mu_b |tau| driven back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples, other_exponent
from pprs_dynamics.physics.effects.effect import Parameter


class GearEfficiency(DriveEffect):
    """Losses of a gear in proportion to its torque, other ones where the load drives the motor.

    Equation
    --------
    mu_d |tau| sgn(q_dot) for tau q_dot > 0, mu_b |tau| sgn(q_dot) else, tau what gear or screw
    pass on

    Symptom
    -------
    A step at each reversal that grows with the load, like load_friction, but another one where
    a load is lifted than where it is let down: as if it were heavier and rubbed.

    Causes
    ------
    Every worm, screw, harmonic and planetary gear: teeth slide in proportion to what they
    transmit, and more so while the motor drives. Grease, wear and preload change what is in
    the data sheet.

    Confirmation
    ------------
    Lift a load slowly, hold it, let it down slowly, then with twice the load. Both steps from
    the held effort must double, each in its own size. Where they are alike it is
    load_friction. A mass or a current gain that is off changes lifting and lowering alike.

    References
    ----------
    Wang, Kim, Directional efficiency in geared transmissions: characterization of
    backdrivability towards improved proprioceptive control, ICRA, 2015.
    """

    name = 'gear_efficiency'
    is_friction = True
    at_one_load = 'asymmetric_friction'
    # A share of what the teeth carry: where the motor drives, that is the load and the loss. Less
    # loss there than driven back is a gain of all loads, which takes on what a mass explains.
    at_least: ClassVar[Mapping[str, str]] = {'driving': 'driven_back'}
    symmetric: ClassVar[Mapping[str, str]] = {
        'driving': 'load_friction', 'driven_back': 'load_friction'}
    linear = (Parameter('driving', 'mu_d', '1', 'share that is lost where the motor drives the '
                        'load: 1 / efficiency - 1', -100.0, 100.0, scale=0.05),
              Parameter('driven_back', 'mu_b', '1', 'share that is lost where the load drives the '
                        'motor: 1 - efficiency', -100.0, 100.0, scale=0.05))

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return the columns of the losses, driving and driven back.

        With a smooth sgn s both turn over as |tau| s does: (|tau| s + tau s^2) / 2 and
        (|tau| s - tau s^2) / 2.
        """
        size = abs(drive.transmitted) * drive.direction
        turned = drive.transmitted * drive.direction ** 2
        return ((size + turned) / 2, (size - turned) / 2)

    @classmethod
    def deviations(cls, drive: DriveSamples, **shape: float) -> tuple[tuple[Array, ...], ...]:
        """Return the change by another exponent of the load, as of `load_friction`."""
        return (tuple(other_exponent(drive.transmitted, row) for row in cls.columns(drive)),)
