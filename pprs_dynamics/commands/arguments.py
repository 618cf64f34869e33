"""Checks of command-line values; argparse turns their errors into one line and status 2."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable


def at_least(lower: float) -> Callable[[str], float]:
    """Return a reader of finite numbers of at least `lower`."""
    def read(text: str) -> float:
        value = _number(text)
        if value < lower:
            raise argparse.ArgumentTypeError(f'{text} must be at least {lower:g}')
        return value
    return read


def positive(text: str) -> float:
    """Read a finite number greater than 0."""
    value = _number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f'{text} must be greater than 0')
    return value


def whole(text: str) -> int:
    """Read a whole number of at least 0."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'{text!r} must be a whole number of at least 0')
    return int(text)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} must be a number') from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text} must be finite')
    return value
