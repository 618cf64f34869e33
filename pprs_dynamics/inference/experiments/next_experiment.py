# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The next experiment: from recordings to the most informative motion.

A question is rival rows of the table, or numbers that are poorly known. Columns are those of
`regression.design`, so that the information of a motion and that of the recordings add up. As in a
fit they are transformed by the orthonormal DCT and divided by the root of the noise's power
spectrum. The one criterion is expected evidence: of rival models, or of a number at the size at
which it matters against zero. The mean of 1 / (1 + evidence) is then the mean share of the numbers'
variances that the data leave (A-optimality).

References
----------
A. C. Atkinson, V. V. Fedorov, The design of experiments for discriminating between two rival
models, Biometrika 62 (1975) 57-70 (T-optimality).
K. Chaloner, I. Verdinelli, Bayesian experimental design: a review, Statistical Science 10 (1995)
273-304 (A-optimality with what is known beforehand).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy import fft
from scipy.linalg import cho_factor, cho_solve
from scipy.special import ndtr

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.experiments.motion_design import Motions, coarse_time, design
from pprs_dynamics.inference.regression.base_columns import BaseColumn, ModelNumber
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.sensitivities import Sensitivities, model_numbers
from pprs_dynamics.inference.regression.terms import Rows
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.body_centres import about_centre
from pprs_dynamics.inference.search.candidates import CandidateSet, Component
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.table import ModelTable, Rival, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import BLOCK_DURATION
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion, JointSeries
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.json_records import JsonRecord

SEPARATE, COMMISSION = 'separate', 'commission'
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
# Effects that most machines have, or that are most often entered wrongly.
COMMON = ('viscous_friction', 'coulomb_friction', 'stribeck_friction', 'effort_offset',
          'drive_spring', 'drive_inertia', 'payload_mass', 'payload_offset', 'platform_inertia',
          'external_wrench', 'base_tilt', 'tool_drag', 'link_mass', 'joint_friction')
# How well the numbers of a new robot are known where its file does not say.
TOLERANCE = 0.1
NOISE_SHARE = 0.01  # of a drive's largest effort, where nothing is recorded
NUMBERS = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods',
           'friction.drives.viscous', 'friction.drives.coulomb', 'friction.revolute.viscous',
           'friction.revolute.coulomb', 'friction.spherical.viscous',
           'friction.spherical.coulomb')
TYPICAL = DriveRange(20.0, BLOCK_DURATION, 0.2, 0.2)  # for shapes of effects
WEAK = 1e-9  # prior precision of what is free, relative to what is known of it
UNSEEN = 1e-8  # share of the squared force, below which a misfit is rounding


@dataclass(frozen=True, eq=False)
class FittedTerm:
    """An effect on a drive or in the structure, with values.

    Its columns are those of its coefficients (one of coefficient 1 where the shape is all), then
    the derivatives by its shape parameters.

    Parameters
    ----------
    component : Component
    values : (k,) array
        Of the coefficients; 1 where the shape is all.
    """

    component: Component
    values: Array

    @property
    def size(self) -> int:
        """Number of columns."""
        return len(self.values) + len(self.component.shape)

    def labels(self, model: DriveModel) -> list[tuple[str, str, float, float]]:
        """Return name, unit, scale and coefficient of that size of each parameter that is fitted.

        Coefficients, then shape parameters, of which the column is that of a factor of e.
        """
        effect, drive = self.component.effect, self.component.drive
        shape, prefix, units = self.component.parameters, effect.name, DriveUnits()
        if drive is not None:
            prefix, units = f'{prefix}.{model.drives[drive]}', model.units[drive]
        known = {c.name: c for c in effect.coefficients}
        return [(f'{prefix}.{p.name}', units.of(p.unit), *(
            (p.spread(1.0, shape[p.name]), 1.0) if p.name in shape else (p.scale, p.scale)))
            for p in (*(known[name] for name in self.component.names), *effect.shape)]

    def rows(self, design: Design) -> Rows:
        """Return the columns of the term on recordings or on a motion."""
        c = self.component
        term = design.find_term(c.effect, c.drive, c.parameters)
        if c.centre:
            term = about_centre(term, c.names[0], c.centre)
        chosen = [term.names.index(name) for name in c.names] or [0]
        rows = {d: values[chosen] for d, values in term.rows.items()}
        if c.shape:
            every = np.zeros(len(term.names) or 1)
            every[chosen] = self.values
            slopes = design.slope_rows(term, every)
            rows = {d: np.concatenate((values, slopes[d])) for d, values in rows.items()}
        return rows


class Information:
    """Gram matrices (P, P) of columns: base columns, then those of terms.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    series : JointSeries
        Any motion.
    terms : sequence of FittedTerm
    noise : mapping of drive to NoiseSpectrum
        Other drives give no information.

    Attributes
    ----------
    base : tuple of BaseColumn
        Every base column that a motion may excite.
    """

    def __init__(self, given: DriveModel, model: DriveModel, series: JointSeries,
                 terms: Sequence[FittedTerm], noise: Mapping[int, NoiseSpectrum]) -> None:
        self.model, self.terms, self.noise = model, tuple(terms), noise
        self._sensitivities = Sensitivities(
            model, given, {term.component.effect for term in terms}
            | {type(effect) for effect in given.effects if isinstance(effect, CatalogueEffect)})
        self.base = self.on_motion(series).base

    @property
    def noise_floor(self) -> float:
        """Largest root of the mean squared noise of a drive [N]."""
        return max(noise.rms for noise in self.noise.values())

    @property
    def size(self) -> int:
        """Number of all columns."""
        return len(self.base) + sum(term.size for term in self.terms)

    def places(self, terms: Sequence[FittedTerm], only_fitted: bool = True) -> tuple[int, ...]:
        """Return the places of the columns of terms that are fitted, or of their coefficients."""
        ends = dict(zip(self.terms, len(self.base) + np.cumsum(
            [term.size for term in self.terms]), strict=True))
        return tuple(int(ends[term]) - term.size + k for term in terms for k in (
            range(len(term.values) - len(term.component.names), term.size) if only_fitted
            else range(len(term.values))))

    def force(self, terms: Sequence[FittedTerm]) -> Array:
        """Return the coefficients of the force of terms, (P,)."""
        found = np.zeros(self.size)
        found[list(self.places(terms, False))] = np.concatenate([term.values for term in terms])
        return found

    def columns(self, design: Design) -> Iterator[tuple[int, Array]]:
        """Yield all columns of each drive on recordings or on a motion, (P, M) [N]."""
        known = {_key(column): column.rows for column in design.base}
        base = [known.get(_key(column), {}) for column in self.base]
        terms = [(term.size, term.rows(design)) for term in self.terms]
        none = np.zeros((1, len(design.residuals)))
        for d in range(len(design.drives)):
            yield d, np.concatenate([none[:0], *(rows.get(d, none[0])[None] for rows in base), *(
                rows.get(d, np.repeat(none, size, axis=0)) for size, rows in terms)])

    def on_motion(self, series: JointSeries, time: Array | None = None, block: int = 1) -> Design:
        """Return the design of a motion at times [s], by default few, of which blocks are averaged.
        """
        time = coarse_time(series) if time is None else time
        return Design.planned(
            self._sensitivities, self.model.drive_forces(series.motion(time)), time, block)

    def prior(self) -> Array:
        """Return the prior precision of the base columns."""
        known = np.zeros(self.size)
        known[:len(self.base)] = [column.precision for column in self.base]
        return np.diag(known)

    def of_recordings(self, design: Design, regression: Regression, fit: JointFit) -> Array:
        """Return the information of recordings and the prior of the base columns."""
        gram = self.prior()
        for d, rows in self.columns(design):
            if d in self.noise:
                series = regression.series[d]
                white = series.transform(rows) * series.spread(np.sqrt(regression.weights(fit, d)))
                gram += white @ white.T
        return gram

    def of_motion(self, design: Design) -> Array:
        """Return the information of a motion, at any sampling rate."""
        white = [whitened(rows, self.noise[d], design.residuals.period)
                 for d, rows in self.columns(design) if d in self.noise]
        return sum((rows @ rows.T for rows in white), np.zeros((self.size,) * 2))


def _key(column: BaseColumn) -> str:
    """Return the key of a base column, the same in any design."""
    return repr(replace(column, rows={}))


def whitened(rows: Array, noise: NoiseSpectrum, period: float) -> Array:
    """Return the DCT of rows of a motion, (p, n), per standard deviation of the noise.

    Fewer samples than the noise has count for as many, as long as they follow the motion: one in a
    period [s].
    """
    count = rows.shape[-1]
    density = noise.power(np.arange(count) / (2 * count * period)) * noise.period / period
    white: Array = fft.dct(rows, norm='ortho', axis=-1) / np.sqrt(density)
    return white


@dataclass(frozen=True)
class Contest:
    """Expected discrimination of a rival from the true model.

    Parameters
    ----------
    missing : (P,) array
        Coefficients of the true force, less what the rival has for certain.
    refitted : tuple of int
        Places of all columns that are fitted with the rival.
    truth, rival : tuple of str
        Effects that only the truth has, and those that only the rival has. For a number its label,
        and none: the rival is the model without it.
    now : float
        By how much the rival costs more on the recordings that there are.
    unit : str
        Of a number.
    scale : float
        Size at which a number matters; that of `missing`.
    """

    missing: Array
    refitted: tuple[int, ...]
    truth: tuple[str, ...]
    rival: tuple[str, ...] = ()
    now: float = 0.0
    unit: str = ''
    scale: float = 1.0

    def misfit(self, gram: Array) -> float:
        """Return the whitened squared residual of the refitted rival."""
        R, whole = list(self.refitted), gram @ self.missing
        largest = float(self.missing @ whole)
        misfit = largest - float(whole[R] @ solve(gram[np.ix_(R, R)], whole[R]))
        return misfit if misfit > UNSEEN * largest else 0.0


def solve(matrix: Array, side: Array) -> Array:
    """Return the solution of a symmetric system whose rows may be nearly dependent."""
    scale = 1 / np.sqrt(np.diag(matrix) * (1 + WEAK) + 1e-12)
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices(len(scaled))] = 1 + WEAK
    found: Array = (scale * cho_solve(cho_factor(scaled), (scale * side.T).T).T).T
    return found


@dataclass(frozen=True)
class Question:
    """Rival sets or uncertain numbers that a motion is designed to decide.

    Parameters
    ----------
    kind : {'separate', 'commission'}
    information : Information
        Of any motion.
    known : (P, P) array
        Information of recordings and tolerances.
    contests : tuple of Contest
    """

    kind: str
    information: Information
    known: Array
    contests: tuple[Contest, ...]

    def after(self, series: JointSeries) -> Array:
        """Return what is known after a motion in addition to the recordings, (P, P)."""
        return self.known + self.information.of_motion(self.information.on_motion(series))

    def worth(self, series: JointSeries) -> float:
        """Return less the mean of 1 / (1 + misfit) after a motion."""
        gram = self.after(series)
        return -float(np.mean([1 / (1 + contest.misfit(gram)) for contest in self.contests]))


def question_of(model: DriveModel, recordings: Sequence[Recording], motions: Motions,
                progress: Callable[[float], None]) -> Question:
    """Return the rivals and uncertain effects after recordings; errors as `diagnose`."""
    table = tabulate(model, recordings, DECISIONS, progress)
    rivals = table.rivals(DECISIONS.rival_margin)
    return _separation(table, rivals, motions) if rivals else (
        commissioning(model, recordings, motions))


def _separation(table: ModelTable, rivals: Sequence[Rival], motions: Motions) -> Question:
    """Return how to separate the reported row from its rivals, of each pair of effects the best.

    A contest is a pair of rows. Each of the two is refitted to the data that the other predicts.
    """
    pairs: set[tuple[str, str]] = set()
    chosen = []
    for rival in rivals:
        new = set(product(rival.missing, rival.instead))
        if not new <= pairs:
            pairs |= new
            chosen.append(rival)
    # The last search, or the first where one of the sets is linear around its point.
    rows = [table.best, *(rival.row for rival in chosen)]
    fits = table.last if all(row.fitted.is_nonlinear for row in rows) else table.first
    placed = [fits.evaluate(row.fitted.candidates) for row in rows]
    terms = [tuple(FittedTerm(component, fitted.coefficients(component))
                   for c in fitted.effects for component in c.components) for fitted in placed]
    joined = {(k, other): _on_drives_of(placed[k], placed[other])
              for n in range(1, len(placed)) for k, other in ((n, 0), (0, n))}
    every = [*terms, *joined.values()]
    information = Information(
        fits.design.given, fits.design.model, motions.drawn(0, 1)[0],
        [term for group in every for term in group], fits.regression.noise(placed[0].fit))
    contests = []
    for (refitted, true), more in joined.items():
        free = information.places((*terms[refitted], *more))
        certain = information.force(terms[refitted])
        certain[list(free)] = 0.0
        rival = chosen[max(refitted, true) - 1]
        sides = ((rival.missing, rival.instead) if true == 0 else (rival.instead, rival.missing))
        contests.append(Contest(
            information.force(terms[true]) - certain, (*range(len(information.base)), *free),
            *sides, rows[refitted].cost - rows[true].cost))
    known = information.of_recordings(fits.design, fits.regression, placed[0].fit)
    return Question(SEPARATE, information, known, tuple(contests))


def _on_drives_of(fitted: CandidateSet, truth: CandidateSet) -> tuple[FittedTerm, ...]:
    """Return the effects of a set on further drives, where those of another set sit.

    A set that is refitted to what another one predicts may also be on the drives of that one.
    """
    theirs = {d for c in truth.effects for d in c.drives or ()}
    known = {candidate.name for candidate in truth.effects}
    return tuple(
        FittedTerm(replace(first, drive=d), np.zeros(max(len(first.names), 1)))
        for c in fitted.effects if c.drives is not None and c.name not in known
        for first in c.components[:1] if len(fitted.blocks[first].rows) == 1
        for d in sorted(theirs - set(c.drives)))


def commissioning(model: DriveModel, recordings: Sequence[Recording], motions: Motions) -> Question:
    """Return the question of a robot that nothing, or little, is known of.

    It is of the model's own numbers, and of the effects that are common.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        What is there already; may be none: then noise is a share of each drive's largest effort.
    motions : Motions
    """
    if not (model.has_links or model_numbers(model)):
        model = DriveModel.from_parameters({**model.values, **{
            f'tolerances.{key}': TOLERANCE for key in NUMBERS if np.any(model.values[key])}})
    series, terms = motions.drawn(0, 1)[0], _common_terms(model)
    if recordings:
        design = Design.of(model, recordings)
        regression = Regression(design.residuals, design.base)
        # What the model does not explain counts as noise as long as nothing else is known.
        fit = regression.fit(())
        information = Information(model, model, series, terms, regression.noise(fit))
        known = information.of_recordings(design, regression, fit)
    else:
        largest = np.abs(model.drive_forces(series.motion(coarse_time(series))).total).max(axis=0)
        information = Information(model, model, series, terms, {
            d: NoiseSpectrum(np.zeros(0), np.array([level ** 2]), BLOCK_DURATION)
            for d, level in enumerate(np.maximum(NOISE_SHARE * largest, 1e-9))})
        known = information.prior()
    return Question(COMMISSION, information, known, _numbers(information))


def _common_terms(model: DriveModel) -> list[FittedTerm]:
    """Return the common effects that a model lacks, of the size at which they matter."""
    present = {effect.name for effect in model.effects}
    terms: list[FittedTerm] = []
    for name in COMMON:
        if name in present or not model.offers(catalogue()[name]):
            continue
        effect = model.bound(catalogue()[name])
        scale = {c.name: c.scale for c in effect.coefficients}
        if issubclass(effect, DriveEffect):
            trials = effect.trials(TYPICAL)
            terms += [FittedTerm(
                Component.of(effect, drive, trials[len(trials) // 3], tuple(scale)),
                np.array([*scale.values()] or [1.0])) for drive in range(len(model.drives))]
            continue
        # In the structure once for each place, with all coefficients that it has there.
        most: dict[object, tuple[str, ...]] = {}
        for names in effect.variants:
            place = effect.places_of(names)
            most[place] = max(most.get(place, ()), names, key=len)
        terms += [FittedTerm(Component.of(effect, None, {}, names),
                             np.array([scale[key] for key in names])) for names in most.values()]
    return terms


def _numbers(information: Information) -> tuple[Contest, ...]:
    """Return a contest for each number of the model, and of each term, which is fitted alone.

    Columns of the model's numbers are per standard deviation of what is known beforehand.
    """
    base, model = range(len(information.base)), information.model
    asked: list[tuple[int, tuple[str, str, float, float], tuple[int, ...]]] = [
        (k, (column.number.label, column.number.unit, column.number.deviation, 1.0), ())
        for k, column in enumerate(information.base) if isinstance(column, ModelNumber)]
    for term in information.terms:
        places = information.places([term])
        asked += [(place, label, places)
                  for place, label in zip(places, term.labels(model), strict=True)]
    found = []
    for place, (label, unit, scale, coefficient), fitted in asked:
        missing = np.zeros(information.size)
        missing[place] = coefficient
        found.append(Contest(missing, tuple(k for k in (*base, *fitted) if k != place), (label,),
                             unit=unit, scale=scale))
    return tuple(found)


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
    kind : {'separate', 'commission'}
        What the motion is for.
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
                 'separated_by_load', 'question', 'text', 'contests', 'accuracy', 'limits',
                 'duration', 'determined', 'total')
    json_attributes = (('question', 'kind'), ('accuracy', 'accuracies'))
    json_optional = ('determined', 'total')

    kind: str
    contests: tuple[ExpectedEvidence, ...]
    accuracies: tuple[Accuracy, ...]
    limits: dict[str, float]
    duration: float
    motion: Callable[[Array], PlatformMotion | JointMotion]
    model: DriveModel = field(repr=False)

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
    motions = Motions(model, duration)
    question = (commissioning(model, recordings, motions) if purpose == COMMISSION else
                question_of(model, recordings, motions, lambda share: report(0.2 * share)))
    motions = replace(motions, effort_reserve=RESERVE * question.information.noise_floor)
    return design_experiment(question, motions, seed, lambda share: report(0.2 + 0.8 * share))


def design_experiment(question: Question, motions: Motions, seed: int,
                      progress: Callable[[float], None] = lambda share: None) -> Experiment:
    """Return the motion that answers a question best."""
    best = design(motions, motions.drawn(seed), question.worth, seed, progress)
    after = question.after(best)
    return Experiment(
        question.kind, _expected(question, after), _accuracies(question, after),
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
