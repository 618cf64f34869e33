# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Checks of command-line values; argparse turns their errors into one line and status 2."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

JSON, PAGE, MODEL, POSES = ('.json',), ('.html',), ('.yaml', '.yml'), ('.csv',)
RECORDING = ('.csv', '.mcap', '.db3', '')  # without an ending: a rosbag2 folder
LARGEST_SEED = 2**63 - 1
MOST_DIGITS = 30  # of a whole number; Python refuses to read those of thousands


DEFAULT_MODEL = 'config/paper.yaml'


def add_details(parser: argparse.ArgumentParser) -> None:
    """Declare --details."""
    parser.add_argument('--details', action='store_true', help='print all there is to say')


def number(lower: float, upper: float, unit: str = '', above: bool = False,
           ) -> Callable[[str], float]:
    """Return a reader of numbers from `lower`, or above it, to `upper`."""
    rule = (f'must be greater than {lower:g} and at most {upper:g}' if above
            else f'must lie between {lower:g} and {upper:g}') + f' {unit}' * bool(unit)

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lower <= value <= upper or (above and value == lower):
            raise argparse.ArgumentTypeError(f'{text[:MOST_DIGITS]!r} {rule}')
        return value
    return read


def seed(text: str) -> int:
    """Read the seed of random numbers."""
    if not (text.isascii() and text.isdecimal() and len(text) <= MOST_DIGITS
            and int(text) <= LARGEST_SEED):
        raise argparse.ArgumentTypeError(
            f'{text[:MOST_DIGITS]!r} must be a whole number from 0 to {LARGEST_SEED}')
    return int(text)


def output_file(*endings: str) -> Callable[[str], str]:
    """Return a reader of names of files that can be written, before minutes are spent on them.

    Parameters
    ----------
    endings : str
        Those that are known; '' where a name without an ending is a folder to be made.
    """
    *first, last = (ending or 'nothing, for a rosbag2 folder' for ending in endings)
    known = f'{", ".join(first)} or {last}' if first else last

    def read(text: str) -> str:
        path = Path(text)
        if path.suffix not in endings and not path.is_dir():
            raise argparse.ArgumentTypeError(f'{text!r} must end in {known}')
        if path.is_dir() or (not path.suffix and path.exists()):
            raise argparse.ArgumentTypeError(f'{text}: cannot be written: ' + (
                'it exists already, and bags are never overwritten' if '' in endings
                else 'it is a folder'))
        if not path.absolute().parent.is_dir():
            raise argparse.ArgumentTypeError(
                f'{text}: cannot be written: its folder does not exist')
        return text
    return read
