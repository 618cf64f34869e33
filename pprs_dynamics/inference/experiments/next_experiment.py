# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The next experiment: from recordings to the most informative motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.special import ndtr

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.experiments.motion_design import MotionLimits, Motions, design
from pprs_dynamics.inference.experiments.question import (
    COMMISSION,
    ESTIMATE,
    SEPARATE,
    Question,
    commissioning,
    question_of,
)
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.system.json_records import JsonRecord

PURPOSES = (SEPARATE, COMMISSION)
SURE = 0.9  # probability from which a design counts as separating
SHORTEST, LONGEST = 5.0, 120.0  # [s]
# Effects that the same motion with a known mass more separates: one grows with it, the other does
# not, or the mass appears too large.
SEPARATED_BY_LOAD = tuple(map(frozenset, (
    ('coulomb_friction', 'load_friction'), ('coulomb_friction', 'gear_efficiency'),
    ('payload_mass', 'external_wrench'), ('link_mass', 'external_wrench'),
    ('counterbalance', 'link_mass'), ('counterbalance', 'payload_mass'),
    ('effort_gain', 'payload_mass'), ('effort_gain', 'link_mass'),
    ('effort_gain', 'drive_inertia'))))
LOAD_SHARE = 0.1  # of all that moves, that such a mass is about
RESERVE = 4.0  # standard deviations of noise that efforts are kept below their limits by


class PurposeError(PprsError, ValueError):
    """A purpose whose recordings are missing."""


@dataclass(frozen=True)
class ExpectedEvidence:
    """Expected evidence of a motion in one contest.

    Parameters
    ----------
    truth, rival : str
        The effect that is assumed to be there, and the one that is compared with it.
    evidence_now, expected_evidence : float
        Cost of the rival above that of the truth: of the recordings, and with the motion.
    probability : float
        Probability that a diagnosis then excludes the rival.
    """

    truth: str
    rival: str
    evidence_now: float
    expected_evidence: float
    probability: float


@dataclass(frozen=True)
class Accuracy:
    """Standard deviations of a number before and after an experiment.

    Parameters
    ----------
    label, unit : str
        The number.
    scale : float
        Size at which it matters, or the standard deviation of its tolerance.
    std_before, std_after : float
        Standard deviation without and with the motion.
    """

    label: str
    unit: str
    scale: float
    std_before: float
    std_after: float


@dataclass(frozen=True)
class Experiment(JsonRecord):
    """A designed motion with its expected evidence.

    Parameters
    ----------
    kind : {'separate', 'estimate', 'commission'}
        What the motion is for.
    subjects : tuple of str
        Effects in question.
    contests : tuple of ExpectedEvidence
        Expected evidence between every two of them.
    accuracies : tuple of Accuracy
        How well numbers would be known.
    limits : dict of str to float
        Use of each limit, its margin taken off: at most 1.
    duration : float
        Duration of the motion [s].
    motion : callable
        Times [s] -> PlatformMotion, or JointMotion of an arm.
    model : DriveModel
    """

    json_keys = ('separates', 'does_not_separate', 'expected_evidence', 'load',
                 'separated_by_load', 'question', 'subjects', 'text', 'contests', 'accuracy',
                 'limits', 'duration', 'determined', 'total')
    json_attributes = (('question', 'kind'), ('accuracy', 'accuracies'))
    json_optional = ('determined', 'total')

    kind: str
    subjects: tuple[str, ...]
    contests: tuple[ExpectedEvidence, ...]
    accuracies: tuple[Accuracy, ...]
    limits: dict[str, float]
    duration: float
    motion: Callable[[Array], PlatformMotion | JointMotion]
    model: DriveModel = field(repr=False)

    def forces(self, time: Array) -> Forces:
        """Return the model's forces along the motion at times [s]."""
        return self.model.drive_forces(self.motion(time))

    @property
    def expected_evidence(self) -> float:
        """Least expected evidence of the pairs that it separates; of all if it separates none."""
        decided = [c for c in self.contests if c.probability >= SURE] or self.contests
        return min((contest.expected_evidence for contest in decided), default=0.0)

    @property
    def pairs(self) -> dict[tuple[str, str], bool]:
        """All pairs in question, and whether it separates them, whichever of the two is true."""
        pairs: dict[tuple[str, str], bool] = {}
        for contest in self.contests:
            first, second = sorted((contest.truth, contest.rival))
            pairs[first, second] = (pairs.get((first, second), True)
                                    and contest.probability >= SURE)
        return pairs

    @property
    def separates(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it separates."""
        return tuple(pair for pair, is_separated in self.pairs.items() if is_separated)

    @property
    def does_not_separate(self) -> tuple[tuple[str, str], ...]:
        """Pairs that it does not separate, or not in every case."""
        return tuple(pair for pair, is_separated in self.pairs.items() if not is_separated)

    @property
    def separated_by_load(self) -> tuple[tuple[str, str], ...]:
        """Pairs that no motion separates, but the same motion with another load does."""
        return tuple(pair for pair in self.does_not_separate
                     if frozenset(pair) in SEPARATED_BY_LOAD)

    @property
    def load(self) -> float | None:
        """Mass that the tool should carry more in a second recording [kg]; None: no need."""
        mass = self.model.robot.moved_mass
        return float(f'{LOAD_SHARE * mass:.1g}') if self.separated_by_load else None

    @property
    def total(self) -> int | None:
        """How many numbers a first motion is for; null for other motions."""
        return len(self.accuracies) if self.kind == COMMISSION else None

    @property
    def determined(self) -> int | None:
        """How many of them it determines better than the size at which they matter."""
        return self.total and sum(a.std_after < a.scale for a in self.accuracies)

    @property
    def text(self) -> str:
        """Purpose and expected evidence, in a few sentences."""
        if self.determined is not None:
            return ('This motion measures the numbers of the model and of common effects. It '
                    f'determines {self.determined} of {self.total} better than the size at which '
                    'they matter. Collisions are not checked.')
        if self.kind == ESTIMATE:
            return (f'Only one explanation remains: {", ".join(self.subjects)}. This motion '
                    'measures its parameters best.')
        found = []
        if self.separates:
            found.append(f'This motion separates {_listed(self.separates)}. The expected evidence '
                         f'is {self.expected_evidence:.0f} (10 are odds of 150 to 1).')
        if self.does_not_separate:
            found.append(f'It hardly separates {_listed(self.does_not_separate)}: no motion within '
                         'the limits was found that does.')
        if self.load:
            found.append(f'For {_listed(self.separated_by_load)} record the same motion once more '
                         f'with {self.load:g} kg more at the tool, and diagnose that recording '
                         'with this payload in the model.')
        return ' '.join(found)


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    """Return pairs in words, grouped by their first effect."""
    others: dict[str, list[str]] = {}
    for name, other in pairs:
        others.setdefault(name, []).append(other)
    return '; '.join(f'{name} from {", ".join(names)}' for name, names in others.items())


def next_experiment(
    model: DriveModel, recordings: Sequence[Recording] = (), purpose: str = SEPARATE,
    duration: float = 20.0, seed: int = 0, progress: Callable[[float], None] | None = None,
) -> Experiment:
    """Return the motion that decides most; see `pprs_dynamics.next_experiment`.

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
    motions = Motions(model, MotionLimits(), duration)
    question = (commissioning(model, recordings, motions) if purpose == COMMISSION else
                question_of(model, recordings, motions, lambda share: report(0.2 * share)))
    motions = replace(motions, limits=MotionLimits(effort_reserve=RESERVE * question.noise_floor))
    return design_experiment(question, motions, seed, lambda share: report(0.2 + 0.8 * share))


def design_experiment(question: Question, motions: Motions, seed: int,
                      progress: Callable[[float], None] = lambda share: None) -> Experiment:
    """Return the motion that answers a question best."""
    best = design(motions, motions.drawn(seed),
                  lambda series: question.worth(question.gram(motions, series)), seed, progress)
    after = question.known + question.gram(motions, best)
    return Experiment(
        question.kind, question.subjects, _expected(question, after), _accuracies(question, after),
        motions.uses(best), best.duration, lambda time: motions.sampled(best, time),
        question.information.model)


def check_purpose(purpose: str, recordings: Sequence[object]) -> None:
    """Raise PurposeError for a purpose that needs recordings where there are none."""
    if purpose not in PURPOSES:
        raise PurposeError(f'purpose is {purpose!r}, must be one of {", ".join(PURPOSES)}')
    if purpose == SEPARATE and not recordings:
        raise PurposeError('purpose separate: no recording is given, must be at least one, as its '
                           'remaining candidates are separated; for a new robot: --purpose '
                           'commission')


def check_duration(duration: float) -> None:
    """Raise PurposeError for a duration that no design is made for."""
    if not SHORTEST <= duration <= LONGEST:
        raise PurposeError(f'duration is {duration:g} s, must lie between {SHORTEST:g} and '
                           f'{LONGEST:g} s')


def _expected(question: Question, after: Array) -> tuple[ExpectedEvidence, ...]:
    """Return the expected evidence of a motion for every pair of effects."""
    found = []
    for contest in question.contests:
        gained = max(contest.misfit(after) - contest.misfit(question.known), 0.0)
        expected = contest.now + gained
        # Twice a log-likelihood ratio scatters by twice the root of its mean.
        sure = float(ndtr((expected - DECISIONS.rival_margin) / (2 * np.sqrt(gained) + 1e-9)))
        found += [ExpectedEvidence(truth, rival, contest.now, expected, sure)
                  for truth, rival in product(contest.truth, contest.rival)]
    return tuple(found)


def _accuracies(question: Question, after: Array) -> tuple[Accuracy, ...]:
    """Return how well numbers would be known; infinite deviations of what nothing shows."""
    found = []
    for contest in question.contests if question.kind != SEPARATE else ():
        with np.errstate(divide='ignore'):
            before, later = (float(contest.scale / np.sqrt(contest.misfit(gram)))
                             for gram in (question.known, after))
        found.append(Accuracy(contest.truth[0], contest.unit, contest.scale, before, later))
    return tuple(found)
