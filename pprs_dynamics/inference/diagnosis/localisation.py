# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Where the model fails: patterns of each drive's error that its noise does not explain.

Noise, criterion and patterns are those of the search for missing effects, without any effect. The
pattern that lowers the cost most is stated first. The columns of its variable then join the fit,
until no pattern lowers the cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pprs_dynamics.inference.diagnosis.statements import Statement, word_statement
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.profiles import MOST_SHARE
from pprs_dynamics.inference.residuals.residuals import Residuals, ResidualsError
from pprs_dynamics.inference.search.candidates import PriorCosts, UnknownCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.scan import with_fast_noise
from pprs_dynamics.inference.search.unknown import DrivePatterns
from pprs_dynamics.system.parallel import each

MOST_SAMPLES = 16_000  # of a drive; longer recordings are averaged
ROUNDING = 1e-9  # of the effort, below which a difference is no error
MOST_STATEMENTS = 3  # per drive
PROPOSALS = 4  # fitted in full, of each scan
PLACES = ('range', 'directed_range', 'fast')  # patterns that say where an error lies
PROPOSED = -30.0  # lowest score of a pattern that is fitted in full


@dataclass(frozen=True)
class DriveFindings:
    """What the search says about one drive.

    Parameters
    ----------
    statements : tuple of Statement
    noise : NoiseSpectrum or None
        Of what remains; None with too few samples to search.
    """

    statements: tuple[Statement, ...]
    noise: NoiseSpectrum | None


@dataclass(frozen=True)
class Localisation:
    """Findings of all drives, and the statements ranked by evidence.

    Parameters
    ----------
    statements : tuple of Statement
    drives : mapping of str to DriveFindings
    """

    statements: tuple[Statement, ...]
    drives: dict[str, DriveFindings]


def localise(residuals: Residuals, progress: Callable[[float], None] | None = None,
             ) -> Localisation:
    """Return where the error of each drive lies, as far as noise would not do the same.

    Parameters
    ----------
    residuals : Residuals
        Averaged to at most 16 000 samples first; what is faster than that is not seen.
    progress : callable, optional
        Called with the share of the work that is done.
    """
    thin = residuals.thinned(MOST_SAMPLES)
    report = progress or (lambda share: None)
    done: list[int] = []

    def search_drive(drive: int) -> DriveFindings:
        found = _search(thin, drive)
        done.append(drive)
        report(len(done) / len(thin.drives))
        return found

    drives = dict(zip(thin.drives, each(search_drive, range(len(thin.drives))), strict=True))
    every = [statement for findings in drives.values() for statement in findings.statements]
    return Localisation(tuple(sorted(every, key=lambda one: -one.evidence)), drives)


def _search(residuals: Residuals, drive: int) -> DriveFindings:
    try:
        regression = Regression(residuals, drives=(drive,))
    except ResidualsError:
        return DriveFindings((), None)
    error, measured = residuals.error[:, drive], residuals.measured[:, drive]
    if np.nanmax(np.abs(error)) <= ROUNDING * np.nanmax(np.abs(measured)):
        return DriveFindings((), None)
    prior_costs = replace(PriorCosts.of(regression, DECISIONS), drives=len(residuals.drives))
    drive_patterns = DrivePatterns(regression, prior_costs, drive, with_plain_forms=True)
    fit = regression.fit(())
    statements: list[Statement] = []
    blocks: list[Block] = []
    while len(statements) < MOST_STATEMENTS:
        winner = _best(drive_patterns, fit, blocks,
                       {statement.variable for statement in statements})
        if winner is None:
            break
        candidate, found, evidence, other_variables = winner
        statements.append(word_statement(drive_patterns, candidate, found.of(
            candidate.parts[drive]), evidence, other_variables))
        blocks += [*candidate.blocks, *_carried(drive_patterns, candidate)]
        fit = regression.fit(blocks, found.amplitudes)
    return DriveFindings(tuple(statements), regression.noise(fit)[drive])


def _best(drive_patterns: DrivePatterns, fit: JointFit, blocks: list[Block], stated: set[str],
          ) -> tuple[UnknownCandidate, JointFit, float, tuple[str, ...]] | None:
    """Return the pattern that lowers the cost most, with its fit, evidence and other_variables."""
    regression = drive_patterns.regression
    chosen: dict[object, tuple[UnknownCandidate, JointFit]] = {}
    for near in (fit, with_fast_noise(regression, fit)):
        for candidate, score in drive_patterns.proposals(near, PROPOSALS, always=True):
            variable = candidate.family.variable
            if (variable in stated and candidate.pattern.kind != 'line') or score < PROPOSED:
                continue
            chosen.setdefault(candidate.key, (candidate, near))
    scored = []
    for candidate, near in chosen.values():
        refined = drive_patterns.refined(candidate, near)
        if refined.pattern.kind in PLACES and np.mean(
                refined.rows[drive_patterns.d][0] != 0) > MOST_SHARE:
            continue
        found = regression.fit([*blocks, *refined.blocks], near.amplitudes)
        scored.append((fit.deviance - found.deviance - refined.prior_cost, refined, found))
    scored.sort(key=lambda scored: -scored[0])
    if not scored or scored[0][0] <= 0:
        return None
    evidence, winner, found = scored[0]
    if _is_friction(winner, drive_patterns):
        # What follows the sign of all but the slowest motion is the direction's.
        evidence, winner, found = next(
            (one for one in scored if one[1].pattern.kind == 'friction' and one[0] > 0), scored[0])
    margin = drive_patterns.prior_costs.decisions.rival_margin
    kin = {winner.family.variable, 'velocity' if winner.family.variable == 'direction' else ''}
    other_variables = [one.family.variable for score, one, _ in scored
                       if score > evidence - margin and one.family.variable not in kin]
    return winner, found, evidence, tuple(dict.fromkeys(other_variables))


def _is_friction(winner: UnknownCandidate, drive_patterns: DrivePatterns) -> bool:
    if winner.family.variable != 'velocity' or winner.pattern.kind != 'directed_range':
        return False
    speed = np.abs(drive_patterns.values('velocity'))
    assert winner.pattern.limits is not None
    low, high = winner.pattern.limits
    return high >= speed.max() and bool(
        np.mean(speed < low) <= drive_patterns.prior_costs.decisions.reversal_share)


def _carried(drive_patterns: DrivePatterns, winner: UnknownCandidate) -> list[Block]:
    """Return all columns that the variable of a statement can carry, as one block each."""
    if winner.pattern.kind in ('line', 'offset'):
        return []
    variables = {winner.family.variable}
    if winner.family.variable in ('velocity', 'direction'):
        variables = {'velocity', 'direction'}
    return [drive_patterns.family_block(family) for family in drive_patterns.families
            if family.variable in variables and not family.paired]
