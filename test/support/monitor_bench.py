# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The monitor, what it says, and a robot that it watches."""

from __future__ import annotations

import numpy as np
from node_bench import Bench, overrides
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pprs_dynamics import DriveModel
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.monitor import MonitorNode

RATE = 500
ORDER = (3, 0, 5, 1, 4, 2)  # drives are matched by name, in any order
START = 1_700_000_000_000_000_000  # [ns]; stamps since 1970, as on a robot


class MonitorBench:
    """The node, what it says, and a robot whose efforts the model explains."""

    def __init__(self, running: Bench, **values: object) -> None:
        self.bench = running
        self.node = running.add(MonitorNode, parameter_overrides=overrides(
            **{'error_span': 0.5, **values}))
        self.model_effort = running.listen(JointState, '/monitor/model_effort', 1000)
        self.residual = running.listen(JointState, '/monitor/residual', 1000)
        self.error = running.listen(Float64MultiArray, '/monitor/error', 1000)
        running.follow_status('/monitor/status')
        self.publisher = running.probe.create_publisher(JointState, '/joint_states', 1000)
        if values.get('autostart', True):
            self.connect()
        motion = Excitation(6.0, seed=3).motion(np.arange(0, 6.0, 1 / RATE))
        forces = DriveModel.load().drive_forces(motion)
        self.position, self.effort = forces.mechanism.position, forces.total
        self.sent = self.published = 0  # samples, and messages of any kind

    def connect(self) -> None:
        """Wait until node and probe see each other on every topic."""
        assert self.bench.spin_until(self.publisher.get_subscription_count)
        assert self.bench.connected()

    def send(self, count: int, change: Array | float = 0.0) -> None:
        """Publish the next samples, efforts changed by a constant per drive."""
        for row in range(self.sent, self.sent + count):
            message = conversions.joint_state(
                START + row * 1_000_000_000 // RATE, self.effort[row] + change,
                self.position[row], self.position[row])
            message.velocity = []
            message.name = [DRIVES[k] for k in ORDER] + ['gripper']
            for field in ('position', 'effort'):
                values = list(getattr(message, field))
                setattr(message, field, [values[k] for k in ORDER] + [float('nan')])
            self.publish(message)
            # No faster than the node takes them: the queue is finite.
            if row % 20 == 0:
                assert self.arrived()
        self.sent += count
        assert self.arrived()
        self.bench.spin_for(0.2)

    def says(self, code: str) -> bool:
        """Spin until the status has a code."""
        return self.bench.spin_until(lambda: self.bench.status[-1]['code'] == code)

    def publish(self, message: JointState) -> None:
        self.publisher.publish(message)
        self.published += 1

    def arrived(self) -> bool:
        """Spin until the node has received all messages."""
        return self.bench.spin_until(lambda: self.node._counters['received'] >= self.published)
