# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The question of an experiment: rival rows of the table, or numbers that are poorly known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.experiments.information import (
    Contest,
    FittedTerm,
    Information,
    Precision,
    separation,
)
from pprs_dynamics.inference.experiments.motion_design import Motions, coarse_time
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.sensitivities import model_numbers
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.candidates import CandidateSet, EffectCandidate
from pprs_dynamics.inference.search.decisions import DECISIONS
from pprs_dynamics.inference.search.table import ModelTable, Rival, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import BLOCK_DURATION
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.mechanism.joint_motion import JointSeries
from pprs_dynamics.physics.model.drive_model import DriveModel

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


@dataclass(frozen=True)
class Question:
    """What a motion is designed to decide.

    Parameters
    ----------
    kind : {'separate', 'estimate', 'commission'}
    information : Information
        Of any motion.
    known : (P, P) array
        Information of recordings and tolerances.
    contests : tuple of Contest
        For 'separate'.
    subjects : tuple of tuple of FittedTerm
        Effects in question.
    noise_floor : float
        Largest root of the mean squared noise of a drive [N].
    """

    kind: str
    information: Information
    known: Array
    contests: tuple[Contest, ...]
    subjects: tuple[tuple[FittedTerm, ...], ...]
    noise_floor: float

    @property
    def precision(self) -> Precision:
        """How well the effects in question are known, of a new robot with its model's numbers."""
        terms = [term for subject in self.subjects for term in subject]
        numbers = self.information.numbers if self.kind == COMMISSION else ()
        return precision_of(self.information, terms, numbers)

    def gram(self, motions: Motions, series: JointSeries) -> Array:
        """Return the information of a motion, (P, P)."""
        time = coarse_time(series)
        moved = replace(motions, model=self.information.model).forces(series, time)
        return self.information.of_motion(self.information.on_motion(moved, time), series.duration)

    def worth(self, gram: Array) -> float:
        """Return the value of a motion in addition to what is known."""
        total = self.known + gram
        return (separation(self.contests, total) if self.contests
                else self.precision.value(total))

    def without_hopeless(self, grams: Sequence[Array]) -> Question:
        """Return the question without the contests that none of some motions would decide."""
        hopeful = tuple(contest for contest in self.contests if contest.now + max(
            contest.misfit(self.known + gram) for gram in grams) - contest.misfit(self.known)
            > DECISIONS.rival_margin)
        return replace(self, contests=hopeful) if hopeful else self


def precision_of(information: Information, terms: Sequence[FittedTerm],
                 numbers: tuple[int, ...] = ()) -> Precision:
    """Return how well the coefficients of terms and numbers of the model are known."""
    return Precision((*numbers, *information.places(terms)),
                     tuple(k for k in range(len(information.base)) if k not in numbers),
                     np.concatenate([np.ones(len(numbers)), *(term.scales for term in terms)]))


def question_of(model: DriveModel, recordings: Sequence[Recording], motions: Motions,
                progress: Callable[[float], None]) -> Question:
    """Return what recordings leave open; errors as `diagnose`."""
    table = tabulate(model, recordings, DECISIONS, progress)
    rivals = table.rivals(DECISIONS.rival_margin)
    if rivals:
        return _separation(table, rivals, motions)
    adopted, fits = table.reported, table.last
    if not adopted.effects:
        return commissioning(model, recordings, motions)
    return _question(ESTIMATE, fits.design, fits.regression, adopted.fit, motions,
                     [_terms(adopted, (candidate,)) for candidate in adopted.effects])


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
    question = _question(SEPARATE, fits.design, fits.regression, placed[0].fit, motions, terms[:1],
                         every)
    information, contests = question.information, []
    for (refitted, true), more in joined.items():
        free = information.places((*terms[refitted], *more))
        certain = information.force(terms[refitted])
        certain[list(free)] = 0.0
        rival = chosen[max(refitted, true) - 1]
        sides = ((rival.missing, rival.instead) if true == 0
                 else (rival.instead, rival.missing))
        contests.append(Contest(
            *sides, information.force(terms[true]) - certain,
            (*range(len(information.base)), *free), rows[refitted].cost - rows[true].cost))
    return replace(question, contests=tuple(contests))


def _terms(fitted: CandidateSet, candidates: Sequence[EffectCandidate]) -> tuple[FittedTerm, ...]:
    """Return effects of a set with their values."""
    return tuple(FittedTerm(c.effect, component.drive, component.parameters, component.names,
                            fitted.coefficients(component), component.centre)
                 for c in candidates for component in c.components)


def _on_drives_of(fitted: CandidateSet, truth: CandidateSet) -> tuple[FittedTerm, ...]:
    """Return the effects of a set on further drives, where those of another set sit.

    A set that is refitted to what another one predicts may also be on the drives of that one.
    """
    theirs = {d for c in truth.effects for d in c.drives or ()}
    known = {candidate.name for candidate in truth.effects}
    return tuple(
        FittedTerm(c.effect, d, first.parameters, first.names, np.zeros(max(len(first.names), 1)))
        for c in fitted.effects if c.drives is not None and c.name not in known
        for first in c.components[:1] if len(fitted.blocks[first].rows) == 1
        for d in sorted(theirs - set(c.drives)))


def commissioning(model: DriveModel, recordings: Sequence[Recording], motions: Motions,
                  noise: float | None = None) -> Question:
    """Return the question of a robot that nothing, or little, is known of.

    It is of the model's own numbers, and of the effects that are common.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        What is there already; may be none.
    motions : Motions
    noise : float, optional
        Standard deviation of means of the effort over 0.01 s [N, N m], where nothing is recorded;
        by default a share of each drive's largest effort.
    """
    if not (model.moves_joints or model_numbers(model)):
        model = DriveModel.from_parameters({**model.values, **{
            f'tolerances.{key}': TOLERANCE for key in NUMBERS if np.any(model.values[key])}})
    subjects = [(term,) for term in _common_terms(model)]
    if recordings:
        design = Design.of(model, recordings)
        regression = Regression(design.residuals, design.base)
        # What the model does not explain counts as noise as long as nothing else is known.
        return _question(COMMISSION, design, regression, regression.fit(()), motions, subjects)
    series = motions.drawn(0, 1)[0]
    largest = np.abs(motions.forces(series, coarse_time(series)).total).max(axis=0)
    levels = np.maximum(NOISE_SHARE * largest, 1e-9) if noise is None else np.full(
        len(largest), noise)
    information = _information(model, model, motions, subjects, {
        d: NoiseSpectrum(np.zeros(0), np.array([level ** 2]), BLOCK_DURATION)
        for d, level in enumerate(levels)})
    return Question(COMMISSION, information, information.prior(), (), tuple(subjects),
                    float(levels.max()))


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
            terms += [FittedTerm(effect, drive, trials[len(trials) // 3], tuple(scale),
                                 np.array([*scale.values()] or [1.0]))
                      for drive in range(len(model.drives))]
            continue
        # In the structure once for each place, with all coefficients that it has there.
        most: dict[object, tuple[str, ...]] = {}
        for names in effect.variants:
            place = effect.places_of(names)
            most[place] = max(most.get(place, ()), names, key=len)
        terms += [FittedTerm(effect, None, {}, names, np.array([scale[key] for key in names]))
                  for names in most.values()]
    return terms


def _question(kind: str, design: Design, regression: Regression, fit: JointFit, motions: Motions,
              subjects: Sequence[Sequence[FittedTerm]],
              every: Sequence[Sequence[FittedTerm]] = ()) -> Question:
    """Return a question after recordings, under the noise of a fit; `every`: all columns."""
    information = _information(design.given, design.model, motions, every or subjects,
                               regression.noise(fit))
    floor = max(regression.noise_floor(fit, d) for d in regression.drives)
    return Question(kind, information, information.of_recordings(design, regression, fit),
                    (), tuple(map(tuple, subjects)), floor)


def _information(given: DriveModel, model: DriveModel, motions: Motions,
                 subjects: Sequence[Sequence[FittedTerm]], noise: Mapping[int, NoiseSpectrum],
                 ) -> Information:
    series = motions.drawn(0, 1)[0]
    time = coarse_time(series)
    return Information.of(given, model, replace(motions, model=model).forces(series, time), time,
                          [term for terms in subjects for term in terms], noise)
