# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The error of a model per drive and over all drives, in numbers and in words."""

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
from pprs_dynamics.inference.search.noise_floors import noise_at_most
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
    noise_floor : float or None
        rms of the noise [N]; None where it is not known. See `search.noise_floors`.
    unit : str
        Of the drive's efforts.
    pattern : float
        rms of the largest pattern of the error that a statement describes [N]; it is no noise.
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
    noise_floor: float | None
    unit: str
    pattern: float
    is_little: bool = False

    @property
    def unexplained(self) -> float:
        """Root of rms squared minus noise floor squared [N]; the rms where that is not known."""
        return float(np.sqrt(max(self.rms ** 2 - (self.noise_floor or 0.0) ** 2, 0.0)))

    @property
    def grade(self) -> str:
        """How good the model is: 'noise', 'good', 'fair' or 'poor'."""
        # Below the uncertainty of the noise nothing can be attributed to the model.
        least = np.sqrt((1 + DECISIONS.noise_accuracy) ** 2 - 1) * (self.noise_floor or 0.0)
        if self.is_little:
            return 'poor'
        if self.rms == 0 or self.relative < DECISIONS.negligible or (
                self.noise_floor is not None and max(self.unexplained, self.pattern) <= least):
            return 'noise'
        if np.isnan(self.relative) or self.unexplained > DECISIONS.poor * self.effort:
            return 'poor'
        return 'good' if self.unexplained <= DECISIONS.good * self.effort else 'fair'

    @property
    def verdict(self) -> str:
        """The numbers in words."""
        share = ('of a constant effort' if np.isnan(self.relative)
                 else f'{percent(self.relative)} of the effort')
        error = f'{self.drive}: the error is {in_unit(self.rms, self.unit)} ({share})'
        if self.rms == 0 or self.relative < DECISIONS.negligible:
            return f'{error}: negligible'
        if self.grade == 'noise':
            has_pattern = self.pattern ** 2 >= DECISIONS.statement_share * self.rms ** 2
            return f'{error}, {"mostly" if has_pattern else "all of it"} noise'
        noise = ('the noise is not known' if self.noise_floor is None else
                 f'{in_unit(self.noise_floor, self.unit)} of it is noise and '
                 f'{in_unit(self.unexplained, self.unit)} unexplained')
        return f'{error}; {noise}: {self.grade}'


@dataclass(frozen=True)
class Beside:
    """Errors of another model on the same recordings.

    Parameters
    ----------
    name : str
        Of its file.
    drives : mapping of str to float
        Root of the mean squared error of each drive [N or N m].
    rms : float
        The same over all drives.
    """

    name: str
    drives: Mapping[str, float]
    rms: float

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
        """Statements that explain a visible share of the squared error, the largest first."""
        large = [statement for statement in self.localisation.statements
                 if statement.drive in self.drives
                 and not self.drives[statement.drive].relative < DECISIONS.negligible
                 and statement.share_of_error >= DECISIONS.statement_share
                 and statement.mean_square >= (
                    DECISIONS.statement_share * self.drives[statement.drive].rms ** 2)]
        return tuple(sorted(large, key=lambda statement: -statement.mean_square))

    @property
    def is_beyond_noise(self) -> bool:
        """Whether there is anything but noise on any drive."""
        return bool(self.where) or any(
            drive.grade != 'noise' for drive in self.drives.values())

    @property
    def verdict(self) -> str:
        """The numbers over all drives, in at most two sentences."""
        share = '' if np.isnan(self.relative) else f' ({percent(self.relative)} of the effort)'
        little = f'{word_little(self.little)}; ' if self.little else ''
        error = f'{little}the error is {in_unit(self.rms, self.unit)}{share}'
        error = error[:1].upper() + error[1:]
        beyond = [drive for drive in self.drives.values() if drive.grade != 'noise']
        known = [drive for drive in beyond if drive.noise_floor is not None]
        if self.relative < DECISIONS.negligible:
            return f'{error}, which is negligible.'
        if not beyond:
            placed = sorted({place.drive for place in self.where})
            return f'{error}. It is noise{f", except on {listed(placed)}" if placed else ""}.'
        worst = (max(known, key=lambda drive: drive.unexplained) if known else
                 max(beyond, key=lambda drive: drive.rms / max(drive.effort, 1e-300)))
        where = 'every drive' if len(beyond) == len(self.drives) > 1 else listed(
            [drive.drive for drive in beyond])
        what = 'it is more than noise' if known else 'the noise is not known'
        worst_is = f'; the worst is {worst.drive} with ' if len(beyond) > 1 else ': '
        return (f'{error}. On {where} {what}{worst_is}{in_unit(worst.unexplained, worst.unit)}'
                f'{" unexplained" if known else ""} ({worst.grade}).')

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
        Of these residuals, where it is known already.
    floors : mapping of str to float, optional
        The noise of the drives [N], see `search.noise_floors`.
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
    noise = findings.noise
    if floor is not None and noise is not None and noise.period == residuals.period:
        # What no pattern explains is an upper bound of the noise.
        floor = noise_at_most(floor, noise.rms)
    most = max((statement.mean_square for statement in findings.statements), default=0.0)
    return DriveComparison(
        name, rms, float(error.mean()), float(np.abs(error).max()), swing,
        float('nan') if np.isnan(share) else rms / swing, share, len(error), floor,
        residuals.units_of(name).effort, float(np.sqrt(most)), is_little)
