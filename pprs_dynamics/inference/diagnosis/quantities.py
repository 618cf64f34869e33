# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Format numbers and names for people: 10.2 ± 0.4 mm/s, all six drives, a or b."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor, inf, isfinite, log10, pi

INTERVAL = 2.0  # standard deviations that ± stands for, about 95 %
# Values below a size are read in another unit: size, factor, name.
READ_IN = {'m': (1.0, 1e3, 'mm'), 'm/s': (1.0, 1e3, 'mm/s'), 's': (0.1, 1e3, 'ms'),
           'kg': (0.1, 1e3, 'g'), 'rad': (inf, 180 / pi, '°')}
PRINTED = {'1': '', 'kg m^2': 'kg m²', 'N s^2/m^2': 'N s²/m²', 'm/s^2': 'm/s²',
           'N m s^2/rad^2': 'N m s²/rad²', 'rad/s^2': 'rad/s²'}
# Times the size that matters, an uncertainty beyond which, and beyond the value, nothing is known.
ANYTHING = 100.0
RESOLVED = 1e-9  # of any quantity in SI units, below which a number is rounding


def with_uncertainty(value: float, std: float, unit: str, size: float | None = None) -> str:
    """Return a value with ± two standard deviations, in a unit that fits its size or another."""
    factor, name = _fitting_unit(abs(value if size is None else size), unit)
    value, spread = value * factor, INTERVAL * std * factor
    if not isfinite(spread):
        return f'{plain(value)}{name} (not determined)'
    if spread < RESOLVED:
        return f'{plain(value, 4)}{name}'
    decimals = 1 - floor(log10(spread))
    digits = max(decimals, 0)
    rounded = round(value, decimals) or 0.0  # no -0.0
    return f'{rounded:.{digits}f} ± {round(spread, decimals):.{digits}f}{name}'


def in_fitting_unit(values: Sequence[float], unit: str) -> str:
    """Return 'a' or 'a to b' of sizes with two digits, in a unit that fits the largest."""
    factor, name = _fitting_unit(max(values), unit)
    return ' to '.join(dict.fromkeys(plain(value * factor, 2) for value in values)) + name


def _fitting_unit(size: float, unit: str) -> tuple[float, str]:
    """Return the printed unit in which a quantity of a size is read, and its factor."""
    below, factor, name = READ_IN.get(unit, (0.0, 1.0, unit))
    if size >= below:
        factor, name = 1.0, unit
    name = PRINTED.get(name, name)
    return factor, name if name in ('', '°') else f' {name}'


def as_fitted(value: float, std: float, unit: str, scale: float, size: float) -> str:
    """Return a fitted value as `with_uncertainty` does; that it is none where it may be anything.

    `scale` is the size that matters.
    """
    if INTERVAL * std > max(size, ANYTHING * scale):
        return 'not determined by this motion'
    return with_uncertainty(value, std, unit, size)


def in_unit(value: float, unit: str = 'N') -> str:
    """Return an effort and its unit, never as a power of ten."""
    return f'{measured(value)} {unit}'


def plain(value: float, digits: int = 3) -> str:
    """Return a number with so many digits, never as a power of ten; 0 below `RESOLVED`."""
    text = measured(value, digits)
    return text.rstrip('0').rstrip('.') if '.' in text else text


def measured(value: float, digits: int = 3) -> str:
    """Return a measured number as `plain` does, with zeros at its end: they are known digits."""
    if not isfinite(value) or abs(value) < RESOLVED:
        return f'{value:g}' if not isfinite(value) else '0'
    return f'{value:.{_decimals(value, digits)}f}'


def rounded_as(value: float, other: float, sign: str = '') -> str:
    """Return a number to the place at which another of its kind has three digits."""
    decimals = _decimals(other, 3) if isfinite(other) and abs(other) >= RESOLVED else 0
    text = f'{value:{sign}.{decimals}f}'
    return text if float(text) else f'{0:.{decimals}f}'


def _decimals(value: float, digits: int) -> int:
    return max(digits - 1 - floor(log10(abs(value))), 0)


def with_sign(value: float, digits: int = 3) -> str:
    """Return a number as `plain` does, with its sign; 0 has none."""
    text = plain(value, digits)
    return f'+{text}' if value > 0 and text != '0' else text


def percent(share: float) -> str:
    """Return a share in percent, with two digits below 10 %; 'none' for NaN."""
    if not isfinite(share):
        return 'none'
    return f'{100 * share:.0f}%' if abs(share) >= 0.0995 else f'{plain(100 * share, 2)}%'


def change(before: float, after: float, unit: str = 'N') -> str:
    """Return 'falls from A to B', with digits that show it, or that it does not fall."""
    if not after < before:  # nor where one is not a number
        return (f'does not fall ({in_unit(before, unit)} before, {in_unit(after, unit)} '
                'after)')
    digits = digits_apart(before, after)
    first, second = measured(before, digits), measured(after, digits)
    if first == second:  # six digits do not show it
        return f'falls from {in_unit(before, unit)} by less than 0.001%'
    return f'falls from {first} {unit} to {second} {unit}'


def fall(before: float, after: float) -> str:
    """Return two efforts as `A → B`, with as many digits as show their difference."""
    digits = digits_apart(before, after)
    return f'{measured(before, digits)} → {measured(after, digits)}'


def digits_apart(before: float, after: float) -> int:
    """Return how many digits show the difference of two numbers, from 3 to 6."""
    return next((n for n in range(3, 7) if plain(before, n) != plain(after, n)), 6)


def word_little(little: Mapping[str, float], after: str = '') -> str:
    """Return 'the model explains 14% of the effort of shoulder, …', '' where there is none.

    Parameters
    ----------
    little : mapping of str to float
        See `little_explained`.
    after : str, optional
        Words after 'the model', e.g. ' with the reported effects'.
    """
    shares = [f'{max(share, 0.0):.0%} of the effort of {name}' for name, share in little.items()]
    return f'the model{after} explains {listed(shares)}' if shares else ''


def name_drives(drives: Sequence[str], every: Sequence[str]) -> str:
    """Return the names of drives: lift_1 and lift_3, all 6 drives."""
    if 2 < len(every) == len(drives):
        return f'all {len(every)} drives'
    return listed([name for name in every if name in drives])


def with_drives(name: str, drives: tuple[str, ...] | None, every: tuple[str, ...]) -> str:
    """Return an effect's name with its drives."""
    return name if drives is None else f'{name} on {name_drives(drives, every)}'


def listed(names: Sequence[str], last: str = 'and') -> str:
    """Return a, b and c."""
    if len(names) < 2:
        return ''.join(names)
    return f'{", ".join(names[:-1])} {last} {names[-1]}'


def capitalised(text: str) -> str:
    """Return a phrase with a capital."""
    return text[:1].upper() + text[1:]


def sentence(text: str) -> str:
    """Return a phrase with a capital and a full stop."""
    return f'{capitalised(text)}.'
