# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The next experiment: from recordings to the most informative motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.special import ndtr

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.experiments.columns import FittedTerm
from pprs_dynamics.inference.experiments.criteria import Contest, Precision, misfits_of
from pprs_dynamics.inference.experiments.motion_design import (
    ArmMotions,
    Motion,
    PlatformMotions,
    design,
    limits_of,
)
from pprs_dynamics.inference.experiments.motion_limits import ArmLimits, MotionLimits
from pprs_dynamics.inference.experiments.question import (
    Question,
    commissioning,
    precision_of,
    question_of,
)
from pprs_dynamics.inference.regression.base_columns import ModelNumber
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces

PURPOSES = ('separate', 'commission')
SURE = 0.9  # probability from which a design counts as separating
SHORTEST, LONGEST = 5.0, 120.0  # [s]
# Effects of which the same motion with a known mass more shows at once which of them it is: one
# grows with it, the other stays, or the mass is seen too large.
TOLD_BY_LOAD = tuple(map(frozenset, (
    ('coulomb_friction', 'load_friction'), ('coulomb_friction', 'gear_efficiency'),
    ('payload_mass', 'external_wrench'), ('link_mass', 'external_wrench'),
    ('counterbalance', 'link_mass'), ('counterbalance', 'payload_mass'),
    ('effort_gain', 'payload_mass'), ('effort_gain', 'link_mass'),
    ('effort_gain', 'drive_inertia'))))
LOAD_SHARE = 0.1  # of all that moves, that such a mass is about
RESERVE = 4.0  # standard deviations of noise that efforts are kept below their limits by


class PurposeError(PprsError, ValueError):
    """A purpose that needs what is not given."""


@dataclass(frozen=True)
class ExpectedEvidence:
    """Expected evidence of a motion in one contest.

    Parameters
    ----------
    truth, rival : str
    now, expected : float
        By how much the rival costs more in a diagnosis: of the recordings, and with the motion.
    probability : float
        That the rival falls behind by what a diagnosis asks for.
    """

    truth: str
    rival: str
    now: float
    expected: float
    probability: float

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {'truth': self.truth, 'rival': self.rival, 'evidence_now': self.now,
                'expected_evidence': self.expected, 'probability': self.probability}


@dataclass(frozen=True)
class Accuracy:
    """How well a number would be known.

    Parameters
    ----------
    label : str
    unit : str
    scale : float
        Size at which it matters, or the tolerance's standard deviation.
    before, after : float
        Standard deviations.
    """

    label: str
    unit: str
    scale: float
    before: float
    after: float

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {'label': self.label, 'unit': self.unit, 'scale': self.scale,
                'std_before': self.before, 'std_after': self.after}


@dataclass(frozen=True)
class Experiment:
    """A designed motion with its expected evidence.

    Parameters
    ----------
    kind : {'separate', 'estimate', 'excite', 'commission'}
    subjects : tuple of str
        Effects in question.
    contests : tuple of ExpectedEvidence
    accuracies : tuple of Accuracy
    expected_evidence : float
        The least of all contests that it decides; without contests, of all effects in question
        against their absence.
    hidden : tuple of str
        Effects in question that would not show at the size at which they matter.
    limits : dict of str to float
        Use of each limit, its margin taken off: at most 1.
    duration : float
        [s]
    motion : callable
        Times [s] -> PlatformMotion, or JointMotion of an arm.
    forces : callable
        Times [s] -> Forces.
    model : DriveModel
    """

    kind: str
    subjects: tuple[str, ...]
    contests: tuple[ExpectedEvidence, ...]
    accuracies: tuple[Accuracy, ...]
    expected_evidence: float
    hidden: tuple[str, ...]
    limits: dict[str, float]
    duration: float
    motion: Callable[[Array], Any]
    forces: Callable[[Array], Forces]
    model: DriveModel

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """All pairs in question."""
        return tuple(dict.fromkeys(tuple(sorted((one.truth, one.rival)))  # type: ignore[misc]
                                   for one in self.contests))

    @property
    def separates(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it separates, whichever of the two is true."""
        return tuple(pair for pair in self.pairs if all(
            one.probability >= SURE for one in self.contests if {one.truth, one.rival} == {*pair}))

    @property
    def fails(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it does not, or not in every case."""
        return tuple(pair for pair in self.pairs if pair not in self.separates)

    @property
    def told_by_load(self) -> tuple[tuple[str, str], ...]:
        """Pairs that no motion separates, but the same motion with another load does."""
        return tuple(pair for pair in self.fails if frozenset(pair) in TOLD_BY_LOAD)

    @property
    def load(self) -> float | None:
        """Mass that the tool should carry more in a second recording [kg]; None: no need."""
        if not self.told_by_load:
            return None
        return float(f'{LOAD_SHARE * self.model.moved_mass:.1g}')

    @property
    def text(self) -> str:
        """What it is for, and whether it will do, in one or two sentences."""
        if self.kind == 'separate':
            found = []
            if self.separates:
                found.append(f'This motion separates {_listed(self.separates)}: evidence of '
                             f'{self.expected_evidence:.0f} is expected.')
            if self.fails:
                found.append(f'It will hardly separate {_listed(self.fails)}: no motion that was '
                             'tried within these limits does so for sure.')
            if self.load:
                found.append(f'For {_listed(self.told_by_load)} record the same motion once more '
                             f'with {self.load:g} kg more at the tool, and diagnose that recording '
                             'with this payload in the model.')
            return ' '.join(found)
        last = (f' At the size at which they matter it would not show {", ".join(self.hidden)}: '
                'a longer motion or wider limits would.' if self.hidden else '')
        return {
            'estimate': f'One explanation is left: {", ".join(self.subjects)}. This motion '
                        'measures its parameters best.',
            'excite': 'Nothing is missing as far as the recordings show. This motion shows what '
                      f'they hardly excite: {", ".join(self.subjects)}.' if self.subjects else
                      'Nothing is missing, and all is excited. This motion measures the model\'s '
                      'own numbers best.',
            'commission': 'This motion measures the model\'s numbers and shows all common '
                          'effects.'}[self.kind] + last

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON of the interface, and what the documentation adds to it."""
        return {'separates': [list(pair) for pair in self.separates],
                'does_not_separate': [list(pair) for pair in self.fails],
                'expected_evidence': self.expected_evidence,
                'load': self.load, 'told_by_load': [list(pair) for pair in self.told_by_load],
                'question': self.kind, 'subjects': list(self.subjects),
                'hidden': list(self.hidden), 'text': self.text,
                'contests': [one.to_dict() for one in self.contests],
                'accuracy': [one.to_dict() for one in self.accuracies],
                'limits': self.limits, 'duration': self.duration}


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    """Return pairs in words, those of one effect together."""
    return '; '.join(f'{name} from {", ".join(other for one, other in pairs if one == name)}'
                     for name in dict.fromkeys(one for one, _ in pairs))


def next_experiment(
    model: DriveModel, recordings: Sequence[Recording] = (),
    purpose: str = 'separate',
    limits: MotionLimits | ArmLimits | None = None, duration: float = 20.0, seed: int = 0,
    noise: float = 0.05, progress: Callable[[float], None] | None = None,
    decisions: Decisions = DECISIONS,
) -> Experiment:
    """Return the motion that decides most; see `pprs_dynamics.next_experiment`.

    Of an arm for 'separate' only; `arm_excitation` designs its first motion.

    Raises
    ------
    PurposeError
        For 'separate' without recordings.
    NoMotionError
        Where the limits leave no room.
    PprsError
        As `diagnose`.
    """
    report = progress or (lambda share: None)
    check_purpose(purpose, recordings)
    check_duration(duration)
    question = (commissioning(model, recordings, noise, decisions)
                if purpose == 'commission' and not model.moves_joints else
                question_of(model, recordings, lambda share: report(0.2 * share), decisions))
    limits = limits or (ArmLimits() if model.moves_joints else MotionLimits())
    limits = replace(limits, effort_reserve=max(
        limits.effort_reserve, RESERVE * question.noise_floor))
    return design_experiment(question, limits, duration, seed,
                             lambda share: report(0.2 + 0.8 * share))


def design_experiment(
    question: Question, limits: MotionLimits | ArmLimits, duration: float, seed: int,
    progress: Callable[[float], None] = lambda share: None,
) -> Experiment:
    """Return the motion that answers a question best."""
    motions = (ArmMotions(question.model, limits, duration) if isinstance(limits, ArmLimits)
               else PlatformMotions(question.model, limits, duration))
    asked = question

    def screened(drawn: list[Any]) -> Callable[[Any], float]:
        nonlocal asked
        asked = without_hopeless(question, [question.gram(motion) for motion in drawn])
        return lambda motion: asked.worth(asked.gram(motion))

    best = design(motions, lambda motion: 0.0, seed, progress, screened)
    progress(1.0)
    return experiment_of(asked, best, limits_of(motions, best))


def without_hopeless(question: Question, grams: Sequence[Array]) -> Question:
    """Return a question without the contests that none of some motions would decide."""
    contests = question.contests
    if not contests:
        return question
    known = question.known
    gained = np.max([misfits_of(contests, known + gram) for gram in grams],
                    axis=0) - misfits_of(contests, known)
    hopeful = [contest for contest, more in zip(contests, gained, strict=True)
               if contest.now + more > question.decisions.rival_margin]
    return question.with_contests(hopeful) if hopeful else question


def check_purpose(purpose: str, recordings: Sequence[object]) -> None:
    """Raise PurposeError for a purpose that needs recordings where there are none."""
    if purpose not in PURPOSES:
        raise PurposeError(f'purpose is {purpose!r}, must be one of {", ".join(PURPOSES)}')
    if purpose == 'separate' and not recordings:
        raise PurposeError('purpose separate: no recording is given, but it reads from recordings '
                           'what is to be told apart; a new robot starts with --purpose '
                           'commission')


def check_duration(duration: float) -> None:
    """Raise PurposeError for a duration that no design is made for."""
    if not SHORTEST <= duration <= LONGEST:
        raise PurposeError(f'duration is {duration:g} s, must lie between {SHORTEST:g} and '
                           f'{LONGEST:g} s')


def experiment_of(question: Question, motion: Motion, limits: dict[str, float]) -> Experiment:
    """Return a motion with what it promises for a question; `limits`: its use of them."""
    known, after = question.known, question.known + question.gram(motion)
    contests = tuple(found for one in question.contests for found in _expected(
        one, known, after, question.decisions.rival_margin))
    decided = [one.expected for one in contests if one.probability >= SURE]
    evidences = _evidences(question, after)
    if contests:
        expected = min(decided or [one.expected for one in contests])
    else:
        expected = min(evidences.values(), default=0.0)
    return Experiment(
        question.kind, tuple(dict.fromkeys(one.name for one in question.subjects)), contests,
        tuple(_accuracies(question, known, after)), expected,
        () if contests else tuple(name for name, one in evidences.items() if one <= 0),
        limits, motion.duration, motion.motion,
        lambda time: question.model.drive_forces(motion.motion(time)), question.model)


def _expected(contest: Contest, known: Array, after: Array, margin: float,
              ) -> list[ExpectedEvidence]:
    """Return what a motion promises for every pair of effects of a contest."""
    expected, gained = contest.evidence(known, after), contest.gained(known, after)
    # Twice a log-likelihood ratio scatters by twice the root of its mean.
    sure = float(ndtr((expected - margin) / (2 * np.sqrt(gained) + 1e-9)))
    return [ExpectedEvidence(truth, rival, contest.now, expected, sure)
            for truth, rival in product(*contest.sides)]


def _evidences(question: Question, after: Array) -> dict[str, float]:
    """Return the evidence of each subject against its absence, the least of its drives."""
    base = tuple(range(len(question.plan.base)))
    found: dict[str, float] = {}
    for one in question.subjects:
        own = Precision(one.index, base, np.ones(len(one.index))).own(after)
        evidence = float(one.truth @ own @ one.truth) - one.prior_cost
        found[one.name] = min(evidence, found.get(one.name, np.inf))
    return found


def _accuracies(question: Question, known: Array, after: Array) -> list[Accuracy]:
    """Return how well numbers and effects would be known; effects that may be there each alone."""
    if question.contests:
        return []
    plan, found = question.plan, []
    if question.kind == 'commission' or not question.subjects:
        numbers = [one.number for one in plan.base if isinstance(one, ModelNumber)]
        # Their columns are per standard deviation of what is known beforehand.
        found += _known_to([(one.label, one.unit, one.deviation) for one in numbers],
                           precision_of(plan, ()), known, after)
    groups = ([question.subjects] if question.kind == 'estimate' else
              [(one,) for one in question.subjects])
    for group in groups:
        found += _known_to([label for one in group for term in one.terms
                            for label in _labels(term, question.model)],
                           precision_of(plan, group), known, after)
    return found


def _known_to(labels: list[tuple[str, str, float]], precision: Precision, known: Array,
              after: Array) -> list[Accuracy]:
    """Return accuracies by name, unit and what one scale of the precision is in that unit."""
    before, later = (precision.deviations(gram) / precision.scales for gram in (known, after))
    return [Accuracy(label, unit, scale, scale * float(a), scale * float(b))
            for (label, unit, scale), a, b in zip(labels, before, later, strict=True)]


def _labels(term: FittedTerm, model: DriveModel) -> list[tuple[str, str, float]]:
    """Return name, unit and scale of each parameter of a term that is fitted."""
    prefix, unit = term.effect.name, DriveUnits()
    if term.drive is not None:
        prefix, unit = f'{prefix}.{model.drives[term.drive]}', model.units[term.drive]
    return [(f'{prefix}.{p.name}', unit.of(p.unit),
             p.spread(1.0, term.shape[p.name]) if p.name in term.shape else p.scale)
            for p in term.parameters]
