# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Diagnosis of recordings: gates, search, and the answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from pprs_dynamics.errors import MotionError
from pprs_dynamics.inference.diagnosis.answer import Answer, answer_of
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis, SinceReference
from pprs_dynamics.inference.fit.reference import Reference
from pprs_dynamics.inference.readings.check import looks_like
from pprs_dynamics.inference.readings.findings import Mistake, OtherReading
from pprs_dynamics.inference.search.decisions import DECISIONS, Decisions, outside_cost
from pprs_dynamics.inference.search.table import input_model_alone, tabulate
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.measurement.motion.rests import share_in_motion
from pprs_dynamics.measurement.motion.stick_slip import StickSlip, sticking_drives
from pprs_dynamics.physics.model.drive_model import DriveModel


def diagnose(
    model: DriveModel, recordings: Sequence[Recording], validate: Sequence[Recording] = (),
    progress: Callable[[float], None] | None = None, decisions: Decisions = DECISIONS,
    as_it_is: bool = False, reference: Reference | None = None,
) -> Diagnosis:
    """Return the diagnosis of a model on recordings: the effects that it lacks.

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
    if not any(recording.are_poses or share_in_motion(recording.time, recording.position)
               for recording in recordings):
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


@outside_cost('another reading, efforts that are no measurement, and stick-slip end the '
              'diagnosis before the search: `unknown`')
def _gate(model: DriveModel, recordings: Sequence[Recording], decisions: Decisions,
          reference: Reference | None) -> tuple[dict[str, Mistake], dict[str, StickSlip]]:
    """Return the drives whose recording has another reading, and those that stick and slip."""
    # No law of a drive's motion describes what its controller and its elasticity do, so that a
    # drive which sticks and slips looks like any reading.
    sticking = {drive: slip for drive, slip in sticking_drives(recordings).items()
                if slip.share_of_time > decisions.stick_slip}
    if sticking:
        return {}, sticking
    other = looks_like(model, recordings)
    if other and reference is not None:
        # What the reference looks like as well is no change.
        before = looks_like(model, reference.recordings)
        other = {drive: looks for drive, looks in other.items()
                 if drive not in before or before[drive].kind != looks.kind}
    return other, {}
