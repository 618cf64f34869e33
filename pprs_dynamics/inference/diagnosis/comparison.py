# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The error of a model per drive and over all drives, in numbers and words, and where it lies.

Noise, criterion and patterns of the places are those of the search for missing effects, without
any effect. The pattern that lowers the cost most is stated first. The columns of its variable then
join the fit, until no pattern lowers the cost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.diagnosis.quantities import (
    capitalised,
    in_unit,
    listed,
    name_drives,
    percent,
    word_little,
)
from pprs_dynamics.inference.diagnosis.statements import Statement, word_statement
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.candidates import PriorCosts
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.explained_effort import explained_shares
from pprs_dynamics.inference.search.noise_floors import noise_at_most
from pprs_dynamics.inference.search.scan import with_fast_noise
from pprs_dynamics.inference.search.unknown import DrivePatterns, best_patterns
from pprs_dynamics.system.json_records import JsonRecord

ROUNDING = 1e-9  # of the effort, below which a difference is no error
MOST_STATEMENTS = 3  # per drive
PROPOSALS, PROPOSED = 4, -30.0  # fitted in full, of each scan; lowest score of these


Localised = tuple[tuple[Statement, ...], Mapping[str, NoiseSpectrum]]
"""Statements on all drives, by evidence, and the noise of each drive with enough samples."""


def localise(residuals: Residuals, progress: Callable[[float], None] = lambda share: None,
             ) -> Localised:
    """Return the patterns of the error of each drive that noise does not explain, and the noise.

    Parameters
    ----------
    residuals : Residuals
        Of as much of recordings as a search holds in memory.
    progress : callable, optional
        Called with the share of the work that is done.
    """
    statements: list[Statement] = []
    noise: dict[str, NoiseSpectrum] = {}
    for drive, name in enumerate(residuals.drives):
        found = _search(residuals, drive)
        if found is not None:
            statements.extend(found[0])
            noise[name] = found[1]
        progress((drive + 1) / len(residuals.drives))
    return tuple(sorted(statements, key=lambda statement: -statement.evidence)), noise


def _search(residuals: Residuals, drive: int) -> tuple[list[Statement], NoiseSpectrum] | None:
    """Return the statements on a drive and its noise; None with too few samples or no error."""
    try:
        regression = Regression(residuals, drives=(drive,))
    except ResidualsError:
        return None
    error, measured = residuals.error[:, drive], residuals.measured[:, drive]
    if np.nanmax(np.abs(error)) <= ROUNDING * np.nanmax(np.abs(measured)):
        return None
    prior_costs = replace(PriorCosts.of(regression, DECISIONS), drives=len(residuals.drives))
    drive_patterns = DrivePatterns(regression, prior_costs, drive, with_plain_forms=True)
    fit = regression.fit(())
    statements: list[Statement] = []
    blocks: list[Block] = []
    while len(statements) < MOST_STATEMENTS:
        stated = {statement.variable for statement in statements}
        tried = [(regression.fit([*blocks, candidate.block], near), candidate)
                 for near in (fit, with_fast_noise(regression, fit))
                 for candidate in best_patterns([drive_patterns], near, PROPOSALS, PROPOSED)
                 if candidate.family.variable not in stated or candidate.pattern.kind == 'line']
        found, winner = min(tried, key=lambda tried: tried[0].deviance + tried[1].terms.total,
                            default=(fit, None))
        if winner is None or not (evidence := (
                fit.deviance - found.deviance - winner.terms.total)) > 0:
            break
        statements.append(word_statement(
            drive_patterns, winner, found.of(winner.block), evidence))
        # Any curve along the variable of a statement is explained with it.
        blocks += [winner.block, *(
            drive_patterns.family_block(family) for family in drive_patterns.families
            if family.variable == winner.family.variable and not family.paired)]
        fit = regression.fit(blocks, found)
    return statements, regression.noise(fit)[drive]


@dataclass(frozen=True)
class DriveComparison(JsonRecord):
    """Error of the model on one drive: rms, bias, peak, explained share and noise.

    Parameters
    ----------
    drive : str
    rms, bias, peak : float
        Root mean square, mean and largest absolute value of measured minus model [N, N m].
    effort : float
        rms of the measured effort with its mean removed [N].
    relative : float
        `rms` over the rms of the effort with its mean removed; NaN for a constant effort.
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

    json_keys = ('rms', 'relative', 'bias', 'peak')

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
    is_little: bool

    @property
    def unexplained(self) -> float:
        """Root of rms squared minus noise floor squared [N]; the rms where that is not known."""
        return float(np.sqrt(max(self.rms ** 2 - (self.noise_floor or 0.0) ** 2, 0.0)))

    @property
    def grade(self) -> str:
        """Grade of the model: 'noise', 'good', 'fair' or 'poor'."""
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


@dataclass(frozen=True)
class Comparison(JsonRecord):
    """Errors of all drives, and of all together.

    Parameters
    ----------
    drives : mapping of str to DriveComparison
        Errors of each drive that was measured.
    rms, relative : float
        Pooled over drives [N]; and over the pooled effort.
    statements : tuple of Statement
        Patterns of all errors.
    noise : mapping of str to NoiseSpectrum
        Of what remains of the error of each drive; not of drives with too few samples.
    unit : str
        Of errors over all drives.
    little : mapping of str to float
        Drives of whose effort the model explains little, with the shares.
    """

    json_keys = ('drives', 'overall', 'explained', 'noise_floors', 'where')

    drives: Mapping[str, DriveComparison]
    rms: float
    relative: float
    statements: tuple[Statement, ...]
    noise: Mapping[str, NoiseSpectrum]
    unit: str
    little: Mapping[str, float]

    @property
    def where(self) -> tuple[Statement, ...]:
        """Statements that explain a visible share of the squared error, the largest first."""
        large = [statement for statement in self.statements
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
        share = ('' if np.isnan(self.relative) else
                 f" ({percent(self.relative)} of the effort's variation)")
        little = f'{word_little(self.little)}; ' if self.little else ''
        error = capitalised(f'{little}the error is {in_unit(self.rms, self.unit)}{share}')
        beyond = [drive for drive in self.drives.values() if drive.grade != 'noise']
        if self.relative < DECISIONS.negligible:
            return f'{error}, which is negligible.'
        if not beyond:
            placed = sorted({place.drive for place in self.where})
            return f'{error}. It is noise{f", except on {listed(placed)}" if placed else ""}.'
        worst = max(beyond, key=lambda drive: drive.unexplained)
        where = name_drives([drive.drive for drive in beyond], list(self.drives))
        most = f', most on {worst.drive}' * (len(beyond) > 1)
        is_known = any(drive.noise_floor is not None for drive in beyond)
        what = 'it is more than noise' if is_known else 'the noise is not known'
        return (f'{error}. On {where} {what}{most}: {in_unit(worst.unexplained, worst.unit)}'
                f'{" unexplained" * is_known} ({worst.grade}).')

    @property
    def overall(self) -> dict[str, float]:
        """`rms` over all drives and samples [N], and `relative`: the same over the effort's."""
        return {'rms': self.rms, 'relative': self.relative}

    @property
    def explained(self) -> dict[str, float]:
        """Share of each drive's effort variance that the model explains."""
        return {name: drive.explained_variance for name, drive in self.drives.items()}

    @property
    def noise_floors(self) -> dict[str, float | None]:
        """Root mean square of the noise of each drive [N]; null where it is not known."""
        return {name: drive.noise_floor for name, drive in self.drives.items()}


def compare(residuals: Residuals, localised: Localised | None = None,
            floors: Mapping[str, float] = MappingProxyType({}),
            little: Mapping[str, float] = MappingProxyType({})) -> Comparison:
    """Return how the model compares with the measurement.

    Parameters
    ----------
    residuals : Residuals
    localised : Localised, optional
        Of these residuals, where it is known already.
    floors : mapping of str to float, optional
        The noise of the drives [N], see `search.noise_floors`.
    little : mapping of str to float, optional
        Drives of whose effort little is explained, see `search.explained_effort`.
    """
    statements, noise = localised or localise(residuals)
    shares = explained_shares(residuals)
    drives = {name: _compare_drive(
        residuals, name, [statement for statement in statements if statement.drive == name],
        noise.get(name), share, floors.get(name), name in little)
        for name, share in shares.items()}
    samples = [drive.samples for drive in drives.values()]
    rms, effort = (float(np.sqrt(np.average(np.square(values), weights=samples))) for values in (
        [drive.rms for drive in drives.values()], [drive.effort for drive in drives.values()]))
    constant = all(np.isnan(drive.relative) for drive in drives.values())
    return Comparison(drives, rms, float('nan') if constant else rms / effort, statements, noise,
                      residuals.unit, little)


def _compare_drive(
    residuals: Residuals, name: str, statements: Sequence[Statement],
    noise: NoiseSpectrum | None, share: float, floor: float | None, is_little: bool,
) -> DriveComparison:
    index = residuals.drives.index(name)
    known = np.isfinite(residuals.measured[:, index])
    error, effort = residuals.error[known, index], residuals.measured[known, index]
    rms, swing = root_mean_square(error), root_mean_square(effort - effort.mean())
    if floor is not None and noise is not None and noise.period == residuals.period:
        # What no pattern explains is an upper bound of the noise.
        floor = noise_at_most(floor, noise.rms)
    most = max((statement.mean_square for statement in statements), default=0.0)
    return DriveComparison(
        name, rms, float(error.mean()), float(np.abs(error).max()), swing,
        float('nan') if np.isnan(share) else rms / swing, share, len(error), floor,
        residuals.units_of(name).effort, float(np.sqrt(most)), is_little)
