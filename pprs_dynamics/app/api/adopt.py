# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Adding effects to a model, fitted and checked on data that they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.app.api.diagnose import DiagnosisResult
from pprs_dynamics.app.api.inputs import Given, Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result
from pprs_dynamics.app.report.figures import (
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
from pprs_dynamics.inference.adoption.adopt import AMBIGUOUS, REFUSED, AdoptionRun, original
from pprs_dynamics.inference.adoption.adopt import adopt as adopt_effect
from pprs_dynamics.inference.adoption.adopt import adopt_all as adopt_effects
from pprs_dynamics.inference.adoption.adoption import VALIDATION, Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.quantities import (
    in_unit,
    measured,
    with_drives,
    with_uncertainty,
)
from pprs_dynamics.inference.diagnosis.sentences import word_values
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import read_steps
from pprs_dynamics.physics.model.model_writer import write_model

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import Figure

MOST_SHOWN = 6  # values in the terminal
MOST_REMARKS = 2


def parameter_rows(answer: Adoption) -> list[tuple[str, str]]:
    """Return each drive, or the effect, with its values ± two standard deviations.

    A curve has a picture.
    """
    values = {} if answer.curve is not None else word_values(
        answer.request.effect, answer.parameters, answer.moments, answer.before.drives)
    return [(drive or answer.effect, text) for drive, text in values.items()]


class RefusedError(PprsError, ValueError):
    """A model of an adoption that was refused."""


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionResult(Result):
    """Result of `pprs adopt`.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    adoption : Adoption
        The answer with all that it was decided from.
    """

    rows = 'parameters'  # what `table` shows
    json_of = 'adoption'
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

    @property
    def headline(self) -> str:
        """The answer in a sentence."""
        answer = self.adoption
        what = answer.effect if answer.curve is not None else with_drives(
            answer.effect, answer.drives, answer.before.drives)
        outcome = ('is refused' if not answer.adopted else
                   'is adopted by force, in spite of this' if answer.forced else 'is adopted')
        return f'{what} {outcome}: {answer.reason}.'

    @property
    def _held_out(self) -> str:
        return ('held-out recordings' if self.adoption.held_out_on == VALIDATION
                else 'held-out blocks')

    def view(self) -> Any:
        """Return answer, fall of the error and first values for the terminal, in 20 lines."""
        answer = self.adoption
        word, colour = (('refused', 'red') if not answer.adopted else
                        ('forced', 'yellow') if answer.forced else ('adopted', 'green'))
        errors = [f'  error on {label}: {measured(before)} → {measured(after)} {answer.unit}'
                  for label, before, after in (
                      ('recordings', answer.error_before, answer.error_after),
                      (self._held_out, answer.held_out_before, answer.held_out_after))]
        rows = parameter_rows(answer)
        more = [f'  … and {len(rows) - MOST_SHOWN} more, with --json or --report']
        return stacked(
            verdict_panel(word, colour, self.headline), *errors,
            f'  noise: {in_unit(answer.noise_floor, answer.unit)}',
            *(f'  {escape(key)}: {escape(text)}' for key, text in rows[:MOST_SHOWN]),
            *more[:len(rows) > MOST_SHOWN],
            *(f'[yellow]![/] {escape(remark)}' for remark in answer.remarks[:MOST_REMARKS]))

    def page(self, saved_as: str = 'better.yaml') -> Page:
        """Return the page of `pprs adopt --report`; its next command names the file of `save`."""
        answer = self.adoption
        before, after = answer.residuals_before, answer.residuals_after
        page = Page(f'{answer.effect}: ' + ('added to the model' if answer.adopted else 'refused'))
        page.text(self.headline, 'lead')
        page.sources(answer.before.source, *self.inputs.names)
        errors, fallen = rms_by_drive(before), rms_by_drive(after)
        with page.columns():
            page.errors([ErrorRow('all drives', answer.error_before, answer.error_after,
                                  answer.noise_floor),
                         ErrorRow(self._held_out, answer.held_out_before, answer.held_out_after,
                                  answer.noise_floor),
                         *(ErrorRow(name, errors[name], fallen[name], answer.noise_floors.get(name))
                           for name in errors)],
                        f'Error on the recordings, rms [{answer.unit}], before (grey) and with the '
                        'effect (blue); dotted: the noise.')
            most = max(answer.noise_floors, key=lambda name: errors[name] - fallen[name],
                       default='')
            if most:
                page.figure(before_and_after(before, after, before.drives.index(most),
                                             answer.noise_floors[most]),
                            f'{most}, where the error falls most: effort and error.',
                            over_time=True)
        if answer.curve is not None:
            page.figure(curve_with_band(answer), 'The measured curve with two standard deviations, '
                        'and the residual of the model without it. It is a correction table, not a '
                        'cause. Beyond the measured range it is constant.')
        if answer.adopted:
            page.command('Look for further effects', replace(
                self.inputs.files, model=saved_as).command('diagnose', held_out=True))
        page.bullets(answer.remarks)
        if rows := parameter_rows(answer):
            page.table(('drive', 'values ± two standard deviations'), rows, caption='Fitted values')
        forces = {effect.name: after.parts[effect.name] for effect in answer.after.effects
                  if isinstance(effect, CatalogueEffect) and effect.name in after.parts}
        if any(np.any(force) for force in forces.values()):
            with page.fold('Contribution of each added effect'):
                add_contributions(page, after, forces, 'Contribution of each added effect.')
        add_every_drive(page, before, after, answer.noise_floors,
                        f'before and with {answer.effect}')
        if answer.calibrated:
            with page.fold('Numbers of the model that changed within their tolerances'):
                page.table(('number', 'before', 'after'),
                           [(number.key, with_uncertainty(number.before, 0.0, number.unit),
                             with_uncertainty(number.after, number.std, number.unit))
                            for number in answer.calibrated])
        return page

    def plot(self) -> Figure:
        """Return a picture: the error of every drive before, after, and the noise."""
        return _plot(self.adoption, self.adoption)


@dataclass(frozen=True, repr=False, eq=False)
class AdoptionRunResult(Result):
    """Result of `pprs diagnose --adopt-all`.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    run : AdoptionRun
        What was adopted and refused, one after the other.
    """

    rows = 'steps'  # what `table` shows
    json_of = 'run'
    inputs: Inputs
    run: AdoptionRun

    @property
    def model(self) -> DriveModel:
        """The model with all that was adopted, and its ledger."""
        return self.run.model

    @property
    def refused(self) -> bool:
        """Whether it ended because the remaining effects were refused."""
        return self.run.ended == REFUSED

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file; with nothing to adopt it is the input model.

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

    def view(self) -> Any:
        """Return adopted and refused effects, and the reason to end, for the terminal."""
        following = [shell_command(self.inputs.files.command(
            'next-experiment', '--output', 'next.csv'))] if self.run.ended == AMBIGUOUS else []
        return stacked(
            *(escape(AdoptionResult(self.inputs, step).headline) for step in self.run.steps),
            f'[bold]{self.run.ended}[/]: {escape(self.run.reason)}{":" * len(following)}',
            *following)

    def page(self) -> Page:
        """Return the page of `pprs history --report` of the model."""
        return history_page('the adopted model', read_steps(self.model.values),
                            common_effort(self.model.units))

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
    request = EffectRequest.of(effect, inputs.model)
    inputs = inputs.since(reference, original(inputs.model))
    return AdoptionResult(inputs, adopt_effect(
        inputs.model, request, inputs.fitted, inputs.held_out, force,
        stage(progress, f'adopting {request.name}'),
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference))


def adopt_all(model: Model, recordings: Recordings, validate: Recordings = (), *,
              diagnosis: DiagnosisResult | None = None,
              topic: str | None = None, progress: Progress | None = None,
              reference: Given | None = None) -> AdoptionRunResult:
    """Diagnose once, and adopt the reported effects.

    Parameters
    ----------
    model, recordings, validate, diagnosis, topic, progress, reference
        As in `adopt`.

    Returns
    -------
    AdoptionRunResult

    Raises
    ------
    PprsError
        As `compare`.
    """
    inputs = Inputs.of(model, recordings, validate, topic, progress).require_recordings()
    inputs = inputs.since(reference, original(inputs.model))
    return AdoptionRunResult(inputs, adopt_effects(
        inputs.model, inputs.fitted, inputs.held_out, inputs.ledger.entered, progress,
        None if diagnosis is None else diagnosis.diagnosis, inputs.reference))


def _plot(first: Adoption, last: Adoption) -> Figure:
    return plot_errors({'before': rms_by_drive(first.residuals_before),
                        'after': rms_by_drive(last.residuals_after),
                        'noise': last.noise_floors}, last.unit)
