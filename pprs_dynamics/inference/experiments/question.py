# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The question of an experiment: rival explanations, or numbers that are poorly known."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import log
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.inference.experiments.columns import ColumnPlan, FittedTerm, reversal_shapes
from pprs_dynamics.inference.experiments.criteria import (
    Contest,
    Explanation,
    Information,
    Precision,
    Separation,
    free_of,
)
from pprs_dynamics.inference.experiments.motion_design import Motion, coarse_time
from pprs_dynamics.inference.regression.base_columns import (
    BaseColumn,
    ModelNumber,
    ReversalShape,
    present_columns,
)
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import Regression
from pprs_dynamics.inference.regression.sensitivities import PASSIVE_WIDTHS, model_numbers
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.search.candidates import (
    CandidateSet,
    EffectCandidate,
    PriorCosts,
    names_of,
)
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.table import ModelTable, Rival, Row, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.treatment import BLOCK_DURATION
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.uncertainties import effect_uncertainties

# Effects that most machines have, or that are most often entered wrongly.
ON_DRIVES = ('viscous_friction', 'coulomb_friction', 'stribeck_friction', 'effort_offset',
             'drive_spring', 'drive_inertia')
IN_STRUCTURE = ('payload_mass', 'payload_offset', 'platform_inertia', 'external_wrench',
                'base_tilt', 'tool_drag', 'link_mass', 'joint_friction')
# How well the numbers of a new robot are known where its file does not say.
TOLERANCE = 0.1
NUMBERS = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods',
           'friction.drives.viscous', 'friction.drives.coulomb', 'friction.revolute.viscous',
           'friction.revolute.coulomb', 'friction.spherical.viscous',
           'friction.spherical.coulomb')
TYPICAL = DriveRange(20.0, BLOCK_DURATION, 0.2, 0.2)  # for shapes of effects
Part = tuple[FittedTerm, Array]
"""A term, and the coefficients that it has in one explanation."""


@dataclass(frozen=True)
class Question:
    """What a motion is designed to decide.

    Parameters
    ----------
    kind : {'separate', 'estimate', 'excite', 'commission'}
    plan : ColumnPlan
    noise : mapping of drive to NoiseSpectrum
    known : (P, P) array
        Information of recordings and tolerances.
    criterion : Separation or Precision
        Objective of a design, to be maximised, of the information of recordings, motion and prior
        together, (P, P).
    contests : tuple of Contest
        For 'separate'.
    subjects : tuple of Explanation
        Effects in question.
    noise_floor : float
        Largest root of the mean squared noise of a drive [N].
    decisions : Decisions
    """

    kind: str
    plan: ColumnPlan
    noise: Mapping[int, NoiseSpectrum]
    known: Array
    criterion: Separation | Precision
    contests: tuple[Contest, ...]
    subjects: tuple[Explanation, ...]
    noise_floor: float
    decisions: Decisions = DECISIONS

    @property
    def model(self) -> Any:
        """Around which all is linear."""
        return self.plan.model

    def gram(self, motion: Motion) -> Array:
        """Return the information of a motion, (P, P)."""
        time = coarse_time(motion)
        columns = self.plan.on_motion(self.model.drive_forces(motion.motion(time)), time)
        return Information(self.plan, self.noise).of_motion(columns, motion.duration)

    def worth(self, gram: Array) -> float:
        """Return the value of a motion in addition to what is known."""
        return self.criterion.value(self.known + gram)

    def with_contests(self, contests: Sequence[Contest]) -> Question:
        """Return the question of some of its contests only."""
        return replace(self, contests=tuple(contests), criterion=Separation(tuple(contests)))


def question_of(model: DriveModel, recordings: Sequence[Recording],
                progress: Callable[[float], None], decisions: Decisions = DECISIONS) -> Question:
    """Return what recordings leave open; errors as `diagnose`."""
    table = tabulate(model, recordings, decisions, progress)
    return question_after(table, table.rivals(decisions.rival_margin))


def question_after(table: ModelTable, rivals: Sequence[Rival]) -> Question:
    """Return what a table does not decide.

    Parameters
    ----------
    table : ModelTable
    rivals : sequence of Rival
        The best first.
    """
    adopted = table.reported
    if rivals:
        return _separation(table, rivals)
    search = table.last
    if adopted.effects:
        return _estimation(search, adopted)
    return _excitation(search, adopted)


def _separation(table: ModelTable, rivals: Sequence[Rival]) -> Question:
    """Return how to separate the reported row from its rivals.

    A contest is a pair of rows. Each of the two is refitted to the data that the other predicts.
    """
    sets = _separate_rows(table, rivals)
    # The last search, or the first where one of the sets is linear around its point.
    fits = (table.last if all(row.fitted.is_nonlinear for row in sets) else table.first)
    placed = [fits.evaluate(row.fitted.candidates) for row in sets]
    terms = _Terms()
    parts = [terms.of_set(fitted) for fitted in placed]
    pairs = [pair for k in range(1, len(sets)) for pair in ((k, 0), (0, k))]
    # A set that is refitted to what another one predicts may also be on that one's drives.
    joining = {pair: terms.on_drives_of(placed[pair[0]], placed[pair[1]]) for pair in pairs}
    plan = ColumnPlan.of_design(fits.design, terms.all)
    explanations = [_explanation(names, part, plan, 0.0)
                    for names, part in zip(_names_apart(placed), parts, strict=True)]
    contests = []
    for (refitted, true), joined in joining.items():
        free = explanations[refitted].free + tuple(
            place for term in joined for place in _places(plan, term)[term.free])
        contest = Contest(explanations[true], explanations[refitted],
                          (*range(len(plan.base)), *free), sets[refitted].cost - sets[true].cost)
        if all(contest.sides):
            contests.append(contest)
    subjects = [_explanation([c.name], terms.of_candidate(placed[0], c), plan, 0.0)
                for c in placed[0].effects]
    return _asked('separate', fits, placed[0], plan, Separation(tuple(contests)), contests,
                  subjects)


def _separate_rows(table: ModelTable, rivals: Sequence[Rival]) -> list[Row]:
    """Return the reported set and, of each further pair of effects, the best set with it."""
    pairs: set[tuple[str, str]] = set()
    sets = [table.best]
    for rival in rivals:
        new = set(product(rival.missing, rival.instead))
        if not new <= pairs:
            pairs |= new
            sets.append(rival.row)
    return sets


def _names_apart(sets: Sequence[CandidateSet]) -> list[list[str]]:
    """Return the names of each set's effects, those that are elsewhere than in the first placed."""
    first, *others = names = [{c.placed_name: c.name for c in fitted.effects} for fitted in sets]
    moved = {name for other in others for placed_name, name in other.items()
             if name in first.values() and placed_name not in first}
    return [[placed_name if name in moved else name for placed_name, name in of_set.items()]
            for of_set in names]


def _estimation(fits: FittedSets, adopted: CandidateSet) -> Question:
    """Return how to measure the parameters of effects that are there."""
    terms = _Terms()
    parts = [terms.of_candidate(adopted, c) for c in adopted.effects]
    plan = ColumnPlan.of_design(fits.design, terms.all)
    samples = fits.components.prior_costs.samples
    subjects = [_explanation([c.name], own, plan, fits.components.prior_cost(c).total + sum(
        len(term.names) for term, _ in own) * log(samples))
        for c, own in zip(adopted.effects, parts, strict=True)]
    return _asked('estimate', fits, adopted, plan, precision_of(plan, subjects), (), subjects)


def _excitation(fits: FittedSets, nothing: CandidateSet) -> Question:
    """Return how to show effects that the motion would not show at a size that matters."""
    regression = fits.regression
    weak = []
    for term in fits.design.structure:
        if term.effect.is_of_one_place or fits.design.present(term.effect, None) is not None:
            continue
        block = regression.block(term.rows)
        gain = np.diag(regression.own_information(nothing.fit, block))
        found = FittedTerm.at_scale(term.effect, None, {})
        here = [term.names.index(name) for name in found.names]
        if np.any(gain[here] * found.scales ** 2 < fits.decisions.unexcited):
            weak.append(found)
    plan = ColumnPlan.of_design(fits.design, weak)
    subjects = subjects_of(plan, fits.components.prior_costs)
    return _asked('excite', fits, nothing, plan, precision_of(plan, subjects), (), subjects)


def subjects_of(plan: ColumnPlan, prior_costs: PriorCosts) -> list[Explanation]:
    """Return each term of a plan as an effect that may be there."""
    subjects = []
    for term in plan.terms:
        prior_cost = (prior_costs.of_name() + prior_costs.of_component(term.effect, 1)
                      + len(term.names) * log(prior_costs.samples))
        if term.drive is not None:
            prior_cost += prior_costs.of_drives(1)
        subjects.append(_explanation([term.effect.name], [(term, term.values)], plan, prior_cost))
    return subjects


def precision_of(plan: ColumnPlan, subjects: Sequence[Explanation]) -> Precision:
    """Return how well effects are known in addition to the base, or the model's numbers."""
    if not subjects:
        return Precision(plan.numbers, plan.others, np.ones(len(plan.numbers)))
    scales = np.concatenate([term.scales for subject in subjects for term in subject.terms])
    return Precision(free_of(subjects), tuple(range(len(plan.base))), scales)


def _asked(kind: str, fits: FittedSets, fitted: CandidateSet, plan: ColumnPlan,
           criterion: Separation | Precision, contests: Sequence[Contest],
           subjects: Sequence[Explanation]) -> Question:
    """Return a question under the noise of a set."""
    regression, fit = fits.regression, fitted.fit
    noise = regression.noise(fit)
    known = Information(plan, noise).of_recordings(fits.design, regression, fit)
    floor = max(regression.noise_floor(fit, d) for d in regression.drives)
    return Question(kind, plan, noise, known, criterion, tuple(contests), tuple(subjects), floor,
                    fits.decisions)


class _Terms:
    """Terms of several sets; what they share is there once."""

    def __init__(self) -> None:
        self._found: dict[Hashable, FittedTerm] = {}

    @property
    def all(self) -> tuple[FittedTerm, ...]:
        """In the order in which they came."""
        return tuple(self._found.values())

    def of_set(self, fitted: CandidateSet) -> list[Part]:
        """Return the terms of a set."""
        return [part for c in fitted.effects for part in self.of_candidate(fitted, c)]

    def of_candidate(self, fitted: CandidateSet, candidate: EffectCandidate) -> list[Part]:
        """Return the terms of an effect of a set."""
        parts = []
        for component in candidate.components:
            values = fitted.coefficients(component)
            term = FittedTerm(candidate.effect, component.drive, component.parameters,
                              component.names, values, component.centre)
            parts.append((self._once(term), values))
        return parts

    def on_drives_of(self, fitted: CandidateSet, truth: CandidateSet) -> list[FittedTerm]:
        """Return the effects of a set on further drives, where those of another set sit."""
        theirs = {d for c in truth.effects for d in c.drives or ()}
        more = []
        for c in fitted.effects:
            first = c.components[0]
            known = {candidate.name for candidate in truth.effects}
            if c.drives is not None and c.name not in known and (
                    len(fitted.blocks[first].rows) == 1):
                values = np.zeros(len(first.names)) if first.names else np.ones(1)
                more += [self._once(FittedTerm(c.effect, d, first.parameters, first.names, values))
                         for d in sorted(theirs - set(c.drives))]
        return more

    def _once(self, term: FittedTerm) -> FittedTerm:
        key = (term.effect, term.drive, tuple(sorted(term.shape.items())), term.names,
               term.centre)
        return self._found.setdefault(key, term)


def _explanation(names: Sequence[str], parts: Sequence[Part], plan: ColumnPlan, prior_cost: float,
                 ) -> Explanation:
    places = [_places(plan, term) for term, _ in parts]
    return Explanation(
        tuple(names), tuple(term for term, _ in parts),
        tuple(k for place, (term, _) in zip(places, parts, strict=True) for k in place[term.free]),
        tuple(k for place, (_, values) in zip(places, parts, strict=True)
              for k in place[:len(values)]),
        np.concatenate([values for _, values in parts]), prior_cost)


def _places(plan: ColumnPlan, term: FittedTerm) -> range:
    place = plan.places()[term]
    return range(place.start, place.stop)


def commissioning(model: DriveModel, recordings: Sequence[Recording], noise: float,
                  decisions: Decisions = DECISIONS) -> Question:
    """Return the question of a robot that nothing, or little, is known of.

    It is of the model's own numbers, and of the effects that are common.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        What is there already; may be none.
    noise : float
        Standard deviation of means of the effort over 0.01 s [N], where nothing is recorded.
    """
    if not model_numbers(model):
        tolerances = {f'tolerances.{key}': TOLERANCE for key in NUMBERS
                      if np.any(model.values[key])}
        model = DriveModel.from_parameters({**model.values, **tolerances})
    present = {effect.name for effect in model.effects}
    terms = []
    for name, effect in catalogue().items():
        if name in present or name not in ON_DRIVES + IN_STRUCTURE:
            continue
        effect = model.bound(effect)
        if issubclass(effect, DriveEffect):
            trials = effect.trials(TYPICAL)
            terms += [FittedTerm.at_scale(effect, drive, trials[len(trials) // 3])
                      for drive in range(len(DRIVES))]
        else:
            terms += FittedTerm.at_places(effect)
    samples = round(TYPICAL.duration / BLOCK_DURATION)
    if recordings:
        design = Design.of(model, recordings)
        regression = Regression(design.residuals, design.base)
        # What the model does not explain counts as noise as long as nothing else is known.
        fit = regression.fit(())
        plan, spectra = ColumnPlan.of_design(design, terms), regression.noise(fit)
        known = Information(plan, spectra).of_recordings(design, regression, fit)
        noise = max(regression.noise_floor(fit, d) for d in regression.drives)
    else:
        white = NoiseSpectrum(np.zeros(0), np.array([noise ** 2]), BLOCK_DURATION)
        plan = ColumnPlan(model, model, base_without_recordings(model), tuple(terms))
        spectra = dict.fromkeys(range(len(DRIVES)), white)
        known = Information(plan, spectra).prior()
    subjects = subjects_of(plan, PriorCosts(names_of(model), len(DRIVES), samples, decisions))
    scales = np.concatenate([np.ones(len(plan.numbers)), *(term.scales for term in terms)])
    criterion = Precision((*plan.numbers, *free_of(subjects)), plan.others, scales)
    return Question('commission', plan, spectra, known, criterion, (), tuple(subjects), noise,
                    decisions)


def base_without_recordings(model: DriveModel) -> tuple[BaseColumn, ...]:
    """Return what is fitted on any recording of a model, as columns without rows."""
    base: list[BaseColumn] = [ModelNumber({}, 1.0, number) for number in model_numbers(model)]
    base += reversal_shapes(range(len(DRIVES)))
    base += [ReversalShape({}, 1.0, None, number) for number in range(len(PASSIVE_WIDTHS))]
    for effect in model.effects:
        if isinstance(effect, CatalogueEffect):
            base += present_columns(effect, effect_uncertainties(model.values, effect.name))
    return tuple(base)
