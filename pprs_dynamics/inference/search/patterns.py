# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Patterns of a drive's error: columns per variable.

A family belongs to one variable. Its columns are indicators of bins (alone, and times the
direction of motion) and straight lines; its patterns are the combinations tried: every
run of neighbouring bins, a growth, a friction-like change of sign. One pattern is one degree of
freedom, so that patterns of all families compete on equal terms; a family with more patterns
pays for having had more tries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from itertools import chain, compress
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.profiles import BINS, bin_edges, bin_of, populated_edges
from pprs_dynamics.inference.residuals.residuals import Residuals

TIME_BINS = 16
# Shares of the samples that lie below the speeds where bins of the velocity end.
SLOW_SHARES = (0.03, 0.06, 0.12, 0.2, 0.35, 0.55, 0.8)
# Friction turns over at a reversal within a speed that is seldom known: shares of the highest.
REVERSAL_WIDTHS = (0.0015, 0.005, 0.015)
RIPPLE_PERIODS = (2, 32)  # periods of a force ripple within the drive's travel
# Cosines of a curve, the shortest with 16 periods within the travel, and the periods from which on
# the prior expects less of them: a curve is smooth.
CURVE, CURVE_TERMS, SMOOTH_PERIODS = 'directed_curve', 33, 2.0
CURVE_WIDTHS = (*REVERSAL_WIDTHS, 0.05)
# Widths of smooth bumps, as parts of the stroke, and their standard deviation in widths.
BUMP_PARTS = (4, 8, 16, 32)
BUMP_DEVIATION = 0.4
OWN = ('position', 'acceleration', 'load', 'rod_angle')
PLATFORM = ('platform_x', 'platform_y', 'platform_z', 'platform_tilt', 'platform_turn')
# Variables along which a force that opposes or follows the motion may change.
DIRECTED = ('position', 'load', 'time')


class Pattern(NamedTuple):
    """One shape of an error along a variable.

    Parameters
    ----------
    kind : str
        'offset', 'range', 'bump', 'directed_range', 'growth', 'directed_growth', 'one_way',
        'friction', 'fading', 'fast', 'ripple', 'line' or 'directed_curve'.
    limits : (float, float) or None
        Of the variable, where the pattern is confined to them.
    scale : float
        Period or frequency of a ripple or line.
    """

    kind: str
    limits: tuple[float, float] | None = None
    scale: float = 0.0


@dataclass(frozen=True, eq=False)
class Family:
    """Columns of one variable and the patterns tried on them.

    Parameters
    ----------
    variable : str
        Name in the interface.
    columns : (C, N) array
        In single precision: there are hundreds of them.
    weights : (P, C) array
        Each pattern's combination of the columns; for pairs (`paired`) unused.
    patterns : tuple of Pattern
    alike : int
        How many variables of this sort there are; their choice is paid for too.
    paired : bool
        Columns 2 k and 2 k + 1 are the cosine and sine of pattern k.
    """

    variable: str
    columns: Array
    weights: Array
    patterns: tuple[Pattern, ...]
    alike: int = 1
    paired: bool = False
    edges: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def is_plain(self) -> bool:
        """True for a constant and for the direction: effects of the catalogue are just that."""
        return self.variable == 'direction' or self.patterns[0].kind == 'offset'

    def pattern_columns(self, index: int) -> Array:
        """Return the (1 or 2, N) columns of one pattern."""
        if self.paired:
            return self.columns[2 * index:2 * index + 2].astype(float)
        return self.weights[index:index + 1] @ self.columns


def build_families(residuals: Residuals, drive: int) -> list[Family]:
    """Return the families of one drive, over the variables that are known."""
    families = [_offset(len(residuals))]
    direction = residuals.variable('direction', drive)
    velocity = residuals.variable('velocity', drive)
    moving = direction is not None and bool(np.ptp(direction) > 0.5)
    if moving and direction is not None:
        families.append(_direction(direction, velocity))
    sign = direction if moving else None
    families += _maybe(_velocity, 'velocity', velocity, sign, 1)
    for name in (*OWN, 'time'):
        values = residuals.variable(name, drive)
        families += _maybe(_scalar, name, values, sign if name in DIRECTED else None, 1)
    for name in PLATFORM:
        families += _maybe(_scalar, name, residuals.variable(name, drive), None, 1)
    position = residuals.variable('position', drive)
    if position is not None and np.ptp(position) > 0:
        families.append(_ripple(position))
    for name in ('position', 'velocity'):
        others = [other for other in range(len(residuals.drives)) if other != drive]
        if name not in residuals.variables or residuals.variables[name].ndim == 1:
            continue
        build = _velocity if name == 'velocity' else _scalar
        for other in others:
            whose = f'{name} of {residuals.drives[other]}'
            families += _maybe(build, whose, residuals.variable(name, other), None, len(others))
    return families


def speed_edges(velocity: Array) -> Array:
    """Return edges of speed, from 0, that resolve slow motion."""
    speed = np.abs(velocity)
    edges = np.concatenate(([0.0], np.quantile(speed, SLOW_SHARES), [speed.max()]))
    return populated_edges(speed, edges)


def _maybe(
    build: Callable[[str, Array, Array | None, int], Family], name: str, values: Array | None,
    sign: Array | None, alike: int,
) -> list[Family]:
    if values is None or np.ptp(values) <= 1e-9 * max(1e-9, float(np.abs(values).max())):
        return []
    return [build(name, values, sign, alike)]


def _offset(samples: int) -> Family:
    return Family('time', np.ones((1, samples)), np.ones((1, 1)), (Pattern('offset'),))


def _direction(sign: Array, velocity: Array | None) -> Family:
    columns, patterns = [], []
    for turned in _turning(sign, velocity):
        columns += [(turned + 1) / 2, (1 - turned) / 2, turned]
        patterns += [Pattern('one_way', (0.0, 1.0)), Pattern('one_way', (-1.0, 0.0)),
                     Pattern('friction')]
    return Family('direction', np.stack(columns), np.eye(len(columns)), tuple(patterns))


def _turning(sign: Array, velocity: Array | None,
             widths: tuple[float, ...] = REVERSAL_WIDTHS) -> list[Array]:
    """Return the direction of motion, also as it turns over within several speeds."""
    return [sign] + [_turned(velocity, width) for width in widths if velocity is not None]


def directed_curve(residuals: Residuals, drive: int) -> tuple[Array, Array] | None:
    """Return friction that is any smooth function of the position, however it turns over.

    As rows (k, M), and the precision of their coefficients (k,) for a curve of about 1. None of a
    drive that does not move both ways.
    """
    position, direction = (residuals.variable(name, drive) for name in ('position', 'direction'))
    if position is None or direction is None or np.ptp(direction) < 0.5:
        return None
    k = np.arange(CURVE_TERMS)
    waves = np.cos(np.pi * k[:, None] * (position - position.min()) / np.ptp(position))
    turning = _turning(direction, residuals.variable('velocity', drive), CURVE_WIDTHS)
    return np.concatenate([turned * waves for turned in turning]), np.tile(
        0.5 * (1 + (k / (2 * SMOOTH_PERIODS)) ** 2) ** 2, len(turning))


def _turned(velocity: Array, width: float) -> Array:
    turned: Array = np.tanh(velocity / (width * max(float(np.abs(velocity).max()), 1e-300)))
    return turned


def _scalar(name: str, values: Array, sign: Array | None, alike: int) -> Family:
    edges = bin_edges(values, TIME_BINS if name == 'time' else BINS)
    bins = _indicators(values, edges)
    low, high = float(values.min()), float(values.max())
    middle = values - values.mean()
    lines = [middle / np.std(values), (values - low) / (high - low), (high - values) / (high - low)]
    # In proportion, where that differs from an offset.
    if low * high > 0 and high - low > 0.3 * max(abs(low), abs(high)):
        lines.append(values / np.abs(values).max())
    parts = [_ranges('range', bins, edges), _each('growth', lines)]
    if sign is not None:
        parts += [_ranges('directed_range', sign * bins, edges),
                  _each('directed_growth', sign * np.stack(lines))]
    if name == 'position':
        parts.append(_bumps(values))
    return _family(name, parts, alike, edges)


Part = tuple[Array, Array, list[Pattern]]
"""Columns of a family, the combinations of them that are patterns, and these."""


def _family(name: str, parts: list[Part], alike: int, edges: Array) -> Family:
    columns, weights, patterns = zip(*parts, strict=True)
    return Family(name, np.concatenate(columns).astype(np.float32), block_diag(*weights),
                  tuple(chain.from_iterable(patterns)), alike, edges=edges)


def _ranges(kind: str, bins: Array, edges: Array) -> Part:
    return bins, _runs(len(bins)), _run_patterns(kind, edges)


def _each(kind: str, columns: Iterable[Array], limits: tuple[float, float] | None = None,
          ) -> Part:
    rows = np.stack(list(columns))
    return rows, np.eye(len(rows)), [Pattern(kind, limits)] * len(rows)


def _bumps(values: Array) -> Part:
    """Return smooth bumps at many places and of several widths.

    A smooth force is no range: at the limits of a range the difference would be a jump, which
    whitening makes larger than what the range explains.
    """
    low, span = float(values.min()), float(np.ptp(values))
    columns, patterns = [], []
    for parts in BUMP_PARTS:
        width = span / parts
        for centre in low + width * np.arange(0.5, parts, 0.5):
            columns.append(np.exp(-0.5 * ((values - centre) / (BUMP_DEVIATION * width)) ** 2))
            patterns.append(Pattern('bump', (max(centre - width / 2, low),
                                             min(centre + width / 2, low + span))))
    return np.stack(columns), np.eye(len(columns)), patterns


def _velocity(name: str, values: Array, sign: Array | None, alike: int) -> Family:
    speeds = speed_edges(values)
    edges = populated_edges(values, np.concatenate((-speeds[:0:-1], speeds)))
    edges[0], edges[-1] = min(edges[0], values.min()), max(edges[-1], values.max())
    bins, runs, ranges = _ranges('range', _indicators(values, edges), edges)
    # What begins or ends at a standstill and spans all of one direction is the direction's.
    keep = [set(p.limits or ()) not in ({0.0, float(edges[-1])}, {0.0, float(edges[0])})
            for p in ranges]
    fast = values / np.abs(values).max()
    parts = [(bins, runs[keep], list(compress(ranges, keep))),
             _each('growth', (fast, fast * np.abs(fast), np.abs(fast)))]
    if len(speeds) > 2:
        # Fast in either direction (one range cannot say it), and with the sign of the motion.
        even = _indicators(np.abs(values), speeds)
        parts.append((even, np.triu(np.ones((len(even), len(even))))[1:], [
            Pattern('fast', (float(edge), float(speeds[-1]))) for edge in speeds[1:-1]]))
        if sign is not None:
            parts.append(_ranges('directed_range', sign * even, speeds))
            # Friction that falls off with speed has no edge.
            turned = np.stack((sign, _turned(values, REVERSAL_WIDTHS[1])))
            parts += [_each('fading', turned * np.exp(-(values / edge) ** 2), (0.0, float(edge)))
                      for edge in speeds[1:-1]]
    return _family(name, parts, alike, edges)


def _ripple(position: Array) -> Family:
    span = float(np.ptp(position))
    numbers = np.arange(*RIPPLE_PERIODS)
    columns, patterns = [], []
    for number in numbers:
        phase = 2 * np.pi * number * position / span
        columns += [np.cos(phase), np.sin(phase)]
        patterns.append(Pattern('ripple', scale=span / float(number)))
    return Family('position', np.stack(columns), np.zeros((0, 0)), tuple(patterns), paired=True)


def _indicators(values: Array, edges: Array) -> Array:
    result: Array = (bin_of(values, edges) == np.arange(len(edges) - 1)[:, None]).astype(float)
    return result


@cache
def _runs(bins: int) -> Array:
    """Return every run of neighbouring bins but that of all, (P, bins)."""
    index = np.arange(bins)
    rows = [((index >= a) & (index <= b)) for a in range(bins) for b in range(a, bins)
            if b - a + 1 < bins]
    return np.array(rows, dtype=float).reshape(-1, bins)


def _run_patterns(kind: str, edges: Array) -> list[Pattern]:
    bins = len(edges) - 1
    return [Pattern(kind, (float(edges[a]), float(edges[b + 1])))
            for a in range(bins) for b in range(a, bins) if b - a + 1 < bins]


def trial_limits(
    limit: float, outer: tuple[float, float], edges: Array, width: float,
) -> Array:
    """Return trial limits within a share of the way to a limit's neighbouring edges."""
    grid = np.unique(np.concatenate((edges, np.abs(edges), outer)))
    below, above = grid[grid < limit - 1e-12], grid[grid > limit + 1e-12]
    low = below[-1] if len(below) else outer[0]
    high = above[0] if len(above) else outer[1]
    share = np.arange(1, 5) / 5 * width
    return np.unique(np.concatenate((limit - share * (limit - low), [limit],
                                     limit + share * (high - limit))))
