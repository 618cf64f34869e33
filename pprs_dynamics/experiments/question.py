"""What is to be found out: which explanations remain, or which numbers are poorly known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.diagnosis.joint_fit import Active, Regression
from pprs_dynamics.diagnosis.library import Candidate, holds
from pprs_dynamics.diagnosis.scan import Scan
from pprs_dynamics.diagnosis.stages import Stage, find_way
from pprs_dynamics.experiments.columns import Block, ColumnPlan, plan_for
from pprs_dynamics.experiments.criteria import (
    Contest,
    Criterion,
    Explanation,
    Precision,
    Separation,
    index_of,
)
from pprs_dynamics.experiments.information import Information, NoiseSpectra, block_index
from pprs_dynamics.measurement.recording import Recording
from pprs_dynamics.model.drive_model import DriveModel

UNEXCITED = 4.0  # gain that an effect of a size that matters would have, at least


@dataclass(frozen=True)
class Question:
    """What a motion is to tell.

    Parameters
    ----------
    kind : {'separate', 'estimate', 'excite', 'commission'}
    model : DriveModel
        Around which all is linear.
    plan : ColumnPlan
    noise : NoiseSpectra
    known : (P, P) array
        What recordings and tolerances tell already.
    criterion : Criterion
    contests : tuple of Contest
        For 'separate'.
    subjects : tuple of Explanation
        Effects in question.
    noise_floor : float
        Largest root of the mean squared noise of a drive [N].
    """

    kind: str
    model: DriveModel
    plan: ColumnPlan
    noise: NoiseSpectra
    known: Array
    criterion: Criterion
    contests: tuple[Contest, ...]
    subjects: tuple[Explanation, ...]
    noise_floor: float

    @property
    def information(self) -> Information:
        """Gram matrices of the plan."""
        return Information(self.plan, self.noise)

    def with_contests(self, contests: Sequence[Contest]) -> Question:
        """Return the question of some of its contests only."""
        return replace(self, contests=tuple(contests), criterion=Separation(tuple(contests)))


def question_of(model: DriveModel, recordings: Sequence[Recording],
                progress: Callable[[float], None]) -> Question:
    """Return what recordings leave open; errors as `diagnose`."""
    way = find_way(model, recordings, progress)
    # As the diagnosis does: all others are judged around a model that has what bends them.
    contested = any(way.rivals.get(one.candidate.name) for one in way.bent)
    stage = way.first if contested else way.last
    progress(1.0)
    return _Asker(stage).question()


class _Asker:
    """Turns a selection into a question."""

    def __init__(self, stage: Stage) -> None:
        self.stage, self.selection = stage, stage.selection
        self.regression: Regression = stage.regression
        self.noises = self.selection.fit.noises
        self.blocks: list[Block] = []

    def question(self) -> Question:
        adopted = self.selection.adopted
        if any(self.selection.rivals.get(one.candidate.name) for one in adopted):
            return self._separation()
        if adopted:
            return self._estimation('estimate', [self._explained(one.candidate, self._others(k))
                                                 for k, one in enumerate(adopted)])
        return self._estimation('excite', self._weak())

    def _others(self, k: int) -> tuple[Active, ...]:
        return tuple(active for j, one in enumerate(self.selection.adopted) if j != k
                     for active in one.candidate.active)

    def _explained(self, candidate: Candidate, others: tuple[Active, ...],
                   more: Sequence[int] = ()) -> Explanation:
        """Return an explanation with its fitted values, on more drives where they are given."""
        coefficients, _, _ = self.regression.solve((*others, *candidate.active), self.noises)
        place = len(self.regression.design.base) + sum(one.size for one in others)
        blocks = []
        for active in candidate.active:
            blocks.append(Block.of(active, coefficients[place:place + active.size]))
            place += active.size
        first = blocks[0]
        blocks += [replace(first, drive=d, values=0 * first.values) for d in more]
        self.blocks += blocks
        return Explanation(candidate.name, tuple(blocks), (),
                           np.concatenate([block.truth for block in blocks]), candidate.penalty)

    def _separation(self) -> Question:
        pairs: list[tuple[Explanation, Explanation, tuple[Explanation, ...]]] = []
        mains = [self._explained(one.candidate, self._others(k))
                 for k, one in enumerate(self.selection.adopted)]
        for k, one in enumerate(self.selection.adopted):
            names = self.selection.rivals.get(one.candidate.name, [])
            scan = Scan(self.stage.selector.library, self._others(k), self.noises)
            found = {c.name: c for c in scan.candidates()} if names else {}
            group = [(one.candidate, mains[k])]
            for name in names:
                candidate = scan.refined(found[name])
                group.append((candidate, self._explained(
                    candidate, self._others(k), _drives_missing(candidate, one.candidate))))
            beside = tuple(other for j, other in enumerate(mains) if j != k)
            # An effect that can be all that another one is fits it on any motion.
            pairs += [(truth, rival, beside) for (small, truth), (large, rival)
                      in permutations(group, 2) if not holds(large, small)]
        plan = plan_for(self.regression.design, self.blocks)
        base = tuple(range(len(plan.labels)))
        contests = []
        for truth, rival, beside in pairs:
            truth, rival = (_placed(one, plan) for one in (truth, rival))
            others = index_of([_placed(one, plan) for one in beside])
            contests.append(Contest(truth, rival, (*base, *others, *rival.index)))
        return self._asked('separate', plan, Separation(tuple(contests)), tuple(contests),
                           [_placed(one, plan) for one in mains])

    def _estimation(self, kind: str, subjects: list[Explanation]) -> Question:
        plan = plan_for(self.regression.design, self.blocks)
        placed = [_placed(one, plan) for one in subjects]
        base = tuple(range(len(plan.labels)))
        if placed:
            scales = np.concatenate([block_scales(b) for one in placed for b in one.blocks])
            criterion = Precision(index_of(placed), base, scales)
        else:
            numbers = tuple(k for k, (what, _) in enumerate(plan.labels) if what == 'number')
            criterion = Precision(numbers, tuple(k for k in base if k not in numbers),
                                  np.ones(len(numbers)))
        return self._asked(kind, plan, criterion, (), placed)

    def _weak(self) -> list[Explanation]:
        """Return effects that the motion would not show at a size that matters."""
        scan = Scan(self.stage.selector.library, (), self.noises)
        weak = []
        for term in self.stage.selector.library.structure:
            S, _, _ = scan.projected(term.rows)
            scales = np.array([c.scale for c in term.effect.coefficients])
            if np.any(np.diag(S) * scales ** 2 < UNEXCITED):
                active = Active(term, tuple(c.name for c in term.effect.coefficients))
                block = Block.of(active, scales)
                self.blocks.append(block)
                weak.append(Explanation(term.effect.name, (block,), (), block.truth,
                                        self.stage.selector.library.penalty(active)))
        return weak

    def _asked(self, kind: str, plan: ColumnPlan, criterion: Criterion,
               contests: tuple[Contest, ...], subjects: Sequence[Explanation]) -> Question:
        noise = NoiseSpectra(self.noises, self.regression.design.residuals.period)
        known = Information(plan, noise).of_recordings(self.regression)
        known[np.diag_indices(len(plan.labels))] += self.regression.precision
        floor = max(float(np.sqrt(np.mean(self.selection.fit.rest[d][
            self.regression.series[d].known] ** 2))) for d in self.noises)
        return Question(kind, plan.model, plan, noise, known, criterion,
                        contests, tuple(subjects), floor)


def block_scales(block: Block) -> Array:
    """Return the sizes at which a block's coefficients matter; shapes are relative."""
    coefficients = block.effect.coefficients
    own = [coefficients[k].scale for k in block.chosen] if coefficients else [1.0]
    return np.array(own + [1.0] * len(block.shape))


def _placed(one: Explanation, plan: ColumnPlan) -> Explanation:
    return replace(one, index=tuple(block_index(plan, one.blocks)))


def _drives_missing(candidate: Candidate, beside: Candidate) -> list[int]:
    """Return drives of the one effect that the other, if it sits on drives, leaves out."""
    mine, theirs = candidate.drives, beside.drives
    if mine is None or theirs is None or len(candidate.active[0].term.rows) > 1:
        return []
    return sorted(set(theirs) - set(mine))
