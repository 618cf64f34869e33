# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Statements about one drive's error: where it is, in numbers and words, with possible causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.diagnosis.quantities import (
    listed,
    percent,
    plain,
    sentence,
    with_sign,
)
from pprs_dynamics.inference.search.candidates import UnknownCandidate
from pprs_dynamics.inference.search.patterns import CURVE, Pattern
from pprs_dynamics.inference.search.unknown import DrivePatterns
from pprs_dynamics.system.json_records import JsonRecord

# The unit in which a variable is read: factor from SI, and name; of linear and of rotary drives.
UNITS = {
    'position': (1e3, 'mm'), 'velocity': (1e3, 'mm/s'), 'acceleration': (1.0, 'm/s²'),
    'load': (1.0, 'N'), 'rod_angle': (180 / np.pi, 'deg'), 'platform_x': (1e3, 'mm'),
    'platform_y': (1e3, 'mm'), 'platform_z': (1e3, 'mm'), 'platform_tilt': (180 / np.pi, 'deg'),
    'platform_turn': (180 / np.pi, 'deg'), 'time': (1.0, 's'), 'frequency': (1.0, 'Hz'),
}
TURNING = {'position': (180 / np.pi, 'deg'), 'velocity': (1.0, 'rad/s'),
           'acceleration': (1.0, 'rad/s²'), 'load': (1.0, 'N m')}
SHOWN = 2  # digits of forces, which are known to some percent
# Possible causes, and how to look, by what the error depends on.
LEADS = {
    'position': ('a dent, dirt or a joint in the guide or screw; something that touches there',
                 'creep over that place both ways, look and feel along the guide'),
    'velocity': ('friction of another form than the catalogue\'s; a controller or amplifier that '
                 'behaves differently at that speed',
                 'run the drive alone at several constant speeds around there'),
    'direction': ('play, or friction of another form that differs by direction',
                  'approach one position from both sides and compare efforts and encoders'),
    'acceleration': ('play or compliance between drive and load; a saturated amplifier',
                     'repeat the motion at half the speed: an error by acceleration falls to a '
                     'quarter'),
    'load': ('a guide or nut that gives or jams under load', 'repeat with a known extra weight'),
    'rod_angle': ('something that touches or binds in a passive joint at that angle',
                  'swing the uncoupled rod by hand through that angle'),
    'time': ('a single event: a load taken up or put down, a touch, a loose part, a sensor that '
             'jumped', 'repeat the recording: an error at the same time belongs to the motion'),
    'frequency': ('a vibration of the structure, a controller near instability, a machine nearby '
                  'or the mains', 'record at rest, and with other gains'),
    'platform': ('something that pulls at the platform or touches it in part of the workspace: a '
                 'hose, a cable, a workpiece', 'remove what touches the platform and repeat'),
    'drive': ('a coupling of the two drives: a shared cable chain or supply, a bending frame, '
              'cross-talk between sensors', 'move that drive alone, with this one at rest'),
}


def read_in(variable: str, units: DriveUnits) -> tuple[float, str]:
    """Return the factor from SI and the unit in which people read a variable of a drive."""
    name = variable.partition(' of ')[0]
    return (TURNING if units.turns and name in TURNING else UNITS)[name]


@dataclass(frozen=True)
class Statement(JsonRecord):
    """One place where the model of a drive fails.

    Parameters
    ----------
    drive, variable : str
        Whose error depends on which variable.
    range : (float, float) or None
        Range of the variable, SI: of the speed where the pattern follows the direction of motion;
        [0, 1] or [-1, 0] of the direction; None for all values.
    share_of_error : float
        Share of the drive's squared error within the range; without a range, the share that the
        pattern explains.
    share_of_time : float
        Share of the samples within the range.
    text : str
        The statement in words.
    evidence : float
        By which the cost rises without it.
    kind : str
        Of pattern, see `patterns.Pattern`.
    mean_square : float
        Of the pattern over the record [N^2].
    """

    json_keys = ('drive', 'variable', 'range', 'share_of_error', 'share_of_time', 'text')

    drive: str
    variable: str
    range: tuple[float, float] | None
    share_of_error: float
    share_of_time: float
    text: str
    evidence: float
    kind: str
    mean_square: float

    @property
    def is_of_speed(self) -> bool:
        """Whether `range` is one of the speed, in either direction."""
        return is_of_speed(self.kind, self.variable)

    @property
    def is_directed(self) -> bool:
        """Whether the pattern has the other sign in the other direction of motion."""
        return self.kind.startswith('directed') and not self.variable.startswith('velocity')


def word_statement(
    drive_patterns: DrivePatterns, candidate: UnknownCandidate, coefficients: Array,
    evidence: float,
) -> Statement:
    """Return the statement that a pattern makes.

    Parameters
    ----------
    drive_patterns : DrivePatterns
        Of the drive.
    candidate : UnknownCandidate
    coefficients : (1 or 2,) array
        Fitted [N].
    evidence : float
    """
    pattern, variable = candidate.pattern, candidate.family.variable
    drive, series = drive_patterns.residuals.drives[drive_patterns.d], drive_patterns.series
    error = series.error
    columns = candidate.rows[:, series.index]
    shape = coefficients @ columns
    total = max(float(error @ error), 1e-300)
    limits, share, time = pattern.limits, 0.0, 1.0
    if limits is None:
        share = float(np.clip(1 - (error - shape) @ (error - shape) / total, 0.0, 1.0))
        if pattern.kind == 'line':
            width = 1 / (len(series) * drive_patterns.residuals.period)
            limits = (pattern.scale - width, pattern.scale + width)
    else:
        held = np.abs(columns[0]) > 0.5
        if pattern.kind == 'fading':
            held = np.abs(drive_patterns.values(variable)) < limits[1]
        share, time = float(error[held] @ error[held]) / total, float(held.mean())
    signed = float(coefficients[0])
    if pattern.kind == 'fading':
        # Its coefficient belongs to a standstill, which hardly any sample is as near as.
        signed = float(np.copysign(np.abs(shape).max(), signed))
    elif pattern.limits is not None:
        # The mean error there, which the table and a plot show; the coefficient is what this
        # pattern has beside the others that overlap it.
        signed = float(error @ columns[0] / (columns[0] @ columns[0]))
    size = float(np.linalg.norm(coefficients))
    when = f' in {percent(time)} of the time' if pattern.limits else ''
    text = (f'{drive}: {_clause(variable, pattern, drive_patterns, signed, size, shape)} '
            f'({percent(share)} of its squared error{when})')
    return Statement(drive, variable, limits, share, time, text, evidence, pattern.kind,
                     float(np.mean(shape ** 2)))


def _clause(variable: str, pattern: Pattern, drive_patterns: DrivePatterns, signed: float,
            amplitude: float, shape: Array) -> str:
    """Return what a pattern says of the error of its drive, of size in the drive's unit."""
    kind, residuals = pattern.kind, drive_patterns.residuals
    units = residuals.units_of(residuals.drives[drive_patterns.d])
    effort, shifted = units.effort, f'{with_sign(signed, SHOWN)} {units.effort}'
    size = f'{plain(amplitude, SHOWN)} {effort}'
    along = ' in the direction of motion' if kind in (
        'directed_growth', 'directed_range', 'fading', CURVE) else ''
    if kind == 'offset':
        return f'its mean error is {shifted}'
    if kind == 'friction':
        return (f'its error has the sign of the motion, {size}: the model has too '
                f'{"little" if signed > 0 else "much"} friction')
    if kind == 'ripple':
        factor, place = read_in('position', units)
        period = f'{plain(pattern.scale * factor)} {place}'
        return f'its error repeats every {period} of position, {size}'
    if kind == 'line':
        return f'its error vibrates at {plain(pattern.scale, 4)} Hz, {size}'
    if kind in (CURVE, 'growth', 'directed_growth'):
        return (f'its error changes with {in_words(variable)}{along}, by '
                f'{plain(float(np.ptp(shape)), SHOWN)} {effort} in all')
    return f'{_place(variable, pattern, drive_patterns)} its error is shifted by {shifted}{along}'


def is_of_speed(kind: str, variable: str) -> bool:
    """Return whether a kind of pattern over a variable depends on the speed alone."""
    return kind in ('directed_range', 'fast', 'fading') and variable.startswith('velocity')


def _place(variable: str, pattern: Pattern, drive_patterns: DrivePatterns) -> str:
    assert pattern.limits is not None
    low, high = pattern.limits
    if variable == 'direction':
        return 'in the positive direction' if low >= 0 else 'in the negative direction'
    of = variable.partition(' of ')[2] or drive_patterns.residuals.drives[drive_patterns.d]
    factor, unit = read_in(variable, drive_patterns.residuals.units_of(of))
    word, values = in_words(variable), drive_patterns.values(variable)
    if is_of_speed(pattern.kind, variable) or (
            variable.startswith('velocity') and np.isclose(-low, high)):
        word, values, low = word.replace('velocity', 'speed'), np.abs(values), max(low, 0.0)
    word = f'an {word}' if word.startswith('a') else f'a {word}'
    first, last = (f'{plain(end * factor)} {unit}' for end in (low, high))
    if low <= values.min() or (low == 0 and 'speed' in word):
        return f'at {word} below {last}'
    return f'at {word} ' + (f'above {first}' if high >= values.max() else
                            f'between {first} and {last}')


def describe_unexplained(group: Sequence[Statement]) -> tuple[str, str, str, str, str]:
    """Return title, what, why, cause and how to confirm, of one pattern on one or more drives."""
    first = group[0]
    drives = list(dict.fromkeys(statement.drive for statement in group))
    texts = '; '.join(
        statement.text if len(drives) > 1 else statement.text.removeprefix(f'{statement.drive}: ')
        for statement in group)
    what = f'The error of {listed(drives)} has a form that no effect of the catalogue has: {texts}.'
    evidence = max(statement.evidence for statement in group)
    why = (f'Noise does not explain it (evidence {evidence:.0f}, threshold 0), and no set of '
           'effects explains it as well.')
    cause, confirm = LEADS[_lead(first.variable)]
    return f'unexplained error {place_on(group)}', what, why, sentence(cause), sentence(confirm)


def place_on(group: Sequence[Statement]) -> str:
    """Return on which drives and depending on what a pattern lies."""
    drives, variable = dict.fromkeys(statement.drive for statement in group), group[0].variable
    where = 'at one frequency' if variable == 'frequency' else f'depending on {in_words(variable)}'
    return f'on {listed([*drives])} ({where})'


def pattern_over(variable: str) -> str:
    """Return the name of a pattern of no catalogue, for a list of sets."""
    return 'a vibration' if variable == 'frequency' else f'a pattern over {in_words(variable)}'


def in_words(variable: str) -> str:
    """Return the printed name of a variable, also of one of another drive."""
    name, of, other = variable.partition(' of ')
    return name.replace('_', ' ') + of + other


def _lead(variable: str) -> str:
    if ' of ' in variable:
        return 'drive'
    return 'platform' if variable.startswith('platform') else variable
