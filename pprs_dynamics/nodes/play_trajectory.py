"""Node `play_trajectory`: publishes a path of the platform in real time, then ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectory

from pprs_dynamics.errors import ModelError
from pprs_dynamics.measurement.pose_files import read_poses
from pprs_dynamics.mechanism.motion import PlatformMotion
from pprs_dynamics.mechanism.paths import Excitation, HelicalPath
from pprs_dynamics.nodes import conversions
from pprs_dynamics.nodes.qos import EVERY_MESSAGE
from pprs_dynamics.nodes.run import Finished

SOURCES = ('helix', 'excitation', 'csv')

PARAMETERS: dict[str, tuple[Any, str]] = {
    'source': ('helix', f'what to play: {", ".join(SOURCES)}'),
    'file': ('', 'CSV of poses, for source csv'),
    'rate': (100.0, 'messages per second, greater than 0 [Hz]'),
    'points': (1, 'points per message, at least 1: the present one and those that follow'),
    'repeat': (1, 'how often to play; 0: until stopped'),
    'duration': (20.0, 'length of an excitation, greater than 0 [s]'),
    'seed': (0, 'of an excitation, at least 0'),
}


class PlayTrajectoryNode(Node):
    """Publishes one message per period, once somebody listens on `feedforward/trajectory`."""

    def __init__(self, **options: Any) -> None:
        super().__init__('play_trajectory', **options)
        values = {}
        for name, (default, description) in PARAMETERS.items():
            self.declare_parameter(name, default, ParameterDescriptor(
                description=description, dynamic_typing=True, read_only=True))
            values[name] = self.get_parameter(name).value
        _require_possible(values)
        self._rate, self._points, self._repeat = values['rate'], values['points'], values['repeat']
        self._motion = _path(values)
        self._next, self._round = 0, 1
        self._publisher = self.create_publisher(
            MultiDOFJointTrajectory, 'feedforward/trajectory', EVERY_MESSAGE)
        self.get_logger().info(
            f'{values["source"]}, {len(self._motion)} messages at {self._rate:g} Hz; waiting for '
            f'a listener on {self._publisher.topic_name}')
        self.create_timer(1.0 / self._rate, self._tick)

    def _tick(self) -> None:
        if self._next == 0 and not self._publisher.get_subscription_count():
            return
        if self._next == len(self._motion):
            if self._round == self._repeat:
                # Leave only when the last message has arrived.
                self._publisher.wait_for_all_acked()
                self.get_logger().info(f'played {self._round * len(self._motion)} messages')
                raise Finished
            self._next, self._round = 0, self._round + 1
        part = self._motion[self._next:self._next + self._points]
        offsets = [round(k * conversions.NANOSECONDS / self._rate) for k in range(len(part))]
        self._publisher.publish(conversions.write_trajectory(
            part, self.get_clock().now().to_msg(), offsets))
        self._next += 1


def _path(values: dict[str, Any]) -> PlatformMotion:
    if values['source'] == 'csv':
        return read_poses(values['file']).resampled(values['rate'])
    path: HelicalPath | Excitation = HelicalPath()
    if values['source'] == 'excitation':
        path = Excitation(duration=values['duration'], seed=values['seed'])
    return path.motion(np.arange(0.0, path.duration, 1.0 / values['rate']))


def _require_possible(values: dict[str, Any]) -> None:
    rules = {
        'source': values['source'] in SOURCES,
        'file': values['source'] != 'csv' or bool(values['file']),
        **{name: _is_number(values[name]) and values[name] > 0 for name in ('rate', 'duration')},
        'points': type(values['points']) is int and values['points'] >= 1,
        'repeat': type(values['repeat']) is int and values['repeat'] >= 0,
        'seed': type(values['seed']) is int and values['seed'] >= 0}
    for name, good in rules.items():
        if not good:
            raise ModelError(name, values[name], f'be {PARAMETERS[name][1]}')


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)
