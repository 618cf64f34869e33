# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The answer to a requested effect, and its entry in the ledger of the model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from os import PathLike
from typing import Any

from pprs_dynamics import __version__
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.adoption.fit_curve import FittedCurve
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.residuals.residuals import Residuals, rms, rms_by_drive
from pprs_dynamics.inference.search.estimates import Estimate, FittedNumber
from pprs_dynamics.measurement.files.fingerprint import fingerprint, samples_fingerprint
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, Step, with_step
from pprs_dynamics.system.json_records import JsonRecord

BLOCKS, VALIDATION = 'blocks', 'validation'


@dataclass(frozen=True)
class Adoption(JsonRecord):
    """The answer to a requested effect.

    Parameters
    ----------
    request : EffectRequest
    drives : tuple of str or None
        Drives on which it was fitted; None: not on drives.
    before, after : DriveModel
        As given; and with the effect. The latter is the former where the effect gives no model.
    residuals_before, residuals_after : Residuals
        On the recordings.
    held_out_before, held_out_after : float
        Errors on held-out data [N].
    held_out_on : {'blocks', 'validation'}
        Held-out data: blocks of the recordings, or those of --validate.
    noise_floors : mapping of str to float
        Root of the mean square of the noise of each drive, as the diagnosis has it [N].
    parameters : mapping of str to Estimate
        Values by drive.parameter, or parameter.
    objections, remarks : tuple of str
        Sentences: why the effect should not be adopted, and what else its user should know.
    calibrated : tuple of FittedNumber
        Numbers of the model that moved within their tolerances.
    rivals : tuple of str
        Effects that explain the recordings as well.
    moments : mapping of str to Estimate
        First moments of added bodies, mass times centre.
    curve : FittedCurve, optional
        Of a measured curve, with its band.
    reference : tuple of str
        Reference runs since which the effect is a change.
    adopted : bool
        Whether the effect was added to the model.
    reason : str
        Why, in one sentence.
    """

    json_keys = ('adopted', 'reason', 'effect', 'error_before', 'error_after', 'held_out_before',
                 'held_out_after', 'held_out_on', 'noise_floor', 'forced', 'drives', 'objections',
                 'remarks', 'rivals', 'parameters', 'calibrated', 'moments', 'reference')
    json_optional = ('moments', 'reference')

    request: EffectRequest
    drives: tuple[str, ...] | None
    before: DriveModel
    after: DriveModel
    residuals_before: Residuals
    residuals_after: Residuals
    held_out_before: float
    held_out_after: float
    held_out_on: str
    noise_floors: Mapping[str, float]
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    objections: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    calibrated: tuple[FittedNumber, ...] = ()
    rivals: tuple[str, ...] = ()
    moments: Mapping[str, Estimate] = field(default_factory=dict)
    curve: FittedCurve | None = None
    reference: tuple[str, ...] = ()
    adopted: bool = True
    reason: str = ''

    @property
    def forced(self) -> bool:
        """Whether it was adopted in spite of objections."""
        return self.adopted and bool(self.objections)

    @property
    def error_before(self) -> float:
        """Error on the recordings as given [N]."""
        return rms(self.residuals_before)

    @property
    def error_after(self) -> float:
        """Error on the recordings with the effect [N]."""
        return rms(self.residuals_after)

    @property
    def noise_floor(self) -> float:
        """Noise over all drives, rms [N]."""
        return root_mean_square(list(self.noise_floors.values()))

    @property
    def unit(self) -> str:
        """Unit of errors over all drives."""
        return self.residuals_before.unit

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.request.name


class RecordingEntry:
    """A recording as the ledger names it: file, hash, first and last time [s].

    Parameters
    ----------
    recording : Recording
    path : path, optional
        Of its file; it may come from none.
    """

    def __init__(self, recording: Recording, path: str | PathLike[str] | None = None) -> None:
        time = recording.epoch + recording.time
        self.name, self.span = recording.name, (float(time[0]), float(time[-1]))
        self.sha256 = samples_fingerprint(recording) if path is None else fingerprint(path)


@dataclass(frozen=True)
class LedgerBook:
    """Enters adoptions into a model's ledger.

    Parameters
    ----------
    fitted, validation : tuple of RecordingEntry
    """

    fitted: tuple[RecordingEntry, ...]
    validation: tuple[RecordingEntry, ...]

    def entered(self, adoption: Adoption) -> DriveModel:
        """Return the model of an adoption with its step in the ledger."""
        values = with_step(adoption.before.values, adoption.after.values, self._step(adoption))
        return DriveModel.from_parameters(values, adoption.before.source)

    def _step(self, adoption: Adoption) -> Step:
        before, after = (rms_by_drive(residuals) for residuals in (
            adoption.residuals_before, adoption.residuals_after))
        estimates = adoption.parameters.values()
        errors: dict[str, Any] = {name: _rounded(getattr(adoption, name)) for name in (
            'error_before', 'error_after', 'held_out_before', 'held_out_after', 'noise_floor')}
        return Step(
            effect=adoption.effect, drives=adoption.drives or (),
            parameters=tuple(adoption.parameters),
            values=tuple(estimate.value for estimate in estimates),
            std=tuple(_rounded(estimate.std, 3) for estimate in estimates),
            units=tuple(estimate.unit for estimate in estimates),
            recordings=tuple(entry.name for entry in self.fitted),
            sha256=tuple(entry.sha256 for entry in self.fitted),
            spans=tuple(time for entry in self.fitted for time in entry.span),
            validation=tuple(entry.name for entry in self.validation),
            validation_sha256=tuple(entry.sha256 for entry in self.validation),
            reference=adoption.reference, held_out_on=adoption.held_out_on, **errors,
            measured=tuple(before), drive_errors_before=tuple(map(_rounded, before.values())),
            drive_errors_after=tuple(map(_rounded, after.values())),
            calibrated=tuple(number.key for number in adoption.calibrated),
            rivals=adoption.rivals, objections=adoption.objections, forced=adoption.forced,
            date=datetime.now(UTC).isoformat(timespec='seconds'), version=__version__)


def _rounded(value: float, digits: int = 6) -> float:
    return float(f'{value:.{digits}g}') if math.isfinite(value) else NOT_KNOWN
