# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Drives: their names and units, and what files of recordings call them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

# Of the 3-PPRS of the paper.
DRIVES = ('slide_1', 'slide_2', 'slide_3', 'lift_1', 'lift_2', 'lift_3')
COUNT = len(DRIVES)

# Units of a drive that pushes, and of the same quantity of one that turns.
TURNED = {'m': 'rad', 'm/s': 'rad/s', 'm/s^2': 'rad/s^2', 'N': 'N m', 'kg': 'kg m^2',
          'N s/m': 'N m s/rad', 'N s^2/m^2': 'N m s^2/rad^2', 'N/m': 'N m/rad', 'm/N': 'rad/(N m)',
          'N/K': 'N m/K', 'N s/m/K': 'N m s/rad/K'}


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
    return ' or '.join(sorted({known.of(unit) for known in units})) or unit


# What may be measured of drives beside their motion and effort, and its unit in one that pushes:
# also the position of the link, behind the gear, where a second encoder tells it.
CHANNELS = {'temperature': 'degC', 'pressure': 'Pa', 'link_position': 'm'}

# A column of a table by its name, or by its number from 1. `name[k]` is element k, from 0, of a
# column that holds lists; a dot is between a structure and its field.
Column = str | int


class DriveColumns(NamedTuple):
    """Columns of one drive, by quantity, and how their numbers become SI units.

    Parameters
    ----------
    names : mapping of str to str or int
    effort_scale, position_scale, velocity_scale : float
        Factors.
    position_offset : float
        Added to positions after the factor [m, rad].
    effort_sign_bit : int, optional
        Bit that is set in negative efforts, of efforts that are recorded as magnitudes.
    """

    names: Mapping[str, Column] = MappingProxyType({})
    effort_scale: float = 1.0
    position_scale: float = 1.0
    velocity_scale: float = 1.0
    position_offset: float = 0.0
    effort_sign_bit: int | None = None


class RecordedColumns(NamedTuple):
    """Layout of a table of recorded columns; the default is the format of this package.

    Parameters
    ----------
    time : str or int, optional
    drives : mapping of str to DriveColumns
    time_scale : float, optional
        Seconds per unit of time; as the stamps look by default.
    rate : float, optional
        Samples per second of tables without times [Hz].
    decimal : {'.', ','}
        What is between the whole and the rest of a number.
    files : mapping of str to str
        By quantity, or `time`: files that make one recording, from its folder; * is what
        recordings differ in.
    channels : mapping of str to str or int
        By quantity: a column of the whole machine, for drives that have none of their own.
    time_fraction : str or int, optional
        Milliseconds, microseconds or nanoseconds to be added to whole seconds in `time`.
    """

    time: Column | None = None
    drives: Mapping[str, DriveColumns] = MappingProxyType({})
    time_scale: float | None = None
    rate: float | None = None
    decimal: str = '.'
    files: Mapping[str, str] = MappingProxyType({})
    channels: Mapping[str, Column] = MappingProxyType({})
    time_fraction: Column | None = None


@dataclass(frozen=True)
class RecordedDrives:
    """D drives, and how recordings hold them.

    Parameters
    ----------
    names : tuple of D str
    joints : tuple of D str, optional
        What messages and columns call them; their names where not given.
    columns : RecordedColumns, optional
        Of tables that are no recordings by their header, and of topics that are no joint states.
    gain : tuple of D floats, optional
        Effort per ampere, for what was recorded as a current [N m/A, N/A].
    in_amperes : bool
        Whether efforts are currents, too; columns named `current` always are.
    units : tuple of D DriveUnits, optional
        For what is found wrong; of drives that push by default.
    effort_limits : tuple of D floats, optional
        Largest absolute efforts that the drives can apply: what is there is left out.
    effort_factor : float
        Recorded efforts are multiplied by it [N m, N per unit of the file].
    """

    names: tuple[str, ...]
    joints: tuple[str, ...] = ()
    columns: RecordedColumns | None = None
    gain: tuple[float, ...] | None = None
    in_amperes: bool = False
    units: tuple[DriveUnits, ...] = ()
    effort_limits: tuple[float, ...] = ()
    effort_factor: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, 'joints', self.joints or self.names)

    @property
    def layout(self) -> RecordedColumns:
        """Layout of tables, that of this package where none is given."""
        return self.columns or RecordedColumns()

    def columns_of(self, drive: str) -> DriveColumns:
        """Return the columns of a drive, none where none are given."""
        return self.layout.drives.get(drive, DriveColumns())

    @property
    def named(self) -> dict[tuple[str, str], Column]:
        """Columns that are given, by joint and quantity."""
        return {(joint, quantity): column
                for joint, drive in zip(self.joints, self.names, strict=True)
                for quantity, column in self.columns_of(drive).names.items()}
