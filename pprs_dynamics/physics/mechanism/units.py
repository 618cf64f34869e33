# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Units of drives: of those that push, and of those that turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
