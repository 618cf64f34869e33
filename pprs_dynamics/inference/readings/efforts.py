# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether the efforts of a recording are measured, and recorded with their sign.

What a drive applies accelerates bodies, carries their weight and overcomes friction, and what
measures it adds noise. A command, an error of position, an external torque or an effort without
gravity lacks some of these, and any missing effect that is found in it is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pprs_dynamics.inference.readings import table
from pprs_dynamics.inference.readings.evidence import Evidence, Shares, effort_contents
from pprs_dynamics.inference.readings.findings import NoMeasurement, OtherReading
from pprs_dynamics.inference.readings.table import named
from pprs_dynamics.inference.residuals.excerpt import Excerpt
from pprs_dynamics.measurement.files.recording import Recording, signed
from pprs_dynamics.physics.model import recorded_names
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import EFFORT_KIND

KINDS = {recorded_names.COMMANDED: (table.COMMAND, 'commands'),
         recorded_names.EXTERNAL: (table.EXTERNAL, 'external torques')}


def find_sign_bit(recording: Recording) -> Iterator[OtherReading]:
    """Yield efforts that are magnitudes with a bit for their sign, as servos report loads."""
    found: dict[int, list[int]] = {}
    for d, column in enumerate(recording.effort.T):
        effort = column[np.isfinite(column)]
        if len(effort) < 2 or np.any(effort < 0) or np.any(effort % 1 != 0):
            continue
        rough = table.CALMER * np.abs(np.diff(effort)).sum()
        for bit in table.SIGN_BITS:
            if 0.02 < np.mean(effort >= 2.0 ** bit) < 0.98 and effort.max() < 2.0 ** (bit + 1) and (
                    np.abs(np.diff(signed(effort, bit))).sum() < rough):
                found.setdefault(bit, []).append(d)
    for bit, group in found.items():
        yield OtherReading.of(
            'effort_sign_bit', recording.drives, group,
            f'the effort of {named(recording.drives, tuple(group))} looks like a magnitude whose '
            f'sign is bit {bit} ({2 ** bit})',
            scales=tuple((recording.drives[d], 'effort_sign_bit', float(bit)) for d in group))


def find_unsigned(model: DriveModel, recording: Recording, excerpt: Excerpt, evidence: Evidence,
                  ) -> Iterator[OtherReading]:
    """Yield efforts that are recorded without their sign."""
    unsigned = []
    for d in np.flatnonzero(evidence.size > table.WEAK * evidence.size.max()).tolist():
        known = np.isfinite(excerpt.effort[:, d]) & np.isfinite(evidence.force).all(axis=1)
        effort, force = excerpt.effort[known, d], evidence.force[known, d]
        if np.any(recording.effort[:, d] < 0) or not np.any(effort):
            continue
        below = float(np.sum(np.minimum(force, 0.0) ** 2) / np.sum(force ** 2))
        if table.BOTH_SIGNS < below < 1 - table.BOTH_SIGNS and table.CLEARLY * np.sum(
                (effort - np.abs(force)) ** 2) < np.sum((effort - force) ** 2):
            unsigned.append(d)
    if unsigned:
        yield OtherReading.of(
            'effort_absolute', model.drives, unsigned,
            f'the effort of {named(model.drives, tuple(unsigned))} looks like its absolute value: '
            'it is never below 0, where the model changes sign; it must be recorded with its sign')


# ------------------------------------------------------------------------------- measurements


def find_no_measurements(model: DriveModel, contents: Mapping[str, Shares],
                         ) -> tuple[NoMeasurement, ...]:
    """Return what efforts look like that are no measurement, a finding for each kind.

    Parameters
    ----------
    model : DriveModel
    contents : mapping of str to Shares
        By drive; of a recording in the units and signs that it says.
    """
    if model.effort_kind in KINDS:
        kind, noun = KINDS[model.effort_kind]
        return (NoMeasurement.of(kind, model.drives, range(len(model.drives)), f'the efforts are '
                                 f'{noun}, as the model file says with {EFFORT_KIND}: '
                                 f'{model.effort_kind}'),)
    kinds = {drive: content.kind for drive, content in contents.items()}
    # What one drive shows certainly is true of all: they are recorded in the same way.
    weighs = any(content.shows_gravity and not content.lacks_gravity
                 for content in contents.values())
    moves = any(content.inertia_doubt < table.LEAST_SHARE and not content.lacks_inertia
                for content in contents.values())
    excluded = ({table.WITHOUT_GRAVITY, table.EXTERNAL} if weighs else set()) | (
        {table.COMMAND, table.POSITION_ERROR, table.EXTERNAL} if moves else set())
    kinds = {drive: '' if kind in excluded else kind for drive, kind in kinds.items()}
    return tuple(_finding(model, contents, [drive for drive in kinds if kinds[drive] == kind], kind)
                 for kind in dict.fromkeys(kinds.values()) if kind)


def looks_like(model: DriveModel, recordings: Sequence[Recording]) -> dict[str, NoMeasurement]:
    """Return the finding for each drive whose effort is no measurement in one of the recordings."""
    found: dict[str, NoMeasurement] = {}
    for recording in recordings:
        for finding in find_no_measurements(model, effort_contents(model, recording)):
            found = {**dict.fromkeys(finding.drives, finding), **found}
    return {drive: found[drive] for drive in model.drives if drive in found}


def kinds_of(findings: Mapping[str, NoMeasurement]) -> dict[str, str] | None:
    """Return the kind of each drive's finding; None where there is none."""
    return {drive: finding.kind for drive, finding in findings.items()} or None


def _finding(model: DriveModel, contents: Mapping[str, Shares], drives: Sequence[str],
             kind: str) -> NoMeasurement:
    group = tuple(model.drives.index(drive) for drive in drives)
    content = contents[drives[0]]
    of = f'the effort of {named(model.drives, group)}'
    gravity = f'gravity ({_amount(content.gravity, content.gravity_doubt)})'
    inertia = f'inertia ({_amount(content.inertia, content.inertia_doubt)})'
    beside = [gravity] * content.lacks_gravity + ['friction'] * (not content.has_friction)
    lacks = f'{of} holds no {" nor ".join([inertia, *beside])}: it looks like'
    what = {
        table.WITHOUT_GRAVITY: f'{of} holds no {gravity}: it looks as if gravity was taken out '
        'already; else a counterweight bears it, or the base stands otherwise than the model says',
        table.EXTERNAL: f'{of} holds no {inertia} nor {gravity}: it looks like an external torque, '
        'from which a model was taken out already',
        table.NOISE_FREE: f'{of} holds no noise: it looks computed, not measured',
        table.POSITION_ERROR: f'{of} is {content.compliance:.2g} times what the model says: it '
        'looks like an error of position under the effort, or is in another unit'
        if content.compliance else f'{lacks} an error of position, which grows with the velocity, '
        'not like a measurement',
        table.COMMAND: f'{lacks} what a controller commands, not like a measurement'}[kind]
    line = {table.COMMAND: recorded_names.COMMANDED, table.EXTERNAL: kind,
            table.WITHOUT_GRAVITY: kind}.get(kind)
    return NoMeasurement.of(kind, model.drives, group, what,
                            f'{EFFORT_KIND}: {line}' if line else '')


def _amount(share: float, doubt: float) -> str:
    # Adding 0 makes minus nothing nothing.
    return f'{round(share, 2) + 0.0:.2f} ± {doubt:.2f} of what the model has'
