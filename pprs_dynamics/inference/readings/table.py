# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Hypotheses about a file: units, names, prior costs and thresholds, in one table.

A hypothesis is a way to read a recording. Its score is a log-likelihood, from the regression of
`evidence.py`, less its prior cost. The plain reading, by names and units, has no cost.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.model import recorded_names

# ------------------------------------------------------------------------------------- units

MICROMETRE = 1e-6
LENGTHS = {1e-3: 'millimetres', 1e-2: 'centimetres', MICROMETRE: 'micrometres'}
ANGLES = {math.pi / 180: 'degrees', 2 * math.pi: 'turns'}
# Encoders, tried where all positions are whole numbers.
COUNTS = {2 * math.pi / 2 ** bits: f'ticks of {2 ** bits} per turn'
          for bits in (12, 10, 11, 13, 14, 15, 16, 17, 18, 19, 20)}
POSITION_UNITS = frozenset((*LENGTHS, *ANGLES, *COUNTS))
TIMES = {1e-3: 'milliseconds', 1e-6: 'microseconds', 1e-9: 'nanoseconds'}
# Given over true ones. At a lower rate inertia looks larger beside the weight, as rotors make it.
RATES = (2.0, 5.0, 10.0)
# Samples per second of controllers and bus cycles.
USUAL_RATES = (10.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 100.0, 120.0, 125.0, 200.0, 240.0, 250.0,
               400.0, 500.0, 800.0, 1e3, 2e3, 2.5e3, 4e3, 5e3, 8e3, 1e4)
KGF_CM, N_CM, KGF = 1 / 0.0980665, 100.0, 1 / 9.80665
OF_TURNS, OF_LENGTHS = (KGF_CM, N_CM), (KGF,)  # of drives that turn, and that push
# Multiples of N m and N that files have, and what a unit of effort is called in a sentence.
EFFORTS = {1e3: 'm{}', 1e-3: 'k{}', KGF_CM: 'kgf cm', N_CM: 'N cm', KGF: 'kgf'}
# Factors within which efforts are in such a unit and no currents, and may be in it: the compliance
# of a controller, times N/m, is near kN, and drives of 0.08 to 0.12 N m/A are near kgf cm.
OFF_IN_UNIT = {1e3: (3.0, 3.0), 1e-3: (1.5, 1.5),
               **dict.fromkeys((KGF_CM, N_CM, KGF), (1.05, 1.2))}
SCALES = (1.0, -1.0, *EFFORTS, *(-unit for unit in EFFORTS))
SIGN_BITS = range(7, 16)  # of magnitudes
CALMER = 0.8  # changes where the bit does, over those of the numbers without a sign
QUARTERS = {math.pi / 2: 90, -math.pi / 2: -90, math.pi: 180}

# ---------------------------------------------------------------- efforts that are not measured

COMMAND, POSITION_ERROR, EXTERNAL = 'command', 'position_error', 'external'
WITHOUT_GRAVITY, NOISE_FREE = 'without_gravity', 'noise_free'
# What they contain of the model's inertia, gravity and friction, and of friction that grows with
# the velocity and by its direction, how a model file calls them, and what they look like.
LACKING: dict[str, tuple[tuple[int, ...], str, str]] = {
    COMMAND: ((0, 1, 0, 0, 0), recorded_names.COMMANDED, 'no inertia nor friction: it looks like '
              'what a controller commands, not like a measurement'),
    POSITION_ERROR: ((0, 0, 0, 1, 0), recorded_names.COMMANDED, 'no inertia nor gravity: it looks '
                     'like an error of position, which grows with the velocity, not like a '
                     'measurement'),
    WITHOUT_GRAVITY: ((1, 0, 1, 1, 1), recorded_names.WITHOUT_GRAVITY, 'no gravity: it looks as if '
                      'gravity was already subtracted, or a counterweight bears it'),
    EXTERNAL: ((0, 0, 1, 1, 1), recorded_names.EXTERNAL, 'no inertia nor gravity: it looks like an '
               'external torque, from which a model was already subtracted')}
LARGEST_COMPLIANCE = 0.01  # [rad/(N m), m/N]: controllers are stiffer than 100 N m/rad
LEAST_NOISE = 1e-5  # over the swing of an effort, of real sensors
LEAST_MEANS, STRETCHES = 50, 8  # of an excerpt; evenly over the recording

# ------------------------------------------------------------------------ likelihood and priors

# A model's error is alike at all samples: an excerpt counts as this many independent ones.
SAMPLES = 12.0
# Residual, as a share of the effort's squared swing, below which fits are equal.
CLOSEST = 2e-4
# Standard deviation of a model's inertia and gravity, relative, and what it can cost at most.
MASSES, MASSES_MOST = 0.35, 7.0
SAME_BALANCE = 1e-3  # standard deviation of the weight of a single body over its mass
# Standard deviation of a constant effort, as a share of the effort.
CONSTANT = 0.3
# Width in which friction turns over, as a share of a drive's root mean square of velocity.
REVERSAL = 0.03
# Times the rigid body's forces, beyond which friction is unlikely, and what it can cost at most.
FRICTION, FRICTION_MOST = 3.0, 9.0
# Prior costs of mistakes [nats].
COST = {'position_unit': 6.0, 'position_title': 6.0, 'position_sign': 6.0, 'drive_order': 8.0,
        'position_offset': 8.0, 'mounting': 8.0, 'time_unit': 6.0, 'rate': 6.0, 'effort_unit': 6.0,
        'effort_sign': 6.0, 'effort_absolute': 6.0, 'load': 1.0, 'drive_constant': 10.0,
        'velocity_unit': 6.0, COMMAND: 4.0, POSITION_ERROR: 3.0, WITHOUT_GRAVITY: 4.0,
        EXTERNAL: 4.0}
UNLIKE_VELOCITY = 7.0  # of units of positions that suit no unit of the recorded velocities
UNCHECKED = 5.0  # less, of amperes where nobody has checked the unit
RARE = 4.0  # more, of micrometres, as millimetres and kN are as likely, and of rates over 10 kHz
# Of times that make such steps [s], where another unit makes some of 10 us to 100 ms.
OTHER_TIME, SLOW = 1.0, 12.0
FEW = 10.0  # more, of positions of some drives in another unit than those of the others
ALL_NEGATED = 2.0  # more, of all positions together: efforts are negated more often
OUTSIDE, FAR_OUTSIDE = 4.0, 12.0  # of positions beyond a stroke, and far beyond it
USED = 0.1  # share of a stroke that recordings use, or more
# Loads at the tool, as shares of the mass that the robot moves.
LOADS = (0.03, 0.1, 0.3, 1.0, 3.0)
BEYOND, FAR = 2.0, 10.0  # multiples of the ends of a stroke, or of the speed limit
STROKE_SLACK = 0.05  # share of a stroke
SURE = 3.0  # nats by which the best hypothesis must win
GOOD_FIT = 0.25  # residual with which a hypothesis other than the plain one is credible
BETTER_ORDER = 0.5  # residual in another order of the drives, over that in the given one
# Residual of what nothing explains, over that of a fit with any signs: a spring is no command.
NO_WORSE = {COMMAND: 1.1, EXTERNAL: 2.0}
CLOSE_FIT = 2e-3  # residual of every drive with which no other reading is tried
# The same, with which only other orders of drives are tried, and the prior cost of the masses.
EXPLAINED, PLAUSIBLE = 0.03, 3.0
RESTING = 0.01  # [rad/s, m/s] speed from which a drive moves, however wide friction turns over
WEAK = 0.01  # swings that are this much smaller than others are no evidence
ALONG = 0.1  # [rad] from an axis of the base, up to which gravity is along it
LEAST_TILT = BaseTilt.linear[0].upper  # [rad]; a smaller one is the effect base_tilt
MOST_LEFT = 0.25  # of the squared error of each drive with the model's direction of gravity
LEAST_FORCE = 1e-3  # the same, of efforts: weak drives may be negated, too

# ------------------------------------------------------------------------- scales of efforts

SAME_MASSES = 3.0  # factor by which masses of a description are off at most
OTHER_UNIT = 1.5  # factor from which on the unit of efforts without a name is a question
CERTAIN = 3.0  # standard errors

NORMAL = 1.4826  # standard deviation over the median of absolute values
STEADY = 0.1  # a weight whose swing is a smaller share of its size is a constant
NOISE_STEP, NOISE_ORDER = 0.01, 4  # differences that separate noise from motion [s]

# ----------------------------------------------------------------------- columns by their names

POSITION, VELOCITY, EFFORT, CURRENT = 'position', 'velocity', 'effort', 'current'
# Words of a title, by the quantity that they name; plurals with s are split into these.
WORDS = {
    POSITION: ('position', 'pos', 'q', 'angle', 'theta', 'phi', 'qpos', 'enc', 'encoder', 'ticks',
               'th', 'winkel', 'lage', 'stellung', 'hub', 'weg'),
    VELOCITY: ('velocity', 'velocities', 'vel', 'velo', 'dq', 'qd', 'qdot', 'dtheta', 'speed',
               'omega', 'qvel', 'dpos', 'v', 'thd', 'dth', 'drehzahl', 'geschwindigkeit'),
    EFFORT: ('effort', 'eff', 'tau', 'torque', 'trq', 'torq', 'force', 'moment', 'mom', 'load',
             'tq', 'tor', 'qfrc', 'u', 'kraft', 'drehmoment', 'f'),
    CURRENT: ('current', 'cur', 'curr', 'amp', 'ampere', 'i', 'iq', 'strom'),
    'temperature': ('temperature', 'temp'), 'pressure': ('pressure',),
}
# Words of a position, where no word names a quantity.
OF_JOINTS = frozenset(('state', 'joint', 'joints', 'j', 'axis', 'achse', 'x', 'actual'))
PLURALS = {POSITION: 'positions', VELOCITY: 'velocities', EFFORT: 'efforts', CURRENT: 'currents'}
# Titles with one of these name neither a joint's measured motion nor its effort.
OTHERS = frozenset((
    'acc', 'acceleration', 'accelerations', 'ddq', 'qdd', 'qddot', 'voltage', 'power', 'tcp',
    'cartesian', 'pose', 'ee', 'twist', 'wrench', 'gravity', 'limit', 'error', 'err', 'action',
    'reward', 'index', 'episode', 'frame', 'done', 'tracking'))
# Words of commands, which are read only where nothing is measured.
COMMANDS = frozenset((
    'd', 'cmd', 'command', 'commands', 'commanded', 'target', 'targets', 'des', 'desired', 'ref',
    'reference', 'goal', 'setpoint', 'sp', 'set', 'soll', 'demand', 'demanded', 'ff',
    'feedforward'))
# Words of external torques, as drivers estimate them: read where no other effort is recorded.
FROM_OUTSIDE = frozenset(('ext', 'external', 'contact', 'dist', 'disturbance'))
# Words of filtered quantities, and of those before a gear.
SECONDARY = frozenset(('filtered', 'filt', 'smooth', 'smoothed', 'model', 'motor', 'rotor'))
LETTERS = {'a': 'actual', 'm': 'measured', 'd': 'desired', 'c': 'commanded', 'r': 'reference'}
MEASURED = frozenset((
    'meas', 'measured', 'actual', 'act', 'real', 'ist', 'fb', 'fbk', 'feedback', 'msr', 'sensor',
    'link'))
TIME, SHARE, NEITHER = 'time', 'share', 'neither'
# Units in titles, in lower case and without signs between their letters, and their factors to SI.
OF_POSITION = {
    'rad': 1.0, 'mrad': 1e-3, 'm': 1.0, 'mm': 1e-3, 'cm': 1e-2, 'um': 1e-6, 'µm': 1e-6,
    **dict.fromkeys(('deg', '°', 'grad', 'degree', 'degrees'), math.pi / 180),
    **dict.fromkeys(('rev', 'revs', 'turn', 'turns'), 2 * math.pi),
    **dict.fromkeys(('radian', 'radians'), 1.0)}
UNITS = {
    POSITION: OF_POSITION,
    VELOCITY: {**{f'{unit}/s': factor for unit, factor in OF_POSITION.items()}, 'mms': 1e-3,
               **dict.fromkeys(('rpm', '1/min', 'u/min', 'rev/min'), math.pi / 30),
               **dict.fromkeys(('degs', 'dps'), math.pi / 180)},
    EFFORT: {'n': 1.0, 'nm': 1.0, 'mn': 1e-3, 'mnm': 1e-3, 'nmm': 1e-3, 'ncm': 1e-2, 'kn': 1e3,
             'knm': 1e3, 'kgf': 9.80665, 'kgfm': 9.80665, 'lbfin': 0.1129848, 'inlb': 0.1129848,
             **dict.fromkeys(('kgfcm', 'kgcm'), 0.0980665),
             **dict.fromkeys(('lbfft', 'ftlb'), 1.3558179), 'ozin': 7.0615518e-3},
    CURRENT: {'a': 1.0, 'ma': 1e-3},
    SHARE: {**dict.fromkeys(('%', 'percent', 'pct', 'prozent'), 0.01),
            **dict.fromkeys(('‰', 'permille', 'promille'), 1e-3)},
    TIME: {**dict.fromkeys(('s', 'sec'), 1.0),
           **dict.fromkeys(('ms', 'msec', 'millis', 'milliseconds'), 1e-3),
           **dict.fromkeys(('us', 'µs', 'usec', 'micros', 'microseconds'), 1e-6),
           **dict.fromkeys(('ns', 'nsec', 'nanosec', 'nanoseconds'), 1e-9)},
    'temperature': dict.fromkeys(('°c', 'c', 'degc', 'k'), 1.0), 'pressure': {'bar': 1.0},
    NEITHER: dict.fromkeys(('v', 'w', 'hz', 'j', *(f'{unit}/s2' for unit in OF_POSITION)), 1.0)}

# --------------------------------------------------------------------- columns by their numbers

COPY = 0.995  # correlation of the changes of a column with those of what it was asked to be
SAME_MOTION = 0.1  # distance of efforts from the motion that they are, over its size
ROUGHER = 1.5  # third differences of what has noise, over those of what has none
NEARLY = 0.95  # of a turn that columns cover whose angles begin again each turn
NO_EFFORT = 0.25  # residual of a column that is no effort, next to one with less
LEAST_ROWS, HALF = 30, 10_000  # samples that are compared, and on each side of the middle at most
LONGEST_LAG = 20  # samples by which what is measured may follow what was asked for
LENGTHS_OF_STEPS = (1, 2, 4, 8, 16, 32, 64, 128)  # [samples]
SHORTEST = 1e-5  # [s]; step of a robot's recording

# --------------------------------------------------------------------------------- velocities

ALIKE = 0.9  # correlation of a velocity with the derivative of its position
# Recorded velocities over those in SI units.
VELOCITY_UNITS = (-1.0, *(sign / unit for sign in (1, -1) for unit in (
    math.pi / 180, 2 * math.pi, math.pi / 30, 1e-3, 1e-6)))
NEAR_ONE = 0.2  # relative distance of a velocity's factor from a known one
RATE_OFF = 0.03  # relative error of a sampling rate that is reported

MOST_PERMUTED = 4  # drives of which all orders are tried


@dataclass(frozen=True)
class Reading:
    """A hypothesis: a way to read a recording of D drives.

    Parameters
    ----------
    kind : str
        Key of `COST`; empty for the plain reading of positions and drives.
    what : str
        The mistake of times, positions or drives as a clause.
    drives : tuple of int
        Those it concerns.
    cost : float
        Prior cost [nats].
    scale, offset : (D,) arrays
        Factors of recorded positions, and what is added to them.
    positions, efforts : (D,) int arrays
        Recorded columns of the drives' positions and efforts.
    effort_scale : (D,) array
        Recorded efforts, as multiples of those in SI units.
    time_unit : float
        [s].
    gravity : (3,) array, optional
        Gravity in the base, if it is not the model's [m/s^2].
    load : float
        At the tool, beyond the model's [kg].
    contains : tuple of int
        What efforts contain of the columns of the regression.
    are_unsigned : bool
        Whether efforts are recorded without their sign.
    parts : tuple of Reading
        Mistakes of which it is made.
    """

    kind: str
    what: str
    drives: tuple[int, ...]
    cost: float
    scale: Array
    offset: Array
    positions: Indices
    efforts: Indices
    effort_scale: Array
    time_unit: float = 1.0
    gravity: Array | None = None
    load: float = 0.0
    contains: tuple[int, ...] = (1, 1, 1, 1, 1)
    are_unsigned: bool = False
    parts: tuple[Reading, ...] = ()

    @classmethod
    def plain(cls, count: int) -> Reading:
        """Return the reading of so many drives as they are recorded."""
        same, ones = np.arange(count), np.ones(count)
        return cls('', '', (), 0.0, ones, np.zeros(count), same, same, ones)

    @property
    def kinds(self) -> set[str]:
        """Kinds of its mistakes: a load is none."""
        return {part.kind for part in self.parts} - {'load'}

    @property
    def is_plain(self) -> bool:
        """Whether it is the reading by names and units."""
        return not self.kinds and bool(np.all(self.effort_scale == 1))

    @property
    def is_no_measurement(self) -> bool:
        """Whether efforts lack a part of a measurement, or are errors of position under it."""
        sizes = np.abs(self.effort_scale)
        return 0 in self.contains or bool(np.all(sizes < LARGEST_COMPLIANCE) and not np.any(
            np.isin(sizes, SCALES)))

    @property
    def of_motion(self) -> bytes:
        """What decides which forces the model has."""
        return np.concatenate([
            self.scale, self.offset, self.positions, [] if self.gravity is None else self.gravity,
            [self.load, self.time_unit, self.are_unsigned]]).tobytes()

    def after(self, first: Reading) -> Reading:
        """Return the reading that makes the mistakes of another one, and this one."""
        return replace(
            self, cost=first.cost + self.cost, scale=first.scale * self.scale,
            positions=first.positions[self.positions], efforts=first.efforts[self.efforts],
            offset=first.offset * self.scale + self.offset,
            time_unit=first.time_unit * self.time_unit,
            load=first.load + self.load, contains=min(first.contains, self.contains),
            are_unsigned=first.are_unsigned or self.are_unsigned,
            parts=(*first.parts, *(self.parts or (self,))),
            gravity=first.gravity if self.gravity is None else self.gravity)


def readings(drives: tuple[str, ...], units: Sequence[DriveUnits], loads: Sequence[float],
             times: Sequence[float], are_counts: bool, are_unsigned: bool,
             known: Mapping[int, float]) -> list[Reading]:
    """Return the table of readings of D drives: first the plain one, other orders last.

    Parameters
    ----------
    drives : tuple of D str
    units : sequence of D DriveUnits
    loads : sequence of float
        That may be at the tool [kg].
    times : sequence of float
        Units in which times may be [s].
    are_counts, are_unsigned : bool
        Whether all angles are whole numbers, as encoders count, and no effort is below 0.
    known : mapping of int to float
        Factors to SI of drives whose positions are read in a unit already.
    """
    every = tuple(range(len(drives)))
    same = np.arange(len(drives))
    rows = [Reading.plain(len(drives))]

    def add(kind: str, what: str, group: tuple[int, ...], more: float = 0.0, **changes: Any,
            ) -> None:
        rows.append(replace(rows[0], kind=kind, what=what, drives=group, cost=COST[kind] + more,
                            **changes))

    for unit in times:
        add('time_unit', f'the times look like {TIMES[unit]}: as seconds they make the motion '
            f'{1 / unit:.0f} times too slow', (), RARE * (unit != times[0]), time_unit=unit)
    angles = {**ANGLES, **COUNTS} if are_counts else ANGLES
    for load in loads:
        add('load', '', (), load=load)
    for names, turns in ((LENGTHS, False), (angles, True)):
        alike = tuple(k for k in every if units[k].turns == turns and k not in known)
        for unit, name in names.items():
            # Encoders of a robot's turning joints count alike.
            for group in _groups(drives, alike)[:1 if unit in COUNTS else None]:
                scale, few = np.where(np.isin(same, group), unit, 1.0), FEW * (
                    len(group) < len(alike))
                few += RARE * (unit == MICROMETRE)
                what = f'the {_position(drives, group)} like {name}'
                add('position_unit', what, group, few, scale=scale)
                if unit in COUNTS:
                    add('position_unit', f'{what} with the zero at {round(math.pi / unit)}', group,
                        few + 1, scale=scale, offset=-math.pi * np.isin(same, group))
    for unit in dict.fromkeys(known.values()):
        group = tuple(k for k in known if known[k] == unit)
        name = 'radians' if units[group[0]].turns else 'metres'
        add('position_title', f'the {_position(drives, group)} like {name}, not in the unit of '
            'the title', group, scale=np.where(np.isin(same, group), 1 / unit, 1.0))
    # Angles in degrees together with lengths in millimetres: neither alone explains efforts.
    alone = [row for row in rows if row.kind == 'position_unit']
    rows += [second.after(first.after(rows[0])) for first, second in combinations(alone, 2)
             if len(first.drives) + len(second.drives) == len(drives)
             and {*first.drives}.isdisjoint(second.drives)
             and units[first.drives[0]].turns != units[second.drives[0]].turns]
    for group in _groups(drives, every):
        add('position_sign', f'the {_position(drives, group)} negated', group, ALL_NEGATED * (
            len(group) == len(every) > 1), scale=np.where(np.isin(same, group), -1.0, 1.0))
    if are_unsigned:
        add('effort_absolute', f'the effort of {named(drives, every)} looks like its absolute '
            'value: it is never below 0, where the model changes sign; it must be recorded with '
            'its sign', every, are_unsigned=True)
    for kind, (contains, _, what) in LACKING.items():
        add(kind, f'the effort of {named(drives, every)} contains {what}', every,
            contains=contains)
    for k in (k for k in every if units[k].turns):
        for turn, angle in QUARTERS.items():
            add('position_offset', f'the zero of {drives[k]} looks off: {angle} degrees '
                f'({drives[k]}) are to be added to its positions', (k,),
                offset=np.where(np.array(every) == k, turn, 0.0))
    for order in _orders(len(drives)):
        moved, other = tuple(k for k in every if order[k] != k), np.array(order)
        listed = ', '.join(f'{drives[order[k]]} like {drives[k]}' for k in moved)
        for noun, positions, efforts in (('drives', other, other), ('positions', other, same),
                                         ('efforts', same, other)):
            add('drive_order', f'the {noun} look recorded in another order: {listed}', moved,
                positions=positions, efforts=efforts)
    return rows


def named(drives: tuple[str, ...], group: tuple[int, ...]) -> str:
    """Return how a sentence names some of the drives."""
    if len(group) == len(drives) > 1:
        return 'all drives'
    return ', '.join(drives[k] for k in group)


def _position(drives: tuple[str, ...], group: tuple[int, ...]) -> str:
    return ('position of ' + named(drives, group) + ' looks' if len(group) == 1
            else 'positions of ' + named(drives, group) + ' look')


def families(drives: Sequence[str]) -> list[tuple[int, ...]]:
    """Return the places of drives whose names differ in their numbers alone, together."""
    stems = [re.sub(r'\d', '', drive) for drive in drives]
    return [tuple(k for k, other in enumerate(stems) if other == stem)
            for stem in dict.fromkeys(stems)]


def _groups(drives: tuple[str, ...], alike: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all of some drives together, those of a family, and each alone."""
    groups = [alike, *families(drives), *((k,) for k in alike)]
    return [*dict.fromkeys(group for group in groups if group and {*group} <= {*alike})]


def _orders(count: int) -> list[tuple[int, ...]]:
    """Return orders of drives; of those that fit alike the one that moves least comes first.

    Of many drives: exchanges of two, last to first, begun at another one, and by columns of a
    table in place of its rows.
    """
    same = tuple(range(count))
    found = {*permutations(same)} if count <= MOST_PERMUTED else {
        same[::-1], *(same[k:] + same[:k] for k in same),
        *(tuple(j if k == i else i if k == j else k for k in same) for i in same for j in same[:i]),
        *(tuple(k for first in range(rows) for k in same[first::rows])
          for rows in range(2, count) if not count % rows)}
    return sorted(found - {same}, key=lambda order: (
        sum(k != place for place, k in enumerate(order)), order))
