# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Ways to read a recording other than its names and units say: as mistakes make them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES, DriveUnits
from pprs_dynamics.inference.residuals.mistakes import POSITION_UNIT
from pprs_dynamics.measurement.motion.drive_motion import DriveMotion

LENGTHS = {1e-3: 'millimetres', 1e-2: 'centimetres', 1e-6: 'micrometres'}
ANGLES = {float(np.pi / 180): 'degrees'}
POSITION_SIGN = 'position_sign'
# Many arms weigh the same but for its sign with all positions negated as with all efforts: those
# are mistaken more often.
ALL_NEGATED = 1.5
SLIDES, LIFTS = (0, 1, 2), (3, 4, 5)  # of the six drives, in drive order
# Columns in the order chain by chain, and last to first, under names in drive order.
OTHER_ORDERS = ((0, 2, 4, 1, 3, 5), (0, 3, 1, 4, 2, 5), (5, 4, 3, 2, 1, 0))


@dataclass(frozen=True)
class Reading:
    """What the columns of a recording may mean.

    Parameters
    ----------
    kind : str
        Of the mistake; empty for the reading by names and units.
    what : str
        The mistake as a clause.
    drives : tuple of int
        Those it concerns.
    position, effort : (D, D) arrays
        From what is recorded to what is meant, for a row of drives.
    cost : float
        How many mistakes it takes.
    backwards : bool
        Whether time runs the other way.
    """

    kind: str
    what: str
    drives: tuple[int, ...]
    position: Array
    effort: Array
    cost: float = 1.0
    backwards: bool = False

    def motion_of(self, motion: DriveMotion) -> DriveMotion:
        """Return a recorded motion as it is meant."""
        turn = -1.0 if self.backwards else 1.0
        return replace(motion, position=motion.position @ self.position.T,
                       velocity=turn * motion.velocity @ self.position.T,
                       acceleration=motion.acceleration @ self.position.T)

    def effort_of(self, effort: Array) -> Array:
        """Return recorded efforts, (N, D) [N], as they are meant; NaN as NaN."""
        known = np.isfinite(effort)
        meant: Array = np.where(known, effort, 0.0) @ self.effort.T
        # A drive that was not measured must not make the others so.
        meant[(~known).astype(float) @ np.abs(self.effort).T > 0] = np.nan
        return meant


def as_named(drives: tuple[str, ...]) -> Reading:
    """Return the reading by names and units."""
    same = np.eye(len(drives))
    return Reading('', '', (), same, same, 0.0)


def readings(drives: tuple[str, ...], units: Sequence[DriveUnits]) -> Iterator[Reading]:
    """Yield all other readings of D drives, the simplest of each kind first."""
    count = len(drives)
    same = np.eye(count)
    yield Reading('reversed_time', 'the recording looks as if it were played backwards: friction '
                  'drives the motion', tuple(range(count)), same, same, backwards=True)
    for names, turns in ((LENGTHS, False), (ANGLES, True)):
        alike = tuple(k for k, units_of_drive in enumerate(units) if units_of_drive.turns == turns)
        for unit, name in names.items():
            for group in _groups(drives, alike):
                yield rescaled(drives, group, unit, name)
    for group in _groups(drives, tuple(range(count))):
        yield Reading(POSITION_SIGN, f'the {_position(drives, group)} negated',
                      group, np.diag(_scaled(count, group, -1.0)), same,
                      ALL_NEGATED if len(group) == count > 1 else 1.0)
    for order in _orders(drives):
        moved = tuple(k for k in range(count) if order[k] != k)
        listed = ', '.join(f'{drives[order[k]]} like {drives[k]}' for k in moved)
        turned = same[list(order)]
        yield Reading('drive_order', f'the drives look recorded in another order: {listed}',
                      moved, turned, turned)
        yield Reading('drive_order', f'the positions look recorded in another order: {listed}',
                      moved, turned, same)
        yield Reading('drive_order', f'the efforts look recorded in another order: {listed}',
                      moved, same, turned)


def rescaled(drives: tuple[str, ...], group: tuple[int, ...], unit: float, name: str) -> Reading:
    """Return the reading of the positions of some drives in another unit."""
    count = len(drives)
    return Reading(POSITION_UNIT, f'the {_position(drives, group)} like {name}', group,
                   np.diag(_scaled(count, group, unit)), np.eye(count))


def named(drives: tuple[str, ...], group: tuple[int, ...]) -> str:
    """Return how a sentence names some of the drives."""
    if len(group) == len(drives) > 1:
        return 'all drives'
    if drives == DRIVES and group in (SLIDES, LIFTS):
        return 'the slides' if group == SLIDES else 'the lifts'
    return ', '.join(drives[k] for k in group)


def _position(drives: tuple[str, ...], group: tuple[int, ...]) -> str:
    return ('position of ' + named(drives, group) + ' looks' if len(group) == 1
            else 'positions of ' + named(drives, group) + ' look')


def _groups(drives: tuple[str, ...], alike: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all of some drives together, those of a kind, and each alone."""
    if not alike:
        return []
    return list(dict.fromkeys((alike, *((SLIDES, LIFTS) if drives == DRIVES else ()),
                               *((k,) for k in alike))))


def _orders(drives: tuple[str, ...]) -> list[tuple[int, ...]]:
    if drives != DRIVES:
        return []
    within = [(*first, *second) for first in permutations(SLIDES)
              for second in permutations(LIFTS)]
    swapped = [order[3:] + order[:3] for order in within]
    # Of those that fit alike, as all that turn the whole robot do, the one that moves least
    # comes first, and keeps chains together.
    return sorted({*within, *swapped, *OTHER_ORDERS}, key=lambda order: (
        sum(k != place for place, k in enumerate(order)),
        sum(k % 3 != place % 3 for place, k in enumerate(order)), order))[1:]


def _scaled(count: int, group: tuple[int, ...], factor: float) -> Array:
    scale = np.ones(count)
    scale[list(group)] = factor
    return scale
