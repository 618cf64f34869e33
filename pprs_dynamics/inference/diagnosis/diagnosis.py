# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer of a diagnosis: which physical effect a model lacks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.inference.diagnosis.quantities import plain
from pprs_dynamics.inference.diagnosis.statements import Statement
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.readings.findings import Mistake
from pprs_dynamics.inference.regression.base_columns import units_of
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.residuals.noise import NoiseSpectrum
from pprs_dynamics.inference.residuals.residuals import Residuals
from pprs_dynamics.inference.search.candidates import (
    SINCE,
    CandidateSet,
    Component,
    CostTerms,
    Course,
    EffectCandidate,
)
from pprs_dynamics.inference.search.components import placed
from pprs_dynamics.inference.search.estimates import Estimate, FittedNumber
from pprs_dynamics.inference.search.explained_effort import explained_shares
from pprs_dynamics.inference.search.fitted_sets import FittedSets
from pprs_dynamics.inference.search.held_out import PredictiveGain
from pprs_dynamics.inference.search.table import ModelTable
from pprs_dynamics.measurement.motion.stick_slip import StickSlip
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.json_records import JsonRecord

Drives = tuple[str, ...] | None


@dataclass(frozen=True)
class RankedSet(JsonRecord):
    """A set of effects with its cost.

    Parameters
    ----------
    effects : tuple of NamedEffect
        Effects, and `unknown, VARIABLE` for patterns of no catalogue.
    terms : CostTerms
        Terms of the cost, less those of the set that it is compared with.
    """

    json_keys = ('cost', 'terms', 'effects')

    effects: tuple[NamedEffect, ...]
    terms: CostTerms

    @property
    def cost(self) -> float:
        """Cost above that of the set that it is compared with; lower is better."""
        return self.terms.total


@dataclass(frozen=True)
class NamedEffect:
    """An effect of a set, and the drives that it is on; null: not on drives."""

    name: str
    drives: Drives


@dataclass(frozen=True)
class EffectAlone(NamedEffect):
    """An effect alone, or in addition to the reported set.

    Parameters
    ----------
    evidence : float
        Fall of the cost with it; 0 is the threshold.
    error_after : float
        Error with it [N]; null in `suspects`.
    """

    evidence: float
    error_after: float


@dataclass(frozen=True)
class FoundEffect(JsonRecord):
    """An effect of a row of the table.

    Parameters
    ----------
    effect : type of CatalogueEffect
    drives : tuple of str or None
        Drives that it is on; None: not on drives.
    parameters : dict of str to Estimate
        Values by drive.parameter, or parameter.
    force : (M, D) array
        What it contributes [N].
    evidence : float
        Cost of the best set without it, less that of the best set.
    error_before, error_after : float
        RMS error over all drives without its force, all else as fitted, and with it [N].
    held_out_before, held_out_after : float
        RMS error over all drives on held-out data, fitted without it and with it [N].
    at_bound : tuple of str
        Parameters whose value is none: at the edge of what was tried.
    gain : PredictiveGain, optional
        By how much the reported effects predict held-out data better than without it; None where
        that is unknown.
    objection : str
        Why data refute it, as a clause; '' where they do not.
    without : RankedSet, optional
        The best set without it, against the best one with it.
    in_model : mapping of str to float
        Values of the input model, if it has the effect and the recordings contradict its values;
        empty for an effect that it lacks.
    course : Course or None
        When it is there, from the start of the first recording [s]; None: all the time.
    moments : mapping of str to Estimate
        First moments of added bodies, mass times centre.
    """

    json_keys = ('name', 'drives', 'alike', 'since', 'course', 'parameters', 'moments', 'in_model',
                 'without', 'held_out_certainty', 'evidence', 'error_before', 'error_after',
                 'held_out_before', 'held_out_after')
    json_attributes = (('course', 'kind_of_course'),)
    json_optional = ('moments', 'in_model')

    effect: type[CatalogueEffect]
    drives: Drives
    parameters: dict[str, Estimate]
    force: Array
    evidence: float
    error_before: float
    error_after: float
    held_out_before: float
    held_out_after: float
    at_bound: tuple[str, ...] = ()
    gain: PredictiveGain | None = None
    objection: str = ''
    without: RankedSet | None = None
    in_model: Mapping[str, float] = field(default_factory=dict)
    course: Course | None = None
    moments: Mapping[str, Estimate] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name in the catalogue."""
        return self.effect.name

    @property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Links or joints that it is on, each with those that no motion separates from it."""
        return self.effect.places_of(self.parameters)

    @property
    def held_out_certainty(self) -> float:
        """Standard errors of the held-out gain; NaN where that is unknown."""
        return float('nan') if self.gain is None else self.gain.certainty

    @property
    def when(self) -> str:
        """When it is there, as the end of a clause; '' where that is all the time."""
        if self.course is None:
            return ''
        if self.course.kind == SINCE:
            return f' since {plain(self.course.begin, 2)} s'
        return f', growing from zero at the start to this value at {plain(self.course.end, 2)} s'

    @property
    def alike(self) -> tuple[tuple[str, ...], ...]:
        """Links or joints that no motion separates from the named one."""
        return tuple(names for names in self.places if len(names) > 1)

    @property
    def since(self) -> float | None:
        """When it began, from the start of the first recording [s]; null: always."""
        return self.course.begin if self.course and self.course.kind == SINCE else None

    @property
    def kind_of_course(self) -> str | None:
        """`since`, `during` or `drift`; null: it is there all the time."""
        return self.course.kind if self.course else None


@dataclass(frozen=True)
class RivalEffect:
    """An effect that would explain the recordings about as well as a reported one.

    Parameters
    ----------
    found : FoundEffect
        In the row of the rival.
    of : str
        The reported effect.
    cost : float
        Of its row, above that of the reported row.
    remaining : (M, D) array
        Residual of its row [N].
    """

    found: FoundEffect
    of: str
    cost: float
    remaining: Array


@dataclass(frozen=True)
class SinceReference(JsonRecord):
    """Coverage and explained error of the reference runs of a diagnosis.

    Parameters
    ----------
    recordings : tuple of str
        The reference runs.
    covered : float
        Share of the samples in states that the reference runs contain.
    explained : mapping of str to float
        Share of each drive's squared error under the input model that they show as well.
    pace : float
        Speed of the drives over that in the reference runs, median over drives.
    """

    recordings: tuple[str, ...]
    covered: float
    explained: Mapping[str, float]
    pace: float

    @classmethod
    def of(cls, reference: Reference, design: Design) -> SinceReference:
        """Return what a reference covers and explains of the recordings of a design."""
        assert design.carried is not None
        error = design.residuals.error
        before, after = (np.nansum(forces ** 2, axis=0) for forces in (
            error + design.carried.shown(design.residuals), error))
        explained = {drive: max(0.0, 1 - float(after[d] / before[d]))
                     for d, drive in enumerate(design.drives) if before[d] > 0}
        here, there = (np.sqrt(np.nanmean(residuals.variables['velocity'] ** 2, axis=0))
                       for residuals in (design.residuals, reference.regression.residuals))
        moved = there > 0
        pace = float(np.median(here[moved] / there[moved])) if moved.any() else 1.0
        return cls(reference.names, design.carried.covered, explained, pace)


@dataclass(frozen=True)
class Diagnosis(JsonRecord):
    """Answer of a diagnosis.

    Parameters
    ----------
    verdict : {'unknown', 'ambiguous', 'effect', 'adequate'}
    effects : tuple of FoundEffect
        The reported effects, largest error reduction first.
    indistinguishable : tuple of tuple of str
        Each a reported effect and its rivals; NAME:PLACE for another link or joint.
    unconfirmed : tuple of FoundEffect
        Effects of the set of least cost that the data refute: the error does not fall with them,
        or held-out data are predicted worse.
    candidates : tuple of EffectAlone
        Each effect alone, against none.
    suspects : tuple of EffectAlone
        Effects that are nearly worth their prior penalty in addition to the reported set.
    depends_on : tuple of Statement
        Patterns of the error that no effect explains.
    sets : tuple of RankedSet
        The best sets of the search; the first is reported.
    calibrated : tuple of FittedNumber
        Numbers of the model that moved within their tolerances.
    warnings, notes : tuple of str
        Sentences that qualify the answer.
    model : DriveModel
        As given.
    adopted : DriveModel
        With the effects.
    residuals : Residuals
        Of the model as given.
    remaining : (M, D) array
        Measured minus `adopted` [N].
    noise : mapping of str to NoiseSpectrum
        By drive.
    noise_floors : mapping of str to float
        Root of the mean square of the noise of each drive [N].
    above_noise : mapping of str to float
        Residual of a drive over its noise, where the reported effects do not explain it.
    little : mapping of str to float
        Drives of whose effort the reported effects explain little, with the shares.
    unseen_noise : tuple of str
        Drives whose noise the recordings do not determine: their floor is an upper bound, the
        residual of the best set.
    held_out_on : {'blocks', 'validation'}
        Held-out data: blocks of the recordings, or those of --validate.
    effort_looks_like : mapping of str to Mistake
        Drives whose efforts are no measurement: then nothing is claimed.
    stick_slip : mapping of str to StickSlip
        Drives that stick and slip for much of the time: then no effect is reported.
    other_reading : str
        Units, signs or order that recordings look to have, but were not read with; '' for none.
    since : SinceReference, optional
        The reference runs since which changes are reported; None without --reference.
    selection : ModelTable, optional
        All rows that were fitted.
    """

    json_keys = (
        'verdict', 'effects', 'indistinguishable', 'unconfirmed', 'sets', 'depends_on',
        'calibrated', 'detectable', 'held_out_on', 'above_noise', 'noise_floor', 'noise_floors',
        'warnings', 'refit', 'candidates', 'suspects', 'stick_slip', 'effort_looks_like',
        'explained', 'little_explained', 'reference')
    json_attributes = (('effort_looks_like', 'kinds_of_effort'), ('little_explained', 'little'),
                       ('reference', 'since'))

    verdict: str
    effects: tuple[FoundEffect, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    unconfirmed: tuple[FoundEffect, ...]
    candidates: tuple[EffectAlone, ...]
    suspects: tuple[EffectAlone, ...]
    depends_on: tuple[Statement, ...]
    sets: tuple[RankedSet, ...]
    calibrated: tuple[FittedNumber, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    model: DriveModel
    adopted: DriveModel
    residuals: Residuals
    remaining: Array
    noise: dict[str, NoiseSpectrum]
    noise_floors: dict[str, float]
    above_noise: Mapping[str, float] = field(default_factory=dict)
    little: Mapping[str, float] = field(default_factory=dict)
    unseen_noise: tuple[str, ...] = ()
    held_out_on: str = 'blocks'
    effort_looks_like: Mapping[str, Mistake] = field(default_factory=dict)
    stick_slip: Mapping[str, StickSlip] = field(default_factory=dict)
    other_reading: str = ''
    since: SinceReference | None = None
    selection: ModelTable | None = field(default=None, repr=False, compare=False)

    @cached_property
    def detectable(self) -> tuple[DetectableSize, ...]:
        """Sizes from which other effects would have been reported; none for an open answer."""
        if (self.selection is None or self.verdict not in ('adequate', 'effect')
                or any(effect.course for effect in self.effects)):
            return ()
        return detectable_sizes(self.selection.last, self.selection.reported)

    @property
    def after(self) -> Residuals:
        """Residuals of the model with the effects."""
        found = self.residuals.measured - self.remaining
        # Where nothing was measured the model is any number.
        return replace(self.residuals, model=np.where(
            np.isfinite(found), found, self.residuals.model))

    @cached_property
    def noise_floor(self) -> float:
        """Root of the mean square of `noise_floors` [N]."""
        return root_mean_square(list(self.noise_floors.values()))

    @property
    def refit(self) -> dict[str, float]:
        """`error_before` and `error_after` a refit of the model's numbers, without the effects."""
        without = sum((effect.force for effect in self.effects), self.remaining)
        return {'error_before': root_mean_square(self.residuals.error),
                'error_after': root_mean_square(without)}

    @property
    def kinds_of_effort(self) -> dict[str, str] | None:
        """Kind of each drive's effort that is no measurement; null for none."""
        return {drive: looks.kind for drive, looks in self.effort_looks_like.items()} or None

    @property
    def explained(self) -> dict[str, float]:
        """Share of each drive's effort variance that the input model explains."""
        return explained_shares(self.residuals)


@dataclass(frozen=True)
class DetectableSize:
    """The smallest size at which an effect would have been reported, by drive or structure.

    Parameters
    ----------
    name : str
        Name of the effect.
    drive : str or None
        None: not on a drive.
    parameter : str
        Name of the one number that it has.
    size : float
        Smallest size that would have been reported.
    unit : str
    """

    name: str
    drive: str | None
    parameter: str
    size: float
    unit: str


def detectable_sizes(fits: FittedSets, fitted: CandidateSet) -> tuple[DetectableSize, ...]:
    """Return the smallest sizes at which effects of one number would have been reported.

    Each alone in addition to a set, at its noise. The deviance must fall by the prior cost of the
    effect and the margin of rivals, and its force must exceed the form errors of the others. For
    a coefficient c of information S and prior precision L the deviance falls by
    (c S)^2 / (S + L) - ln(1 + S / L).

    Parameters
    ----------
    fits : FittedSets
    fitted : CandidateSet
        Whose effects and those of the given model are left out.
    """
    known = {effect.name for effect in fits.design.given.effects} | {
        candidate.name for candidate in fitted.effects}
    found = []
    for component in _of_one_number(fits):
        if component.effect.name in known:
            continue
        block = fits.components.block(component)
        information = float(fits.regression.own_information(fitted.fit, block)[0, 0])
        prior = float(block.precision[0, 0])
        if information <= prior:  # the recordings say less of it than is expected anyway
            continue
        candidate = EffectCandidate.of([component])
        asked = (fits.components.prior_cost(candidate).total
                 + fits.decisions.rival_margin + np.log1p(information / prior))
        beside, _ = fits.form_errors.beside(fitted, candidate, set(block.rows), False)
        c = np.array([max(np.sqrt(asked * (information + prior)) / information,
                          np.sqrt(beside / information))])
        units = units_of(fits.design.given, component.drive)
        values = component.values(c)
        numbers = [p for p in component.effect.linear if values[p.name]]
        if not component.is_within(c, units) or len(numbers) != 1:
            continue  # no machine has so much of it; a body somewhere else has a place as well
        (parameter,) = numbers
        drive = None if component.drive is None else fits.design.drives[component.drive]
        found.append(DetectableSize(component.effect.name, drive, parameter.name,
                                    abs(values[parameter.name]), units.of(parameter.unit)))
    return tuple(found)


def _of_one_number(fits: FittedSets) -> Iterator[Component]:
    """Yield the effects that have a number and no shape, on each drive that they may be on."""
    components = fits.components
    yield from (component for component in (*components.structure, *components.spanning)
                if len(component.names) == 1 and not component.shape and not (
                    issubclass(component.effect, MeasurementEffect)
                    and component.effect.not_linear_in))
    for d, local in components.local.items():
        for effect in local.effects:
            if not effect.shape and len(effect.variants) == len(effect.variants[0]) == 1:
                yield placed(fits.design, effect, d, {}, effect.variants[0])
