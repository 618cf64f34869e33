# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""From an adoption to a model file with its entry in the ledger."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import PathLike

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
        before, after = (rms_by_drive(one) for one in (
            adoption.residuals_before, adoption.residuals_after))
        found = adoption.parameters
        return Step(
            effect=adoption.effect, drives=adoption.drives or (),
            parameters=tuple(found), values=tuple(one.value for one in found.values()),
            std=tuple(_rounded(one.std, 3) for one in found.values()),
            units=tuple(one.unit for one in found.values()),
            recordings=tuple(one.name for one in self.fitted),
            sha256=tuple(one.sha256 for one in self.fitted),
            spans=tuple(time for one in self.fitted for time in one.span),
            validation=tuple(one.name for one in self.validation),
            validation_sha256=tuple(one.sha256 for one in self.validation),
            reference=adoption.reference,
            held_out_on=adoption.held_out_on,
            error_before=_rounded(adoption.error_before),
            error_after=_rounded(adoption.error_after),
            held_out_before=_rounded(adoption.held_out_before),
            held_out_after=_rounded(adoption.held_out_after),
            noise_floor=_rounded(adoption.noise_floor), measured=tuple(before),
            drive_errors_before=tuple(map(_rounded, before.values())),
            drive_errors_after=tuple(map(_rounded, after.values())),
            calibrated=tuple(one.label for one in adoption.calibrated), rivals=adoption.rivals,
            objections=adoption.objections, forced=adoption.forced,
            date=datetime.now(UTC).isoformat(timespec='seconds'), version=__version__)


def _rounded(value: float, digits: int = 6) -> float:
    return float(f'{value:.{digits}g}') if math.isfinite(value) else NOT_KNOWN
