# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Statements of where a drive's error lies, with their shares and their sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.diagnosis.quantities import listed
from pprs_dynamics.inference.search.candidates import UnknownCandidate
from pprs_dynamics.inference.search.patterns import Pattern
from pprs_dynamics.inference.search.unknown import PatternLibrary

# How a variable is called, and the unit it is read in: factor from SI, and name. Those of drives
# that push, and of those that turn.
UNITS = {
    'position': (1e3, 'mm'), 'velocity': (1e3, 'mm/s'), 'acceleration': (1.0, 'm/s²'),
    'load': (1.0, 'N'), 'rod_angle': (180 / np.pi, 'deg'), 'platform_x': (1e3, 'mm'),
    'platform_y': (1e3, 'mm'), 'platform_z': (1e3, 'mm'), 'platform_tilt': (180 / np.pi, 'deg'),
    'platform_turn': (180 / np.pi, 'deg'), 'time': (1.0, 's'), 'frequency': (1.0, 'Hz'),
}
TURNING = {'position': (180 / np.pi, 'deg'), 'velocity': (1.0, 'rad/s'),
           'acceleration': (1.0, 'rad/s²'), 'load': (1.0, 'N m')}
WORDS = {'load': 'load', 'rod_angle': 'rod angle', 'platform_x': 'platform x',
         'platform_y': 'platform y', 'platform_z': 'platform z', 'platform_tilt': 'platform tilt',
         'platform_turn': 'platform turn'}


def read_in(variable: str, units: DriveUnits) -> tuple[float, str]:
    """Return the factor from SI and the unit in which people read a variable of a drive."""
    name = variable.partition(' of ')[0]
    return (TURNING if units.turns and name in TURNING else UNITS)[name]


@dataclass(frozen=True)
class Statement:
    """One place where the model of a drive fails.

    Parameters
    ----------
    drive, variable : str
    range : (float, float) or None
        Of the variable, SI; of the speed where the pattern follows the direction of motion;
        [0, 1] or [-1, 0] of the direction; None where all of it is meant.
    share_of_error : float
        Of the drive's squared error, within the range; without a range, what the pattern
        explains.
    share_of_time : float
        Of the samples, within the range.
    text : str
    evidence : float
        By which the cost rises without it.
    kind : str
        Of pattern, see `patterns.Pattern`; 'scatter' for a changed variance, 'level' for noise
        far above that of the other drives.
    amplitude : float
        Size of the pattern [N].
    mean_square : float
        Of the pattern over the record [N^2]; of a scatter what it is beyond the rest's.
    rivals : tuple of str
        Other variables that do nearly as well.
    """

    drive: str
    variable: str
    range: tuple[float, float] | None
    share_of_error: float
    share_of_time: float
    text: str
    evidence: float
    kind: str
    amplitude: float
    mean_square: float
    rivals: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the interface."""
        return {'drive': self.drive, 'variable': self.variable,
                'range': None if self.range is None else list(self.range),
                'share_of_error': self.share_of_error, 'share_of_time': self.share_of_time,
                'text': self.text}


def word_statement(
    drive: str, library: PatternLibrary, candidate: UnknownCandidate, coefficients: Array,
    evidence: float, rivals: tuple[str, ...],
) -> Statement:
    """Return the statement that a pattern makes.

    Parameters
    ----------
    drive : str
    library : PatternLibrary
        Of the drive.
    candidate : UnknownCandidate
    coefficients : (1 or 2,) array
        Fitted [N].
    evidence : float
    rivals : tuple of str
        Variables that would do as well.
    """
    pattern, variable = candidate.pattern, candidate.family.variable
    series = library.series
    known = series.known
    error = series.error[known]
    columns = candidate.rows[library.d][:, series.index][:, known]
    shape = coefficients @ columns
    total = max(float(error @ error), 1e-300)
    limits, share, time = pattern.limits, 0.0, 1.0
    if limits is None:
        share = float(np.clip(1 - (error - shape) @ (error - shape) / total, 0.0, 1.0))
        if pattern.kind == 'line':
            width = 1 / (len(series) * library.residuals.period)
            limits = (pattern.scale - width, pattern.scale + width)
    else:
        held = np.abs(columns[0]) > 0.5
        if pattern.kind == 'fading':
            held = np.abs(library.values(variable)[known]) < limits[1]
        share, time = float(error[held] @ error[held]) / total, float(held.mean())
    amplitude = float(np.hypot(*coefficients)) if candidate.family.paired else float(
        np.abs(coefficients).max())
    signed = float(coefficients[0])
    if pattern.kind == 'fading':
        # Its coefficient belongs to a standstill, which hardly any sample is as near as.
        amplitude = float(np.abs(shape).max())
        signed = float(np.copysign(amplitude, signed))
    elif pattern.limits is not None:
        # The mean error there, which the table and a plot show; the coefficient is what this
        # pattern has beside the others that overlap it.
        signed = float(error @ columns[0] / (columns[0] @ columns[0]))
    sentence = _sentence(variable, pattern, library, signed, amplitude, share, time, shape)
    if rivals:
        sentence += (f'; {listed([_words(name) for name in rivals], "or")} would explain it about '
                     'as well')
    return Statement(drive, variable, limits, share, time, f'{drive}: {sentence}', evidence,
                     pattern.kind, amplitude, float(np.mean(shape ** 2)), rivals)


def word_scatter(drive: str, library: PatternLibrary, variable: str, pattern: Pattern,
                 column: Array, evidence: float) -> Statement:
    """Return the statement that the noise is larger in a range than elsewhere."""
    known = library.series.known
    error = library.series.error[known]
    held = column[known] > 0.5
    total = max(float(error @ error), 1e-300)
    share, time = float(error[held] @ error[held]) / total, float(held.mean())
    sentence = _sentence(variable, pattern, library, 0.0, 0.0, share, time, np.zeros(0))
    return Statement(drive, variable, pattern.limits, share, time, f'{drive}: {sentence}',
                     evidence, 'scatter', 0.0, total / len(error) * max(share - time, 0.0))


def _sentence(
    variable: str, pattern: Pattern, library: PatternLibrary, signed: float, amplitude: float,
    share: float, time: float, shape: Array,
) -> str:
    kind, word = pattern.kind, _words(variable)
    residuals = library.residuals
    units = residuals.units_of(residuals.drives[library.d])
    effort = units.effort
    if kind == 'offset':
        return (f'its error has a mean of {signed:+.3g} {effort} over the whole recording, '
                f'{share:.0%} of its squared error')
    if kind == 'friction':
        return (f'its error has the sign of the motion, {amplitude:.3g} {effort}: friction is too '
                f'{"small" if signed > 0 else "large"} in the model; this is {share:.0%} of its '
                'squared error')
    if kind == 'ripple':
        factor, place = read_in('position', units)
        return (f'its error repeats about every {pattern.scale * factor:.3g} {place} of position, '
                f'{amplitude:.3g} {effort}; this is {share:.0%} of its squared error')
    if kind == 'line':
        return (f'its error holds a vibration at {pattern.scale:.4g} Hz of {amplitude:.3g} '
                f'{effort}, {share:.0%} of its squared error')
    if kind in ('growth', 'directed_growth'):
        opposed = ' in the direction of motion' if kind == 'directed_growth' else ''
        low, high = _ends(library, variable, shape, kind == 'directed_growth')
        return (f'its error changes with {word}: {low:+.3g} {effort} at its least, '
                f'{high:+.3g} {effort} at its greatest{opposed}; this is '
                f'{share:.0%} of its squared error')
    place = _place(variable, pattern, library)
    where = f'{share:.0%} of its squared error lies {place}, in {time:.0%} of the time'
    if kind == 'scatter':
        return (f'{where}; it scatters there {np.sqrt(pattern.scale):.2g} times as much as '
                'elsewhere')
    along = ' in the direction of motion' if kind in ('directed_range', 'fading') else ''
    return f'{where}; it is shifted there by {signed:+.3g} {effort}{along}'


def _place(variable: str, pattern: Pattern, library: PatternLibrary) -> str:
    assert pattern.limits is not None
    low, high = pattern.limits
    if variable == 'direction':
        return 'in the positive direction' if low >= 0 else 'in the negative direction'
    of = variable.partition(' of ')[2] or library.residuals.drives[library.d]
    factor, unit = read_in(variable, library.residuals.units_of(of))
    word = _words(variable)
    values = library.values(variable)
    speed = pattern.kind in ('directed_range', 'fast', 'fading') and variable.startswith('velocity')
    if variable.startswith('velocity') and (speed or np.isclose(-low, high)):
        word = word.replace('velocity', 'speed')
        values, low = np.abs(values), max(low, 0.0)
    below, above = high < values.max(), low > values.min() and not (speed and low <= 0)
    if below and (not above or (word.startswith('speed') and low <= 0)):
        return f'at a {word} below {high * factor:.3g} {unit}'
    if above and not below:
        return f'at a {word} above {low * factor:.3g} {unit}'
    return f'at a {word} between {low * factor:.3g} and {high * factor:.3g} {unit}'


def _ends(
    library: PatternLibrary, variable: str, shape: Array, directed: bool,
) -> tuple[float, float]:
    values = library.values(variable)[library.series.known]
    if directed:
        shape = shape * library.values('direction')[library.series.known]
    order = np.argsort(values)
    few = max(1, len(order) // 100)
    return float(np.median(shape[order[:few]])), float(np.median(shape[order[-few:]]))


def _words(variable: str) -> str:
    name, of, other = variable.partition(' of ')
    return WORDS.get(name, name) + of + other
