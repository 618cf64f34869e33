# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What changed on a machine between two recordings."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.api.diagnose import DiagnosisResult, diagnose
from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings
from pprs_dynamics.app.api.result import Result, data_frame
from pprs_dynamics.inference.diagnosis.changed_number import ChangedNumber
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.residuals.residuals import rms, rms_by_drive
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.physics.model.model_file import build_model
from pprs_dynamics.physics.model.uncertainties import with_uncertainties

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import DataFrame, Figure, Page


@dataclass(frozen=True, repr=False, eq=False)
class ChangeResult(Result):
    """What `pprs changed` says.

    Parameters
    ----------
    inputs : Inputs
        Model, and the recordings of before and after together.
    first : DiagnosisResult
        Of the recordings of before.
    second : DiagnosisResult
        Of those of after, against the model that explains those of before.
    """

    inputs: Inputs
    first: DiagnosisResult
    second: DiagnosisResult

    @property
    def changes(self) -> tuple[ChangedNumber, ...]:
        """All numbers that changed, those of the effect that explains most first."""
        known = {(one.name, key): estimate.std for one in self.first.effects
                 for key, estimate in one.parameters.items()}
        found = []
        for one in self.second.effects:
            strengths = {parameter.name for parameter in one.effect.linear}
            for key, estimate in one.parameters.items():
                place, _, last = key.rpartition('.')
                if one.in_model and key not in one.in_model:
                    continue
                before = one.in_model.get(key, 0.0 if last in strengths else None)
                found.append(ChangedNumber(
                    one.name, (place,) if one.drives is not None and place in one.drives
                    else one.drives, key, before, estimate.value,
                    hypot(estimate.std, known.get((one.name, key), 0.0)), estimate.unit))
        found += [ChangedNumber('model', None, one.key, one.before, one.after, one.std, one.unit)
                  for one in self.second.diagnosis.calibrated]
        return tuple(found)

    def _error(self, model: ForceModel) -> float:
        """Return the error of a model on the recordings of after, rms over all drives [N]."""
        return rms(measure_residuals(model, self.second.inputs.fitted)[0])

    @property
    def error_before(self) -> float:
        """Error of the recordings of after by the model of before [N]."""
        return self._error(self.second.inputs.model)

    @property
    def error_after(self) -> float:
        """The same with what changed [N]."""
        return self._error(self.second.fitted)

    def to_dict(self) -> dict[str, Any]:
        """Return what `pprs changed --json` writes."""
        return {'changes': [one.to_dict() for one in self.changes],
                'error_before': self.error_before, 'error_after': self.error_after,
                'verdict': self.second.verdict, 'before': self.first.to_dict(),
                'after': self.second.to_dict()}

    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows."""
        from pprs_dynamics.app.report.change_report import change_view

        return change_view(self.changes, self.second.verdict, self.error_before,
                           self.error_after, self.second.diagnosis.residuals.unit,
                           self.second.view(details=True, next_step=False) if details else None)

    def page(self) -> Page:
        """Return the page of `pprs changed --report`."""
        from pprs_dynamics.app.report.change_report import change_page

        return change_page(self.changes, self.second.verdict, self.error_before,
                           self.error_after, self.second.diagnosis.residuals.unit,
                           [one.name for one in self.inputs.fitted])

    def table(self) -> DataFrame:
        """Return a row for each number that changed."""
        return data_frame([one.to_dict() for one in self.changes])

    def plot(self) -> Figure:
        """Return a picture: the error of every drive by the model of before, and with changes."""
        from pprs_dynamics.app.report.pictures import plot_errors

        fitted = self.second.inputs.fitted
        errors = {name: rms_by_drive(measure_residuals(model, fitted)[0]) for name, model in (
            ('as before', self.second.inputs.model), ('with what changed', self.second.fitted))}
        return plot_errors(errors, self.second.diagnosis.residuals.unit)


def changed(model: Model, before: Recordings, after: Recordings, *, topic: str | None = None,
            progress: Progress | None = None) -> ChangeResult:
    """Find what changed on a machine between two recordings.

    The effects that explain `before` join the model, with the uncertainties of their numbers;
    `after` is diagnosed against that: what no longer holds, or is new, changed.

    Parameters
    ----------
    model : ForceModel or path
    before, after : path, Recording, or a sequence of them
    topic, progress : optional
        As in `compare`.

    Raises
    ------
    PprsError
        As `compare`.
    """
    first = diagnose(model, before, topic=topic, progress=progress)
    values: dict[str, Any] = dict(first.fitted.values)
    for one in first.effects:
        values = dict(with_uncertainties(values, one.name, {
            key: estimate.std for key, estimate in one.parameters.items()
            if isfinite(estimate.std)}))
    explained = build_model(values, first.fitted.source)
    second = diagnose(explained, after, topic=topic, progress=progress)
    return ChangeResult(
        Inputs(first.inputs.model, {**first.inputs.recordings, **second.inputs.recordings}, {},
               first.inputs.paths | second.inputs.paths, first.inputs.base,
               first.inputs.model_path, topic or ''), first, second)
