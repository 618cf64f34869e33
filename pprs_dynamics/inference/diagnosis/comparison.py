# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How wrong the model is: the numbers per drive and overall, and what they mean in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.localisation import Localisation, localise
from pprs_dynamics.inference.diagnosis.quantities import in_unit, listed, percent
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.system.numbers import finite

# Of the effort's size, below which a changing effort is rounding.
CONSTANT = 1e-9


@dataclass(frozen=True)
class DriveComparison:
    """Model against measurement on one drive.

    Parameters
    ----------
    rms, bias, peak : float
        Of measured minus model [N]; peak is the largest absolute value.
    relative : float
        rms over the rms of the measured effort with its mean removed; NaN where that effort is
        constant.
    effort : float
        rms of the measured effort with its mean removed [N].
    explained_variance : float
        1 - var(residual) / var(effort); NaN where the effort is constant.
    samples : int
        Measured ones.
    effective_samples : float
        Independent samples whose mean would be as uncertain.
    noise_floor : float
        rms of the noise: of the spectrum that is fitted beside all patterns [N].
    unexplained : float
        Root of rms squared minus noise floor squared [N].
    parts : mapping of str to float
        rms of each part of the model, its mean removed [N].
    grade : {'noise', 'good', 'fair', 'poor'}
    unit : str
        Of the drive's efforts.
    verdict : str
    """

    rms: float
    relative: float
    bias: float
    peak: float
    effort: float
    explained_variance: float
    samples: int
    effective_samples: float
    noise_floor: float
    unexplained: float
    parts: Mapping[str, float]
    grade: str
    unit: str
    verdict: str


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
    verdict : str
    localisation : Localisation
        Where it fails.
    unit : str
        Of errors over all drives.
    """

    drives: Mapping[str, DriveComparison]
    rms: float
    relative: float
    verdict: str
    localisation: Localisation
    unit: str = 'N'

    @property
    def where(self) -> tuple[Statement, ...]:
        """Where it fails, what explains most of the squared error first, and nothing slight."""
        return _told(self.drives, self.localisation)

    @property
    def is_beyond_noise(self) -> bool:
        """Whether there is anything but noise on any drive."""
        return bool(self.where) or any(one.grade != 'noise' for one in self.drives.values())

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of the interface; a number that is not defined is null."""
        return {
            'drives': {name: {key: finite(getattr(drive, key))
                              for key in ('rms', 'relative', 'bias', 'peak')}
                       for name, drive in self.drives.items()},
            'overall': {'rms': finite(self.rms), 'relative': finite(self.relative)},
            'where': [statement.to_dict() for statement in self.where]}


def compare(residuals: Residuals, localisation: Localisation | None = None) -> Comparison:
    """Return how the model compares with the measurement.

    Parameters
    ----------
    residuals : Residuals
    localisation : Localisation, optional
        Its result where it is known already; what it finds is not noise.
    """
    where = localisation or localise(residuals)
    drives: dict[str, DriveComparison] = {}
    squares = efforts = 0.0
    count = 0
    for index, name in enumerate(residuals.drives):
        known = np.isfinite(residuals.measured[:, index])
        if not known.any():
            continue
        error = residuals.error[known, index]
        effort = residuals.measured[known, index]
        drives[name] = _compare_drive(residuals, index, name, where)
        squares += float(error @ error)
        efforts += float(np.sum((effort - effort.mean()) ** 2))
        count += len(error)
    rms = float(np.sqrt(squares / count))
    whole = float(np.sqrt(efforts / count))
    constant = all(np.isnan(drive.relative) for drive in drives.values())
    relative = float('nan') if constant else rms / whole
    told, unit = {one.drive for one in _told(drives, where)}, residuals.unit
    return Comparison(drives, rms, relative,
                      _overall_verdict(drives, told, rms, relative, unit), where, unit)


def _compare_drive(
    residuals: Residuals, index: int, name: str, where: Localisation,
) -> DriveComparison:
    known = np.isfinite(residuals.measured[:, index])
    error, effort = residuals.error[known, index], residuals.measured[known, index]
    rms, bias, peak = root_mean_square(error), float(error.mean()), float(np.abs(error).max())
    swing = root_mean_square(effort - effort.mean())
    constant = swing <= CONSTANT * max(float(np.abs(effort).max()), CONSTANT)
    relative = float('nan') if constant else rms / swing
    explained = float('nan') if constant else 1 - float(np.var(error)) / swing ** 2
    findings = where.drives.get(name)
    noise = findings.noise if findings is not None else None
    level = next((one for one in findings.statements if one.kind == 'level'), None) if (
        findings is not None) else None
    floor = rms if noise is None else min(rms, noise.rms_at(residuals.period))
    if level is not None:
        floor = float(np.sqrt(max(floor ** 2 - level.mean_square, 0.0)))
    # What a statement explains is no noise, even where a spectrum takes its peaks for some.
    most = max((one.mean_square for one in (findings.statements if findings is not None else ())
                if one.kind not in ('scatter', 'level')), default=0.0)
    floor = min(floor, float(np.sqrt(max(rms ** 2 - most, 0.0))))
    unexplained = float(np.sqrt(max(rms ** 2 - floor ** 2, 0.0)))
    parts = {part: root_mean_square(values[known, index] - values[known, index].mean())
             for part, values in residuals.parts.items()}
    grade = _grade(unexplained, floor, swing, constant, parts)
    unit = residuals.units_of(name).effort
    return DriveComparison(
        rms, relative, bias, peak, swing, explained, len(error),
        float(len(error)) if noise is None else noise.effective_samples(len(error)), floor,
        unexplained, parts, grade, unit, f'{name}: ' + _verdict(
            rms, swing, relative, floor, unexplained, parts, grade, unit,
            most >= DECISIONS.statement_share * rms ** 2))


def _grade(
    unexplained: float, floor: float, swing: float, constant: bool, parts: Mapping[str, float],
) -> str:
    # The noise is known to a share: what is left beyond it is nothing below this.
    if unexplained <= np.sqrt((1 + DECISIONS.noise_accuracy) ** 2 - 1) * floor:
        return 'noise'
    smallest = min((size for size in parts.values() if size > 0), default=np.inf)
    if not constant and unexplained <= DECISIONS.good * swing and unexplained <= smallest:
        return 'good'
    if constant or unexplained > DECISIONS.poor * swing:
        return 'poor'
    return 'fair'


def _verdict(
    rms: float, swing: float, relative: float, floor: float, unexplained: float,
    parts: Mapping[str, float], grade: str, unit: str, is_told: bool,
) -> str:
    of = ('of a constant effort' if np.isnan(relative)
          else f'of {in_unit(swing, unit)} ({percent(relative)})')
    left = f'the model leaves {in_unit(rms, unit)} {of}; '
    if rms == 0:
        return f'the model leaves nothing {of}'
    if grade == 'noise':
        return left + ('noise accounts for most of it' if is_told else
                       'noise accounts for it: nothing else stands out in this recording')
    left += (f'noise accounts for {in_unit(floor, unit)}, so {in_unit(unexplained, unit)} is '
             'unexplained')
    ranked = sorted(((size, part) for part, size in parts.items() if size > 0), reverse=True)
    below = [(size, part) for size, part in ranked if size < unexplained]
    if below:
        size, part = below[0]
        left += f' - more than {part.replace("_", " ")} contributes ({in_unit(size, unit)})'
    elif ranked:
        size, part = ranked[-1]
        left += f' - less than {part.replace("_", " ")} contributes ({in_unit(size, unit)})'
    return f'{left}: {grade}'


def _told(drives: Mapping[str, DriveComparison], where: Localisation) -> tuple[Statement, ...]:
    told = [one for one in where.statements if one.drive in drives
            and one.mean_square >= DECISIONS.statement_share * drives[one.drive].rms ** 2]
    return tuple(sorted(told, key=lambda one: -one.mean_square))


def _overall_verdict(drives: Mapping[str, DriveComparison], told: Collection[str], rms: float,
                     relative: float, unit: str) -> str:
    share = '' if np.isnan(relative) else f' ({percent(relative)} of the effort)'
    beyond = {name: drive for name, drive in drives.items() if drive.grade != 'noise'}
    if not beyond:
        most = f'most of it on {listed(sorted(told))}, for all of it elsewhere' if told else (
            'it on every drive')
        return f'the model leaves {in_unit(rms, unit)}{share}: noise accounts for {most}'
    worst = max(beyond, key=lambda name: beyond[name].unexplained)
    where = 'every drive' if len(beyond) == len(drives) > 1 else ', '.join(beyond)
    return (f'the model leaves {in_unit(rms, unit)}{share}: more than noise on {where}; '
            f'worst on {worst}, {in_unit(beyond[worst].unexplained, beyond[worst].unit)} '
            f'unexplained ({beyond[worst].grade})')
