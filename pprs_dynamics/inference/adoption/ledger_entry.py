# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From an adoption to a model file with its entry in the ledger."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import PathLike
from typing import Any

from pprs_dynamics import __version__
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.residuals.residuals import rms_by_drive
from pprs_dynamics.measurement.files.fingerprint import fingerprint, samples_fingerprint
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, Step, with_step


@dataclass(frozen=True)
class RecordingEntry:
    """A recording as the ledger names it: file, hash, first and last time [s]."""

    name: str
    sha256: str
    span: tuple[float, float]

    @classmethod
    def of(cls, recording: Recording, path: str | PathLike[str] | None = None) -> RecordingEntry:
        """Return what the ledger says of a recording, which may come from no file."""
        time = recording.epoch + recording.time
        sha256 = samples_fingerprint(recording) if path is None else fingerprint(path)
        return cls(recording.name, sha256, (float(time[0]), float(time[-1])))


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
        return replace(DriveModel.from_parameters(values), source=adoption.before.source)

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
            calibrated=tuple(number.label for number in adoption.calibrated),
            rivals=adoption.rivals, objections=adoption.objections, forced=adoption.forced,
            date=datetime.now(UTC).isoformat(timespec='seconds'), version=__version__)


def _rounded(value: float, digits: int = 6) -> float:
    return float(f'{value:.{digits}g}') if math.isfinite(value) else NOT_KNOWN
