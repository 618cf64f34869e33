# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The floor: a node as rclpy's tutorials write it, that answers six zeros and calculates nothing.

Same subscription, publication and QoS as `feedforward`; with the argument `joints` that of an arm.
"""

from __future__ import annotations

import sys
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory


class EchoNode(Node):
    """Publishes one message for each that arrives."""

    def __init__(self) -> None:
        super().__init__('echo')
        qos = QoSProfile(depth=100)
        self._commands = self.create_publisher(Float64MultiArray, '~/commands', qos)
        kind = JointTrajectory if 'joints' in sys.argv[1:] else MultiDOFJointTrajectory
        self.create_subscription(kind, '~/trajectory', self._answer, qos)

    def _answer(self, message: JointTrajectory | MultiDOFJointTrajectory) -> None:
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
