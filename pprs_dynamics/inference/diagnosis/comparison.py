# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How wrong the model is: the numbers per drive and overall, and what they mean in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.localisation import DriveFindings, Localisation, localise
from pprs_dynamics.inference.diagnosis.quantities import in_unit, listed, percent, word_little
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.explained_effort import explained_shares
from pprs_dynamics.system.numbers import finite


@dataclass(frozen=True)
class DriveComparison:
    """Model against measurement on one drive.

    Parameters
    ----------
    drive : str
    rms, bias, peak : float
        Of measured minus model [N]; peak is the largest absolute value.
    effort : float
        rms of the measured effort with its mean removed [N].
    relative : float
        rms over `effort`; NaN where that effort is constant.
    explained_variance : float
        1 - var(residual) / var(effort); NaN where the effort is constant.
    samples : int
        Measured ones.
    effective_samples : float
        Independent samples whose mean would be as uncertain.
    noise_floor : float or None
        rms of the noise [N]; None where it cannot be told. See `search.noise_floors`.
    parts : mapping of str to float
        rms of each part of the model, its mean removed [N].
    unit : str
        Of the drive's efforts.
    told : float
        rms of the largest pattern that a statement tells [N]; it is no noise.
    is_little : bool
        Whether the model explains little of the effort, see `search.explained_effort`.
    """

    drive: str
    rms: float
    bias: float
    peak: float
    effort: float
    relative: float
    explained_variance: float
    samples: int
    effective_samples: float
    noise_floor: float | None
    parts: Mapping[str, float]
    unit: str
    told: float
    is_little: bool = False

    @property
    def unexplained(self) -> float:
        """Root of rms squared minus noise floor squared [N]; the rms where that is not known."""
        return float(np.sqrt(max(self.rms ** 2 - (self.noise_floor or 0.0) ** 2, 0.0)))

    @property
    def grade(self) -> str:
        """How good the model is: 'noise', 'good', 'fair' or 'poor'."""
        # The noise is known to a share: what is left beyond it is nothing below this.
        sure = np.sqrt((1 + DECISIONS.noise_accuracy) ** 2 - 1)
        if self.is_little:
            return 'poor'
        if self.rms == 0 or self.relative < DECISIONS.negligible or (
                self.noise_floor is not None
                and max(self.unexplained, self.told) <= sure * self.noise_floor):
            return 'noise'
        if np.isnan(self.relative) or self.unexplained > DECISIONS.poor * self.effort:
            return 'poor'
        smallest = min((size for size in self.parts.values() if size > 0), default=np.inf)
        is_small = self.unexplained <= min(DECISIONS.good * self.effort, smallest)
        return 'good' if is_small else 'fair'

    @property
    def verdict(self) -> str:
        """The numbers in words."""
        of = ('of a constant effort' if np.isnan(self.relative)
              else f'of {self._told(self.effort)} ({percent(self.relative)})')
        if self.rms == 0:
            return f'{self.drive}: the model leaves nothing {of}'
        left = f'{self.drive}: the model leaves {self._told(self.rms)} {of}; '
        if self.relative < DECISIONS.negligible:
            return f'{left}next to nothing'
        if self.grade == 'noise':
            is_told = self.told ** 2 >= DECISIONS.statement_share * self.rms ** 2
            return left + ('noise accounts for most of it' if is_told else
                           'noise accounts for it: nothing else stands out in this recording')
        left += ('how much of it is noise cannot be told' if self.noise_floor is None else
                 f'noise accounts for {self._told(self.noise_floor)}, so '
                 f'{self._told(self.unexplained)} is unexplained')
        # What contributes next to nothing is no measure of anything.
        least = DECISIONS.statement_share * self.effort
        ranked = sorted(((size, part) for part, size in self.parts.items() if size > least),
                        reverse=True)
        below = [(size, part) for size, part in ranked if size < self.unexplained]
        if ranked:
            size, part = below[0] if below else ranked[-1]
            left += (f' - {"more" if below else "less"} than {part.replace("_", " ")} contributes '
                     f'({self._told(size)})')
        return f'{left}: {self.grade}'

    def _told(self, value: float) -> str:
        return in_unit(value, self.unit)


@dataclass(frozen=True)
class Beside:
    """Errors of another model on the same recordings, or of the model on another recording.

    Parameters
    ----------
    name : str
        Of its file.
    drives : mapping of str to float
        Root of the mean squared error of each drive [N].
    rms : float
        Over all drives [N].
    unit : str
    """

    name: str
    drives: Mapping[str, float]
    rms: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return name and errors."""
        return {'name': self.name, 'drives': {name: {'rms': finite(value)}
                                              for name, value in self.drives.items()},
                'overall': {'rms': finite(self.rms)}}


@dataclass(frozen=True)
class Comparison:
    """All drives, and what they pool to.

    Parameters
    ----------
    drives : mapping of str to DriveComparison
        Only drives with measurements.
    rms, relative : float
        Pooled over drives [N]; and over the pooled effort.
    localisation : Localisation
        Where it fails.
    unit : str
        Of errors over all drives.
    little : mapping of str to float
        Drives of whose effort the model explains little, with the shares.
    """

    drives: Mapping[str, DriveComparison]
    rms: float
    relative: float
    localisation: Localisation
    unit: str = 'N'
    little: Mapping[str, float] = field(default_factory=dict)

    @property
    def where(self) -> tuple[Statement, ...]:
        """Where it fails, what explains most of the squared error first, and nothing slight."""
        told = [statement for statement in self.localisation.statements
                if statement.drive in self.drives
                and not self.drives[statement.drive].relative < DECISIONS.negligible
                and statement.share_of_error >= DECISIONS.statement_share
                and statement.mean_square >= (
                    DECISIONS.statement_share * self.drives[statement.drive].rms ** 2)]
        return tuple(sorted(told, key=lambda one: -one.mean_square))

    @property
    def is_beyond_noise(self) -> bool:
        """Whether there is anything but noise on any drive."""
        return bool(self.where) or any(one.grade != 'noise' for one in self.drives.values())

    @property
    def verdict(self) -> str:
        """The numbers over all drives in words."""
        share = '' if np.isnan(self.relative) else f' ({percent(self.relative)} of the effort)'
        leaves = f'leaves {in_unit(self.rms, self.unit)}{share}'
        left = (f'{word_little(self.little)}; it {leaves}: ' if self.little
                else f'the model {leaves}: ')
        beyond = [drive for drive in self.drives.values() if drive.grade != 'noise']
        told = [drive for drive in beyond if drive.noise_floor is not None]
        if beyond and not told:
            worst = max(beyond, key=lambda drive: drive.rms / max(drive.effort, 1e-300))
            return (f'{left}how much of it is noise cannot be told on '
                    f'{listed([drive.drive for drive in beyond])}; worst on {worst.drive}, '
                    f'{in_unit(worst.rms, worst.unit)} ({worst.grade})')
        if self.relative < DECISIONS.negligible:
            return f'{left}next to nothing'
        if not beyond:
            placed = sorted({place.drive for place in self.where})
            return f'{left}noise accounts for ' + (
                f'most of it on {listed(placed)}, for all of it elsewhere' if placed
                else 'it on every drive')
        worst = max(told, key=lambda drive: drive.unexplained)
        where = ('every drive' if len(told) == len(self.drives) > 1
                 else ', '.join(drive.drive for drive in told))
        return (f'{left}more than noise on {where}; worst on {worst.drive}, '
                f'{in_unit(worst.unexplained, worst.unit)} unexplained ({worst.grade})')

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the interface; a number that is not defined is null."""
        return {
            'drives': {name: {key: finite(getattr(drive, key))
                              for key in ('rms', 'relative', 'bias', 'peak')}
                       for name, drive in self.drives.items()},
            'overall': {'rms': finite(self.rms), 'relative': finite(self.relative)},
            'explained': {name: finite(drive.explained_variance)
                          for name, drive in self.drives.items()},
            'noise_floors': {name: drive.noise_floor for name, drive in self.drives.items()},
            'where': [statement.to_dict() for statement in self.where]}


def compare(residuals: Residuals, localisation: Localisation | None = None,
            floors: Mapping[str, float] = MappingProxyType({}),
            little: Mapping[str, float] = MappingProxyType({})) -> Comparison:
    """Return how the model compares with the measurement.

    Parameters
    ----------
    residuals : Residuals
    localisation : Localisation, optional
        Its result where it is known already; what it finds is not noise.
    floors : mapping of str to float, optional
        The noise of the drives where it can be told [N], see `search.noise_floors`.
    little : mapping of str to float, optional
        Drives of whose effort little is explained, see `search.explained_effort`.
    """
    where = localisation or localise(residuals)
    shares = explained_shares(residuals)
    drives = {name: _compare_drive(residuals, name, where, share, floors.get(name),
                                   name in little) for name, share in shares.items()}
    samples = [drive.samples for drive in drives.values()]
    rms, effort = (float(np.sqrt(np.average(np.square(values), weights=samples))) for values in (
        [drive.rms for drive in drives.values()], [drive.effort for drive in drives.values()]))
    constant = all(np.isnan(drive.relative) for drive in drives.values())
    return Comparison(drives, rms, float('nan') if constant else rms / effort, where,
                      residuals.unit, little)


def _compare_drive(
    residuals: Residuals, name: str, where: Localisation, share: float, floor: float | None,
    is_little: bool,
) -> DriveComparison:
    index = residuals.drives.index(name)
    known = np.isfinite(residuals.measured[:, index])
    error, effort = residuals.error[known, index], residuals.measured[known, index]
    rms, swing = root_mean_square(error), root_mean_square(effort - effort.mean())
    findings = where.drives.get(name, DriveFindings((), None))
    most = max((statement.mean_square for statement in findings.statements
                if statement.kind not in ('scatter', 'level')), default=0.0)
    return DriveComparison(
        name, rms, float(error.mean()), float(np.abs(error).max()), swing,
        float('nan') if np.isnan(share) else rms / swing, share, len(error),
        float(len(error)) if findings.noise is None else findings.noise.effective_samples(
            len(error)), floor,
        {part: root_mean_square(values[known, index] - values[known, index].mean())
         for part, values in residuals.parts.items()},
        residuals.units_of(name).effort, float(np.sqrt(most)), is_little)
