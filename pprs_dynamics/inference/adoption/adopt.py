# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding an effect to a model: its row of the table, the held-out test, and the decision.

The values are those of the diagnosis: of the best row that has the effect. The error must fall, on
the recordings and on held-out data, drive by drive in units of the noise and by more than its
uncertainty. Of one effect alone the error over all drives, which is printed, must fall as well. Of
several effects in the values that they have together, that error may fall with the last one only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Any

import numpy as np

from pprs_dynamics.errors import ModelError
from pprs_dynamics.inference.adoption.adoption import BLOCKS, VALIDATION, Adoption
from pprs_dynamics.inference.adoption.fit_curve import (
    FittedCurve,
    with_curve,
    without_curve,
    without_effect,
)
from pprs_dynamics.inference.adoption.request import EffectRequest, EffectRequestError
from pprs_dynamics.inference.diagnosis.answer import Answer
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, FoundEffect
from pprs_dynamics.inference.diagnosis.quantities import capitalised, change, listed, plain
from pprs_dynamics.inference.diagnosis.sentences import remarks_on
from pprs_dynamics.inference.diagnosis.statements import in_words, read_in
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import Residuals, rms
from pprs_dynamics.inference.search.candidates import Candidate
from pprs_dynamics.inference.search.decisions import outside_cost
from pprs_dynamics.inference.search.estimates import calibrations, estimate_present
from pprs_dynamics.inference.search.fitted_model import linearised, model_at, parts_of
from pprs_dynamics.inference.search.held_out import (
    SURE,
    PredictiveGain,
    hold_out,
    predictive_gain,
)
from pprs_dynamics.inference.search.scan import Scan
from pprs_dynamics.inference.search.table import ModelTable, Row
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.laws.measured_curve import OF, OWN
from pprs_dynamics.physics.effects.structure_effect import StructureEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import EFFORT_UNITS
from pprs_dynamics.physics.model.ledger import original_values
from pprs_dynamics.physics.model.parameter_values import UNCERTAINTIES
from pprs_dynamics.system.json_records import JsonRecord

DIAGNOSED = 0.8  # share of the work that a diagnosis is, for the progress bar
WEAK = 'Held-out blocks of the same recordings are weak evidence; confirm with --validate'
REFUSED, AMBIGUOUS = 'refused', 'ambiguous'


def adopt(
    model: DriveModel, request: EffectRequest, recordings: Sequence[Recording],
    validate: Sequence[Recording] = (), force: bool = False,
    progress: Callable[[float], None] | None = None, diagnosis: Diagnosis | None = None,
    reference: Reference | None = None, beside: Sequence[FoundEffect] | None = None,
) -> Adoption:
    """Return a model with an effect, or why it should not have it.

    A curve of the same drive that the model has already is replaced.

    Parameters
    ----------
    model : DriveModel
    request : EffectRequest
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Held out, and decisive; without any, blocks of the recordings are.
    force : bool, optional
        Adopt it in spite of objections.
    progress : callable, optional
        Called with the share of the work that is done.
    diagnosis : Diagnosis, optional
        Of `original(model)` on the same recordings, with its table; for a curve of the model.
    reference : Reference, optional
        Since which the effect is a change. Errors are then those in addition to its errors.
    beside : sequence of FoundEffect, optional
        Effects of the diagnosis that `model` has already, where all are adopted; None: one alone.

    Raises
    ------
    EffectRequestError
        For an effect that cannot act in this robot, for a curve since a reference, and where the
        recordings cannot give the curve.
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda share: None)
    if request.variable and reference is not None:
        raise EffectRequestError(f'{request.name}: a curve contains the error of the reference, '
                                 'too; since a reference, request an effect')
    start = model if request.variable else original(model)
    if diagnosis is None or not (diagnosis.selection or request.variable):
        diagnosis = diagnose(start, recordings, (), lambda share: report(DIAGNOSED * share),
                             reference=reference)
    case = _Case(model, recordings, validate, diagnosis, reference, is_alone=beside is None)
    if request.variable:
        found = _with_curve(case, request)
    else:
        try:
            found = _with_effect(case, request, beside or ())
        except (ModelError, EffectRequestError) as error:
            force = False
            found = replace(case.adoption(request, model, (nan, nan), None, ()), objections=(
                f'its fit gives no model: {error}',))
    report(1.0)
    is_sure = not found.objections
    reason = '. '.join(capitalised(text) if number else text
                       for number, text in enumerate(found.objections)) or found.reason
    remarks = (*found.remarks, WEAK) if is_sure and not validate else found.remarks
    return replace(found, adopted=is_sure or force, reason=reason, remarks=remarks)


def original(model: DriveModel) -> DriveModel:
    """Return a model with its numbers as they were before anything was fitted to them.

    Tolerances are limits about what the file said at first. Counted from the last fit, they
    would let a number drift.
    """
    values = original_values(model.values)
    if all(values[key] == value for key, value in model.values.items()):
        return model
    return DriveModel.from_parameters(values, model.source)


@dataclass(frozen=True)
class _Case:
    """A model and the data that decide about a request."""

    model: DriveModel
    recordings: Sequence[Recording]
    validate: Sequence[Recording]
    diagnosis: Diagnosis
    reference: Reference | None
    is_alone: bool = True

    @property
    def held_out(self) -> str:
        """Name of the held-out data, for a sentence."""
        return ('the validation recordings' if self.validate
                else 'held-out blocks of the recordings')

    def residuals(self, recordings: Sequence[Recording], *models: DriveModel) -> list[Residuals]:
        """Return the residuals of models, less the error that a reference has as well."""
        found = [measure_residuals(model, recordings)[0] for model in models]
        if self.reference is None:
            return found
        shown = self.reference.shown_by(recordings)
        return [replace(residuals, measured=residuals.measured - shown) for residuals in found]

    @outside_cost('adopt refuses an effect that does not lower the error, on the recordings and '
                  'held out')
    def objections(self, gain: PredictiveGain | None, errors: tuple[float, float], where: str,
                   unit: str) -> tuple[str, ...]:
        """Return why an effect does not lower the error on some data for certain; none if it does.

        Parameters
        ----------
        gain : PredictiveGain or None
            Of the model with the effect.
        errors : (before, after)
            Over all drives [N].
        where : str
            The data, for the sentence.
        unit : str
            Of the errors.
        """
        # Newtons and newton metres have no sum: there each drive is judged by itself.
        does_fall = errors[1] < errors[0] or not self.is_alone or unit not in EFFORT_UNITS
        if gain is not None and gain.confirms and does_fall:
            return ()
        if gain is None or not does_fall:
            return (f'the error on {where} {change(errors[0], errors[1], unit)}',)
        changes = 'falls' if gain.certainty > 0 else 'rises'
        worse = f' and rises on {listed(gain.losing)}' if gain.losing else ''
        return (f'the error on {where}, weighted by the noise, {changes} by '
                f'{abs(gain.certainty):.2g} standard errors{worse}; it must fall by at least '
                f'{SURE:g} and rise on no drive',)

    def adoption(self, request: EffectRequest, after: DriveModel, held_out: tuple[float, float],
                 gain: PredictiveGain | None, objections: Sequence[str], **details: Any,
                 ) -> Adoption:
        """Return the undecided adoption of a model, with all objections.

        Parameters
        ----------
        request : EffectRequest
        after : DriveModel
        held_out : (before, after)
            Errors on blocks of the recordings [N]; on validation recordings they are computed.
        gain : PredictiveGain or None
            On held-out data.
        objections : sequence of str
        details
            Further fields of the adoption.
        """
        before, with_it = self.residuals(self.recordings, self.model, after)
        if self.validate:
            first, last = self.residuals(self.validate, self.model, after)
            held_out = rms(first), rms(last)
        against = self.objections(predictive_gain(before, with_it), (rms(before), rms(with_it)),
                                  'the recordings', before.unit)
        return Adoption(**{
            'request': request, 'drives': request.drives, 'before': self.model, 'after': after,
            'residuals_before': before, 'residuals_after': with_it, 'held_out_before': held_out[0],
            'held_out_after': held_out[1], 'held_out_on': VALIDATION if self.validate else BLOCKS,
            'noise_floors': self.diagnosis.noise_floors,
            'objections': (*objections, *(against or self.objections(
                gain, held_out, self.held_out, before.unit))),
            'reason': (f'the error on {self.held_out} '
                       + change(held_out[0], held_out[1], before.unit)),
            'reference': () if self.reference is None else self.reference.names, **details})


# An effect of the catalogue


def _with_effect(case: _Case, request: EffectRequest, beside: Sequence[FoundEffect]) -> Adoption:
    """Return the undecided adoption of an effect, in addition to others of its row.

    Raises
    ------
    ModelError, EffectRequestError
        Where the effect gives no model.
    """
    table, name = case.diagnosis.selection, request.name
    assert table is not None
    row = requested_row(table, request)
    answer = Answer(table, row, case.validate)
    candidate = next(c for c in row.effects if c.name == name)
    effect = answer.found(candidate)
    after, gone = requested_model(answer, (*beside, effect))
    rivals = tuple(dict.fromkeys(
        other for rival in table.rivals(table.first.decisions.rival_margin)
        for mine, theirs in ((rival.missing, rival.instead), (rival.instead, rival.missing))
        if name in mine for other in theirs))
    remarks = []
    if rivals:
        remarks.append(f'{listed(rivals, "or")} explains the data about as well')
    remarks += [f'{name}{" of " + place.rstrip(".") if place else ""} is removed from the model: '
                'the recordings show none of it' for place in gone]
    remarks += remarks_on(effect)
    if others := [c.name for c in row.effects if c.name != name]:
        remarks.append(f'The recordings also show {listed(others)}')
    # Without the other effects of the row, in the values that they all have together.
    known = [component for c in row.effects for effect in beside if effect.name == c.name
             for component in c.components]
    held_out = (nan, nan) if case.validate else (
        hold_out(row.fits, row.fitted, known).error,
        hold_out(row.fits, row.fitted, (*known, *candidate.components)).error)
    prefix = f'effects.{name}.'
    return case.adoption(
        request, after, held_out, effect.gain, _of_table(case, request, row, effect, bool(rivals)),
        drives=effect.drives, remarks=tuple(remarks), rivals=rivals, moments=effect.moments,
        parameters={
            key: replace(estimate, value=float(after.values[prefix + key]))
            for key, estimate in effect.parameters.items() if prefix + key in after.values},
        calibrated=tuple(number for number in calibrations(
            answer.fits, answer.fitted) if number.after != number.before))


def requested_row(table: ModelTable, request: EffectRequest) -> Row:
    """Return the row that answers a request: the best one, a rival, or the effect alone.

    Parameters
    ----------
    table : ModelTable
    request : EffectRequest
        On its drives the effect is fitted; without drives, where it lowers the cost.

    Raises
    ------
    EffectRequestError
        Where the effect has no force in these recordings.
    """
    rows = [table.best, *(rival.row for rival in table.rivals(
        table.first.decisions.rival_margin))]
    known = [(row, c) for row in rows for c in row.effects if c.name == request.name]
    fits, rest = table.first, tuple[Candidate, ...]()
    if known:
        row, found = known[0]
        if request.drives in (None, row.fits.design.named(found.drives)):
            return row if row.is_exact else Row.exact(row.fits, row.fitted)
        fits, rest = row.fits, row.fitted.without(found)
    design, names = fits.design, request.drives
    chosen = Scan(fits).offered(
        request.effect, None if names is None else [design.drives.index(name) for name in names],
        fits.evaluate(rest))
    if chosen is None:
        standing = [name for name in names or design.drives
                    if not design.moves(design.drives.index(name))]
        raise EffectRequestError(
            f'{", ".join(standing)} hardly moved in the recordings' if standing
            else f'{request.name} has no force in these recordings')
    fitted = fits.refined(fits.evaluate((*rest, chosen)))
    return Row(*linearised(fits, fitted), 0.0)


def requested_model(answer: Answer, effects: Sequence[FoundEffect],
                    ) -> tuple[DriveModel, tuple[str, ...]]:
    """Return the input model with some effects alone, and where the last of them is removed.

    Parameters
    ----------
    answer : Answer
        Of the row that has the effects.
    effects : sequence of FoundEffect

    Raises
    ------
    ModelError
        For values that no model may have.
    """
    base, placed = parts_of(answer.fits, answer.fitted)
    known = {effect.name: effect.parameters for effect in effects}
    model = model_at(answer.design, base, [part for part in placed if part.effect.name in known])
    given = answer.design.given.values.get('effects.active') or ()
    known = {**{effect.name: estimate_present(answer.fits, answer.fitted, effect)
                for effect in model.effects if effect.name in given
                and isinstance(effect, (DriveEffect, StructureEffect))}, **known}
    values = dict(model.values)
    for name, parameters in known.items():
        values.update({
            f'{UNCERTAINTIES}.{name}.{key}': float(f'{number.std:.3g}')
            for key, number in parameters.items()
            if np.isfinite(number.std) and number.std > 0 and f'effects.{name}.{key}' in values})
    for effect in effects:
        gone = _gone(answer, effect)
        values = without_effect(values, effect.name, gone)
    return replace(DriveModel.from_parameters(values), source=model.source), gone


@outside_cost('adopt removes an effect of the model of which the recordings show none')
def _gone(answer: Answer, found: FoundEffect) -> tuple[str, ...]:
    """Return where the input model has the effect and the error is no larger without it.

    As the beginnings of keys: `drive.`, `link.`, or '' for all of it. Not by the deviations of
    single parameters: of breakaway force and Stribeck velocity only both together may be known.
    """
    effect, design = found.effect, answer.design
    candidate = next(c for c in answer.fitted.effects if c.name == effect.name)
    with_it = replace(answer.given, measured=answer.remaining,
                      model=np.zeros_like(answer.remaining))
    places = []
    for component in candidate.components:
        if design.present(effect, component.drive) is None:
            continue
        inner = {name.rpartition('.')[0] for name in component.names if effect.is_of_one_place}
        place = (f'{design.drives[component.drive]}.' if component.drive is not None
                 else ''.join(f'{link}.' for link in inner))
        less = DriveModel.from_parameters(
            without_effect(answer.adopted.values, effect.name, [place]))
        less_force = design.exact_forces(answer.adopted) - design.exact_forces(less)
        without = replace(with_it, measured=answer.remaining + less_force)
        if not predictive_gain(without, with_it).confirms:
            places.append(place)
    return tuple(places)


def _of_table(case: _Case, request: EffectRequest, row: Row, effect: FoundEffect,
              is_rival: bool) -> tuple[str, ...]:
    """Return why the table does not report the requested effect; nothing where it does."""
    table, name = case.diagnosis.selection, request.name
    assert table is not None
    if effect.course is not None:
        return (f'it is there{effect.when} only, and a model has it all the time: record the '
                'machine in its present state',)
    if any(component.effect is effect.effect for component in row.fits.refused(row.fitted)):
        return (f'the values of {name} that fit best are impossible: beyond its bounds, or more '
                'is taken away than the model has',)
    best = next((c for c in table.best.effects if c.name == name), None)
    known = table.first.design.named(best.drives) if best else None
    if known and (missed := [drive for drive in effect.drives or () if drive not in known]):
        return (f'the recordings show {name} on {listed(known)}, not on {listed(missed)}',)
    if best or is_rival:
        return ()
    more = f'the set with {name} costs {plain(row.cost - table.best.cost, 2)} more'
    for first in case.diagnosis.effects:
        on = f' on {listed(first.drives)}' if first.drives else ''
        return (f'{first.name}{on} explains these recordings better ({more})',)
    other = 'other values of ' * any(there.name == name for there in case.model.effects)
    return (f'the recordings do not support {other}{name}: {more} than the model as it is',)


# A measured curve


def _with_curve(case: _Case, request: EffectRequest) -> Adoption:
    """Return the undecided adoption of a measured curve."""
    model, drive = case.model, request.drive
    bare = without_curve(model, drive)
    start, _ = measure_residuals(bare, case.recordings)
    fitted = FittedCurve(start, request)
    after = with_curve(bare, drive, fitted)
    if case.validate:
        given, found = (measure_residuals(tried, case.validate)[0] for tried in (bare, after))
    else:
        held_out = np.zeros_like(start.model)
        held_out[:, model.drives.index(drive)] = fitted.held_out
        given, found = start, replace(start, model=start.model + held_out)
    count = len(model.drives)
    # Chosen among the curves of every drive over every variable.
    evidence = fitted.evidence - 2 * float(np.log(count * (len(OWN) + len(OF) * (count - 1))))
    against = () if evidence > 0 else (
        f'the recordings support no curve over {request.variable} on {drive}: evidence '
        f'{evidence:.3g} (threshold 0)',)
    factor, unit = read_in(request.variable, start.units_of(drive))
    low, high = (plain(factor * end) for end in (fitted.curve.start, fitted.curve.end))
    remarks = ['A measured curve is a correction table, not a cause. It has '
               f'{fitted.freedom:.0f} degrees of freedom over {in_words(request.variable)} from '
               f'{low} to {high} {unit}, and is constant beyond']
    if case.diagnosis.effects:
        others = listed([effect.name for effect in case.diagnosis.effects])
        remarks.append(f'The recordings also show {others}: adopt causes first. A curve in '
                       'their place is valid for this motion only')
    return case.adoption(
        request, after, (rms(given), rms(found)),
        predictive_gain(given, found), against,
        parameters=fitted.parameters(drive, start.units_of(drive).effort), curve=fitted,
        remarks=tuple(remarks))


# All reported effects


@dataclass(frozen=True)
class AdoptionRun(JsonRecord):
    """Result of adopting all reported effects: the steps, and why the run ended.

    Parameters
    ----------
    steps : tuple of Adoption
        Answers, effect by effect; refused ones come last.
    ended : {'adequate', 'ambiguous', 'unknown', 'refused'}
        Why the run ended.
    reason : str
        The same in one sentence.
    model : DriveModel
        With all that was adopted.
    """

    json_keys = ('ended', 'reason', 'steps')

    steps: tuple[Adoption, ...]
    ended: str
    reason: str
    model: DriveModel

    @property
    def adopted(self) -> tuple[Adoption, ...]:
        """The steps that were taken."""
        return tuple(step for step in self.steps if step.adopted)


def adopt_all(
    model: DriveModel, recordings: Sequence[Recording], validate: Sequence[Recording] = (),
    record: Callable[[Adoption], DriveModel] = lambda adoption: adoption.after,
    progress: Callable[[str, float], None] | None = None, diagnosis: Diagnosis | None = None,
    reference: Reference | None = None,
) -> AdoptionRun:
    """Adopt the effects that one diagnosis reports, in the values that they have together.

    What is refused is tried again after another effect was adopted. Of effects that explain the
    recordings alike, the best is adopted as the last: it lowers the error, and which of them it is
    another recording must show.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted: an effect with which the error on them does not fall is refused.
    record : callable, optional
        Returns the model of an adoption with its entry in the ledger.
    progress : callable, optional
        Called with what is being done and the share of it that is done.
    diagnosis : Diagnosis, optional
        Of the model as given, with its table, where it is known already.
    reference : Reference, optional
        As in `adopt`.

    Raises
    ------
    PprsError
        As `measure_residuals`.
    """
    report = progress or (lambda what, share: None)
    given = original(model)
    if diagnosis is None or diagnosis.selection is None or given is not model:
        diagnosis = diagnose(given, recordings, (), lambda share: report('diagnosing', share),
                             reference=reference)
    rivals = {names[0] for names in diagnosis.indistinguishable}
    open_effects = sorted(diagnosis.effects, key=lambda effect: effect.name in rivals)
    steps: list[Adoption] = []
    refused: list[Adoption] = []
    adopted: list[FoundEffect] = []
    while len(refused) < len(open_effects):
        # First what was not refused beside the effects that are adopted already.
        effect = open_effects[len(refused)]
        report(f'adopting {effect.name}', len(adopted) / len(diagnosis.effects))
        step = adopt(model, EffectRequest(effect.effect, effect.drives), recordings, validate,
                     diagnosis=diagnosis, reference=reference, beside=adopted)
        if step.adopted:
            model = record(step)
            steps.append(step)
            adopted.append(effect)
            open_effects.remove(effect)
            refused = []
        else:
            refused.append(step)
    steps += refused
    return AdoptionRun(tuple(steps), *_end(diagnosis, steps), model)


def _end(diagnosis: Diagnosis, steps: Sequence[Adoption]) -> tuple[str, str]:
    """Return how a run ends, and why."""
    if refused := [f'{step.effect}: {step.reason}' for step in steps if not step.adopted]:
        return REFUSED, '; '.join(refused)
    if steps and steps[-1].rivals:
        return AMBIGUOUS, (f'{listed(steps[-1].rivals, "or")} explains these recordings as well as '
                           f'{steps[-1].effect}. Another motion separates them')
    if diagnosis.verdict == 'unknown':
        return 'unknown', 'no effect of the catalogue explains what remains'
    return 'adequate', 'the remaining error does not differ from noise'
