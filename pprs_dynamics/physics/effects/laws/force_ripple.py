# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Force that repeats with position: A sin(2 pi q / p + phi), and its second harmonic.

Linear in the amplitudes of sine and cosine, A cos(phi) and A sin(phi). q is the drive's position
as in joint_states, so that phi depends on where the drive has its zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import Parameter, Wave

SHORTEST = 8e-4  # [m], pitch tried
FEWEST = 3  # periods over the stroke; fewer are a spring's curve as well
MOST = 120  # periods over the stroke, tried
# Half a step puts a trial out of step with the truth by pi/4 at most at the ends of the stroke.
STEP = 0.5  # periods over the stroke from trial to trial
TURN = 2 * math.pi


class ForceRipple(DriveEffect):
    """Force that repeats with each turn or pole: screw, gear or motor cogging.

    Equation
    --------
    A sin(2 pi q / p + phi) + A_2 sin(4 pi q / p + phi_2)

    Symptom
    -------
    A wave over position, always at the same places, both ways and at any speed. Over time its
    frequency follows the speed.

    Causes
    ------
    Cogging of the motor (p is the pole pitch, or lead / poles), a bent or eccentric screw (p
    is the lead), balls entering a nut or carriage, gear or belt teeth. The wave generator of a
    harmonic drive ripples twice a turn of the motor (p is pi over the gear ratio).

    Confirmation
    ------------
    Compare p with lead, pole pitch and tooth pitch, or 2 pi / p with the gear ratio. Creep
    along the stroke both ways: peaks must stay in place. Turn the motor against the screw by
    half a period at the coupling and repeat: cogging moves with the motor.

    References
    ----------
    Van den Braembussche, Swevers, Van Brussel, Vanherck, Accurate tracking control of linear
    synchronous motor machine tool axes, Mechatronics 6, 1996.
    """

    name = 'force_ripple'
    linear = (
        Parameter('force', 'A', 'N', 'amplitude', 0.0, 1e6, scale=0.3),
        Parameter('phase', 'phi', 'rad', 'phase at position 0', -TURN, TURN),
        Parameter('second', 'A_2', 'N', 'amplitude of the second harmonic', 0.0, 1e6, 0.0, 0.3),
        Parameter('second_phase', 'phi_2', 'rad', 'its phase at position 0', -TURN, TURN, 0.0))
    shape = (Parameter('pitch', 'p', 'm', 'distance of one period', 1e-6, 10.0, scale=1e-3),)
    scanned = ('sine', 'cosine')
    is_wave = True
    variants = (('sine', 'cosine'), ('sine', 'cosine', 'second_sine', 'second_cosine'))
    waves = (Wave('force', 'phase'), Wave('second', 'second_phase', 'second_sine', 'second_cosine'))

    @classmethod
    def columns(cls, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return sine and cosine of 2 pi q / p and of 4 pi q / p."""
        turn = TURN * drive.position / shape['pitch']
        sine, cosine = np.sin(turn), np.cos(turn)
        return (sine, cosine, 2 * sine * cosine, 1 - 2 * sine * sine)

    @classmethod
    def averaged(cls, drive: DriveSamples, period: float,
                 shapes: Sequence[Mapping[str, float]]) -> Array:
        """Return the first harmonic's columns of many shapes, averaged over `period`.

        Parameters
        ----------
        drive : DriveSamples
            Means over `period` [s] of N blocks.
        period : float
        shapes : sequence of mappings
            With `pitch`.

        Returns
        -------
        (S, 2, N) array
            In single precision. A wave passed at steady speed keeps sinc(v period / p) of its
            height in the mean.
        """
        waves = 1 / np.array([shape['pitch'] for shape in shapes])[:, None]
        kept = np.sinc((waves * drive.velocity * period).astype(np.float32))
        passed = waves * drive.position
        turn = np.float32(TURN) * (passed - np.floor(passed)).astype(np.float32)
        return np.stack((kept * np.sin(turn), kept * np.cos(turn)), axis=1)

    @classmethod
    def trials(cls, covered: DriveRange) -> Sequence[Mapping[str, float]]:
        """Return pitches from the stroke down to a 120th of it or 0.8 mm, evenly in stroke / p.

        Of a gear those of one and of two waves a turn of the motor, too.
        """
        stroke = np.clip(covered.stroke, 1e-5, 10.0)
        most = np.clip(stroke / SHORTEST, 1, MOST)
        of_gear = [TURN / (waves * covered.gear_ratio) for waves in (1, 2)]
        return [{'pitch': float(pitch)} for pitch in (
            *(stroke / np.arange(FEWEST, max(most, FEWEST) + STEP / 2, STEP)),
            *(of_gear if covered.gear_ratio > 1 else ()))]
