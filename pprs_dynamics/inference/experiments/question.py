# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The question of an experiment, and the information of a motion that nobody has made yet.

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
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy import fft
from scipy.linalg import cho_factor, cho_solve

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DriveUnits
from pprs_dynamics.inference.experiments.motion_design import Motions, coarse_time
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    PresentParameter,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.sensitivities import Sensitivities, model_numbers
from pprs_dynamics.inference.regression.terms import Rows
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.body_centres import about_centre
from pprs_dynamics.inference.search.candidates import CandidateSet, Component, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.table import ModelTable, Rival, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import BLOCK_DURATION
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.mechanism.joint_motion import JointSeries
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import Forces

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
SEPARATE, ESTIMATE, COMMISSION = 'separate', 'estimate', 'commission'
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


@dataclass(frozen=True)
class Information:
    """Gram matrices (P, P) of columns: base columns, then those of terms.

    Parameters
    ----------
    given, model : DriveModel
        As the user has it; and around which forces are linear.
    base : tuple of BaseColumn
        Every base column that a motion may excite.
    terms : tuple of FittedTerm
    noise : mapping of drive to NoiseSpectrum
        Other drives give no information.
    """

    given: DriveModel
    model: DriveModel
    base: tuple[BaseColumn, ...]
    terms: tuple[FittedTerm, ...]
    noise: Mapping[int, NoiseSpectrum]

    @classmethod
    def of(cls, given: DriveModel, model: DriveModel, forces: Forces, time: Array,
           terms: Sequence[FittedTerm], noise: Mapping[int, NoiseSpectrum]) -> Information:
        """Return the information of terms and of the base columns of any motion."""
        found = cls(given, model, (), tuple(terms), noise)
        return replace(found, base=found.on_motion(forces, time).base)

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

    def on_motion(self, forces: Forces, time: Array, block: int = 1) -> Design:
        """Return the design of a motion.

        Parameters
        ----------
        forces : Forces
            Of the model, before its sensors.
        time : (N,) array
        block : int
            Samples that are averaged.
        """
        return Design.planned(self._sensitivities, forces, time, block)

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
                white = series.transform(rows) * series.spread(
                    np.sqrt(regression.weights(fit, d)))
                gram += white @ white.T
        return gram

    def of_motion(self, design: Design, duration: float) -> Array:
        """Return the information of a motion of some duration [s], at any sampling rate."""
        white = [whitened(rows, self.noise[d], duration)
                 for d, rows in self.columns(design) if d in self.noise]
        return sum((rows @ rows.T for rows in white), np.zeros((self.size,) * 2))

    @cached_property
    def _sensitivities(self) -> Sensitivities:
        found = Sensitivities(self.model, self.given)
        found.restrict({term.component.effect for term in self.terms}
            | {column.effect for column in self.base if isinstance(column, PresentParameter)}
            | {type(effect) for effect in self.given.effects
               if isinstance(effect, CatalogueEffect)})
        return found


def _key(column: BaseColumn) -> str:
    """Return the key of a base column, the same in any design."""
    return repr(replace(column, rows={}))


def whitened(rows: Array, noise: NoiseSpectrum, duration: float) -> Array:
    """Return the DCT of rows of a motion, (p, n), per standard deviation of the noise.

    Fewer samples than the noise has count for as many, as long as they follow the motion.
    """
    count = rows.shape[-1]
    density = noise.power(np.arange(count) / (2 * duration)) * count * noise.period / duration
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


def left_open(contests: Sequence[Contest], gram: Array) -> float:
    """Return the mean of 1 / (1 + misfit) of contests."""
    return float(np.mean([1 / (1 + contest.misfit(gram)) for contest in contests]))


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
    kind : {'separate', 'estimate', 'commission'}
    information : Information
        Of any motion.
    known : (P, P) array
        Information of recordings and tolerances.
    contests : tuple of Contest
    subjects : tuple of str
        Effects in question.
    noise_floor : float
        Largest root of the mean squared noise of a drive [N].
    """

    kind: str
    information: Information
    known: Array
    contests: tuple[Contest, ...]
    subjects: tuple[str, ...]
    noise_floor: float

    def gram(self, motions: Motions, series: JointSeries) -> Array:
        """Return the information of a motion, (P, P)."""
        time = coarse_time(series)
        moved = replace(motions, model=self.information.model).forces(series, time)
        return self.information.of_motion(self.information.on_motion(moved, time), series.duration)

    def worth(self, gram: Array) -> float:
        """Return the value of a motion in addition to the recordings."""
        return -left_open(self.contests, self.known + gram)


def question_of(model: DriveModel, recordings: Sequence[Recording], motions: Motions,
                progress: Callable[[float], None]) -> Question:
    """Return the rivals and uncertain effects after recordings; errors as `diagnose`."""
    table = tabulate(model, recordings, DECISIONS, progress)
    rivals = table.rivals(DECISIONS.rival_margin)
    if rivals:
        return _separation(table, rivals, motions)
    adopted, fits = table.reported, table.last
    if not adopted.effects:
        return commissioning(model, recordings, motions)
    # Effects of one set are fitted together.
    return _question(ESTIMATE, fits.design, fits.regression, adopted.fit, motions,
                     [_terms(adopted, adopted.effects)])


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
    terms = [_terms(fitted, fitted.effects) for fitted in placed]
    joined = {(k, other): _on_drives_of(placed[k], placed[other])
              for n in range(1, len(placed)) for k, other in ((n, 0), (0, n))}
    every = [*terms, *joined.values()]
    question = _question(SEPARATE, fits.design, fits.regression, placed[0].fit, motions, every)
    information, contests = question.information, []
    for (refitted, true), more in joined.items():
        free = information.places((*terms[refitted], *more))
        certain = information.force(terms[refitted])
        certain[list(free)] = 0.0
        rival = chosen[max(refitted, true) - 1]
        sides = ((rival.missing, rival.instead) if true == 0
                 else (rival.instead, rival.missing))
        contests.append(Contest(
            information.force(terms[true]) - certain, (*range(len(information.base)), *free),
            *sides, rows[refitted].cost - rows[true].cost))
    return replace(question, contests=tuple(contests), subjects=_names(terms[:1]))


def _terms(fitted: CandidateSet, candidates: Sequence[EffectCandidate]) -> tuple[FittedTerm, ...]:
    """Return effects of a set with their values."""
    return tuple(FittedTerm(component, fitted.coefficients(component))
                 for c in candidates for component in c.components)


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


def commissioning(model: DriveModel, recordings: Sequence[Recording], motions: Motions,
                  ) -> Question:
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
    groups = [(term,) for term in _common_terms(model)]
    if recordings:
        design = Design.of(model, recordings)
        regression = Regression(design.residuals, design.base)
        # What the model does not explain counts as noise as long as nothing else is known.
        return _question(COMMISSION, design, regression, regression.fit(()), motions, groups)
    series = motions.drawn(0, 1)[0]
    largest = np.abs(motions.forces(series, coarse_time(series)).total).max(axis=0)
    levels = np.maximum(NOISE_SHARE * largest, 1e-9)
    information = _information(model, model, motions, groups, {
        d: NoiseSpectrum(np.zeros(0), np.array([level ** 2]), BLOCK_DURATION)
        for d, level in enumerate(levels)})
    return Question(COMMISSION, information, information.prior(),
                    _numbers(information, groups, True), _names(groups), float(levels.max()))


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


def _question(kind: str, design: Design, regression: Regression, fit: JointFit, motions: Motions,
              groups: Sequence[Sequence[FittedTerm]]) -> Question:
    """Return the question of the numbers of effects after recordings, under the noise of a fit."""
    information = _information(design.given, design.model, motions, groups, regression.noise(fit))
    floor = max(regression.noise_floor(fit, d) for d in regression.drives)
    return Question(kind, information, information.of_recordings(design, regression, fit),
                    _numbers(information, groups, kind == COMMISSION), _names(groups), floor)


def _names(groups: Sequence[Sequence[FittedTerm]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(term.component.effect.name for terms in groups for term in terms))


def _numbers(information: Information, groups: Sequence[Sequence[FittedTerm]], with_model: bool,
             ) -> tuple[Contest, ...]:
    """Return a contest for each number of terms, which are fitted group by group, and of the model.

    Columns of the model's numbers are per standard deviation of what is known beforehand.
    """
    base, model = range(len(information.base)), information.model
    asked: list[tuple[int, tuple[str, str, float, float], tuple[int, ...]]] = [
        (k, (column.number.label, column.number.unit, column.number.deviation, 1.0), ())
        for k, column in enumerate(information.base)
        if with_model and isinstance(column, ModelNumber)]
    for terms in groups:
        places, labels = information.places(terms), [
            label for term in terms for label in term.labels(model)]
        asked += [(place, label, places) for place, label in zip(places, labels, strict=True)]
    found = []
    for place, (label, unit, scale, coefficient), fitted in asked:
        missing = np.zeros(information.size)
        missing[place] = coefficient
        found.append(Contest(missing, tuple(k for k in (*base, *fitted) if k != place), (label,),
                             unit=unit, scale=scale))
    return tuple(found)


def _information(given: DriveModel, model: DriveModel, motions: Motions,
                 subjects: Sequence[Sequence[FittedTerm]], noise: Mapping[int, NoiseSpectrum],
                 ) -> Information:
    series = motions.drawn(0, 1)[0]
    time = coarse_time(series)
    return Information.of(given, model, replace(motions, model=model).forces(series, time), time,
                          [term for terms in subjects for term in terms], noise)
