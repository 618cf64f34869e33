"""Where the model fails: statements that stand against correlated noise, the strongest first.

Per drive, patterns along every variable are proposed under two noise models, compared by
likelihoods in which the noise is refitted (`search`), and the best is stated where its gain, less
the price of the number of tries, exceeds what white innovations would reach in one of two hundred
recordings, over all drives, variables and ranges together. What was stated is taken out with all
that its variable can carry, and the search goes on; then the scatter of what remains is searched.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import norm, rankdata

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.noise import NoiseModel, effective_samples
from pprs_dynamics.diagnosis.parallel import each
from pprs_dynamics.diagnosis.search import FINE, Candidate, DriveSearch
from pprs_dynamics.diagnosis.wording import Statement, word_statement
from pprs_dynamics.residuals.residuals import Residuals
from pprs_dynamics.selection.patterns import Pattern

FALSE_ALARMS = 0.005
DRAWS = 64
MOST_SAMPLES = 16_000
LEAST_SAMPLES = 100
ROUNDING = 1e-9  # of the effort, below which a difference is no error
MOST_STATEMENTS = 3  # per drive
PROPOSALS = (5, 7)  # under the noise of the error itself, and of what a rich regression leaves
# A second statement lives on what the first left over, and an imperfect first leaves something.
MARGIN = 10.0
FINELY = 3  # of the best patterns are given limits to the sample
REVISIONS = 2  # of the proposals, once a pattern stands
# Patterns so near in log-likelihood, doubled, are told with the one that is stated: odds of 20.
TIE = 6.0
REVERSAL_SHARE = 0.12  # of the samples, the slowest, that friction may leave out at reversals
LEAST_SCATTER = 1.5  # ratio of variances worth a statement


@dataclass(frozen=True)
class DriveFindings:
    """What the search says about one drive.

    Parameters
    ----------
    statements : tuple of Statement
    noise : NoiseModel or None
        Of what remains; None with too few samples to search.
    remaining : (N,) array
        The error at `index` without what was stated [N].
    index : (N,) int array
        Samples (of the thinned residuals) that were searched.
    columns : (C, N) array
        All that the variables of the statements can carry.
    """

    statements: tuple[Statement, ...]
    noise: NoiseModel | None
    remaining: Array
    index: np.typing.NDArray[np.int_]
    columns: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Localisation:
    """Findings of all drives, and the statements ranked by evidence.

    Parameters
    ----------
    statements : tuple of Statement
    drives : mapping of str to DriveFindings
    threshold : float
        What a score had to exceed.
    """

    statements: tuple[Statement, ...]
    drives: dict[str, DriveFindings]
    threshold: float


@dataclass
class _Open:
    """A drive while it is searched."""

    search: DriveSearch
    null: Array
    proposed: list[Candidate]
    noise: NoiseModel
    columns: Array
    stated: list[tuple[Candidate, tuple[str, ...]]] = field(default_factory=list)


def localise(
    residuals: Residuals, *, false_alarms: float = FALSE_ALARMS, seed: int = 0,
    progress: Callable[[float], None] | None = None, known: Localisation | None = None,
    changed: Collection[str] = (),
) -> Localisation:
    """Return where the error of each drive lies, as far as noise would not do the same.

    Parameters
    ----------
    residuals : Residuals
        Averaged to at most 16 000 samples first; what is faster than that is not seen.
    false_alarms : float
        Share of recordings with a perfect model in which any statement may appear.
    seed : int
        Of the draws that the threshold comes from.
    progress : callable, optional
        Called with the share of the work that is done.
    known : Localisation, optional
        Of residuals that differ on the `changed` drives only: the others keep their findings.
    changed : collection of str
    """
    thin = residuals.thinned(MOST_SAMPLES)
    rng = np.random.default_rng(seed)
    report = progress or (lambda share: None)
    seeds = rng.spawn(len(thin.drives))

    def open_drive(drive: int) -> _Open | None:
        if (np.isfinite(thin.measured[:, drive]).sum() < LEAST_SAMPLES
                or (known and thin.drives[drive] not in changed)):
            return None
        search = DriveSearch(thin, drive)
        return _open(search, seeds[drive]) if _has_error(search) else None

    opened = each(open_drive, range(len(thin.drives)))
    report(0.4)
    threshold = known.threshold if known else _threshold(
        [state.null for state in opened if state], false_alarms)
    done: list[str] = []

    def search_drive(drive: int) -> DriveFindings:
        name, state = thin.drives[drive], opened[drive]
        if known and name not in changed:
            return known.drives[name]
        found = (DriveFindings((), None, np.zeros(0), np.zeros(0, dtype=int)) if state is None
                 else _search(name, state, threshold))
        done.append(name)
        report(0.4 + 0.6 * len(done) / len(thin.drives))
        return found

    drives = dict(zip(thin.drives, each(search_drive, range(len(thin.drives))), strict=True))
    ranked = sorted((statement for findings in drives.values()
                     for statement in findings.statements), key=lambda s: -s.evidence)
    return Localisation(tuple(ranked), drives, threshold)


def _has_error(search: DriveSearch) -> bool:
    effort = float(np.nanmax(np.abs(search.residuals.measured[:, search.drive])))
    return bool(np.abs(search.error).max() > ROUNDING * effort)


def _open(search: DriveSearch, rng: np.random.Generator) -> _Open:
    none = np.zeros((0, len(search.error)))
    noise = search.fit(none).noise
    draws = rng.normal(size=(len(search.error), DRAWS))
    proposed, null = search.propose(noise, none, draws)
    return _Open(search, null, proposed, noise, none)


def _threshold(nulls: list[Array], false_alarms: float) -> float:
    """Return what the largest gain over all drives exceeds with that probability.

    Largest of many chi-squared variates are Gumbel distributed; its two moments need fewer
    draws than a quantile far out.
    """
    if not nulls:
        return np.inf
    scale = np.array([np.std(null) * np.sqrt(6) / np.pi for null in nulls])
    place = np.array([np.mean(null) for null in nulls]) - np.euler_gamma * scale
    low, high = float(place.min()), float(place.max() + 100 * scale.max())
    for _ in range(60):
        middle = (low + high) / 2
        inside = np.exp(-np.exp(-(middle - place) / scale).sum())
        low, high = (middle, high) if inside < 1 - false_alarms else (low, middle)
    return high


def _search(name: str, state: _Open, threshold: float) -> DriveFindings:
    search = state.search
    while len(state.stated) < MOST_STATEMENTS:
        needed = threshold + (MARGIN if state.stated else 0.0)
        winner, rivals = _best(state, needed)
        if winner is None or winner.fit is None:
            break
        state.stated.append((winner, rivals))
        state.columns = np.concatenate((state.columns, _carried(search, winner)))
        state.noise = search.fit(state.columns).noise
        state.proposed, _ = search.propose(state.noise, state.columns)
    fit = search.fit(state.columns)
    remaining = search.error - fit.coefficients @ state.columns
    statements = [word_statement(name, search, candidate, rivals)
                  for candidate, rivals in state.stated]
    needed = threshold + (MARGIN if state.stated else 0.0)
    scatter = _scatter(search, search.whiten(fit.noise, remaining), needed,
                       {candidate.family.variable for candidate, _ in state.stated})
    if scatter is not None:
        statements.append(word_statement(name, search, scatter, ()))
    return DriveFindings(tuple(statements), fit.noise, remaining, search.index, state.columns)


def _best(state: _Open, needed: float) -> tuple[Candidate | None, tuple[str, ...]]:
    """Return the best pattern above the threshold, and the variables that do nearly as well."""
    search = state.search
    stated = {candidate.family.variable for candidate, _ in state.stated}
    rich, _ = search.propose(search.rich_noise, state.columns)
    always = [c for c in (*state.proposed, *rich)
              if c.pattern.kind in ('friction', 'one_way', 'line', 'offset')]
    # Whitening cuts a line that the noise model has learnt; the error itself still shows it.
    line = search.line(search.error * np.hanning(len(search.error)))
    listed = [(c, state.noise) for c in state.proposed[:PROPOSALS[0]]]
    listed += [(c, search.rich_noise) for c in rich[:PROPOSALS[1]]]
    if max((c.proposal for c, _ in listed), default=0.0) > 0.5 * needed:
        listed += [(c, state.noise) for c in (*always, *([line] if line else ()))]
    chosen: dict[tuple[str, Pattern], Candidate] = {}
    for candidate, noise in listed:
        key = (candidate.family.variable, candidate.pattern)
        new = candidate.family.variable not in stated or candidate.pattern.kind == 'line'
        if key not in chosen and new and candidate.proposal > 0:
            chosen[key] = search.refine(candidate, noise, state.columns)
    if not chosen:
        return None, ()
    scored = search.compare(list(chosen.values()), state.columns)
    fine = [search.refine(c, c.fit.noise, state.columns, FINE) for c in scored[:FINELY]
            if c.fit is not None and c.score + c.family.penalty > 0]
    scored = sorted(scored + search.compare(fine, state.columns), key=lambda c: -c.score)
    for revision in range(REVISIONS):
        standing = [c for c in scored if c.score >= needed]
        if not standing:
            return None, ()
        winner = max(standing, key=_weight)
        assert winner.fit is not None
        # Beside a good pattern the noise is nearly the true one, and shows better patterns.
        noise, fresh = winner.fit.noise, []
        seen = chosen if revision else {}
        for candidate in search.propose(noise, state.columns)[0][:PROPOSALS[1]]:
            key = (candidate.family.variable, candidate.pattern)
            if candidate.family.variable not in stated and key not in seen:
                chosen[key] = search.refine(candidate, noise, state.columns)
                fresh.append(chosen[key])
        if not fresh:
            break
        better = search.compare(fresh, state.columns)
        fine = [search.refine(c, noise, state.columns, FINE) for c in better[:FINELY]]
        scored = sorted(scored + better + search.compare(fine, state.columns),
                        key=lambda candidate: -candidate.score)
    winner = scored[0]
    if _is_friction(winner, search):
        # What follows the sign of all but the slowest motion is the direction's.
        winner = next((c for c in scored if c.pattern.kind == 'friction' and c.score >= needed),
                      winner)
    kin = {winner.family.variable, 'velocity' if winner.family.variable == 'direction' else ''}
    rivals = [c.family.variable for c in scored
              if _weight(c) > _weight(winner) - TIE and c.family.variable not in kin]
    return winner, tuple(dict.fromkeys(rivals))


def _weight(candidate: Candidate) -> float:
    return candidate.score + candidate.family.margin


def _is_friction(winner: Candidate, search: DriveSearch) -> bool:
    if winner.family.variable != 'velocity' or winner.pattern.kind != 'directed_range':
        return False
    speed = np.abs(search.values('velocity'))
    assert winner.pattern.limits is not None
    low, high = winner.pattern.limits
    return high >= speed.max() and bool(np.mean(speed < low) <= REVERSAL_SHARE)


def _carried(search: DriveSearch, winner: Candidate) -> Array:
    """Return all columns that belong to what was stated."""
    if winner.pattern.kind in ('line', 'offset'):
        return winner.columns
    variables = {winner.family.variable}
    if winner.family.variable in ('velocity', 'direction'):
        variables = {'velocity', 'direction'}
    blocks = [family.columns for family in search.families
              if family.variable in variables and not family.paired]
    return np.concatenate((winner.columns, *blocks))


def _scatter(
    search: DriveSearch, innovations: Array, needed: float, stated: set[str],
) -> Candidate | None:
    """Return the range in which innovations are larger than elsewhere, if any stands out.

    Ranks of their size stand for the sizes, so that noise need not be Gaussian.
    """
    known = search.known
    scores = np.zeros(len(innovations))
    n = int(known.sum())
    ranked = norm.ppf((rankdata(np.abs(innovations[known])) - 0.5) / n)
    # Equal sizes share a rank, which shifts and narrows the scores of quantised efforts.
    scores[known] = (ranked - ranked.mean()) / max(float(ranked.std()), 1e-12)
    best: Candidate | None = None
    for family in search.families:
        if family.paired or family.variable in stated or len(family.columns) == 1:
            continue
        # Bins do not overlap, so that sums over patterns are sums over their bins.
        members = family.columns[:, known] > 0.5
        inside, totals = family.weights @ members.sum(axis=1), family.weights @ (
            members @ scores[known])
        gains = totals ** 2 / np.maximum(inside * (1 - inside / n), 1e-9) - family.penalty
        for at in np.argsort(-gains):
            pattern, gain = family.patterns[at], float(gains[at])
            if gain <= max(needed, best.score if best else 0.0):
                break
            if pattern.kind not in ('range', 'fast') or totals[at] <= 0:
                continue
            column = family.pattern_columns(int(at))[0]
            held = column[known] > 0.5
            ratio = (np.mean(innovations[known][held] ** 2)
                     / max(float(np.mean(innovations[known][~held] ** 2)), 1e-300))
            if ratio >= LEAST_SCATTER:
                best = Candidate(family, Pattern('scatter', pattern.limits, float(ratio)),
                                 column[None], gain, gain)
    if best is None:
        return None
    # Scatter that comes and goes by itself, or gaps that were bridged, make sizes go together.
    held = known & (best.columns[0] > 0.5)
    for part in (held, known & ~held):
        scores[part] -= scores[part].mean()
    worth = effective_samples(search.fit_noise(scores), n) / n
    score = worth * (best.score + best.family.penalty) - best.family.penalty
    return replace(best, score=score) if score > needed else None
