# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drives: their names and units, and what files of recordings call them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

# Of the 3-PPRS of the paper.
DRIVES = ('slide_1', 'slide_2', 'slide_3', 'lift_1', 'lift_2', 'lift_3')
COUNT = len(DRIVES)

# Units of a drive that pushes, and of the same quantity of one that turns.
TURNED = {'m': 'rad', 'm/s': 'rad/s', 'm/s^2': 'rad/s^2', 'N': 'N m', 'kg': 'kg m^2',
          'N s/m': 'N m s/rad', 'N s^2/m^2': 'N m s^2/rad^2', 'N/m': 'N m/rad'}


@dataclass(frozen=True)
class DriveUnits:
    """Units of one drive's quantities.

    Parameters
    ----------
    turns : bool
        Whether it is revolute.
    """

    turns: bool = False

    def of(self, unit: str) -> str:
        """Return the unit of a quantity of which this is the unit where a drive pushes."""
        return TURNED.get(unit, unit) if self.turns else unit

    @property
    def effort(self) -> str:
        """Unit of efforts."""
        return self.of('N')

    @property
    def position(self) -> str:
        """Unit of positions."""
        return self.of('m')


def common_effort(units: Sequence[DriveUnits]) -> str:
    """Return the unit of errors over all drives: that of their efforts, or of both kinds."""
    return common_unit(units, 'N')


def common_unit(units: Sequence[DriveUnits], unit: str) -> str:
    """Return a quantity's unit over all drives, or the units of both kinds; see `DriveUnits.of`."""
    return ' or '.join(sorted({one.of(unit) for one in units})) or unit


class DriveColumns(NamedTuple):
    """Columns of one drive, by quantity, and what their numbers are multiplied by."""

    names: Mapping[str, str]
    effort_scale: float = 1.0
    position_scale: float = 1.0


class RecordedColumns(NamedTuple):
    """Columns of a table that is no recording by its header: of time, and of each drive."""

    time: str
    drives: Mapping[str, DriveColumns]


@dataclass(frozen=True)
class RecordedDrives:
    """D drives, and how recordings hold them.

    Parameters
    ----------
    names : tuple of D str
    joints : tuple of D str, optional
        What messages and columns call them; their names where not given.
    columns : RecordedColumns, optional
        Of tables that are no recordings by their header.
    gain : tuple of D floats, optional
        Effort per ampere, for what was recorded as a current [N m/A, N/A].
    in_amperes : bool
        Whether efforts are currents, too; columns named `current` always are.
    units : tuple of D DriveUnits, optional
        For what is found wrong; of drives that push by default.
    effort_limits : tuple of D floats, optional
        Largest absolute efforts that the drives can apply: what is there is left out.
    """

    names: tuple[str, ...]
    joints: tuple[str, ...] = ()
    columns: RecordedColumns | None = None
    gain: tuple[float, ...] | None = None
    in_amperes: bool = False
    units: tuple[DriveUnits, ...] = ()
    effort_limits: tuple[float, ...] = ()
