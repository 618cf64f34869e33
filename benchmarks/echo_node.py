# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The floor: a node as rclpy's tutorials write it, that answers six zeros and calculates nothing.

Same subscription, publication and QoS as `feedforward`.
"""

from __future__ import annotations

import sys
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory


class EchoNode(Node):
    """Publishes one message for each that arrives."""

    def __init__(self) -> None:
        super().__init__('echo')
        qos = QoSProfile(depth=100)
        self._commands = self.create_publisher(Float64MultiArray, '~/commands', qos)
        self.create_subscription(MultiDOFJointTrajectory, '~/trajectory', self._answer, qos)

    def _answer(self, message: MultiDOFJointTrajectory) -> None:
        self._commands.publish(Float64MultiArray(data=[0.0] * 6))


def main() -> int:
    """Run until it is stopped."""
    rclpy.init()
    executor = SingleThreadedExecutor()
    executor.add_node(EchoNode())
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()
    return 0


if __name__ == '__main__':
    sys.exit(main())
