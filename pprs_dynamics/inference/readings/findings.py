# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a recording's numbers mean instead of what its names and units say, as findings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.system.plain_yaml import scalar

Scales = tuple[tuple[str, str, float | str | int], ...]


@dataclass(frozen=True)
class Mistake(Defect):
    """A finding about what a recording's numbers mean.

    Parameters
    ----------
    kind, count, what, spans, drives
        See `Defect`.
    line : str
        What to write into the model file, so that it is read as it looks; '' where no line does.
    """

    line: str = ''

    @classmethod
    def of(cls, kind: str, drives: Sequence[str], group: Sequence[int], what: str,
           line: str = '', **more: Any) -> Self:
        """Return a mistake of some of the drives."""
        return cls(kind, len(group), what, (), tuple(drives[k] for k in group), line, **more)

    @property
    def action(self) -> str:
        """What was done about it, as a clause."""
        return 'nothing is changed'


class NoMeasurement(Mistake):
    """A finding that efforts are not what drives were measured to apply."""

    @property
    def action(self) -> str:
        """What follows, as a clause."""
        return 'no effect is claimed'


def effort_looks_like(findings: Iterable[Iterable[Defect]]) -> dict[str, str] | None:
    """Return the kind of each drive's effort that findings call no measurement; None for none."""
    return {drive: finding.kind for finding in no_measurements(findings)
            for drive in finding.drives} or None


def no_measurements(findings: Iterable[Iterable[Defect]]) -> list[NoMeasurement]:
    """Return what of the findings of recordings says that efforts are no measurement."""
    return [one for each in findings for one in each if isinstance(one, NoMeasurement)]


@dataclass(frozen=True)
class OtherReading(Mistake):
    """A finding that a recording is in other units, signs or another order than it says.

    Parameters
    ----------
    kind, count, what, spans, drives, line
        See `Mistake`.
    scales : tuple of (drive, key, value)
        Of `columns` in the model file, so that it is read as it looks; '' for keys of no drive.
    """

    scales: Scales = ()


def columns_line(findings: Iterable[OtherReading], has_columns: bool = False) -> str:
    """Return the line of a model file with which a recording is read as it looks; '' for none.

    Where the file has `columns` already, what is to be added to the columns of each drive.
    """
    blocks: dict[str, list[str]] = {}
    for drive, key, value in (scale for finding in findings for scale in finding.scales):
        blocks.setdefault(drive, []).append(
            f'{key}: {scalar(value) if isinstance(value, str | int) else f"{value:.7g}"}')
    entries = [entry if not drive else f'{drive}: {{{entry}}}' for drive, entry in (
        (drive, ', '.join(keys)) for drive, keys in blocks.items())]
    if has_columns and entries:
        return f'under columns, beside what stands there: {", ".join(entries)}'
    return f'columns: {{{", ".join(entries)}}}' if entries else ''
