# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How right an answer is, and how often an entrant is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from scipy.stats import binomtest

from benchmarks.naming.problems import Answer, Truth

COVERED = 1.96  # standard deviations of a 95 % interval
SINGLE = ('single', 'form')
SETS = ('two', 'three')


@dataclass(frozen=True)
class Judged:
    """What is right about one answer; None where the problem does not ask.

    Parameters
    ----------
    first : bool or None
        The strongest effect of the first set is the one that was hidden.
    named : bool or None
        All hidden effects are in one of the sets that are named.
    exact : bool or None
        The first set is what was hidden, no more and no less, and the verdict is not unknown.
    wrong_alone : bool or None
        Verdict effect, with nothing of what was hidden.
    false_alarm : bool or None
        Nothing was hidden, and something was claimed.
    unknown : bool or None
        Something outside the catalogue was hidden, and the verdict is unknown.
    drives : bool or None
        Hidden effects in the first set are on the right drives.
    covered : tuple of bool
        For each parameter with a deviation: the interval contains the truth.
    sets : int or None
        Sets of an ambiguous answer.
    """

    first: bool | None = None
    named: bool | None = None
    exact: bool | None = None
    wrong_alone: bool | None = None
    false_alarm: bool | None = None
    unknown: bool | None = None
    drives: bool | None = None
    covered: tuple[bool, ...] = ()
    sets: int | None = None


def judge(truth: Truth, answer: Answer) -> Judged:
    """Return how right an answer is."""
    sets = len(answer.sets) if answer.verdict == 'ambiguous' else None
    if truth.kind == 'nothing':
        return Judged(false_alarm=answer.verdict != 'none', sets=sets)
    if truth.kind == 'unknown':
        return Judged(unknown=answer.verdict == 'unknown',
                      wrong_alone=answer.verdict == 'effect', sets=sets)
    true = truth.names
    best = answer.sets[0] if answer.sets else ()
    told = [effect.name for effect in best]
    both = [(effect, next(t for t in truth.effects if t.name == effect.name))
            for effect in best if effect.name in true]
    on_drives = [(effect, t) for effect, t in both if t.drives is not None]
    return Judged(
        first=told[:1] == [true[0]] if truth.kind in SINGLE else None,
        named=any(set(true) <= {effect.name for effect in found} for found in answer.sets),
        exact=sorted(told) == sorted(true) and answer.verdict != 'unknown',
        wrong_alone=answer.verdict == 'effect' and not set(told) & set(true),
        drives=all(set(effect.drives or ()) == set(t.drives or ()) for effect, t in on_drives)
        if on_drives else None,
        covered=tuple(
            abs(value - t.parameters[key][0]) <= COVERED * std
            for effect, t in both for key, (value, std) in effect.parameters.items()
            if std is not None and key in t.parameters),
        sets=sets)


@dataclass(frozen=True)
class Rate:
    """How often something was so."""

    hits: int
    count: int

    @classmethod
    def of(cls, answers: Iterable[bool | None]) -> Rate:
        """Return the share of those that were asked."""
        known = [answer for answer in answers if answer is not None]
        return cls(sum(known), len(known))

    @property
    def share(self) -> float:
        """The share; not a number where nothing was asked."""
        return self.hits / self.count if self.count else float('nan')

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval."""
        if not self.count:
            return 0.0, 1.0
        low, high = binomtest(self.hits, self.count).proportion_ci(method='wilson')
        return float(low), float(high)

    def __str__(self) -> str:
        if not self.count:
            return '-'
        low, high = self.interval
        return (f'{100 * self.share:.0f} % ({self.hits}/{self.count}; '
                f'{100 * low:.0f}-{100 * high:.0f})')


Scored = Sequence[tuple[Truth, Answer, Judged]]


def _of(*kinds: str) -> Callable[[Truth], bool]:
    return lambda truth: truth.kind in kinds


# Columns of the table: what is asked, of which problems, and whether more is better.
FIGURES: tuple[tuple[str, Callable[[Truth], bool], Callable[[Judged], bool | None], bool], ...] = (
    ('first', _of(*SINGLE), lambda j: j.first, True),
    ('named', _of(*SINGLE), lambda j: j.named, True),
    ('exact, one', _of('single'), lambda j: j.exact, True),
    ('exact, form off', _of('form'), lambda j: j.exact, True),
    ('exact, two or three', _of(*SETS), lambda j: j.exact, True),
    ('wrong alone', _of(*SINGLE, *SETS, 'unknown'), lambda j: j.wrong_alone, False),
    ('false alarms', _of('nothing'), lambda j: j.false_alarm, False),
    ('unknown', _of('unknown'), lambda j: j.unknown, True),
    ('right drives', _of(*SINGLE, *SETS), lambda j: j.drives, True),
)


def figures(scored: Scored) -> dict[str, Rate]:
    """Return each figure of an entrant."""
    found = {name: Rate.of(asked(judged) for truth, _, judged in scored if chosen(truth))
             for name, chosen, asked, _ in FIGURES}
    found['interval coverage'] = Rate.of(hit for _, _, judged in scored for hit in judged.covered)
    return found


def set_size(scored: Scored) -> float | None:
    """Return the median number of sets in answers that are ambiguous."""
    sizes = [judged.sets for _, _, judged in scored if judged.sets is not None]
    return float(median(sizes)) if sizes else None


def seconds(scored: Scored) -> float:
    """Return the median processor time of an answer [s]."""
    return float(median(answer.seconds for _, answer, _ in scored)) if scored else float('nan')
