# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Whether a joint_trajectory_controller follows what it is sent, by the state that it publishes.

A controller that drops a trajectory writes that into its own log only; the sender gets no answer.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.ros.force_command import STILL, DriveTrajectory, ForceCommand
from pprs_dynamics.ros.messages.conversions import LARGEST

STATE_TOPIC = 'controller_state'  # in the namespace of its joint_trajectory
LOOKED_BACK = 1.0  # [s] of what was sent and of where the controller went
# [s] without following, or without a state, before a fault is reported.
PATIENCE = 0.5
# Share of the way of a joint that moves: nearer to what was sent a controller follows, and one
# whose reference makes less of the way stands.
NEAR, STANDS = 0.25, 0.05
MOVES = 0.1  # joints that make at least that share of the longest way are looked at
SLOW = 3.0  # usual steps between states: longer ones are silence
LEAST_WAY = 1e-5  # [m, rad] in LOOKED_BACK; less is standing still
# [s] from sending to the end of a trajectory: messages were dropped that had been 11.5 ms on the
# way at the median, and a busy machine takes longer.
SHORT_END = 0.03


class SentPoints(NamedTuple):
    """A trajectory that was sent.

    Parameters
    ----------
    time : float
        When [s].
    position : (N, D) array
    left : float
        From then to its last point [s].
    moves_at_end : bool
    """

    time: float
    position: Array
    left: float
    moves_at_end: bool


class ControllerWatch:
    """Compares the reference of a controller with the trajectories that were sent to it.

    Parameters
    ----------
    joints : sequence of D str
        That are sent, in order.
    clock : callable, optional
        Returns a time that only goes on [s].
    """

    def __init__(self, joints: Sequence[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._joints, self._clock = tuple(joints), clock
        self._sent: deque[SentPoints] = deque()
        self._went: deque[tuple[float, Array]] = deque()
        self._heard, self._step, self._stands = -np.inf, 0.0, False
        self._first_sent = np.inf  # of a stream without a pause
        self._strays_since: float | None = None
        self._names: tuple[str, ...] = ()
        self._has_efforts = True
        self._hold_is_due = False

    @property
    def was_heard(self) -> bool:
        """Whether a state has ever come."""
        return bool(np.isfinite(self._heard))

    def sent(self, position: Array, left: float, moves_at_end: bool) -> None:
        """Store a published trajectory; see `SentPoints`."""
        now = self._clock()
        if not self._sent or now - self._sent[-1].time > LOOKED_BACK:
            self._first_sent, self._strays_since = now, None
        self._sent.append(SentPoints(now, np.array(position), left, moves_at_end))
        _forget(self._sent, now - LOOKED_BACK)

    def heard(self, state: Any, has_commanded: bool) -> None:
        """Take note of a controller's state.

        A controller that was silent before has just become active. It holds a pose without any
        effort by itself, so a hold is due if this node has commanded it before.

        Parameters
        ----------
        state : control_msgs/JointTrajectoryControllerState
        has_commanded : bool
            Whether this node has ever sent it a trajectory: another node may command it now.
        """
        now, reference = self._clock(), state.reference
        self._names = tuple(state.joint_names)
        self._has_efforts = bool(len(state.output.effort))
        silence, self._heard = now - self._heard, now
        # States may come less often than once a second.
        was_silent = silence > max(LOOKED_BACK, SLOW * self._step)
        self._hold_is_due |= was_silent and has_commanded
        self._step = silence if np.isfinite(silence) else 0.0
        # A reference that is no position of a drive is none.
        values = {joint: place for joint, place in zip(
            state.joint_names, reference.positions, strict=False) if abs(place) <= LARGEST}
        if was_silent or any(joint not in values for joint in self._joints):
            self._went.clear()
        self._stands = bool(np.all(np.abs(reference.velocities) <= STILL))
        if any(joint not in values for joint in self._joints):
            return
        place = np.array([values[joint] for joint in self._joints])
        self._went.append((now, place))
        while len(self._went) > 2 and self._went[0][0] < now - LOOKED_BACK:
            self._went.popleft()
        if not self._strays(place):
            self._strays_since = None
        elif self._strays_since is None:
            self._strays_since = now

    def require_hold(self) -> None:
        """Note that the controller has lost its trajectory and must be held."""
        self._hold_is_due = True

    def take_hold(self) -> Array | None:
        """Return reference positions (D,) where a hold is due, once; None while they move.

        The reference is at rest if the last two are the same and have no velocity.
        """
        if not self._hold_is_due or not self._stands or len(self._went) < 2:
            return None
        (_, before), (_, now) = list(self._went)[-2:]
        if (before != now).any():
            return None
        self._hold_is_due = False
        return now

    def fault(self) -> str:
        """Return that the controller does not follow, and the likely reason; '' where it does."""
        now = self._clock()
        _forget(self._sent, now - LOOKED_BACK)
        if not self._sent or now - self._first_sent < PATIENCE:
            return ''
        if now - self._heard > LOOKED_BACK:
            return ('no controller_state comes' + (' any more' if self.was_heard else '')
                    + ': is the controller active?')
        missing = [joint for joint in self._joints if joint not in self._names]
        if not missing and (self._strays_since is None or now - self._strays_since < PATIENCE):
            return ''
        return 'the controller does not follow: ' + next(self._reasons(missing))

    def _strays(self, reference: Array) -> bool:
        """Return whether a reference is far from the latest trajectories, or at rest meanwhile."""
        if not self._sent:
            return False
        sent = np.concatenate([setpoint.position for setpoint in self._sent])
        way = np.ptp(sent, axis=0)
        if way.max() < LEAST_WAY:
            return False
        moving = way >= MOVES * way.max()
        off = np.abs(sent - reference)[:, moving] / way[moving]
        gone = np.ptp([position for _, position in self._went], axis=0)
        full = self._went[-1][0] - self._went[0][0] > PATIENCE
        stands = full and (gone[moving] < STANDS * way[moving]).all()
        return bool(stands or off.max(axis=1).min() > NEAR)

    def _reasons(self, missing: Sequence[str]) -> Iterator[str]:
        """Yield possible reasons, likeliest first."""
        more = [name for name in self._names if name not in self._joints]
        if missing:
            yield f'it has no joint {missing[0]}'
        if more:
            yield (f'it has the joint {more[0]}, too, and takes trajectories without it only with '
                   'allow_partial_joints_goal: true')
        if not self._has_efforts:
            yield 'it has no command interface `effort`, and drops trajectories with efforts'
        left = float(np.median([setpoint.left for setpoint in self._sent]))
        if left < SHORT_END:
            when = (f'end {1e3 * left:.0f} ms after' if left > 0
                    else f'ended {-1e3 * left:.0f} ms before')
            yield (f'trajectories {when} they are sent on, and are dropped when they arrive later: '
                   'more points, or stamps further ahead')
        if self._sent[-1].moves_at_end:
            yield ('trajectories end in motion, which it takes only with '
                   'allow_nonzero_velocity_at_trajectory_end: true; or set stop_time here')
        yield 'its log has the reason'


def hold_controller(node: Node, watch: ControllerWatch, hold_at: Callable[[Array], ForceCommand],
                    send: Callable[[DriveTrajectory], None]) -> None:
    """Let a controller hold with gravity where it would hold without."""
    if (reference := watch.take_hold()) is None:
        return
    try:
        held = hold_at(reference)
        send(DriveTrajectory.holding(held.forces.drive_motion, held.effort))
    except PprsError as error:
        node.get_logger().warning(f'the controller holds without gravity: {error}')
    else:
        node.get_logger().info('the controller holds with gravity')


def _forget(entries: deque[Any], before: float) -> None:
    """Leave out entries whose first element is an earlier time."""
    while entries and entries[0][0] < before:
        entries.popleft()
