# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding effects to a model, fitted and checked on data that they were not fitted to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.app.api.diagnose import DiagnosisResult
from pprs_dynamics.app.api.inputs import Given, Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.app.report.diagnosis_figures import (
    add_contributions,
    add_every_drive,
    before_and_after,
    curve_with_band,
)
from pprs_dynamics.app.report.history_report import history_page
from pprs_dynamics.app.report.page import ErrorRow, Page
from pprs_dynamics.app.report.pictures import plot_errors
from pprs_dynamics.app.report.terminal import escape, shell_command, stacked, verdict_panel
from pprs_dynamics.drives import common_effort
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.adoption.adopt import adopt as adopt_effect
from pprs_dynamics.inference.adoption.adopt import original
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.loop import AMBIGUOUS, REFUSED, AdoptionRun
from pprs_dynamics.inference.adoption.loop import adopt_all as adopt_effects
from pprs_dynamics.inference.adoption.request import requested
from pprs_dynamics.inference.diagnosis.quantities import (
    as_fitted,
    in_unit,
    plain,
    with_drives,
    with_uncertainty,
)
from pprs_dynamics.inference.diagnosis.sentences import sure_moments
from pprs_dynamics.inference.fit.base_fit import BaseFit, fit_base, require_open_numbers
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure


MOST_SHOWN = 6  # values without --details
MOST_REMARKS = 2


def run_view(run: AdoptionRun, command: str, details: bool = False) -> Any:
    """Return adopted and refused effects, a line or all values of each, and the reason to end.

    `command` designs the motion that separates an ambiguous effect from its rivals.
    """
    steps = [adoption_view(step) if details else escape(headline(step)) for step in run.steps]
    following = [shell_command(command)] if run.ended == AMBIGUOUS else []
    return stacked(*steps, f'[bold]{run.ended}[/]: {escape(run.reason)}{":" * len(following)}',
                   *following)


def adoption_view(answer: Adoption) -> Any:
    """Return the answer for the terminal, in at most 20 lines."""
    return stacked(*_parts(answer))


def _parts(answer: Adoption) -> Iterator[Any]:
    """Yield the answer, the fall of the error and the first values."""
    word, colour = (('refused', 'red') if not answer.adopted else
                    ('forced', 'yellow') if answer.forced else ('adopted', 'green'))
    yield verdict_panel(word, colour, headline(answer))
    held = _held_out(answer)
    for label, before, after in (('recordings', answer.error_before, answer.error_after),
                                 (held, answer.held_out_before, answer.held_out_after)):
        yield f'  error on {label}: {plain(before)} → {plain(after)} {answer.unit}'
    yield f'  noise: {in_unit(answer.noise_floor, answer.unit)}'
    rows = parameter_rows(answer)
    for key, text in rows[:MOST_SHOWN]:
        yield f'  {escape(key)} = {escape(text)}'
    if len(rows) > MOST_SHOWN:
        yield f'  … and {len(rows) - MOST_SHOWN} more, with --json or --report'
    for remark in answer.remarks[:MOST_REMARKS]:
        yield f'[yellow]![/] {escape(remark)}'


def _held_out(answer: Adoption) -> str:
    return 'held-out recordings' if answer.held_out_on == VALIDATION else 'held-out blocks'


def headline(answer: Adoption) -> str:
    """Return the answer in a sentence."""
    what = with_drives(answer.effect, answer.drives, answer.before.drives)
    said = ('is refused' if not answer.adopted else
            'is adopted by force, in spite of this' if answer.forced else 'is adopted')
    return f'{what} {said}: {answer.reason}.'


def parameter_rows(answer: Adoption) -> list[tuple[str, str]]:
    """Return each parameter that is not 0, and its value ± two standard deviations.

    With first moments of bodies that are sure where the mass is not.
    """
    effect = answer.request.effect
    scales = {parameter.name: parameter.scale for parameter in effect.parameters}
    rows = [(key, as_fitted(parameter.value, parameter.std, parameter.unit,
                            scales.get(effect.place_and_parameter(key)[1], inf)))
            for key, parameter in answer.parameters.items() if parameter.value != 0.0]
    return rows + [(key, with_uncertainty(entry.value, entry.std, entry.unit)) for key, entry in (
        (told.name, answer.moments[told.name])
        for told in sure_moments(effect, answer.parameters, answer.moments))]


def adoption_page(answer: Adoption, recordings: Sequence[Recording],
                  validation: Sequence[Recording], command: str = '') -> Page:
    """Return the page of one adoption, or refusal: an answer on one screen, the rest folded.

    Parameters
    ----------
    answer : Adoption
    recordings, validation : sequence of Recording
        Those fitted, and those held out.
    command : str, optional
        That says what is still missing.
    """
    before, after = answer.residuals_before, answer.residuals_after
    page = Page(f'{answer.effect}: ' + ('added to the model' if answer.adopted else 'refused'))
    page.text(headline(answer), 'lead')
    page.sources(answer.before.source, [recording.name for recording in recordings],
                 [recording.name for recording in validation])
    errors, fallen = rms_by_drive(before), rms_by_drive(after)
    with page.columns():
        page.errors([ErrorRow('all drives', answer.error_before, answer.error_after,
                              answer.noise_floor),
                     ErrorRow(_held_out(answer), answer.held_out_before, answer.held_out_after,
                              answer.noise_floor),
                     *(ErrorRow(name, errors[name], fallen[name], answer.noise_floors.get(name))
                       for name in errors)],
                    f'Error on the recordings, rms [{answer.unit}], before (grey) and with the '
                    'effect (blue); dotted: the noise.')
        most = max(answer.noise_floors, key=lambda name: errors[name] - fallen[name], default='')
        if most:
            page.figure(before_and_after(before, after, before.drives.index(most),
                                         answer.noise_floors[most]),
                        f'{most}, where the error falls most: effort and error.',
                        over_time=True)
    if answer.curve is not None:
        page.figure(curve_with_band(answer), 'The measured curve with two standard deviations, '
                    'and the residual of the model without it. It is a correction table, not a '
                    'cause. Beyond the measured range it is constant.')
    if command and answer.adopted:
        page.command('Look for further effects', command)
    page.bullets(answer.remarks)
    if answer.parameters:
        page.table(('parameter', '± two standard deviations'), parameter_rows(answer),
                   caption='Fitted values')
    forces = {effect.name: after.parts[effect.name] for effect in answer.after.effects
              if isinstance(effect, CatalogueEffect) and effect.name in after.parts}
    if any(np.any(force) for force in forces.values()):
        with page.fold('Contribution of each added effect'):
            add_contributions(page, after, forces, 'Contribution of each added effect.')
    add_every_drive(page, before, after, answer.noise_floors, f'before and with {answer.effect}')
    if answer.calibrated:
        with page.fold('Numbers of the model that changed within their tolerances'):
            page.table(('number', 'before', 'after'),
                       [(number.label, with_uncertainty(number.before, 0.0, number.unit),
                         with_uncertainty(number.after, number.std, number.unit))
                        for number in answer.calibrated])
    return page


class RefusedError(PprsError, ValueError):
    """A model of an adoption that was refused."""


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionResult(Result):
    """What `pprs adopt` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    adoption : Adoption
        The answer with all that it was decided from.
    """

    inputs: Inputs
    adoption: Adoption

    @property
    def adopted(self) -> bool:
        """Whether the model takes the effect."""
        return self.adoption.adopted

    @property
    def reason(self) -> str:
        """Why, in one sentence."""
        return self.adoption.reason

    @cached_property
    def model(self) -> DriveModel:
        """The model with the effect and its entry in the ledger; as given, where it is refused."""
        return self.inputs.ledger.entered(self.adoption) if self.adopted else self.inputs.model

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file, with the comments and further keys of the one that was given.

        Raises
        ------
        RefusedError
            Where the effect was not adopted.
        PprsError
            Where it cannot be written, or is the file that was given.
        """
        if not self.adopted:
            raise RefusedError(f'{self.adoption.effect} is refused: {self.reason}')
        write_model(path, self.model.values, self.inputs.base)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs adopt --json` writes."""
        return self.adoption.to_dict()

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return adoption_view(self.adoption)

    def page(self, saved_as: str = 'better.yaml') -> Page:
        """Return the page of `pprs adopt --report`; its next command names the file of `save`."""
        return adoption_page(self.adoption, self.inputs.fitted, self.inputs.held_out,
                             replace(self.inputs.files, model=saved_as).command(
                                 'diagnose', held_out=True))

    def table(self) -> DataFrame:
        """Return a row per parameter: its value, std and unit."""
        found = self.adoption.parameters
        return data_frame([{'value': entry.value, 'std': entry.std, 'unit': entry.unit}
                           for entry in found.values()], list(found), 'parameter')

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, after, and the noise."""
        return _plot(self.adoption, self.adoption)


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionRunResult(Result):
    """What `pprs diagnose --adopt-all` says.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    run : AdoptionRun
        What was adopted and refused, one after the other.
    refit : BaseFit, optional
        Of the base model with the adopted effects.
    """

    inputs: Inputs
    run: AdoptionRun
    refit: BaseFit | None = None

    @property
    def model(self) -> DriveModel:
        """The model with all that was adopted, and its ledger."""
        if self.refit is not None and self.refit.ratio < 1:
            return self.refit.model
        return self.run.model

    @property
    def refused(self) -> bool:
        """Whether it ended because the remaining effects were refused."""
        return self.run.ended == REFUSED

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file, as `AdoptionResult.save`; as it was, with nothing to adopt.

        Raises
        ------
        RefusedError
            Where nothing was adopted because it was refused.
        PprsError
            Where it cannot be written, or is the file that was given.
        """
        if self.refused and not self.run.adopted:
            raise RefusedError(self.run.reason)
        write_model(path, self.model.values, self.inputs.base)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs diagnose --adopt-all --json` writes as `adoption`."""
        refit = {} if self.refit is None else {'refit': {
            **self.refit.to_dict(), 'taken': self.refit.ratio < 1, 'reason': self.refit.change}}
        return {**self.run.to_dict(), **refit}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        return run_view(self.run, self.inputs.files.command(
            'next-experiment', '--output', 'next.csv'), details)

    def page(self) -> Page:
        """Return the page of `pprs history --report` of the model."""
        return history_page('the adopted model', read_steps(self.model.values),
                            common_effort(self.model.units))

    def table(self) -> DataFrame:
        """Return a row per step: the effect, whether it was adopted, errors [N], the reason."""
        return data_frame([
            {'effect': step.effect, 'adopted': step.adopted, 'error_before': step.error_before,
             'error_after': step.error_after, 'held_out_before': step.held_out_before,
             'held_out_after': step.held_out_after, 'reason': step.reason}
            for step in self.run.steps])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before all, after all, and the noise.

        Raises
        ------
        RefusedError
            Where nothing was adopted.
        """
        if not self.run.adopted:
            raise RefusedError(f'nothing was adopted: {self.run.reason}')
        return _plot(self.run.adopted[0], self.run.adopted[-1])


def adopt(model: Model, effect: str, recordings: Recordings, validate: Recordings = (), *,
          force: bool = False, diagnosis: DiagnosisResult | None = None,
          topic: str | None = None, progress: Progress | None = None, as_it_is: bool = False,
          reference: Given | None = None) -> AdoptionResult:
    """Add an effect to a model: fit it, check it on data it was not fitted to, take or refuse it.

    Parameters
    ----------
    model : DriveModel or path
    effect : str
        Its name, on the drives that the recordings call for; or 'EFFECT:drive,drive'; or
        'measured_curve:DRIVE@VARIABLE'.
    recordings, validate : path, Recording, or a sequence of them
        To fit to; and never fitted, optional.
    force : bool
        Take it in spite of objections.
    diagnosis : DiagnosisResult, optional
        Of this model on these recordings, where it is known: it is not made again.
    topic, progress, as_it_is : optional
        As in `compare`.
    reference : path, Recording, or a sequence of them, optional
        As in `diagnose`: the effect is a change since then. Errors of the reference are subtracted.

    Returns
    -------
    AdoptionResult

    Raises
    ------
    EffectRequestError
        For an effect or a drive that does not exist, or does not act in the model.
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(
        model, recordings, validate, topic, progress, as_it_is=as_it_is).require_measurements()
    request = requested(effect, inputs.model)
    inputs = inputs.since(reference, original(inputs.model))
    return AdoptionResult(inputs, adopt_effect(
        inputs.model, request, inputs.fitted, inputs.held_out, force,
        stage(progress, f'adopting {request.name}'),
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference))


def adopt_all(model: Model, recordings: Recordings, validate: Recordings = (), *,
              refit: Recordings | None = None, diagnosis: DiagnosisResult | None = None,
              topic: str | None = None, progress: Progress | None = None,
              reference: Given | None = None) -> AdoptionRunResult:
    """Diagnose and adopt until no effect is missing.

    Parameters
    ----------
    model, recordings, validate, diagnosis, topic, progress, reference
        As in `adopt`.
    refit : path, Recording, or a sequence of them, optional
        To which the base model is then fitted again, as `fit` does, with the adopted effects. It is
        taken if the error on other data falls. An empty sequence means `recordings`.

    Returns
    -------
    AdoptionRunResult

    Raises
    ------
    FitError
        Where there is nothing to fit again.
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(model, recordings, validate, topic, progress).require_recordings()
    inputs = inputs.since(reference, original(inputs.model))
    again: list[Recording] = []
    if refit is not None:
        require_open_numbers(inputs.model)
        again = Inputs.of(inputs.model, refit, inputs.held_out, topic,
                          progress, as_it_is=inputs.as_it_is).fitted or inputs.fitted
    run = adopt_effects(
        inputs.model, inputs.fitted, inputs.held_out, inputs.ledger.entered, progress,
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference)
    if not again or not run.adopted:
        return AdoptionRunResult(inputs, run)
    return AdoptionRunResult(inputs, run, fit_base(
        run.model, again, inputs.held_out, stage(progress, 'fitting the base')))


def _plot(first: Adoption, last: Adoption) -> Figure:
    return plot_errors({'before': rms_by_drive(first.residuals_before),
                        'after': rms_by_drive(last.residuals_after),
                        'noise': last.noise_floors}, last.unit)
