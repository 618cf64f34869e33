# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A joint that winds up: the motor's encoder leads the link by w, k w + d w' = tau.

Positions are those before the gear. Without a second encoder w is tau / k, and its rates are
neglected. Where the link has one, it says what the link does, and its wind-up what it carries:
k w + d w' with k and d as they explain what gear or screw pass on. Friction is the motor's, whose
speed is as read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect, Windup
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM

LINK_POSITION = 'link_position'
# Usual compliances of screws and belts, of gears and shafts [m/N, rad/(N m)].
SOFT = (2e-6, 3e-4)


class ElasticJoint(MeasurementEffect):
    """Gear, shaft or belt that winds up between an encoder on the motor and the link.

    Equation
    --------
    motor position = q + w, k w + d w_dot = tau

    Symptom
    -------
    Weight and inertia as of a displaced drive, in proportion to its load, and
    shakes after jerks. The difference to an encoder on the link follows the load.

    Causes
    ------
    The flexspline of a harmonic drive, a belt, a long shaft or screw. More than before: a
    crack, a loose clamp, a worn belt.

    Confirmation
    ------------
    Lock the motor, load the link by known weights, and read its own encoder: slope and width
    of the loop are 1/k and the loss. Without one a dial gauge does.

    References
    ----------
    Spong, Modeling and control of elastic joint robots, ASME J. Dynamic Systems, Measurement,
    and Control 109, 1987.
    """

    name = 'elastic_joint'
    acts_in = frozenset({PLATFORM, MECHANISM})
    nonlinear = True
    linear = (
        Parameter('compliance', '1/k', 'm/N', 'lead of the motor over the link per load', -1.0,
                  1.0, scale=1e-6, expected=SOFT, turning=(-10.0, 10.0)),
        Parameter('loss', 'd/k', 's', 'loss over stiffness: time by which wind-up lags its load',
                  -10.0, 10.0, 0.0, scale=0.01, expected=(0.03, 0.03)))
    is_positive = True

    @classmethod
    def sizes_seen(cls, windup: Windup) -> Mapping[str, float]:
        """Return compliance and loss."""
        return {'compliance': windup.compliance, 'loss': abs(windup.loss)}

    def loaded_position_error(self, drives: Sequence[str], transmitted: Array) -> Array:
        """Return how far encoders are ahead because of loads, (N, D) [m, rad]."""
        return self.by_drive(drives, transmitted, lambda load, own: own['compliance'] * load)

    def windup_error(self, drives: Sequence[str], transmitted: Array, windup: Array) -> Array:
        """Return errors of positions and rates by the difference of second encoder and load."""
        error = np.zeros_like(windup)
        for name, values in self.drives.items():
            k = drives.index(name) if name in drives else -1
            if k < 0 or not np.any(w := windup[:, :, k]):
                continue
            load = transmitted[:, k]
            stiffness, _, said = load_by_windup(load, w)
            error[0, :, k] = values['compliance'] * (said - load) - values['loss'] * w[1]
            error[2, :, k] = values['compliance'] * stiffness * w[2]
        return error


def load_by_windup(load: Array, windup: Array) -> tuple[float, float, Array]:
    """Return stiffness, damping, and the load that a second encoder shows, (N,).

    Parameters
    ----------
    load : (N,) array
        What gear or screw pass on by the model [N, N m].
    windup : (2 or 3, N) array
        Position less that of the link, and its rate.
    """
    columns = np.stack((windup[0], windup[1], np.ones_like(load)), axis=1)
    found = np.linalg.lstsq(columns, load, rcond=None)[0]
    return float(found[0]), float(found[1]), columns @ found
