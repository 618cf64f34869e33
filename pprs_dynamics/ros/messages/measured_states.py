# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measured joint states of all drives, out of messages that may hold some of them each."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from statistics import median
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.merged_states import LONGEST_STEP
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, nanoseconds, read_drives
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection

PATIENCE = 1.0  # [s] for messages with the other drives; so far apart may stamps be, too
STEPS = 15  # of a drive's stream, whose median is its period


class MeasuredState(NamedTuple):
    """Stamp [ns], positions and efforts (D,) of the drives; efforts NaN where unknown."""

    stamp: int
    position: Array
    effort: Array


class _Sample(NamedTuple):
    stamp: int
    position: float
    effort: float


class _Stream:
    """What came in of one drive: the sample before the one that is asked for, and all later."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()
        self._steps: deque[int] = deque(maxlen=STEPS)

    @property
    def newest(self) -> int | None:
        """Stamp of the newest sample [ns]; None: there is none."""
        return self._samples[-1].stamp if self._samples else None

    def push(self, sample: _Sample) -> None:
        if self._samples:
            self._steps.append(sample.stamp - self._samples[-1].stamp)
        self._samples.append(sample)

    def at(self, stamp: int) -> tuple[float, float] | None:
        """Return position and effort at a time [ns] that is not after the newest sample's.

        Exact where there is a sample, else on a straight line between its neighbours; None where
        these are too far apart. Later calls must ask for later times.
        """
        samples = self._samples
        while len(samples) > 1 and samples[1].stamp <= stamp:
            samples.popleft()
        before = samples[0]
        if before.stamp == stamp:
            return before.position, before.effort
        if before.stamp > stamp:
            return None
        after = samples[1]
        step = after.stamp - before.stamp
        if step > LONGEST_STEP * median(self._steps):
            return None
        share = (stamp - before.stamp) / step
        return (before.position + share * (after.position - before.position),
                before.effort + share * (after.effort - before.effort))


class MeasuredStates:
    """Reads joint states, and merges those that hold some of the drives each by their stamps.

    A message with all drives is a sample as it is. Of others, as of several broadcasters, samples
    are at the stamps of the first drive, as `pprs` reads recordings. Messages with no drive at
    all, as of a gripper, are passed over while the drives come in others.

    Parameters
    ----------
    joints : sequence of D str
        Names of the drives, in order.
    clock : callable, optional
        Returns a time that only goes on [s].
    """

    def __init__(self, joints: Sequence[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._joints, self._clock = tuple(joints), clock
        self._heard = dict.fromkeys(joints, -np.inf)
        self._whole = -np.inf  # when a message with all drives came last
        self._read_last = clock()
        self._forget()

    def read(self, data: bytes) -> list[MeasuredState]:
        """Return the samples that a message completes.

        Raises
        ------
        Rejection
            As `message_in` and `read_drives`; with `NAMES` where drives come in no message, with
            `TIME` where stamps of several are of different clocks.
        """
        message = message_in(data, JointState)
        now, stamp = self._clock(), nanoseconds(message.header.stamp)
        if (silent := now - self._read_last) > PATIENCE:
            # Nothing came, or nobody read: this tells nothing of single drives.
            self._heard = {joint: heard + silent for joint, heard in self._heard.items()}
            self._whole += silent
        self._read_last = now
        names = set(message.name)
        present = [joint for joint in self._joints if joint in names]
        absent = [joint for joint in self._joints
                  if joint not in names and now - self._heard[joint] > PATIENCE]
        if absent:
            self._forget()
        if not present:
            if absent:
                raise _missing(message, absent[0])
            return []
        position = read_drives(message, 'position', drives=present)
        effort = read_drives(message, 'effort', may_be_nan=True, drives=present)
        self._heard.update(dict.fromkeys(present, now))
        if len(present) == len(self._joints):
            self._whole = now
            self._forget()
            return [MeasuredState(stamp, position, effort)]
        if now - self._whole <= PATIENCE:
            return []
        for values in zip(present, position.tolist(), effort.tolist(), strict=True):
            self._push(stamp, *values)
        if absent:
            raise _missing(message, absent[0])
        return self._completed()

    def _forget(self) -> None:
        self._streams = {joint: _Stream() for joint in self._joints}
        self._due: deque[int] = deque()

    def _push(self, stamp: int, joint: str, position: float, effort: float) -> None:
        newest = self._streams[joint].newest
        if newest is not None and stamp <= newest:  # a new stream
            self._forget()
        for other, stream in self._streams.items():
            if stream.newest is not None and abs(
                    stamp - stream.newest) > PATIENCE * NANOSECONDS:
                apart = (stamp - stream.newest) / NANOSECONDS
                self._forget()
                raise Rejection('TIME', f'stamps of {joint} are {apart:.6g} s from those of '
                                f'{other}, must be within {PATIENCE:g} s')
        self._streams[joint].push(_Sample(stamp, position, effort))
        if joint == self._joints[0]:
            self._due.append(stamp)

    def _completed(self) -> list[MeasuredState]:
        """Return the samples at whose stamps all drives are known by now."""
        known = [stream.newest for stream in self._streams.values()]
        if None in known:
            return []
        latest = min(stamp for stamp in known if stamp is not None)
        found = []
        while self._due and self._due[0] <= latest:
            stamp = self._due.popleft()
            values = [stream.at(stamp) for stream in self._streams.values()]
            if None not in values:
                table = np.array(values, dtype=float)
                found.append(MeasuredState(stamp, table[:, 0].copy(), table[:, 1].copy()))
        return found


def _missing(message: JointState, joint: str) -> Rejection:
    return Rejection('NAMES', f'name is {list(message.name)!r:.100}, must hold {joint}, or another '
                     f'message within {PATIENCE:g} s')
