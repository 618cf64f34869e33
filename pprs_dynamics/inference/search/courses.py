# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Sets in which an effect begins, ends or grows within the recordings.

To a fit of constants a payload that is picked up in the middle is half of it throughout, and a
contact of some seconds is a spring and a ripple. Where a score test of onsets passes, effects are
refitted with an onset, as a stretch, and as a drift.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pprs_dynamics.inference.regression.design import LEAST_MOVING
from pprs_dynamics.inference.search.candidates import (
    DRIFT,
    DURING,
    SINCE,
    Candidate,
    Candidates,
    CandidateSet,
    Course,
    EffectCandidate,
    UnknownCandidate,
)
from pprs_dynamics.inference.search.fitted_sets import LEAST_IMPROVEMENT, FittedSets
from pprs_dynamics.inference.search.patterns import CURVE, Family, Pattern, directed_curve
from pprs_dynamics.inference.search.score_test import Entry, ScoreTest

# Onsets that are tried, and stretches: so many parts of the recordings, each of so many of them
# long. The best is refined to `COURSE_TIMES`.
ONSETS, STRETCHES, STRETCH_LENGTHS = 50, 40, (1, 4)
COURSE_HALVINGS = 8  # of the step between them, around the best
COURSE_TRIALS = 6  # candidates of a scan that are fitted
FIRST_TIMES = 5  # parts of the recordings, between which effects that are not reported are tested
REFINED = 6  # of the fitted sets of a round
MOST_COURSES = 3  # effects of one set that change within the recordings
SINGLE = float(np.finfo(np.float32).eps)  # share of a force's squares that is rounding
Alone = list[tuple[CandidateSet, EffectCandidate]]


@dataclass(frozen=True)
class _Offer:
    """A candidate with a course, the least fall of the deviance with it, and its drives."""

    gain: float
    candidate: EffectCandidate
    drives: frozenset[int]


def fit_courses(fits: FittedSets, reported: CandidateSet, alone: Sequence[CandidateSet],
                first: FittedSets | None) -> None:
    """Fit sets in which effects begin, end or grow, where the score test of onsets passes.

    Parameters
    ----------
    fits : FittedSets
        To which the sets are added.
    reported : CandidateSet
        Of these, without onsets.
    alone : sequence of CandidateSet
        Of one effect each, that may be the right one with an onset.
    first : FittedSets or None
        Around the input model, where the reported set is nonlinear: the search is repeated there,
        since a nonlinear constant effect may imitate an onset around its own model.
    """
    others = [(fitted, fitted.effects[0]) for fitted in alone if _is_new(fitted.effects[0])]
    if _fit(fits, reported, others) and first is not None:
        _fit(first, first.evaluate(tuple(
            candidate for candidate in reported.effects if not candidate.effect.nonlinear)), others)


def _fit(fits: FittedSets, reported: CandidateSet, alone: Alone) -> bool:
    """Fit sets with onsets from a set without, as long as the cost falls.

    Return whether something changes.
    """
    drives = _changing_drives(fits, reported, alone)
    best, alone = reported, [*alone, *_alone_on_drives(fits, drives)]
    for _ in range(MOST_COURSES if drives else 0):
        constant = [(best, candidate) for candidate in best.effects
                    if not candidate.course and _is_new(candidate)]
        # Patterns of no catalogue imitate onsets: offers are beside effects alone.
        plain = fits.at_noise_of(best, best.effects) if best.unknowns else best
        offers = sorted(_offers(fits, _bases(fits, plain), [*constant, *alone], _courses(fits)),
                        key=lambda offer: -offer.gain)
        # Its shape was that of an effect that is there all the time. Times that are samples off
        # cost more than a pattern of no catalogue, which needs none.
        offered = sorted((fits.evaluate((*rest, offer.candidate)) for offer in _best_of_each(offers)
                          for rest in _rests(best, offer.candidate)), key=lambda found: found.total)
        tried = [fits.refined(_refined(fits, found)) for found in offered[:REFINED]]
        found = min([*map(fits.pruned, tried), *tried], key=lambda fitted: fitted.cost,
                    default=best)
        if not found.cost < best.cost - LEAST_IMPROVEMENT:
            break
        best = found
    if best is not reported:
        # With the times known, an effect may suffice that was not the likeliest without them.
        changing = {d for candidate in best.effects if candidate.course
                    for d in candidate.drives or ()}
        effects = (*filter(_is_new, reported.effects), *(candidate for _, candidate in alone))
        for fitted in _of_one_cause(fits, best, (
                other for other in effects if not changing.isdisjoint(other.drives or changing))):
            fits.pruned(fits.refined(fits.evaluate(_refined(fits, fitted).candidates)))
    return bool(drives)


def fit_curves(first: FittedSets, last: FittedSets, best: CandidateSet) -> bool:
    """Fit friction that depends on the position in any way, where the best set may be such a curve.

    What returns at the same place, in the same direction, is no event, and may be no pattern over
    the position alone. Only in place of these are such curves tried: they imitate any friction.
    Return whether any was.

    Parameters
    ----------
    first, last : FittedSets
        Around the input model, for sets without a nonlinear effect, and around the last model.
    best : CandidateSet
    """
    drives = sorted({d for candidate in best.candidates if _may_be_curve(candidate)
                     for d in candidate.drives or last.regression.drives})
    for effects in dict.fromkeys((best.effects, tuple(
            effect for effect in best.effects if not effect.course), ())) if drives else ():
        base = last.evaluate(effects)
        fits = last if base.is_nonlinear else first
        base = fits.evaluate(effects)
        for d in drives:
            if (curve := _curve(fits, d)) is not None:
                base = min(base, fits.evaluate((*base.candidates, curve)),
                           key=lambda found: found.total)
    return bool(drives)


def _may_be_curve(candidate: Candidate) -> bool:
    return (candidate.family.variable in ('time', 'position')
            if isinstance(candidate, UnknownCandidate) else candidate.course is not None)


def _curve(fits: FittedSets, d: int) -> UnknownCandidate | None:
    """Return friction of a drive that is any smooth function of its position."""
    if (curve := directed_curve(fits.design.residuals, d)) is None:
        return None
    rows, precision = curve
    regression, pattern = fits.regression, Pattern(CURVE)
    block = regression.block({d: rows}, np.diag(precision) / regression.error_scale[d] ** 2)
    return UnknownCandidate(Family('position', rows, np.zeros((0, 0)), (pattern,)), pattern, d,
                            rows, block, fits.prior_costs.of_pattern(1, 1))


def _changing_drives(fits: FittedSets, reported: CandidateSet, alone: Alone) -> set[int]:
    """Return drives on which something may begin, end or grow, or that show a pattern."""
    constant = [(reported, candidate) for candidate in reported.effects if _is_new(candidate)]
    offers = [*_offers(fits, [(reported, 0.0)], constant, _courses(fits)),
              *_offers(fits, _bases(fits, reported), alone, _few_courses(fits))]
    drives = {d for unknown in reported.unknowns for d in unknown.drives}
    for offer in offers:
        assert offer.candidate.course is not None
        if offer.gain > fits.prior_costs.of_course(offer.candidate.course):
            drives |= offer.drives
    return drives


def _alone_on_drives(fits: FittedSets, drives: Iterable[int]) -> Alone:
    """Return all effects, each alone, on drives on which something changes.

    What is there for a stretch hardly shows in a fit of all the time: the search need not have
    proposed it.
    """
    base = fits.evaluate(()).fit
    candidates = [EffectCandidate.of([component]) for d in sorted(drives)
                  for component, _ in fits.components.local[d].offers(base).values()]
    return [(fits.evaluate((candidate,)), candidate) for candidate in candidates
            if _is_new(candidate)]


def _is_new(candidate: EffectCandidate) -> bool:
    """Return whether the given model lacks an effect: what it has is there all the time."""
    return not any(component.given for component in candidate.components)


def _few_courses(fits: FittedSets) -> Iterator[Course]:
    """Yield a few beginnings, one of which shows most of what begins at any time."""
    first, last = fits.design.residuals.time[[0, -1]].tolist()
    for at in np.linspace(first, last, FIRST_TIMES + 1)[1:-1].tolist():
        yield Course(SINCE, at, last)


def _courses(fits: FittedSets) -> Iterator[Course]:
    first, last = fits.design.residuals.time[[0, -1]].tolist()
    yield Course(DRIFT, first, last)
    for at in _amid_motion(fits, np.linspace(first, last, ONSETS + 1)[1:-1].tolist()):
        yield Course(SINCE, at, last)
    edges = np.linspace(first, last, STRETCHES + 1).tolist()
    for length in STRETCH_LENGTHS:
        for begin, end in zip(edges, edges[length:], strict=False):
            yield Course(DURING, begin, end)


def _amid_motion(fits: FittedSets, times: Sequence[float]) -> list[float]:
    """Return the times with a noteworthy share of the motion before and after them.

    What a robot does at its start, or while it stands at the end, is friction that has not turned
    over or has not settled, and no other state of the machine.
    """
    moving = np.any([fits.design.moving(d) for d in fits.regression.drives], axis=0)
    moved = fits.design.residuals.time[moving]
    before = np.searchsorted(moved, times) / max(len(moved), 1)
    return [at for at, share in zip(times, before, strict=True)
            if LEAST_MOVING <= share <= 1 - LEAST_MOVING]


def _bases(fits: FittedSets, best: CandidateSet) -> list[tuple[CandidateSet, float]]:
    """Return a set and no set at all, with what each costs more than the set.

    A set of constant forms may imitate an onset. Without it an onset has to explain all of its
    force.
    """
    if not best.candidates:
        return [(best, 0.0)]
    nothing = fits.at_noise_of(best, ())
    return [(best, 0.0), (nothing, nothing.total - best.total)]


def _offers(fits: FittedSets, bases: Sequence[tuple[CandidateSet, float]],
            effects: Iterable[tuple[CandidateSet, EffectCandidate]],
            courses: Iterable[Course]) -> Iterator[_Offer]:
    """Yield effects with the course that lowers the deviance most, by the force that they had.

    With each of the `bases`, less its cost.
    """
    residuals, shape = fits.design.residuals, fits.design.residuals.measured.shape
    courses = list(courses)
    weights = np.array([course.weight(residuals.time, residuals.period) for course in courses])
    lengths, squares = weights.sum(axis=1), weights ** 2
    for found, candidate in effects:
        force = fits.components.force(found, candidate, shape)
        rows = {d: fits.regression.series[d].transform(
            (weights * force[:, d]).astype(np.float32)) for d in fits.regression.drives
            if np.any(force[:, d])}
        if not rows:
            continue
        test = ScoreTest(fits.regression, rows,
                         [Entry(course, (k,)) for k, course in enumerate(courses)])
        # A stretch of no more samples than coefficients can be explained by anything.
        told = lengths > sum(len(component.names) for component in candidate.components)
        # Nor is one in which the force is nothing but rounding, as of Stribeck friction at speed.
        told &= squares @ (force ** 2).sum(axis=1) > SINGLE * np.sum(force ** 2)
        for base, dearer in bases:
            for labels, gains in test.gains(base.fit):
                gains = np.where(told, gains, -np.inf)
                ranked = np.argsort(-gains)
                for kind in dict.fromkeys(course.kind for course in labels):
                    at = next(k for k in ranked if labels[k].kind == kind)
                    yield _Offer(float(gains[at]) - dearer,
                                 _with_course(candidate, labels[at]), frozenset(rows))


def _best_of_each(offers: list[_Offer]) -> list[_Offer]:
    """Return the best offers of different effects and kinds of course."""
    found: dict[tuple[str, str], _Offer] = {}
    for offer in offers:
        assert offer.candidate.course is not None
        found.setdefault((offer.candidate.name, offer.candidate.course.kind), offer)
    return list(found.values())[:COURSE_TRIALS]


def _rests(base: CandidateSet, candidate: EffectCandidate) -> Iterator[Candidates]:
    """Yield the rest of a set with a candidate: all others, and all that cannot imitate it."""
    effects = tuple(effect for effect in base.effects if effect.effect is not candidate.effect)
    rests: list[Candidates] = [tuple(effect for effect in effects if effect.course), effects,
                               (*effects, *base.unknowns)]
    yield from dict.fromkeys(rests)


def _with_course(candidate: EffectCandidate, course: Course) -> EffectCandidate:
    return EffectCandidate.of(replace(component, course=course)
                              for component in candidate.components)


def _refined(fits: FittedSets, fitted: CandidateSet) -> CandidateSet:
    """Return a set with beginnings and ends where they cost least.

    At the noise of the set: with its own, one that is a block off costs as much as one that is
    far off.
    """
    time = fits.design.residuals.time
    for candidate in fitted.effects:
        course = candidate.course
        if course is None or course.kind == DRIFT:
            continue
        rest = fitted.without(candidate)
        step = float(time[-1] - time[0]) / (
            STRETCHES if course.kind == DURING else ONSETS)
        beside, best = fits.at_noise_of(fitted, rest).fit, -np.inf
        for _ in range(COURSE_HALVINGS):
            step /= 2
            moved = [replace(course, begin=course.begin + by) for by in (-step, 0.0, step)]
            if course.kind == DURING:
                moved += [replace(course, end=course.end + by) for course in moved
                          for by in (-step, step)]
            tried = [tried for tried in moved if tried.begin < tried.end - step]
            blocks = [fits.regression.joined([
                fits.components.block(replace(component, course=at))
                for component in candidate.components]) for at in tried]
            for labels, gains in ScoreTest.of_blocks(fits.regression, tried, blocks).gains(beside):
                if gains.max() > best:
                    best, course = float(gains.max()), labels[int(np.argmax(gains))]
        fitted = min(fitted, fits.evaluate((*rest, _with_course(candidate, course))),
                     key=lambda fitted: fitted.total)
    return fitted


def _of_one_cause(fits: FittedSets, fitted: CandidateSet, effects: Iterable[EffectCandidate],
                  ) -> list[CandidateSet]:
    """Return the best sets in which one effect alone changes, at the times found for a set.

    What changes at one time has one cause. All are under the noise of the set: with its own, one
    that is a block off costs as much as one that is far off.
    """
    last = float(fits.design.residuals.time[-1])
    edges = sorted({at for candidate in fitted.effects if candidate.course is not None
                    for at in (candidate.course.begin, candidate.course.end)} - {last})
    courses = [*(Course(SINCE, at, last) for at in _amid_motion(fits, edges)),
               *(Course(DURING, *times) for times in combinations(edges, 2))]
    constant = [candidate for candidate in fitted.effects if candidate.course is None]
    tried = []
    for effect in effects:
        beside = tuple(other for other in constant if other.effect is not effect.effect)
        tried += [(fits.at_noise_of(fitted, (*rest, _with_course(effect, course))),
                   (effect.name, course.kind))
                  for course in courses for rest in dict.fromkeys(((), beside))]
    best: dict[tuple[str, str], CandidateSet] = {}
    for found, key in sorted(tried, key=lambda scored: scored[0].total):
        best.setdefault(key, found)
    return list(best.values())[:COURSE_TRIALS]
