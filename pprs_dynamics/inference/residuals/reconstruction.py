# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Reconstruction of the mechanism's motion from measured drive positions, sample by sample.

Per segment: equal steps, smoothed position, velocity and acceleration of the drives, and, for a
3-PPRS, forward kinematics that follows the branch, and the platform's twist and acceleration
through the Jacobian. Effort is only cut to the same samples. `Reconstruction.treat` is for both
sides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import MotionError, WorkspaceError
from pprs_dynamics.measurement.files.samples import Progress
from pprs_dynamics.measurement.motion.differentiation import Smoothing
from pprs_dynamics.measurement.motion.drive_motion import (
    DriveMotion,
    smooth_drives,
    smoothed_again,
    smoothed_as,
)
from pprs_dynamics.measurement.motion.rests import find_rests, rest_speeds
from pprs_dynamics.measurement.motion.treatment import Treatment
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.effects.laws.elastic_joint import LINK_POSITION
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.model.drive_model import DriveModel

if TYPE_CHECKING:
    from pprs_dynamics.measurement.files.recording import Recording

POSITION_STEP = 1e-4  # [m, rad], for derivatives of errors by positions
CHUNK = 4_000  # samples at a time; a million at once would take gigabytes
MOST_KEPT = 2 ** 27  # bytes of kinematics, of a recording on which many models are evaluated
MOTION = ('position', 'velocity', 'acceleration')


@dataclass(frozen=True)
class Chunk:
    """Consecutive whole blocks of one segment.

    Parameters
    ----------
    motion : JointMotion
        With times.
    samples, blocks : slice
        Its place in the reconstruction, before and after treatment.
    is_start : bool
        True where a segment starts: effects with memory start afresh.
    treat : Treatment
        For these samples alone.
    """

    motion: JointMotion
    samples: slice
    blocks: slice
    is_start: bool
    treat: Treatment


@dataclass(frozen=True)
class Reconstruction(DriveMotion):
    """Motion of the drives with effort; N samples, and M blocks of them.

    Parameters
    ----------
    time : (N,) array
        [s].
    effort : (N, D) array
        As measured [N]; NaN where it was not, where a drive stands whose effort then means
        nothing, and where it is late and of motion before its segment.
    treat : Treatment
        What effort and model both get: values (N, k) -> (M, k).
    gain : (D,) array
        By which recorded currents were multiplied [N m/A, N/A]; NaN where efforts were recorded.
    start : float
        Time of the recording's first sample, which may be dropped here [s].
    channels : mapping of str to (N, D) array
        Further channels of the drives, interpolated by straight lines; NaN in drives that lack
        them.
    recorded : Recording
        What it is of.
    read : DriveMotion
        The motion of the drives as their encoders say.
    windup : (3, N, D) array or None
        By how much these lead the links, as second encoders say, with its rates; 0 in drives
        without one, None where no drive has one.
    keeps : bool
        Whether it keeps kinematics, `MOST_KEPT` of them, because many models are evaluated on it.
    """

    time: Array
    effort: Array
    treat: Treatment
    gain: Array
    start: float
    channels: Mapping[str, Array]
    recorded: Recording
    read: DriveMotion
    windup: Array | None
    keeps: bool = False

    def __len__(self) -> int:
        return len(self.time)

    @property
    def motion(self) -> JointMotion:
        """The motion without times, which need not increase from segment to segment."""
        return JointMotion(self.position, self.velocity, self.acceleration)

    def recorded_share(self, model: DriveModel) -> Array:
        """Return by what a model's efforts are multiplied to be those of the recording, (D,).

        1, but for currents that another gain than the model's made efforts of.
        """
        if model.gain is None:
            return np.ones_like(self.gain)
        return np.where(np.isfinite(self.gain), self.gain / np.asarray(model.gain), 1.0)

    def with_known_past(self, delays: Array) -> Reconstruction:
        """Return this without the efforts of motion that is not in their segment.

        Parameters
        ----------
        delays : (D,) array
            By which efforts are measured late; early where negative [s].
        """
        effort = self.effort.copy()
        for part, grid in zip(self.segments, self.grids, strict=True):
            # A delay is known to half a step.
            time, late = self.time[part, None], np.abs(delays) + grid.step / 2
            effort[part][(delays > 0) & (time - time[0] < late)
                         | (delays < 0) & (time[-1] - time < late)] = np.nan
        return replace(self, effort=effort)

    def chunks(self, samples: int = CHUNK) -> Iterator[Chunk]:
        """Yield whole blocks of at most about `samples` samples, segment by segment."""
        starts = self.treat.starts
        for segment in self.segments:
            first = int(np.searchsorted(starts, segment.start))
            end = int(np.searchsorted(starts, segment.stop))
            while first < end:
                last = int(np.searchsorted(starts, starts[first] + samples, side='right')) - 1
                last = min(max(last, first + 1), end)
                stop = int(starts[last]) if last < len(starts) else len(self)
                rows = slice(int(starts[first]), stop)
                measured = {name: values[rows] for name, values in self.channels.items()}
                motion = self.motion[rows].with_time(self.time[rows]).with_channels(measured)
                yield Chunk(replace(motion, kept=self._kept_of(rows.start)), rows,
                            slice(first, last), rows.start == segment.start,
                            self.treat.blocks(first, last))
                first = last

    @cached_property
    def _kept(self) -> dict[int, dict[Any, LinkMotion]]:
        """Kinematics that are kept, by first sample of a chunk and by structure."""
        return {}

    def _kept_of(self, first: int) -> dict[Any, LinkMotion] | None:
        """Return where the kinematics of a chunk are kept; None where they are not."""
        if not self.keeps:
            return None
        size = sum(links.rows.nbytes for kept in self._kept.values() for links in kept.values())
        return self._kept.setdefault(first, {}) if size < MOST_KEPT else self._kept.get(first)


def reconstruct(model: DriveModel, recording: Recording) -> Reconstruction:
    """Return the motion and effort behind a recording.

    Parameters
    ----------
    model : DriveModel
    recording : Recording

    Raises
    ------
    MotionError
        Where no segment is long enough, or the drives are not the model's.
    WorkspaceError, SingularityError
        Of a model whose encoders err by loads, see `DriveModel.drive_forces`.
    """
    names = model.drives
    if tuple(recording.drives) != names:
        order = ', in this order' if len(names) > 1 else ''
        raise MotionError('drives', f'they are {", ".join(recording.drives)}',
                          f'be {", ".join(names)}{order}', 'shape')
    unit = 'rad' if all(units.turns for units in model.units) else 'm'
    drives = smooth_drives(recording, model.blocks_per_period, unit)
    read, time, total = drives, recording.time[drives.index], len(drives.index)
    effort = _efforts(model, recording)[drives.index]
    windup = _windup(recording, read)
    drives = _followed_rightly(model, recording, read, windup)
    dropped = sum(part.stop - part.start for part in recording.segments) - total
    notes = [*drives.notes, f'{dropped} samples are dropped: half a window at the ends of '
             f'{len(drives.segments)} segments, what fills no block, and segments too short']
    rests = np.isfinite(recording.effort[drives.index]) & np.isnan(effort)
    if np.any(rests):
        shares = (f'{name} {share:.0%}' for name, share in zip(
            names, rests.mean(axis=0), strict=True) if share >= 0.005)
        notes.append('efforts of drives at rest do not count, static friction balances any: '
                     + (', '.join(shares) or 'less than 0.5% of the time'))
    drives = replace(drives, notes=tuple(notes))
    gain = np.full(len(names), np.nan) if recording.gain is None else recording.gain
    return Reconstruction(
        **vars(drives), time=time, effort=effort,
        treat=Treatment(drives.block_starts, total), gain=gain,
        start=float(recording.time[0]), channels=_channels(recording, drives.index),
        recorded=recording, read=read, windup=windup).with_known_past(model.lateness)


def read_by(reconstruction: Reconstruction, model: DriveModel) -> Reconstruction:
    """Return the reconstruction with drive positions by another model's encoders.

    Blocks do not depend on them.

    Raises
    ------
    WorkspaceError, SingularityError
        See `reconstruct`.
    """
    drives = _followed_rightly(model, reconstruction.recorded, reconstruction.read,
                               reconstruction.windup)
    return replace(reconstruction, position=drives.position, velocity=drives.velocity,
                   acceleration=drives.acceleration, smoothing=drives.smoothing, keeps=False)


def misread(effects: Sequence[MeasurementEffect], names: Sequence[str], recording: Recording,
            read: DriveMotion, drive: int | None = None, smoothing: Smoothing | None = None,
            ) -> tuple[Array, Array, Array]:
    """Return the errors of position, velocity and acceleration that were measured, (N, D) each.

    Smoothed as these are, or otherwise, but for functions of the position, whose rates follow from
    its own; of one drive (N, 1).
    """
    chosen = slice(None) if drive is None else [drive]

    def errors(of: Sequence[MeasurementEffect], position: Array) -> Array:
        found = np.zeros_like(position)
        for effect in of:
            found += effect.position_error(names, position)
        return found

    q, v, a = (values[:, chosen] for values in (read.position, read.velocity, read.acceleration))
    functions = [effect for effect in effects if effect.is_of_position]
    before, at, after = (errors(functions, q + step) for step in (-POSITION_STEP, 0.0,
                                                                  POSITION_STEP))
    slope = (after - before) / (2 * POSITION_STEP)
    found = at, slope * v, slope * a + (after - 2 * at + before) / POSITION_STEP ** 2 * v ** 2
    others = [effect for effect in effects if not effect.is_of_position]
    if not others:
        return found
    smoothed = smoothed_as(read, recording,
                           lambda position: errors(others, position[:, chosen]), smoothing)
    return found[0] + smoothed[0], found[1] + smoothed[1], found[2] + smoothed[2]


def _followed_rightly(model: DriveModel, recording: Recording, read: DriveMotion,
                      windup: Array | None) -> DriveMotion:
    """Return the true motion of the drives behind that which was read."""
    if not model.position_effects:
        return read
    q, q_dot, q_ddot = misread(model.position_effects, model.drives, recording, read)
    drives = replace(read, position=read.position - q, velocity=read.velocity - q_dot,
                     acceleration=read.acceleration - q_ddot)
    if np.any(q_dot) and not all(effect.is_of_position for effect in model.position_effects):
        drives = smoothed_again(drives, recording,
                                lambda position: position - model.position_error(position))
    if not np.any(model.loaded_position_error(np.ones((1, len(model.drives))))):
        return drives
    followed = JointMotion(drives.position, drives.velocity, drives.acceleration)
    # Loads hardly change by what they do to positions: one step is enough.
    load = np.concatenate([
        model.mechanism(followed[start:start + CHUNK]).transmitted
        for start in range(0, len(followed), CHUNK)])
    drives = replace(drives, position=drives.position - model.loaded_position_error(load))
    if windup is not None:
        q, q_dot, q_ddot = model.windup_error(load, windup)
        drives = replace(drives, position=drives.position - q, velocity=drives.velocity - q_dot,
                         acceleration=drives.acceleration - q_ddot)
    return drives


def _windup(recording: Recording, read: DriveMotion) -> Array | None:
    """Return by how much encoders lead links, with its rates, (3, N, D), None without a second."""
    if LINK_POSITION not in recording.channels:
        return None
    link = _channels(recording, np.arange(len(recording.time), dtype=float))[LINK_POSITION]
    ahead = np.nan_to_num(recording.position - link)
    return np.stack(smoothed_as(read, replace(recording, position=ahead), lambda values: values))


def _channels(recording: Recording, index: Array) -> dict[str, Array]:
    """Return further channels at some samples, (N, D) by name."""
    found = {}
    for name, values in recording.channels.items():
        filled = np.full((len(index), values.shape[1]), np.nan)
        for d in range(values.shape[1]):
            known = np.flatnonzero(np.isfinite(values[:, d]))
            if len(known):
                filled[:, d] = np.interp(index, known, values[known, d])
        found[name] = filled
    return found


def _efforts(model: DriveModel, recording: Recording) -> Array:
    """Return the efforts of a recording, NaN where a drive stands between motions.

    Where poses are held throughout, their efforts count: they show gravity and offsets.
    """
    effort = recording.effort
    if model.rest_speed and not recording.are_poses:
        effort = effort.copy()
        for part in recording.segments:
            step = float(np.median(np.diff(recording.time[part])))
            position = recording.position[part]
            speeds = rest_speeds(position, step, model.rest_speed)
            effort[part][find_rests(position, step, speeds)] = np.nan
    return effort


def measured_forces(
    model: DriveModel, reconstruction: Reconstruction,
) -> Iterator[tuple[Chunk, Any, dict[str, Array]]]:
    """Yield chunk by chunk what the model returns, and its efforts as the sensors would see them.

    Effects with memory run through each segment and start afresh in the next.
    """
    share = reconstruction.recorded_share(model)
    state = model.initial_state(reconstruction.start)
    for chunk in reconstruction.chunks():
        if chunk.is_start:
            state = model.initial_state(reconstruction.start)
        try:
            forces = model.measured(model.drive_forces(chunk.motion, state), state)
        except WorkspaceError as error:
            sample = chunk.samples.start + error.sample
            raise type(error)(
                int(reconstruction.index[sample]),
                f'at {reconstruction.time[sample]:.6g} s {error.found}', error.rule) from None
        yield chunk, forces, {name: values * share for name, values in {
            **forces.parts, 'total': forces.total}.items()}


def treated_forces(
    model: DriveModel, reconstruction: Reconstruction, progress: Progress | None = None,
    more: Callable[[Any, Treatment], Mapping[Any, Array]] = lambda forces, treat: {},
) -> dict[Any, Array]:
    """Return the model's forces on a reconstruction, treated: parts and their 'total', (M, D) [N].

    Parameters
    ----------
    model : DriveModel
    reconstruction : Reconstruction
    progress : callable, optional
        Called with (samples done, all) now and then.
    more : callable, optional
        Returns further quantities of the same evaluation by name, (M, ...) each, from what
        `drive_forces` of the model returns, and the treatment for its samples.

    Raises
    ------
    WorkspaceError, SingularityError
        See `DriveModel.drive_forces`.
    """
    treated: dict[Any, Array] = {}
    for chunk, forces, efforts in measured_forces(model, reconstruction):
        means = {name: chunk.treat(values) for name, values in efforts.items()}
        for name, values in {**means, **more(forces, chunk.treat)}.items():
            if name not in treated:
                treated[name] = np.empty((len(reconstruction.treat), *values.shape[1:]))
            treated[name][chunk.blocks] = values
        if progress is not None:
            progress(chunk.samples.stop, len(reconstruction))
    return treated
