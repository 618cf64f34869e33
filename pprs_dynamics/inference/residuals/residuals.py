# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measured and modelled efforts side by side, with the variables the error may depend on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pprs_dynamics.arrays import Array, Integers, root_mean_square
from pprs_dynamics.drives import DriveUnits, common_effort
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.stamps import stretches

# Samples that may be missing, in times the usual distance of those that were measured: over more
# missing ones a stretch ends.
LONGEST_BRIDGE = 10


class ResidualsError(PprsError, ValueError):
    """Arrays that do not make a comparison.

    Parameters
    ----------
    quantity, found, rule : str
        The quantity, its value, and the rule ("it must ...").
    """

    def __init__(self, quantity: str, found: str, rule: str) -> None:
        self.quantity, self.found, self.rule = quantity, found, rule
        super().__init__(f'{quantity}: {found}, must {rule}')


@dataclass(frozen=True)
class Residuals:
    """M samples of D drives: effort measured and effort of the model, after one treatment.

    Parameters
    ----------
    drives : tuple of str
        Names, D of them.
    time : (M,) array
        [s].
    segment : (M,) int array
        Samples of one number follow each other without a gap.
    measured : (M, D) array
        Effort [N]; NaN where it was not measured.
    model : (M, D) array
        Effort of the model [N].
    parts : mapping of str to (M, D) array
        Shares of `model` [N], e.g. rigid_body.
    variables : mapping of str to (M,) or (M, D) array
        What the error may depend on, under the names of the interface, in SI units:
        per drive position, velocity, acceleration, load, rod_angle and direction (sgn of the
        velocity; derived from it where absent); common to all platform_x and so on.
    period : float
        Time between samples [s].
    units : tuple of DriveUnits
        Of the drives; drives that push where they are not given.
    record : (M,) int array
        Noise goes on through gaps between samples of one number, and starts anew in the next; by
        default the segments.

    Raises
    ------
    ResidualsError
        For a non-finite model or variable, or nothing measured.
    """

    drives: tuple[str, ...]
    time: Array
    segment: Integers
    measured: Array
    model: Array
    parts: Mapping[str, Array] = field(default_factory=dict)
    variables: Mapping[str, Array] = field(default_factory=dict)
    period: float = 0.01
    units: tuple[DriveUnits, ...] = ()
    record: Integers = field(
        default_factory=lambda: np.zeros(0, dtype=int))

    def __post_init__(self) -> None:
        if not len(self.record):
            object.__setattr__(self, 'record', self.segment)
        for name, array in {'model': self.model, **self.variables}.items():
            _require(bool(np.isfinite(array).all()), name,
                     'it contains a number that is not finite', 'be finite')
        _require(bool(np.isfinite(self.measured).any()), 'effort', 'none was measured on any drive',
                 'be recorded with the positions (<drive>/effort in a CSV, effort in JointState)')

    def blocks(self, count: int) -> Integers:
        """Return in which of `count` blocks of equal length each sample is, (M,)."""
        return np.arange(len(self)) * count // len(self)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def unit(self) -> str:
        """Unit of efforts and errors over all drives."""
        return common_effort(self.units)

    def units_of(self, drive: str) -> DriveUnits:
        """Return the units of a drive's quantities."""
        return self.units[self.drives.index(drive)] if self.units else DriveUnits()

    @property
    def error(self) -> Array:
        """Measured minus model [N], (M, D); NaN where not measured."""
        return self.measured - self.model

    def variable(self, name: str, drive: int) -> Array | None:
        """Return a variable as that drive sees it, (M,), or None where it is unknown.

        Of another one `position of DRIVE`.
        """
        name, _, other = name.partition(' of ')
        if other:
            return self.variable(name, self.drives.index(other)) if other in self.drives else None
        if name == 'time':
            return self.time
        if name == 'direction' and name not in self.variables:
            velocity = self.variable('velocity', drive)
            return None if velocity is None else np.sign(velocity)
        array = self.variables.get(name)
        return array if array is None or array.ndim == 1 else array[:, drive]

    def stretches(self, drive: int) -> list[slice]:
        """Return where the drive was measured without a gap that is long.

        Each stretch is of one segment, and starts and ends with a measurement.
        """
        found = []
        for part in stretches(self.segment):
            known = part.start + np.flatnonzero(np.isfinite(self.measured[part, drive]))
            if len(known):
                steps = np.diff(known)
                usual = np.median(steps) if len(steps) else 1
                cuts = np.flatnonzero(steps > LONGEST_BRIDGE * usual + 1)
                begins = np.concatenate(([known[0]], known[cuts + 1]))
                ends = np.concatenate((known[cuts], [known[-1]])) + 1
                found += [slice(int(a), int(b)) for a, b in zip(begins, ends, strict=True)]
        return found


def rms(residuals: Residuals) -> float:
    """Return the root of the mean squared error over samples and drives, in `residuals.unit`."""
    return root_mean_square(residuals.error)


def rms_by_drive(residuals: Residuals) -> dict[str, float]:
    """Return the root of the mean squared error of every drive that was measured [N or N m]."""
    return {drive: root_mean_square(residuals.error[:, d])
            for d, drive in enumerate(residuals.drives)
            if np.isfinite(residuals.error[:, d]).any()}


def _require(condition: bool, quantity: str, found: str, rule: str) -> None:
    if not condition:
        raise ResidualsError(quantity, found, rule)
