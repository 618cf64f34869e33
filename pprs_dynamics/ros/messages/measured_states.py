# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Measured joint states of all drives, out of messages that may hold some of them each."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from pprs_dynamics.arrays import Array
from pprs_dynamics.measurement.files.merged_states import at_stamps
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, nanoseconds, read_drives
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection

PATIENCE = 1.0  # [s] for messages with the other drives; so far apart may stamps be, too
STEPS = 15  # samples before the present one that give the period of a drive


class MeasuredState(NamedTuple):
    """Stamp [ns], positions and efforts (D,) of the drives; efforts NaN where unknown."""

    stamp: int
    position: Array
    effort: Array


class MeasuredStates:
    """Reads joint states, and merges messages of different drives by their stamps.

    A message with all drives is one sample. Of others, as of several broadcasters, samples
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
            # No message came, or none was read: single drives cannot be judged.
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
        # Stamp, position and effort of the last samples of each drive.
        self._streams: dict[str, list[tuple[int, float, float]]] = {
            joint: [] for joint in self._joints}
        self._due: list[int] = []

    def _push(self, stamp: int, joint: str, position: float, effort: float) -> None:
        stream = self._streams[joint]
        if stream and stamp <= stream[-1][0]:  # a new stream
            self._forget()
        for other, samples in self._streams.items():
            apart = (stamp - samples[-1][0]) / NANOSECONDS if samples else 0.0
            if abs(apart) > PATIENCE:
                self._forget()
                raise Rejection('TIME', f'stamps of {joint} are {apart:.6g} s from those of '
                                f'{other}, must be within {PATIENCE:g} s')
        self._streams[joint].append((stamp, position, effort))
        if joint == self._joints[0]:
            self._due.append(stamp)

    def _completed(self) -> list[MeasuredState]:
        """Return the samples at whose stamps all drives are known by now."""
        if not all(self._streams.values()):
            return []
        latest = min(samples[-1][0] for samples in self._streams.values())
        due = np.array([stamp for stamp in self._due if stamp <= latest], dtype=np.int64)
        if not len(due):
            return []
        self._due = self._due[len(due):]
        position, effort = np.zeros((2, len(due), len(self._joints)))
        for k, samples in enumerate(self._streams.values()):
            times, *values = zip(*samples, strict=True)
            position[:, k], effort[:, k] = (at_stamps(due, times, series) for series in values)
            older = sum(time < due[-1] for time in times)
            del samples[:max(older - STEPS, 0)]
        return [MeasuredState(int(due[row]), position[row], effort[row])
                for row in range(len(due)) if np.isfinite(position[row]).all()]


def _missing(message: JointState, joint: str) -> Rejection:
    return Rejection('NAMES', f'name is {list(message.name)!r:.100}, must contain {joint}, or '
                     f'another message within {PATIENCE:g} s')
