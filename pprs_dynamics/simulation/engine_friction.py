# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Friction in every joint of the simulated robot, by the model file's numbers.

A joint resists with c v + mu N tanh(v / v_rev); a spherical joint along the relative angular
velocity of rod and platform. N comes from the engine's inverse dynamics. The width v_rev may
differ from the model's: that is one of the ways in which a robot is unlike its model.

Arrays of 12 hold the drives, C_1..C_3, A_1..A_3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array

# Speeds are taken as at least this share of the width: tanh(s)/s is 1 there to rounding.
SMALLEST_SHARE = 1e-6


class EngineFriction:
    """Friction of drives and passive joints.

    Parameters
    ----------
    values : mapping
        Flat keys and values of a model file.
    drive_width : float or (6,) array
        Width in which the drives' friction turns over, as a multiple of the model file's.
    passive_width : float
        The same for the passive joints.
    present : bool
        False for a robot without friction.
    """

    def __init__(self, values: Mapping[str, Any], drive_width: float | Array = 1.0,
                 passive_width: float = 1.0, present: bool = True) -> None:
        joints = [{key: values[f'friction.{joint}.{key}'] for key in
                   ('viscous', 'coulomb', 'diameter')} for joint in ('revolute', 'spherical')]
        self.viscous = np.concatenate((
            values['friction.drives.viscous'], *([joint['viscous']] * 3 for joint in joints)))
        self.dry = np.concatenate((
            values['friction.drives.coulomb'],
            *([joint['coulomb'] * joint['diameter'] / 2] * 3 for joint in joints)))
        self.width = np.concatenate((
            np.broadcast_to(np.multiply(drive_width, values['friction.reversal_velocity']), 6),
            np.full(6, passive_width * values['friction.reversal_rate'])))
        if not present:
            self.viscous, self.dry = np.zeros(12), np.zeros(12)
        self.smallest_squares = (SMALLEST_SHARE * self.width) ** 2

    def resist(self, squares: Array, loads: Array) -> tuple[Array, Array]:
        """Return force per speed, (..., 12), and the drives' slopes over speed, (..., 6).

        Parameters
        ----------
        squares : (..., 12) array
            Of the speeds in the joints [m^2/s^2, rad^2/s^2].
        loads : (..., 12) array
            N [N].
        """
        speeds = np.sqrt(squares + self.smallest_squares)
        sign = np.tanh(speeds / self.width)
        dry = self.dry * loads
        resistances: Array = self.viscous + dry * sign / speeds
        sign = sign[..., :6]
        slopes: Array = self.viscous[:6] + dry[..., :6] / self.width[:6] * (1.0 - sign * sign)
        return resistances, slopes
