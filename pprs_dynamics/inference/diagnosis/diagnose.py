# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnosis of recordings: gates, search, and the answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import MotionError
from pprs_dynamics.inference.diagnosis.answer import Answer, answer_of
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, SinceReference
from pprs_dynamics.inference.diagnosis.next_step import MOUNTING
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.readings.findings import NoMeasurement, OtherReading, looks_like
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions, outside_cost
from pprs_dynamics.inference.search.table import input_model_alone, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion
from pprs_dynamics.measurement.motion.stick_slip import StickSlip, sticking_drives
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

SAME_SIZE = 0.05  # relative error of gravity's size, up to which a vector is gravity
LEAST_TILT = BaseTilt.linear[0].upper  # [rad]; a smaller one is the effect base_tilt
MOST_LEFT = 0.25  # of the variance of each drive's error, with another direction


def diagnose(
    model: DriveModel, recordings: Sequence[Recording], validate: Sequence[Recording] = (),
    progress: Callable[[float], None] | None = None, decisions: Decisions = DECISIONS,
    as_it_is: bool = False, reference: Reference | None = None,
) -> Diagnosis:
    """Return which physical effect a model lacks, as far as recordings show it.

    Parameters
    ----------
    model : DriveModel
    recordings : sequence of Recording
        To fit to.
    validate : sequence of Recording, optional
        Never fitted: held-out errors are taken on them, instead of on blocks.
    progress : callable, optional
        Called with the share of the work that is done.
    decisions : Decisions, optional
    as_it_is : bool
        Whether efforts that look like no measurement are taken for one all the same.
    reference : Reference, optional
        Since when it is asked what has changed; without it, what the model lacks.

    Raises
    ------
    PprsError
        Where no drive moves, and as `measure_residuals`.
    """
    report = progress or (lambda share: None)
    if not any(share_in_motion(recording.time, recording.position) for recording in recordings):
        raise MotionError('position', 'no drive moves by more than its measured position resolves '
                          f'in {", ".join(recording.name for recording in recordings)}',
                          'move: a robot at rest shows no friction, mass or delay', 'shape')
    other, sticking = ({}, {}) if as_it_is else _gate(model, recordings, decisions, reference)
    if other or sticking:
        table = input_model_alone(model, recordings, decisions, report)
        bare = Answer(table, table.best, validate).diagnosis()
        return replace(bare, verdict='unknown', warnings=(), depends_on=(),
                       effort_looks_like=other, stick_slip=sticking)
    table = tabulate(model, recordings, decisions, lambda share: report(0.9 * share),
                     None if reference is None else reference.carried_over)
    since = None if reference is None else SinceReference.of(reference, table.first.design)
    found = replace(answer_of(table, validate), since=since)
    report(1.0)
    doubts = _other_reading((*recordings, *validate))
    return replace(found, verdict='unknown', other_reading=doubts) if doubts else found


@outside_cost('a recording looks like other units, signs or order of drives than it was read with: '
              '`unknown`')
def _other_reading(recordings: Sequence[Recording]) -> str:
    """Return what recordings look like; '' if they look like what they were read as."""
    return '; '.join(dict.fromkeys(
        finding.what for recording in recordings for finding in recording.findings
        if isinstance(finding, OtherReading)))


@outside_cost('another mounting, efforts that are no measurement, and stick-slip end the '
              'diagnosis before the search: `unknown`')
def _gate(model: DriveModel, recordings: Sequence[Recording], decisions: Decisions,
          reference: Reference | None) -> tuple[dict[str, NoMeasurement], dict[str, StickSlip]]:
    """Return the drives whose efforts are no measurement, and those that stick and slip."""
    other = other_mounting(model, recordings) or looks_like(model, recordings)
    if other and reference is not None:
        # What the reference looks like as well is no change.
        before = (other_mounting(model, reference.recordings)
                  or looks_like(model, reference.recordings))
        other = {drive: looks for drive, looks in other.items()
                 if drive not in before or before[drive].kind != looks.kind}
    # No law of a drive's motion describes what its controller and its elasticity do.
    return other, {} if other else {drive: slip for drive, slip in sticking_drives(
        recordings).items() if slip.share_of_time > decisions.stick_slip}


def other_mounting(model: DriveModel, recordings: Sequence[Recording],
                   ) -> dict[str, NoMeasurement]:
    """Return the finding that gravity has another direction than in the model, by drive.

    Efforts are fitted with a free gravity vector, and each drive's inertia, friction and offset.
    """
    given = np.asarray(model.robot.gravity, dtype=float) if model.moves_joints else np.zeros(3)
    size = float(np.linalg.norm(given))
    if size == 0:
        return {}
    residuals = measure_residuals(model, recordings)[0]
    q, v, a = (residuals.variables[name] for name in ('position', 'velocity', 'acceleration'))

    def weight(gravity: Array) -> Array:
        """Return the efforts at rest, (M, D)."""
        robot = replace(model.robot, gravity=tuple(gravity.tolist()))
        efforts: Array = replace(model, robot=robot, effects=()).drive_forces(
            JointMotion(q, 0.0 * q, 0.0 * q, residuals.time)).total
        return efforts

    nothing = weight(np.zeros(3))
    columns = np.stack([weight(axis) - nothing for axis in size * np.eye(3)], axis=2)
    own = np.stack((v, np.sign(v), a, np.ones_like(v)), axis=2)
    rows, targets = [], []
    for d in np.flatnonzero(np.isfinite(residuals.error).any(axis=0)):
        at = np.isfinite(residuals.error[:, d])
        y = np.column_stack((residuals.error[at, d], columns[at, d]))
        # What the drive's inertia, friction and offset do not explain.
        rest = y - own[at, d] @ np.linalg.lstsq(own[at, d], y, rcond=None)[0]
        rest /= max(root_mean_square(rest[:, 0]), 1e-300)
        rows.append(rest[:, 1:])
        targets.append(rest[:, 0] + rest[:, 1:] @ (given / size))
    share = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=1e-3)[0]
    is_explained = all(np.mean((target - G @ share) ** 2) < MOST_LEFT
                       for G, target in zip(rows, targets, strict=True) if np.any(G))
    norm = float(np.linalg.norm(share))
    tilt = float(np.arccos(np.clip(share @ given / max(norm * size, 1e-300), -1.0, 1.0)))
    if abs(norm - 1) > SAME_SIZE or tilt < LEAST_TILT or not is_explained:
        return {}
    found, said = (', '.join(f'{round(value, 1) + 0.0:.1f}' for value in vector)
                   for vector in (size * share.round(3), given))
    finding = NoMeasurement.of(
        MOUNTING, model.drives, range(len(model.drives)),
        f'gravity in the base is ({found}) m/s² in this recording and ({said}) m/s² in the model: '
        'the robot is mounted in another direction', f'robot: {{gravity: [{found}]}}')
    return dict.fromkeys(model.drives, finding)
