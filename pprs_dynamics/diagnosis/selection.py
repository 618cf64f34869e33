"""Which effects the errors call for: proposed by a scan, judged with the noise refitted.

A scan under one noise model only proposes: noise fitted to an error that holds an effect
swallows part of it, and noise fitted to what a rich regression leaves is too optimistic where
noise is slow. Each proposal is judged by likelihoods in which the noise is fitted once with the
effect and once without it, must pay its penalty and a margin, and must predict blocks of the
recording that it was not fitted to.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pprs_dynamics.diagnosis.form import is_form, within_form
from pprs_dynamics.diagnosis.joint_fit import JointFit, Regression
from pprs_dynamics.diagnosis.judging import MARGIN, Judge, Judged, actives_of
from pprs_dynamics.diagnosis.library import Candidate, holds
from pprs_dynamics.diagnosis.scan import Scan

MOST_EFFECTS = 6
FURTHER_MARGIN = 10.0  # more, for an effect that lives on what others have left
LEAST_SUSPECT = -20.0  # evidence; further below, slow noise is the better explanation by far
PROPOSALS = 4  # of each scan
FIRST_ERRORS, FURTHER_ERRORS = 1.0, 2.0  # standard errors of the blocks' losses
# A rival explains as well that is this near in score, or a little further and as near as one
# standard error of the blocks' losses.
NEAR_SCORE, FAR_SCORE = 10.0, 30.0
MOST_RIVALS = 8  # looked at
SWAP = 4.0  # in score, for which an adopted effect gives way to another


@dataclass
class Selection:
    """What was adopted, and what competed.

    Parameters
    ----------
    adopted : list of Judged
        In order.
    fit : JointFit
        Of all.
    candidates : list of Judged
        The best of every effect that was judged as the first, best first.
    suspects : list of Judged
        What only slow noise could explain otherwise.
    rivals : dict of str to list of str
        Effects that explain as well as an adopted one.
    """

    adopted: list[Judged]
    fit: JointFit
    start: JointFit
    candidates: list[Judged] = field(default_factory=list)
    suspects: list[Judged] = field(default_factory=list)
    rivals: dict[str, list[str]] = field(default_factory=dict)


class Selector:
    """Forward selection with pruning and swapping.

    Parameters
    ----------
    regression : Regression
    progress : callable, optional
        Called with the share that is done.
    earlier : sequence of Judged
        What was adopted already and is in the design's model.
    excluded : collection of str
        Effects that may be rivals only.
    """

    def __init__(self, regression: Regression,
                 progress: Callable[[float], None] | None = None,
                 earlier: Sequence[Judged] = (), excluded: Collection[str] = ()) -> None:
        self.regression, self.earlier, self.excluded = regression, tuple(earlier), excluded
        self._report = progress or (lambda share: None)
        self.judge = Judge(regression)
        self.library, self.rich = self.judge.library, self.judge.rich

    def select(self) -> Selection:
        """Return the effects that the errors call for."""
        start = min(self.regression.fit((), self.rich), self.judge.from_least_squares(()),
                    key=lambda fit: fit.deviance)
        selection = Selection([], start, start)
        while len(selection.adopted) < MOST_EFFECTS:
            judged = self._judge_proposals(selection)
            if not selection.adopted:
                selection.candidates = judged
            self._report((len(selection.adopted) + 1) / (MOST_EFFECTS + 2))
            winner = next((one for one in judged if self._stands(one, selection.adopted)), None)
            if winner is None:
                selection.suspects = [one for one in judged if self._is_suspect(one, selection)]
                break
            winner = self.judge.polished(self._simplest(winner, judged, selection),
                                         selection.fit, actives_of(selection.adopted))
            _add(selection, winner)
            self._prune(selection)
        self._swap(selection)
        selection.rivals = self.find_rivals(selection)
        self._report(1.0)
        return selection

    def _allowed(self, scan: Scan) -> list[Candidate]:
        return [one for one in scan.candidates() if one.name not in self.excluded]

    def _judge_proposals(self, selection: Selection) -> list[Judged]:
        """Return proposals of two scans, each judged, best first."""
        active = actives_of(selection.adopted)
        chosen: dict[tuple[Any, ...], Candidate] = {}
        for noises in (selection.fit.noises, self.rich):
            scan = Scan(self.library, active, noises)
            for candidate in self._allowed(scan)[:PROPOSALS]:
                if candidate.score > -MARGIN:
                    refined = scan.refined(candidate)
                    for number, shaped in enumerate([refined, *scan.alternatives(refined)]):
                        variants = tuple(one.variant for one in shaped.active)
                        chosen.setdefault((shaped.name, shaped.drives, variants, number), shaped)
        judged = [self.judge.of(candidate, selection.fit, active) for candidate in chosen.values()]
        best: dict[str, Judged] = {}
        for one in sorted(judged, key=lambda one: -one.evidence):
            best.setdefault(one.candidate.name, one)
        most = max((one.evidence for one in best.values()), default=0.0)
        front = [self.judge.completed(one, selection.fit, active)
                 if one.evidence >= most - abs(most) / 2 else one for one in best.values()]
        return sorted(front, key=lambda one: -one.evidence)

    def _stands(self, one: Judged, adopted: Sequence[Judged]) -> bool:
        before_it = [*self.earlier, *adopted]
        if one.evidence <= (FURTHER_MARGIN if before_it else 0.0):
            return False
        active = actives_of(adopted)
        before = self.regression.block_losses(active, one.fit.noises).losses
        after = self.regression.block_losses(one.fit.active, one.fit.noises).losses
        change = before - after
        errors = FURTHER_ERRORS if before_it else FIRST_ERRORS
        if change.mean() <= errors * change.std(ddof=1) / np.sqrt(len(change)):
            return False
        mine = one.candidate.drives
        for other in before_it:
            theirs = other.candidate.drives
            shared = mine is None or theirs is None or set(mine) & set(theirs)
            if shared and is_form(one, other, active, self.regression):
                return False
        return True

    def stands_alone(self, one: Judged) -> bool:
        """Return whether an effect stands beside nothing else."""
        return self._stands(one, ())

    def _simplest(self, winner: Judged, judged: Sequence[Judged],
                  selection: Selection) -> Judged:
        """Return an effect that the winner holds, where the rest may be the form of that one."""
        before = actives_of(selection.adopted)
        special = [self.judge.of(one, selection.fit, before)
                   for one in self.library.special_cases(winner.candidate)
                   if one.name not in self.excluded]
        held = [one for one in judged if one is not winner
                and holds(winner.candidate, one.candidate)]
        for one in sorted((*special, *held), key=lambda one: -one.evidence):
            lost = one.fit.deviance - winner.fit.deviance
            better = one.evidence > winner.evidence or within_form(
                lost, one.candidate, (*before, *one.candidate.active), winner.fit.noises,
                self.regression)
            if better and self._stands(one, selection.adopted):
                return one
        return winner

    def _is_suspect(self, one: Judged, selection: Selection) -> bool:
        """Return whether an effect would stand if the noise were as a rich regression says."""
        if not LEAST_SUSPECT < one.evidence <= 0:
            return False
        scan = Scan(self.library, actives_of(selection.adopted), self.rich)
        gain = sum(scan.gain(active) for active in one.candidate.active)
        return gain - one.candidate.penalty - MARGIN > 0

    def _prune(self, selection: Selection) -> None:
        """Drop what no longer pays beside what came after it."""
        while len(selection.adopted) > 1:
            worst, drop = 0.0, None
            for k, one in enumerate(selection.adopted[:-1]):
                others = selection.adopted[:k] + selection.adopted[k + 1:]
                fit = self.regression.fit(actives_of(others), selection.fit.noises)
                value = fit.deviance - selection.fit.deviance - one.candidate.penalty - MARGIN
                if value < worst:
                    worst, drop, kept = value, k, fit
            if drop is None:
                return
            del selection.adopted[drop]
            selection.fit = kept

    def _swap(self, selection: Selection) -> None:
        """Give an adopted effect's place to another that does better beside the rest."""
        for k in range(len(selection.adopted) if len(selection.adopted) > 1 else 0):
            others = selection.adopted[:k] + selection.adopted[k + 1:]
            active = actives_of(others)
            scan = Scan(self.library, active, selection.fit.noises)
            without = self.regression.fit(active, selection.fit.noises)
            found = [scan.refined(one) for one in self._allowed(scan)[:2]]
            judged = [self.judge.of(one, without, active) for one in found]
            own = next((one for one in judged
                        if one.candidate.name == selection.adopted[k].candidate.name), None)
            current = without.deviance - selection.fit.deviance - (
                selection.adopted[k].candidate.penalty + MARGIN)
            best = max(judged, key=lambda one: one.evidence)
            limit = max(current, own.evidence if own else current)
            if best.evidence > limit + SWAP or (best is own and best.evidence > current):
                selection.adopted[k] = best
                selection.fit = best.fit

    def find_rivals(self, selection: Selection) -> dict[str, list[str]]:
        """Return, for each adopted effect, those that explain as well in its place."""
        rivals: dict[str, list[str]] = {}
        for k, one in enumerate(selection.adopted):
            others = selection.adopted[:k] + selection.adopted[k + 1:]
            active = actives_of(others)
            noises = selection.fit.noises
            scan = Scan(self.library, active, noises)
            found = scan.candidates()
            mine = next((c for c in found if c.name == one.candidate.name), one.candidate)
            mine = scan.refined(mine)
            losses = self.regression.block_losses((*active, *mine.active), noises).losses
            near = []
            for candidate in found[:MOST_RIVALS]:
                if candidate.name == mine.name or candidate.score < mine.score / 2:
                    continue
                refined = scan.refined(candidate)
                behind = mine.score - refined.score
                if holds(refined, mine):
                    # It can do all that the adopted effect does: a rival only where it uses more.
                    if behind < NEAR_SCORE / 2 and not within_form(
                            refined.gain - mine.gain, mine, (*active, *mine.active), noises,
                            self.regression):
                        near.append(refined.name)
                    continue
                change = self.regression.block_losses(
                    (*active, *refined.active), noises).losses - losses
                error = change.std(ddof=1) / np.sqrt(len(change))
                if behind < NEAR_SCORE or (behind < FAR_SCORE and change.mean() <= error):
                    near.append(refined.name)
            if near:
                rivals[one.candidate.name] = near
        return rivals


def _add(selection: Selection, winner: Judged) -> None:
    """Adopt a winner; on further drives it is the same effect, in the place that it has."""
    fit = winner.fit
    for k, one in enumerate(selection.adopted):
        if one.candidate.name == winner.candidate.name:
            old, new = one.candidate, winner.candidate
            joined = Candidate((*old.active, *new.active), old.gain + new.gain,
                               old.penalty + new.penalty)
            selection.adopted[k] = Judged(joined, fit, one.evidence + winner.evidence)
            break
    else:
        selection.adopted.append(winner)
    selection.fit = fit
