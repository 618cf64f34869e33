# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Numbers and names as people read them: 10.2 ± 0.4 mm/s, all six drives, a or b."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, inf, isfinite, log10, pi

INTERVAL = 2.0  # standard deviations that ± stands for, about 95 %
# Values below a size are read in another unit: size, factor, name.
READ_IN = {'m': (1.0, 1e3, 'mm'), 'm/s': (1.0, 1e3, 'mm/s'), 's': (0.1, 1e3, 'ms'),
           'kg': (0.1, 1e3, 'g'), 'rad': (inf, 180 / pi, '°')}
PRINTED = {'1': '', 'kg m^2': 'kg m²', 'N s^2/m^2': 'N s²/m²', 'm/s^2': 'm/s²',
           'N m s^2/rad^2': 'N m s²/rad²', 'rad/s^2': 'rad/s²'}
COUNTS = ('no', 'one', 'two', 'three', 'four', 'five', 'six')


def with_uncertainty(value: float, std: float, unit: str, size: float | None = None) -> str:
    """Return a value with ± two standard deviations, in a unit that fits its size or another."""
    below, factor, name = READ_IN.get(unit, (0.0, 1.0, unit))
    if abs(value if size is None else size) >= below:
        factor, name = 1.0, unit
    name = PRINTED.get(name, name)
    name = name if name in ('', '°') else f' {name}'
    value, spread = value * factor, INTERVAL * std * factor
    if not isfinite(spread):
        return f'{value:.3g}{name} (not determined)'
    if spread <= 0:
        return f'{value:.4g}{name}'
    decimals = 1 - floor(log10(spread))
    digits = max(decimals, 0)
    return f'{round(value, decimals):.{digits}f} ± {round(spread, decimals):.{digits}f}{name}'


def in_unit(value: float, unit: str = 'N', digits: int = 3) -> str:
    """Return an effort with as many digits and its unit, never as a power of ten."""
    return f'{plain(value, digits)} {unit}'


def plain(value: float, digits: int = 3) -> str:
    """Return a number with as many digits, never as a power of ten."""
    if not isfinite(value) or value == 0:
        return f'{value:g}'
    decimals = max(digits - 1 - floor(log10(abs(value))), 0)
    text = f'{value:.{decimals}f}'
    return text.rstrip('0').rstrip('.') if '.' in text else text


def percent(share: float) -> str:
    """Return a share in percent, with two digits below 10 %; 'none' for NaN."""
    if not isfinite(share):
        return 'none'
    return f'{100 * share:.0f}%' if abs(share) >= 0.0995 else f'{plain(100 * share, 2)}%'


def change(before: float, after: float, unit: str = 'N') -> str:
    """Return 'falls from A to B', with digits that show it, or that it does not fall."""
    if after >= before:
        return (f'does not fall ({in_unit(before, unit)} before, {in_unit(after, unit)} '
                'after)')
    digits = next((n for n in range(3, 7) if plain(before, n) != plain(after, n)), 6)
    return f'falls from {in_unit(before, unit, digits)} to {in_unit(after, unit, digits)}'


def name_drives(drives: Sequence[str], every: Sequence[str]) -> str:
    """Return what a set of drives is called: all six drives, all three lifts, lift_1 and lift_3."""
    kinds = {'drives': list(every), **{f'{kind}s': [d for d in every if d.startswith(f'{kind}_')]
                                       for kind in ('slide', 'lift')}}
    for kind, alike in kinds.items():
        if 2 < len(alike) < len(COUNTS) and set(drives) == set(alike):
            return f'all {COUNTS[len(alike)]} {kind}'
    return listed([name for name in every if name in drives])


def with_drives(name: str, drives: tuple[str, ...] | None, every: tuple[str, ...]) -> str:
    """Return what it is and where it sits."""
    return name if drives is None else f'{name} on {name_drives(drives, every)}'


def listed(names: Sequence[str], last: str = 'and') -> str:
    """Return a, b and c."""
    if len(names) < 2:
        return ''.join(names)
    return f'{", ".join(names[:-1])} {last} {names[-1]}'


def sentence(text: str) -> str:
    """Return a phrase with a capital and a full stop."""
    return f'{text[:1].upper()}{text[1:]}.'
