# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Lost motion between encoder and link: the encoder is not where the link is.

The encoder reads q + e. With backlash, e is half of it towards the side to which the load pushes
the gear, b / 2 sgn(tau). The link falls from one flank to the other, while motor and encoder go on
as before. With play, the link stays behind at reversals: the encoder first travels all of the play
without it. No encoder measures the link meanwhile: its motion is taken as smooth between those
before and after. `elastic_joint` is the effect of a gear that winds up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.mechanism.state import MECHANISM, PLATFORM

# On either side of the travel through the play, of its length: there the link may separate from the
# flank. A polynomial through its motion before and after, as long as that, determines it.
MARGIN, ORDER = 0.5, 5
# Of the play: flanks give way, and a link turns over that has nearly come to the other.
CROSSED = 0.9
# Clearances of screws and gears [m, rad].
USUAL = (5e-4, math.radians(1.0))


class LostMotion(MeasurementEffect):
    """Backlash or play of what is between an encoder and the link that it is to measure.

    Equation
    --------
    measured position = q + e, e = b sgn(tau) / 2, or b_r sgn(q_dot) / 2 once the encoder has
    returned by b_r

    Symptom
    -------
    Weight and inertia as of a displaced drive, displaced to the other side where the load changes
    sign. With play a burst at each reversal, where the encoder moves fast and the drive does
    not, which looks like a delay or like hysteresis.

    Causes
    ------
    Worn teeth, a loose coupling, key or belt, a nut with clearance, between an encoder on the
    motor and the link.

    Confirmation
    ------------
    Lock the motor and move the link to and fro by hand with a dial gauge on it. What it moves
    freely is backlash, what it gives per force is elastic_joint. Reverse slowly and watch when
    the link follows the encoder.

    References
    ----------
    Nordin and Gutman, Controlling mechanical systems with backlash - a survey, Automatica 38,
    2002.
    """

    name = 'lost_motion'
    acts_in = frozenset({PLATFORM, MECHANISM})
    nonlinear = True
    not_linear_in: ClassVar[tuple[str, ...]] = ('play',)
    linear = (
        Parameter('backlash', 'b', 'm', 'distance between the flanks, of which the load chooses '
                  'one', -0.1, 0.1, 0.0, 5e-4, expected=USUAL, turning=(-0.5, 0.5)),
        Parameter('play', 'b_r', 'm', 'travel of the encoder without the link at each reversal',
                  -0.1, 0.1, 0.0, 5e-4, expected=USUAL, turning=(-0.5, 0.5)))
    variants = (('backlash',), ('play',))
    is_positive = True

    def position_error(self, drives: Sequence[str], position: Array) -> Array:
        """Return how far encoders are ahead because of play, (N, D) [m, rad]."""
        return self.by_drive(drives, position, lambda q, own: (
            q - behind_play(q, own['play']) if own['play'] else np.zeros_like(q)))

    def loaded_position_error(self, drives: Sequence[str], transmitted: Array) -> Array:
        """Return how far encoders are ahead because of loads, (N, D) [m, rad]."""
        return self.by_drive(drives, transmitted, lambda load, own: (
            own['backlash'] / 2 * np.sign(load)))


def behind_play(position: Array, play: float) -> Array:
    """Return where a link is that an encoder moves through a play, (N,).

    While the encoder travels through the play, the link's motion is a polynomial through its motion
    before and after. With a negative play, in the encoder's coupling, the link leads the encoder.

    Parameters
    ----------
    position : (N,) array
        Of the encoder [m, rad].
    play : float
        [m, rad]
    """
    turns = reversals(position, CROSSED * abs(play))
    if not turns:
        return position.copy()
    link = position + play / 2 * turns[0][2]  # before the first of them
    lasts = [0, *(end for _, end, _ in turns)]
    nexts = [*(start for start, _, _ in turns[1:]), len(position) - 1]
    is_known, passages = np.ones(len(link), dtype=bool), []
    for (start, end, side), last, following in zip(turns, lasts, nexts, strict=False):
        link[start:] = position[start:] - play / 2 * side
        margin = int(MARGIN * (end - start)) + 1
        first, until = max(start - margin, last), min(end + margin, following)
        is_known[first + 1:until] = False
        passages.append((first, until))
    beside = np.flatnonzero(is_known)
    for first, until in passages:
        _bridge(link, beside, first, until)
    return link


def _bridge(link: Array, beside: np.ndarray, first: int, until: int) -> None:
    """Fill the samples of a link between two by a polynomial through the known ones around them.

    Through as many of these on either side as are between; where a recording ends before, a
    straight line.
    """
    reach = max(until - first, ORDER + 1)
    at = int(np.searchsorted(beside, first, side='right'))
    known = beside[max(at - reach, 0):at + reach]
    order = ORDER if min(at, len(beside) - at) > ORDER else 1
    middle, scale, origin = (first + until) / 2, (known[-1] - known[0]) / 2, link[first]

    def powers(samples: np.ndarray) -> Array:
        return np.vander((samples - middle) / scale, order + 1)

    # Places within -1 to 1 and this order: normal equations lose five digits of sixteen.
    columns = powers(known)
    c = np.linalg.solve(columns.T @ columns, columns.T @ (link[known] - origin))
    link[first + 1:until] = origin + powers(np.arange(first + 1, until)) @ c


def reversals(position: Array, width: float) -> list[tuple[int, int, float]]:
    """Return the reversals of a position (N,) that return by at least a width.

    Each as the sample at which it turns, the first at which it has returned by the width, and
    the direction afterwards.
    """
    step = np.sign(np.diff(position))
    moved = np.flatnonzero(step)
    if not len(moved):
        return []
    turned = moved[1:][step[moved[1:]] != step[moved[:-1]]]
    extremes = [0, *turned.tolist(), len(position) - 1]
    values = position[extremes].tolist()
    low = high = 0
    side, found = 0.0, []
    for k, value in enumerate(values):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if side >= 0 and values[high] - value >= width:
            if side:
                found.append((extremes[high], -1.0, extremes[k]))
            side, low = -1.0, k
            high = k
        elif side <= 0 and value - values[low] >= width:
            if side:
                found.append((extremes[low], 1.0, extremes[k]))
            side, high = 1.0, k
            low = k
    result = []
    for at, direction, until in found:
        come_back = direction * (position[at:until + 1] - position[at]) >= width
        result.append((at, at + int(np.argmax(come_back)), direction))
    return result
