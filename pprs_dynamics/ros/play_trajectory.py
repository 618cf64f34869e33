# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `play_trajectory`: publishes a path of the platform, or of joints, then ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.errors import ModelError
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.physics.mechanism.paths import Excitation, HelicalPath, sampled, with_lead_in
from pprs_dynamics.physics.model.keys import is_described
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.trajectory_request import Motion
from pprs_dynamics.ros.node.clocks import MISSING_CLOCK, clock_is_missing, steady_timer
from pprs_dynamics.ros.node.parameters import (
    declare_node_parameters,
    declared_model,
    node_parameter,
    overrides,
    refuse_unknown,
    with_changed,
)
from pprs_dynamics.ros.node.provenance import arguments_of
from pprs_dynamics.ros.node.qos import publisher
from pprs_dynamics.ros.run_node import Finished
from pprs_dynamics.simulation.injection import draw_motion
from pprs_dynamics.simulation.motion_files import read_poses

# Fast DDS asks subscribers every 3 s what they have received; they do not report it unasked.
ACKNOWLEDGED = Duration(seconds=4.0)
EXCITATION = 'excitation'
SOURCES = ('helix', EXCITATION, 'csv')

PARAMETERS = (
    node_parameter('source', 'helix', 'what to play', choices=SOURCES),
    node_parameter('file', '', 'CSV of poses, for source csv'),
    node_parameter('rate', 100.0, 'messages per second [Hz]', lower=0.1, upper=10_000),
    # (points - 1) / rate + ahead is how long a message may be on its way before a
    # joint_trajectory_controller drops it; messages took 11.5 ms at the median where it did.
    node_parameter('points', 10, 'points per message: the present one and those that follow',
                   lower=1),
    node_parameter('repeat', 1, 'number of repetitions; 0: until stopped', lower=0),
    node_parameter('duration', 20.0, 'length of an excitation [s]', lower=0.1),
    node_parameter('seed', 0, 'seed of an excitation', lower=0),
    node_parameter('lead_in', 0.0, 'time to go from the home pose to where the path starts [s]; '
                   '0: start there', lower=0),
    node_parameter('ahead', 0.02, 'time from sending a message to its stamp [s]',
                   lower=0),
)


# A node that was kept for longer than this [s] goes on from now instead of catching up.
LONGEST_CATCH_UP = 0.1

# Of an arm or a robot with loops: what goes with its model, given as to the other nodes.
OF_JOINTS = tuple(parameter for parameter in with_changed(
    PARAMETERS, 'source', default=EXCITATION, choices=(EXCITATION,))
    if parameter.name not in ('file', 'lead_in'))


class PlayTrajectoryNode(Node):
    """Publishes one message per period, once `feedforward/trajectory` has a subscriber.

    With the model file of an arm or of a robot with loops it plays an excitation of its drives.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('play_trajectory', **options)
        joints = is_described(overrides(self))
        values = declare_node_parameters(self, OF_JOINTS if joints else PARAMETERS)
        self._rate, self._points, self._repeat = values['rate'], values['points'], values['repeat']
        self._ahead = round(values['ahead'] * conversions.NANOSECONDS)
        self._beats = Beats(conversions.NANOSECONDS / self._rate)
        self._motion: Motion
        if joints:
            self._motion, self._write = _joints(self, values, arguments_of(options))
        else:
            refuse_unknown(self)
            self._motion, self._write = _path(values), conversions.write_trajectory
        self._next, self._round = 0, 1
        self._publisher = publisher(
            self, JointTrajectory if joints else MultiDOFJointTrajectory, 'feedforward/trajectory')
        self.get_logger().info(
            f'{values["source"]}, {len(self._motion)} messages at {self._rate:g} Hz; waiting for '
            f'a listener on {self._publisher.topic_name}')
        self.create_timer(1.0 / self._rate, self._tick)
        steady_timer(self, 1.0, self._look_at_clock)

    def _tick(self) -> None:
        if self._next == 0 and self._round == 1 and not self._publisher.get_subscription_count():
            return
        now = self.get_clock().now().nanoseconds
        # A timer skips the periods that it missed; all later stamps would then be late.
        for beat in self._beats.due(now):
            self._play(beat)

    def _play(self, beat: int) -> None:
        """Publish the next message, which belongs to a moment [ns]."""
        if self._next == len(self._motion):
            if self._round == self._repeat:
                # End when the last message has arrived, but do not wait for a stuck subscriber.
                if not self._publisher.wait_for_all_acked(ACKNOWLEDGED):
                    self.get_logger().warning('a listener did not take the last messages')
                self.get_logger().info(f'played {self._round * len(self._motion)} messages')
                raise Finished
            self._next, self._round = 0, self._round + 1
        part = self._motion[self._next:self._next + self._points]
        offsets = [round(k * conversions.NANOSECONDS / self._rate) for k in range(len(part))]
        self._publisher.publish(self._write(part, conversions.time(beat + self._ahead), offsets))
        self._next += 1

    def _look_at_clock(self) -> None:
        if clock_is_missing(self):
            self.get_logger().warning(MISSING_CLOCK, throttle_duration_sec=5.0)


class Beats:
    """Moments of a stream of messages, evenly spaced, whatever the timer misses.

    Parameters
    ----------
    period : float
        [ns].
    """

    def __init__(self, period: float) -> None:
        self._period = round(period)
        self._next: int | None = None

    def due(self, now: int) -> Iterator[int]:
        """Yield the moments that have come by now [ns]; the first is now.

        After a standstill of more than `LONGEST_CATCH_UP`, and where the clock was set back, the
        stream goes on from now.
        """
        late = 0 if self._next is None else now - self._next
        if self._next is None or not (
                -2 * self._period <= late <= LONGEST_CATCH_UP * conversions.NANOSECONDS):
            self._next = now
        while self._next <= now:
            yield self._next
            self._next += self._period


def _joints(node: Node, values: dict[str, Any], arguments: Sequence[str],
            ) -> tuple[JointMotion, Callable[..., Any]]:
    """Return an excitation of the drives of the node's model, and what writes its messages."""
    model = declared_model(node, arguments, values)
    drawn = draw_motion(model, values['duration'], values['seed'], values['rate'])
    # One step beyond the end, which is where it began, at rest.
    motion = JointMotion(*(np.concatenate((values, values[:1])) for values in (
        drawn.position, drawn.velocity, drawn.acceleration)))
    return motion, partial(conversions.write_joint_trajectory, names=RobotNames.of(model))


def _path(values: dict[str, Any]) -> PlatformMotion:
    if values['source'] == 'csv':
        if not values['file']:
            raise ModelError('file', '', 'be a CSV of poses where source is csv')
        motion = read_poses(values['file']).resampled(values['rate'])
    else:
        path = (Excitation(duration=values['duration'], seed=values['seed'])
                if values['source'] == EXCITATION else HelicalPath())
        # One step beyond the end, held there: the last message is the pose at rest.
        motion = sampled(path, values['rate'], beyond=1)
    if values['repeat'] != 1 and not motion.is_closed():
        raise ModelError('repeat', values['repeat'],
                         'be 1 for a path that does not end where it starts')
    return with_lead_in(motion, values['lead_in'], values['rate'])
