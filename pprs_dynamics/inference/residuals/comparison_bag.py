# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A comparison as a bag: measured effort, model, its parts and residual at the measured stamps.

What there is to say of it in words stands at its beginning.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.residuals.reconstruction import (
    Reconstruction,
    measured_forces,
    reconstruct,
)
from pprs_dynamics.measurement.files.bag_files import write_bag
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.files.samples import Samples
from pprs_dynamics.physics.model.drive_model import DriveModel

MEASURED, MODEL, RESIDUAL, PARTS = '/measured', '/model', '/residual', '/parts'
FINDINGS = '/findings'


def write_comparison(
    path: Path, model: DriveModel, recordings: Sequence[Recording],
    findings: Sequence[str], progress: Callable[[float], None] = lambda share: None,
) -> int:
    """Write joint states of measured and modelled efforts, and return how many samples.

    Parameters
    ----------
    path : Path
        .mcap, .db3, or without an ending a folder.
    model : DriveModel
    recordings : sequence of Recording
        One after the other, at their own stamps.
    findings : sequence of str
        What the comparison says, a message each.
    progress : callable, optional
        Called with the share that is done.

    Raises
    ------
    PprsError
        As `reconstruct` and `write_bag`.
    """
    found: dict[str, list[Samples]] = {}
    for number, recording in enumerate(recordings):
        reconstruction = reconstruct(model, recording)
        for name, effort in _efforts(model, reconstruction).items():
            found.setdefault(name, []).append(Samples(
                recording.drives, reconstruction.time, reconstruction.position,
                reconstruction.velocity, effort, recording.epoch))
        progress((number + 0.5) / len(recordings))
    write_bag(path, {name: _joined(parts) for name, parts in found.items()},
              {FINDINGS: findings})
    progress(1.0)
    return sum(len(part.time) for part in found[MEASURED])


def _efforts(model: DriveModel, reconstruction: Reconstruction) -> dict[str, Array]:
    """Return efforts by topic, (N, D); NaN where there is none."""
    shape = reconstruction.effort.shape
    efforts: dict[str, Array] = {}
    for chunk, _, found in measured_forces(model, reconstruction):
        for name, values in found.items():
            topic = MODEL if name == 'total' else f'{PARTS}/{name}'
            efforts.setdefault(topic, np.full(shape, np.nan))[chunk.samples] = values
    return {MEASURED: reconstruction.effort, **efforts,
            RESIDUAL: reconstruction.effort - efforts[MODEL]}


def _joined(parts: Sequence[Samples]) -> Samples:
    """Return samples of several recordings, counted from the first one's epoch."""
    first = parts[0]
    velocities = [part.velocity for part in parts if part.velocity is not None]
    return Samples(
        first.drives, np.concatenate([part.time + (part.epoch - first.epoch) for part in parts]),
        np.concatenate([part.position for part in parts]), np.concatenate(velocities),
        np.concatenate([part.effort for part in parts]), first.epoch)
