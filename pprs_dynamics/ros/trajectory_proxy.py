# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `trajectory_proxy`: goals of FollowJointTrajectory, passed on with efforts filled in.

MoveIt and other planners send goals to `~/follow_joint_trajectory`; the node computes the drives'
efforts at every point and sends the goal on to the controller's own action. Feedback, result and
cancelling pass through. A goal that breaks a rule, or asks for what the robot cannot do, is aborted
with the reason in `error_string`, and nothing reaches the controller. So is one whose controller
goes, or falls silent, in the middle of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse
from rclpy.serialization import serialize_message

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.preparation import prepare
from pprs_dynamics.physics.three_pprs.forward_motion import solve_forward_motion
from pprs_dynamics.ros.force_command import Feedforward, parameters_for
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.serialisation import CommandObjects
from pprs_dynamics.ros.messages.status_codes import Code, Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    SPLINE,
    TrajectoryRequest,
    read_joint_trajectory,
    reader_for,
)
from pprs_dynamics.ros.node.goal_relay import ControllerError, GoalRelay
from pprs_dynamics.ros.node.model_parameters import ExplainsRefusals, ModelParameters
from pprs_dynamics.ros.node.parameters import drive_count, own_parameter
from pprs_dynamics.ros.node.provenance import hardware_of
from pprs_dynamics.ros.node.status import StatusReporter

# Of the feedforward node's parameters, those that say what may go out.
SHARED = ('feedforward_scale', 'effort_limits', 'limit_policy', 'missing_derivatives')
ACTION = own_parameter('action', '/joint_trajectory_controller/follow_joint_trajectory',
                       'of the controller that the goals are passed on to', stays=True)
TIMEOUT = own_parameter('controller_timeout', 5.0, 'silence of the controller after which a goal '
                        'is aborted [s]; 0: only where it has gone', lower=0, upper=3600)
Goal = FollowJointTrajectory.Goal
Result = FollowJointTrajectory.Result


class TrajectoryProxyNode(ExplainsRefusals):
    """Passes goals on with the efforts that the model says."""

    def __init__(self, **options: Any) -> None:
        super().__init__('trajectory_proxy', allow_undeclared_parameters=True, **options)
        # Planners may leave derivatives out; feedforward, whose messages are short, refuses that.
        parameters = (ACTION, TIMEOUT, *(
            replace(one, default=SPLINE) if one.name == 'missing_derivatives' else one
            for one in parameters_for(drive_count(self)) if one.name in SHARED))
        self._settings = ModelParameters(self, parameters, lambda: None)
        own = self._settings.own
        prepare(self._settings.model)
        self._counters = {'received': 0, 'passed_on': 0, 'refused': 0}
        self._status = StatusReporter(self, {'action': own['action']}, self._counters,
                                      hardware_of(self._settings.model))
        self._relay = GoalRelay(self, FollowJointTrajectory, own['action'],
                                lambda: self._settings.own['controller_timeout'])
        self._server = ActionServer(
            self, FollowJointTrajectory, '~/follow_joint_trajectory', self._execute,
            cancel_callback=self._cancel)
        self._status.report('OK', 'WAITING', f'goals go to {own["action"]}')

    async def _execute(self, handle: Any) -> Any:
        self._counters['received'] += 1
        try:
            goal = self._filled(handle.request)
        except PprsError as error:
            reason = Rejection.of(error)
            return self._refused(handle, reason.code, reason.text)
        try:
            watched = await self._relay.accepted(handle, goal, self._duration(goal))
            self._counters['passed_on'] += 1
            self._status.report('OK', 'OK', 'a goal was passed on with its efforts')
            answer = await self._relay.finished(watched)
        except ControllerError as error:
            return self._refused(handle, 'CONTROLLER', str(error))
        if answer.status == GoalStatus.STATUS_SUCCEEDED:
            handle.succeed()
        elif answer.status == GoalStatus.STATUS_CANCELED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return answer.result

    def _cancel(self, handle: Any) -> CancelResponse:
        self._relay.cancel(handle)
        return CancelResponse.ACCEPT

    def _refused(self, handle: Any, status: Code, text: str) -> Any:
        self._counters['refused'] += 1
        self._status.report('ERROR', status, text)
        self.get_logger().warning(f'refused, {status}: {text}', throttle_duration_sec=1.0)
        handle.abort()
        return Result(error_code=Result.INVALID_GOAL, error_string=f'{status}: {text}')

    def _filled(self, goal: Any) -> Any:
        """Return the goal for the controller: of all drives, with their efforts.

        Raises
        ------
        PprsError
            Where it breaks a rule.
        """
        model, own = self._settings.model, self._settings.own
        feedforward = Feedforward(model, own)
        answer = feedforward.answer(self._request(model, goal))
        trajectory = CommandObjects(RobotNames.of(model)).joint_trajectory(
            0, answer.request.offsets, answer.forces, answer.effort)
        given = goal.trajectory if goal.trajectory.points else goal.multi_dof_trajectory
        trajectory.header = given.header  # a stamp of 0 means: at once, when it arrives
        return Goal(
            trajectory=trajectory, path_tolerance=goal.path_tolerance,
            goal_tolerance=goal.goal_tolerance, goal_time_tolerance=goal.goal_time_tolerance)

    def _duration(self, goal: Any) -> float:
        """Return how long from now a goal's motion may take [s]."""
        start = conversions.nanoseconds(goal.trajectory.header.stamp)
        ahead = max(start - self.get_clock().now().nanoseconds, 0) if start else 0
        return (ahead + conversions.nanoseconds(goal.trajectory.points[-1].time_from_start)
                + conversions.nanoseconds(goal.goal_time_tolerance)) / conversions.NANOSECONDS

    def _request(self, model: Any, goal: Any) -> TrajectoryRequest:
        now = self.get_clock().now().nanoseconds
        missing = self._settings.own['missing_derivatives']
        if not isinstance(model, DriveModel):
            return reader_for(model).read(serialize_message(goal.trajectory), now, missing)
        if not goal.trajectory.points:
            return reader_for(model).read(
                serialize_message(goal.multi_dof_trajectory), now, missing)
        # Drives' positions: the platform's motion follows from them.
        request = read_joint_trajectory(
            goal.trajectory, RobotNames.of(model).joints, now, missing)
        drives: Any = request.motion
        found = solve_forward_motion(
            model.robot.geometry, drives.position, drives.velocity, drives.acceleration)
        return TrajectoryRequest(found.motion, request.start, request.offsets)
