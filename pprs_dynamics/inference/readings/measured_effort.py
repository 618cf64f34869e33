# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether the efforts of a recording can be measurements of what the drives apply.

What a drive applies accelerates bodies, carries their weight and overcomes friction, and what
measures it adds noise. A command, an error of position, an external torque or an effort without
gravity lacks some of these, and any missing effect that is found in it is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import comb

import numpy as np

from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.inference.readings.evidence import Shares, parts_of, shares
from pprs_dynamics.inference.readings.findings import NoMeasurement
from pprs_dynamics.inference.readings.table import (
    CERTAIN,
    COMMAND,
    EXTERNAL,
    FOLLOWS,
    LARGEST_COMPLIANCE,
    LEAST_FRICTION,
    LEAST_LEFT,
    LEAST_MEANS,
    LEAST_NOISE,
    LEAST_SHARE,
    LEFT_GRAVITY,
    NOISE_FREE,
    NOISE_ORDER,
    NOISE_STEP,
    POSITION_ERROR,
    WITHOUT_GRAVITY,
    named,
    plain,
)
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.model import recorded_names
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import EFFORT_KIND

STRETCHES = 8  # of an excerpt
NORMAL = 1.4826  # standard deviation over the median of absolute values
KINDS = {recorded_names.COMMANDED: (COMMAND, 'commands'),
         recorded_names.EXTERNAL: (EXTERNAL, 'external torques')}


@dataclass(frozen=True)
class EffortContent(Shares):
    """Shares of an effort, and its fast noise over its swing."""

    noise: float

    @property
    def lacks_inertia(self) -> bool:
        """Whether there is certainly less than half of the model's inertia."""
        return abs(self.inertia) + self.inertia_doubt < LEAST_SHARE

    @property
    def lacks_gravity(self) -> bool:
        """Whether there is certainly less than half of the model's gravity."""
        return abs(self.gravity) + self.gravity_doubt < LEAST_SHARE

    @property
    def shows_gravity(self) -> bool:
        """Whether half of the model's gravity would show."""
        return self.gravity_doubt < LEAST_SHARE

    @property
    def compliance(self) -> float:
        """Common factor of inertia and gravity; 0 where they have none."""
        share, doubt = min((self.inertia, self.inertia_doubt), (self.gravity, self.gravity_doubt),
                           key=lambda pair: pair[1])
        apart = abs(self.inertia - self.gravity)
        is_one = share > 2 * doubt and not apart > self.inertia_doubt + self.gravity_doubt
        return share if is_one else 0.0

    @property
    def has_friction(self) -> bool:
        """Whether friction is part of it."""
        return abs(self.friction) > max(LEAST_FRICTION, CERTAIN * self.friction_by_chance)

    @property
    def kind(self) -> str:
        """What the effort looks like in place of a measurement; '' where it may be one."""
        if self.lacks_inertia and (self.lacks_gravity or not self.shows_gravity):
            follows = (self.viscous > 0 and self.viscous ** 2 > FOLLOWS
                       and self.dry < LEAST_FRICTION)
            if follows or 0 < self.compliance < LARGEST_COMPLIANCE:
                return POSITION_ERROR
            if self.compliance:
                return ''  # a gain, or another unit
            if self.lacks_gravity:
                return EXTERNAL
        if self.lacks_inertia and not self.has_friction:
            return COMMAND
        if abs(self.gravity) + self.gravity_doubt < LEFT_GRAVITY and not self.compliance:
            return WITHOUT_GRAVITY
        return NOISE_FREE if self.noise < LEAST_NOISE or self.left < LEAST_LEFT else ''


def find_no_measurements(model: DriveModel, contents: Mapping[str, EffortContent],
                         ) -> tuple[NoMeasurement, ...]:
    """Return what efforts look like that are no measurement, a finding for each kind.

    Parameters
    ----------
    model : DriveModel
    contents : mapping of str to EffortContent
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
    moves = any(content.inertia_doubt < LEAST_SHARE and not content.lacks_inertia
                for content in contents.values())
    excluded = ({WITHOUT_GRAVITY, EXTERNAL} if weighs else set()) | (
        {COMMAND, POSITION_ERROR, EXTERNAL} if moves else set())
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


def effort_contents(model: DriveModel, recording: Recording, excerpt: Excerpt | None = None,
                    ) -> dict[str, EffortContent]:
    """Return the shares of the efforts of drives that move and have enough samples."""
    excerpt = excerpt or excerpt_of(recording, stretches=STRETCHES)
    if excerpt is None:
        return {}
    parts = parts_of(model, excerpt, plain(len(model.drives)), in_pieces=False)
    if parts is None:
        return {}
    width = np.broadcast_to(model.reversal.velocity, (len(model.drives),))
    found = {}
    for d, drive in enumerate(model.drives):
        known = np.isfinite(excerpt.effort[:, d])
        effort = excerpt.effort[known, d]
        if (known.sum() >= LEAST_MEANS and root_mean_square(parts.velocity[known, d]) > width[d]
                and np.ptp(effort) > 0):
            some = shares(effort, parts.rows(known), d)
            found[drive] = EffortContent(
                **{field.name: getattr(some, field.name) for field in fields(some)},
                noise=_fast_noise(recording, d) / float(np.std(effort)))
    return found


def _fast_noise(recording: Recording, drive: int) -> float:
    """Return the standard deviation of changes that are faster than a motion.

    By the median of differences of samples 10 ms apart, so that reversals have no part in it; at
    least that of rounding.
    """
    found = [np.zeros(0)]
    for part in recording.segments:
        time = recording.time[part]
        step = max(1, round(NOISE_STEP / float(np.median(np.diff(time)))))
        found.append(np.abs(np.diff(recording.effort[part, drive][::step], NOISE_ORDER)))
    differences = np.concatenate(found)
    differences = differences[np.isfinite(differences)]
    if not len(differences):
        return float('inf')
    # White noise has its differences multiplied by the root of the sum of squared binomials.
    gain = np.sqrt(comb(2 * NOISE_ORDER, NOISE_ORDER))
    values = np.unique(recording.effort[np.isfinite(recording.effort[:, drive]), drive])
    return float(max(NORMAL * np.median(differences) / gain,
                     np.min(np.diff(values)) / np.sqrt(12)))


def _finding(model: DriveModel, contents: Mapping[str, EffortContent], drives: Sequence[str],
             kind: str) -> NoMeasurement:
    group = tuple(model.drives.index(drive) for drive in drives)
    content = contents[drives[0]]
    of, line = f'the effort of {named(model.drives, group)}', ''
    gravity = f'gravity ({_share(content.gravity, content.gravity_doubt)})'
    inertia = f'inertia ({_share(content.inertia, content.inertia_doubt)})'
    if kind == WITHOUT_GRAVITY:
        line = f'{EFFORT_KIND}: {kind}'
        what = (f'{of} holds no {gravity}: it looks as if gravity was taken out already; else a '
                'counterweight bears it, or the base stands otherwise than the model says')
    elif kind == EXTERNAL:
        line = f'{EFFORT_KIND}: {kind}'
        what = (f'{of} holds no {inertia} nor {gravity}: it looks like an external torque, from '
                'which a model was taken out already')
    elif kind == NOISE_FREE:
        what = f'{of} holds no noise: it looks computed, not measured'
    elif kind == POSITION_ERROR and content.compliance:
        what = (f'{of} is {content.compliance:.2g} times what the model says: it looks like an '
                'error of position under the effort, or is in another unit')
    else:
        beside = [gravity] * content.lacks_gravity + ['friction'] * (not content.has_friction)
        what = f'{of} holds no {" nor ".join([inertia, *beside])}: it looks like ' + (
            'an error of position, which grows with the velocity' if kind == POSITION_ERROR else
            'what a controller commands') + ', not like a measurement'
        line = f'{EFFORT_KIND}: {recorded_names.COMMANDED}' * (kind == COMMAND)
    return NoMeasurement.of(kind, model.drives, group, what, line)


def _share(share: float, doubt: float) -> str:
    # Adding 0 makes minus nothing nothing.
    return f'{round(share, 2) + 0.0:.2f} ± {doubt:.2f} of what the model has'
