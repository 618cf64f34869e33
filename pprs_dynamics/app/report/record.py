# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a page is of: date, version, command line, model and recordings with their hashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pprs_dynamics import __version__
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.fingerprint import fingerprint, samples_fingerprint
from pprs_dynamics.measurement.files.recording import Recording, describe

if TYPE_CHECKING:
    from pprs_dynamics.physics.model.drive_model import DriveModel


def record_of(model: DriveModel | None, recordings: Mapping[str, Recording],
              held_out: Mapping[str, Recording], command: str = '') -> list[tuple[str, str]]:
    """Return labelled lines.

    Parameters
    ----------
    model : DriveModel or None
    recordings, held_out : mapping of str to Recording
        By path, or by a name that is none.
    command : str
        As it was given; '' for none.
    """
    found = [('date', datetime.now(UTC).isoformat(timespec='seconds')),
             ('version', f'pprs_dynamics {__version__}')]
    if command:
        found.append(('command', command))
    if model is not None:
        name = Path(model.source).name if model.source else 'built in memory'
        found.append(('model', f'{name}, sha256 of its values {model.fingerprint}'))
    for label, of in (('recording', recordings), ('held out', held_out)):
        found += [(label, text) for text in _described(of)]
    return found


def _described(recordings: Mapping[str, Recording]) -> Iterator[str]:
    for name, recording in recordings.items():
        summary = describe(recording)
        try:
            digest = fingerprint(name) if Path(name).exists() else samples_fingerprint(recording)
        except UnreadableFileError:
            digest = samples_fingerprint(recording)
        yield (f'{recording.name}: {summary.used} samples, {summary.duration:.2f} s at '
               f'{summary.rate:.6g} Hz, sha256 {digest}')
