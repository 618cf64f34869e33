# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether the efforts of a recording can be measurements of what the drives apply.

What a drive applies accelerates bodies, carries their weight and overcomes friction, and what
measures it adds noise. A controller's command, an error of position or an effort from which
gravity was taken out lacks some of these for certain, and whatever a search for missing effects
would say of it is wrong: that inertia is missing, say, with minus all that the model has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np

from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.residuals.excerpt import Excerpt, excerpt_of
from pprs_dynamics.inference.residuals.mistakes import (
    COMMAND,
    NOISE_FREE,
    POSITION_ERROR,
    WITHOUT_GRAVITY,
    NoMeasurement,
)
from pprs_dynamics.inference.residuals.readings import named
from pprs_dynamics.inference.residuals.reconstruction import follow
from pprs_dynamics.measurement.files.recording import Recording
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.reversal import smooth_sign
from pprs_dynamics.physics.model.force_model import RIGID_BODY, ForceModel
from pprs_dynamics.physics.model.recorded_names import COMMANDED, EFFORT_KIND

# Stretches of a recording that are looked at, evenly over it.
STRETCHES = 8
# Means of efforts that a drive needs.
LEAST_MEANS = 50
# Masses of a model are right within a factor of two: with less than half of its inertia or gravity
# an effort holds none.
LEAST_SHARE = 0.5
# Where gravity is taken out by another model, less than this share is left; a counterweight that
# bears most of a weight leaves more.
LEFT_GRAVITY = 0.2
# Friction of a drive with a gear is more than this share of its effort; a command's is none.
LEAST_FRICTION = 0.05
SURE = 3.0  # times what is found by chance, beyond which friction is there
# A weight whose swing is a smaller share of its size is a constant.
CONSTANT = 0.1
# Share of an effort's variance beyond which it follows the velocity and nothing else.
FOLLOWS = 0.9
# Efforts that are the model's but for so small a factor are errors of position [rad/(N m), m/N]:
# controllers are stiffer than 50 N m/rad, and no unit of an effort is a fiftieth.
LARGEST_COMPLIANCE = 0.02
# Over the swing of an effort: what sensors, amplifiers and converters leave. Drives of six robots
# had from 9e-4 on.
LEAST_NOISE = 1e-5
# Over that swing: what a model that is right leaves of a measured effort is more. Seen: 4e-3.
LEAST_LEFT = 5e-4
# Steps between the samples whose differences tell noise from motion [s], and their order.
NOISE_STEP, NOISE_ORDER = 0.01, 4
CERTAIN = 2.0  # doubts by which a share is above 0
NORMAL = 1.4826  # standard deviation over the median of absolute values
CONDITION = 1e-6  # of a column beside others: less is rounding


@dataclass(frozen=True)
class EffortContent:
    """What of an effort is inertia, gravity and friction, by least squares on a model's parts.

    Parameters
    ----------
    inertia, gravity : float
        Shares of the model's that are in the effort.
    inertia_doubt, gravity_doubt : float
        By how much each would be another if all that is left were its; infinite where the motion
        does not show it.
    viscous, dry : float
        Friction, over the swing of the effort; the former with its sign.
    friction, friction_by_chance : float
        Both together, negative where they drive the motion; and what of what is left would be
        found as friction by chance.
    left : float
        What is left, over the swing of the effort.
    noise : float
        Fast noise, over the swing of the effort.
    """

    inertia: float
    inertia_doubt: float
    gravity: float
    gravity_doubt: float
    viscous: float
    dry: float
    friction: float
    friction_by_chance: float
    left: float
    noise: float

    @property
    def shows_inertia(self) -> bool:
        """Whether half of the model's inertia would show."""
        return self.inertia_doubt < LEAST_SHARE

    @property
    def shows_gravity(self) -> bool:
        """Whether half of the model's gravity would show."""
        return self.gravity_doubt < LEAST_SHARE

    @property
    def lacks_inertia(self) -> bool:
        """Whether there is less than half of the model's inertia for certain."""
        return abs(self.inertia) + self.inertia_doubt < LEAST_SHARE

    @property
    def lacks_gravity(self) -> bool:
        """Whether there is less than half of the model's gravity for certain."""
        return abs(self.gravity) + self.gravity_doubt < LEAST_SHARE

    @property
    def compliance(self) -> float:
        """The factor by which inertia and gravity are the model's; 0 where it is not one."""
        share, doubt = min((self.inertia, self.inertia_doubt), (self.gravity, self.gravity_doubt),
                           key=lambda one: one[1])
        apart = abs(self.inertia - self.gravity)
        is_one = (share > CERTAIN * doubt
                  and not apart > self.inertia_doubt + self.gravity_doubt)
        return share if is_one else 0.0

    @property
    def follows_velocity(self) -> bool:
        """Whether it grows with the velocity and does nearly nothing else."""
        return (self.viscous > 0 and self.viscous ** 2 > FOLLOWS
                and self.dry < LEAST_FRICTION)

    @property
    def holds_friction(self) -> bool:
        """Whether there is friction in it."""
        return abs(self.friction) > max(LEAST_FRICTION, SURE * self.friction_by_chance)

    @property
    def factor(self) -> float:
        """By what its weight, or else its inertia, is the model's; 0 where neither is certain."""
        for share, doubt in ((self.gravity, self.gravity_doubt),
                             (self.inertia, self.inertia_doubt)):
            if abs(share) > SURE * doubt:
                return share
        return 0.0

    @property
    def is_upright(self) -> bool:
        """Whether anything for certain has the sign that it must have."""
        return (self.factor > 0 or self.inertia > CERTAIN * self.inertia_doubt
                or (self.holds_friction and self.friction > 0))

    @property
    def is_negated(self) -> bool:
        """Whether all that is there for certain has the other sign, and its usual size."""
        return (not self.is_upright and self.holds_friction
                and (self.factor == 0 or LEAST_SHARE < -self.factor < 1 / LEAST_SHARE))

    @property
    def kind(self) -> str:
        """What the effort looks like instead of a measurement; '' where it may be one."""
        if self.lacks_inertia and (self.lacks_gravity or not self.shows_gravity):
            if self.follows_velocity or 0 < self.compliance < LARGEST_COMPLIANCE:
                return POSITION_ERROR
            if self.compliance:
                return ''  # a gain, or another unit
            if self.lacks_gravity:
                return COMMAND
        if self.lacks_inertia and not self.holds_friction:
            return COMMAND
        if abs(self.gravity) + self.gravity_doubt < LEFT_GRAVITY and not self.compliance:
            return WITHOUT_GRAVITY
        return NOISE_FREE if self.noise < LEAST_NOISE or self.left < LEAST_LEFT else ''


def find_no_measurements(model: ForceModel, recording: Recording,
                         contents: Mapping[str, EffortContent] | None = None,
                         ) -> tuple[NoMeasurement, ...]:
    """Return what efforts look like that are no measurement, a finding for each kind.

    Parameters
    ----------
    model : ForceModel
    recording : Recording
        Of the model's drives, in the units and signs that it says.
    contents : mapping of str to EffortContent, optional
        Of its efforts, where they are known.

    Returns
    -------
    tuple of NoMeasurement
        Their `kind` is `command`, `position_error`, `without_gravity` or `noise_free`. Empty where
        efforts may be measured, and where the recording cannot tell.
    """
    if model.effort_kind == COMMANDED:
        every = range(len(model.drives))
        return (NoMeasurement.of(COMMAND, model.drives, every, 'the efforts are commands, as the '
                                 f'model file says with {EFFORT_KIND}: {COMMANDED}'),)
    contents = effort_contents(model, recording) if contents is None else contents
    kinds = {drive: content.kind for drive, content in contents.items()}
    # What one drive shows for certain holds for all: they are recorded in the same way.
    weighs = any(content.shows_gravity and not content.lacks_gravity
                 for content in contents.values())
    moves = any(content.shows_inertia and not content.lacks_inertia
                for content in contents.values())
    excluded = ({WITHOUT_GRAVITY} if weighs else set()) | (
        {COMMAND, POSITION_ERROR} if moves else set())
    kinds = {drive: '' if kind in excluded else kind for drive, kind in kinds.items()}
    return tuple(_told(model, contents, [drive for drive in kinds if kinds[drive] == kind], kind)
                 for kind in dict.fromkeys(kinds.values()) if kind)


def looks_like(model: ForceModel, recordings: Sequence[Recording]) -> dict[str, NoMeasurement]:
    """Return the finding for each drive whose effort is no measurement in one of the recordings."""
    found: dict[str, NoMeasurement] = {}
    for recording in recordings:
        for finding in find_no_measurements(model, recording):
            found = {**dict.fromkeys(finding.drives, finding), **found}
    return {drive: found[drive] for drive in model.drives if drive in found}


def kinds_of(findings: Mapping[str, NoMeasurement]) -> dict[str, str] | None:
    """Return the kind of each drive's finding; None where there is none."""
    return {drive: finding.kind for drive, finding in findings.items()} or None


def effort_contents(model: ForceModel, recording: Recording) -> dict[str, EffortContent]:
    """Return what the efforts of drives that move hold; of those that tell enough."""
    excerpt = excerpt_of(recording, stretches=STRETCHES)
    if excerpt is None:
        return {}
    try:
        inertia, gravity = _rigid_parts(model, excerpt)
    except (PprsError, np.linalg.LinAlgError):  # the mechanism cannot follow
        return {}
    width = np.broadcast_to(model.reversal.velocity, (len(model.drives),))
    found = {}
    for d, drive in enumerate(model.drives):
        known = np.isfinite(excerpt.effort[:, d])
        effort, velocity = excerpt.effort[known, d], excerpt.motion.velocity[known, d]
        if (known.sum() >= LEAST_MEANS and root_mean_square(velocity) > width[d]
                and np.ptp(effort) > 0):
            found[drive] = _content(effort, inertia[known, d], gravity[known, d], velocity,
                                    smooth_sign(velocity, width[d]), _fast_noise(recording, d))
    return found


def _content(effort: Array, inertia: Array, gravity: Array, velocity: Array, direction: Array,
             noise: float) -> EffortContent:
    swing = float(np.std(effort))
    columns = [inertia, gravity, velocity, direction]
    constant = np.ones_like(effort)
    found, doubts, left = _fitted(effort, [*columns, constant])
    share, doubt = found[1], doubts[1]
    if np.std(gravity) < CONSTANT * root_mean_square(gravity):
        # A weight that hardly changes is a constant: then there is no other one.
        alone, alone_doubts, _ = _fitted(effort, columns)
        share, doubt = alone[1], alone_doubts[1]
    resistance = found[2] * velocity + found[3] * direction
    friction = root_mean_square(resistance) * float(np.sign(np.mean(resistance * velocity)))
    return EffortContent(
        found[0], doubts[0], share, doubt, found[2] * float(np.std(velocity)) / swing,
        abs(found[3]) * float(np.std(direction)) / swing, friction / swing,
        left * float(np.sqrt(2 / len(effort))) / swing, left / swing, noise / swing)


def _fitted(effort: Array, columns: Sequence[Array]) -> tuple[list[float], list[float], float]:
    """Return coefficients, by how much each would be another by what is left, and what is left.

    Columns that others hold, or that are 0, have the coefficient 0 and infinite doubt.
    """
    matrix = np.column_stack(columns)
    sizes = np.sqrt(np.mean(matrix ** 2, axis=0))
    used = np.flatnonzero(sizes > 0)
    unit = matrix[:, used] / sizes[used]
    solution = np.linalg.lstsq(unit, effort, rcond=CONDITION)[0]
    left = root_mean_square(effort - unit @ solution)
    values, doubts = [0.0] * len(columns), [np.inf] * len(columns)
    for k, column in enumerate(used):
        others = np.delete(unit, k, axis=1)
        beyond = unit[:, k] - others @ np.linalg.lstsq(others, unit[:, k], rcond=CONDITION)[0]
        alone = root_mean_square(beyond)
        if alone > CONDITION:
            values[column] = float(solution[k] / sizes[column])
            doubts[column] = left / (alone * float(sizes[column]))
    return values, doubts, left


def _rigid_parts(model: ForceModel, excerpt: Excerpt) -> tuple[Array, Array]:
    """Return the model's forces by inertia and by gravity on an excerpt, (N, D) each."""
    bodies = {RIGID_BODY, DriveInertia.name, *(
        effect.name for effect in model.effects if isinstance(effect, BodyEffect))}
    position = excerpt.motion.position
    moved = replace(excerpt.motion, position=position - model.position_error(position))
    still = np.zeros_like(moved.velocity)
    forces = []
    for motion in (moved, replace(moved, velocity=still, acceleration=still)):
        followed = follow(model, excerpt.time, motion).motion.with_time(excerpt.time)
        parts = model.drive_forces(followed).parts
        forces.append(np.sum([parts[name] for name in parts if name in bodies], axis=0))
    return forces[0] - forces[1], forces[1]


def _fast_noise(recording: Recording, drive: int) -> float:
    """Return the standard deviation of what changes faster than a motion does.

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


def _told(model: ForceModel, contents: Mapping[str, EffortContent], drives: Sequence[str],
          kind: str) -> NoMeasurement:
    group = tuple(model.drives.index(drive) for drive in drives)
    one = contents[drives[0]]
    of, line = f'the effort of {named(model.drives, group)}', ''
    gravity = f'gravity ({_share(one.gravity, one.gravity_doubt)})'
    lacking = f'inertia ({_share(one.inertia, one.inertia_doubt)})'
    if kind == WITHOUT_GRAVITY:
        line = f'{EFFORT_KIND}: {kind}'
        what = (f'{of} holds no {gravity}: it looks as if gravity was taken out already; else a '
                'counterweight bears it, or the base stands otherwise than the model says')
    elif kind == NOISE_FREE:
        what = f'{of} holds no noise: it looks computed, not measured'
    elif kind == POSITION_ERROR and one.compliance:
        what = (f'{of} is {one.compliance:.2g} times what the model says: it looks like an error '
                'of position under the effort, or is in another unit')
    else:
        beside = [gravity] * one.lacks_gravity + ['friction'] * (not one.holds_friction)
        what = f'{of} holds no {" nor ".join([lacking, *beside])}: it looks like ' + (
            'an error of position, which grows with the velocity' if kind == POSITION_ERROR else
            'what a controller commands') + ', not like a measurement'
        line = f'{EFFORT_KIND}: {COMMANDED}' * (kind == COMMAND)
    return NoMeasurement.of(kind, model.drives, group, what, line)


def _share(share: float, doubt: float) -> str:
    # Adding 0 makes minus nothing nothing.
    return f'{round(share, 2) + 0.0:.2f} ± {doubt:.2f} of what the model has'
