"""Node `feedforward`: platform pose trajectories in, six drive forces out."""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from pprs_dynamics.errors import PprsError
from pprs_dynamics.model.drive_model import DriveForces
from pprs_dynamics.nodes import conversions
from pprs_dynamics.nodes.conversions import TrajectoryRequest
from pprs_dynamics.nodes.model_parameters import ModelParameters
from pprs_dynamics.nodes.parameters import NodeParameter, declare_own
from pprs_dynamics.nodes.qos import EVERY_MESSAGE
from pprs_dynamics.nodes.rejection import CODES, Rejection
from pprs_dynamics.nodes.status import StatusReporter

PARAMETERS = (
    NodeParameter('max_age', 0.0, 'oldest header stamp that is accepted [s]; 0: any', lower=0),
)


class FeedforwardNode(Node):
    """Answers every valid trajectory with friction-compensated drive forces.

    A message that breaks a rule is rejected whole: nothing goes out, a counter rises, and the
    reason stands in `~/status` and in the log.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('feedforward', allow_undeclared_parameters=True, **options)
        declare_own(self, PARAMETERS)
        self._parts: dict[str, Any] = {}
        self._settings = ModelParameters(self, PARAMETERS, self._use_model)
        self._model = self._settings.model
        self._state = self._model.initial_state()
        self._use_model()
        self._counters = {'received': 0, 'accepted': 0, **dict.fromkeys(CODES, 0)}
        self._status = StatusReporter(
            self, {'taken_from_paper': self._settings.taken_from_paper}, self._counters)
        self._commands = self.create_publisher(Float64MultiArray, '~/commands', EVERY_MESSAGE)
        self._joint_command = self.create_publisher(
            JointState, '~/joint_command', EVERY_MESSAGE)
        self._joint_trajectory = self.create_publisher(
            JointTrajectory, '~/joint_trajectory', EVERY_MESSAGE)
        self.create_subscription(
            MultiDOFJointTrajectory, '~/trajectory', self._on_trajectory, EVERY_MESSAGE)
        self.get_logger().info(
            f'equations {self._model.equations}, effects '
            f'{", ".join(effect.name for effect in self._model.effects)}; ready')

    def _on_trajectory(self, message: MultiDOFJointTrajectory) -> None:
        self._counters['received'] += 1
        try:
            request = conversions.read_trajectory(
                message, self.get_clock().now().nanoseconds, self._settings.own['max_age'])
            forces = self._answer(request)
        except PprsError as error:
            self._reject(Rejection.of(error))
            return
        self._counters['accepted'] += 1
        self._publish(request, forces)
        self._status.report('OK', 'OK', 'commands follow the trajectory')

    def _answer(self, request: TrajectoryRequest) -> DriveForces:
        model, state = self._model, self._state
        forces = model.drive_forces(request.motion, state.copy())
        mechanism = forces.mechanism
        for name, quantity in (('force', forces.total), ('drive velocity', mechanism.velocity),
                               ('drive acceleration', mechanism.acceleration)):
            if not np.all(np.isfinite(quantity)):
                raise Rejection('OUTPUT', f'the model gave a {name} that is not finite')
        model.limits.check_strokes(mechanism.position)
        model.limits.check_efforts(forces.total)
        # Memory advances with what is executed, the first point, and only once it is accepted.
        if state.has_memory:
            model.drive_forces(request.motion[:1], state)
        return forces

    def _publish(self, request: TrajectoryRequest, forces: DriveForces) -> None:
        self._commands.publish(conversions.commands(forces))
        if self._joint_command.get_subscription_count():
            self._joint_command.publish(conversions.joint_command(request, forces))
        if self._joint_trajectory.get_subscription_count():
            self._joint_trajectory.publish(conversions.joint_trajectory(request, forces))
        for name, publisher in self._parts.items():
            if publisher.get_subscription_count():
                publisher.publish(conversions.effort_part(request, forces.parts[name]))

    def _reject(self, rejection: Rejection) -> None:
        self._counters[rejection.code] += 1
        self._status.report('ERROR', rejection.code, rejection.text)
        self.get_logger().warning(f'rejected, {rejection}', throttle_duration_sec=1.0)

    def _use_model(self) -> None:
        model = self._settings.model
        self._state = model.continued_state(self._model, self._state)
        self._model = model
        names = ['rigid_body', *(e.name for e in self._model.effects if not e.is_measurement)]
        for name in self._parts.keys() - set(names):
            self.destroy_publisher(self._parts[name])
        self._parts = {
            name: self._parts.get(name) or self.create_publisher(
                JointState, f'~/effort/{name}', EVERY_MESSAGE)
            for name in names}
