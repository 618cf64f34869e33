# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `trajectory_proxy`: goals of FollowJointTrajectory, passed on with efforts filled in.

MoveIt and other planners send goals to `~/follow_joint_trajectory`; the node computes the drives'
efforts at every point and sends the goal on to the controller's own action. Feedback, result and
cancelling pass through. A goal that breaks a rule, or asks for what the robot cannot do, is refused
when it is asked, with the reason in `~/status` and the log. A goal is aborted where its controller
disappears or falls silent, or reports the goal as reached long before it can be: a controller
switches to a trajectory that comes on its topic, and answers the goal by that.

A controller holds a pose without any effort by itself, after it has become active, and after a goal
was cancelled or aborted: the node then sends it that pose at rest, with its gravity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import Twist
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.preparation import prepare
from pprs_dynamics.ros.force_command import (
    STILL,
    Feedforward,
    parameters_for,
    warn_without_limits,
)
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.incoming_bytes import only_whole
from pprs_dynamics.ros.messages.status_codes import Code, Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    SPLINE,
    TRAJECTORY,
    RequestReader,
    TrajectoryRequest,
    readers_for,
)
from pprs_dynamics.ros.node.controller_watch import STATE_TOPIC, ControllerWatch, hold_controller
from pprs_dynamics.ros.node.goal_relay import ControllerError, GoalRelay
from pprs_dynamics.ros.node.model_parameters import ModelParameters
from pprs_dynamics.ros.node.parameters import drive_count, node_parameter, with_changed
from pprs_dynamics.ros.node.provenance import arguments_of, hardware_of
from pprs_dynamics.ros.node.qos import publisher, subscription
from pprs_dynamics.ros.node.senders import publishers_of
from pprs_dynamics.ros.node.status import StatusReporter

# Parameters of the feedforward node that limit the efforts.
SHARED = ('feedforward_scale', 'effort_limits', 'limit_policy', 'missing_derivatives')
ACTION = node_parameter('action', '/joint_trajectory_controller/follow_joint_trajectory',
                        'action of the controller that receives the goals', stays=True)
TIMEOUT = node_parameter('controller_timeout', 5.0, 'silence of the controller after which a goal '
                         'is aborted [s]; 0: only where it has gone', lower=0, upper=3600)
Goal = FollowJointTrajectory.Goal
Result = FollowJointTrajectory.Result
# [s] after the last point of a goal in which the effort of its inertia fades: the controller
# applies the effort of the very last point until it gets another.
SETTLING = 0.02
# Share of a goal's motion before the end of which the answer that it is reached is not believed;
# a controller's clock and its last cycles take less.
LEFT_AT_MOST = 0.1
MOST_SCALING = 10.0  # of the speed that a controller may report; larger ones are no factor of it


class TrajectoryProxyNode(Node):
    """Passes goals on with the efforts that the model says."""

    def __init__(self, **options: Any) -> None:
        super().__init__('trajectory_proxy', allow_undeclared_parameters=True, **options)
        arguments = arguments_of(options)
        # Planners may leave derivatives out; feedforward, whose messages are short, refuses that.
        parameters = (ACTION, TIMEOUT, *(parameter for parameter in with_changed(
            parameters_for(drive_count(self)), 'missing_derivatives', default=SPLINE)
            if parameter.name in SHARED))
        self._settings = ModelParameters(self, arguments, parameters, lambda: None, drives=True)
        node_values = self._settings.node_values
        prepare(self._settings.model)
        self._counters = {'received': 0, 'passed_on': 0, 'refused': 0}
        self._status = StatusReporter(
            self, self._counters, hardware_of(self._settings.model), self._refresh)
        self._status.content.action = node_values['action']
        self._refresh()
        warn_without_limits(self, self._settings.model, node_values)
        self._relay = GoalRelay(self, FollowJointTrajectory, node_values['action'],
                                lambda: self._settings.node_values['controller_timeout'])
        self._server = ActionServer(
            self, FollowJointTrajectory, '~/follow_joint_trajectory', self._execute,
            goal_callback=self._accept, cancel_callback=self._cancel)
        self._controller = ControllerWatch(RobotNames.of(self._settings.model).joints)
        where = node_values['action'].rpartition('/')[0]
        self._speed_scaling = 1.0  # the largest that the controller has reported
        self._hold = publisher(self, JointTrajectory, f'{where}/joint_trajectory')
        subscription(self, JointTrajectoryControllerState, f'{where}/{STATE_TOPIC}',
                     only_whole(JointTrajectoryControllerState, self._on_controller))
        self._status.report('OK', 'WAITING', f'goals go to {node_values["action"]}')

    def _refresh(self) -> None:
        self._status.content.model = self._settings.provenance

    def _accept(self, goal: Any) -> GoalResponse:
        """Refuse a goal that breaks a rule, or asks for what the robot cannot do."""
        self._counters['received'] += 1
        try:
            self._checked(goal)
        except PprsError as error:
            self._note_refusal(Rejection.of(error))
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        try:
            goal, duration = self._checked(handle.request)
        except PprsError as error:  # the model was changed meanwhile
            return self._aborted(handle, Rejection.of(error), Result.INVALID_GOAL)
        try:
            tolerance = conversions.nanoseconds(goal.goal_time_tolerance)
            watched = await self._relay.accepted(
                handle, goal, duration + tolerance / conversions.NANOSECONDS)
            self._counters['passed_on'] += 1
            self._status.report('OK', 'OK', 'a goal was passed on with its efforts')
            answer = await self._relay.finished(watched)
            if answer.status == GoalStatus.STATUS_SUCCEEDED:
                self._check_in_time(goal, watched.sent_at)
        except ControllerError as error:
            if error.began:
                self._controller.require_hold()
            # It has not kept to the path, and where it is is not known.
            return self._aborted(handle, error, Result.PATH_TOLERANCE_VIOLATED
                                 if error.began else Result.INVALID_GOAL)
        if answer.status == GoalStatus.STATUS_SUCCEEDED:
            handle.succeed()
            return answer.result
        self._controller.require_hold()
        if answer.status == GoalStatus.STATUS_CANCELED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return answer.result

    def _cancel(self, handle: Any) -> CancelResponse:
        self._relay.cancel(handle)
        return CancelResponse.ACCEPT

    def _on_controller(self, state: Any) -> None:
        """Let the controller hold with gravity where it would hold without."""
        if state.speed_scaling_factor <= MOST_SCALING:
            self._speed_scaling = max(self._speed_scaling, state.speed_scaling_factor)
        self._controller.heard(state, self._counters['passed_on'] > 0)
        # In the middle of a goal, which has its own efforts, a hold would replace it.
        if self._relay.is_idle:
            model, node_values = self._settings.model, self._settings.node_values
            hold_controller(self, self._controller,
                            lambda position: Feedforward(model, node_values).hold_at(position),
                            lambda held: self._hold.publish(held.message(0, RobotNames.of(model))))

    def _check_in_time(self, goal: Any, sent_at: int) -> None:
        """Check that a goal's motion can be over.

        Raises
        ------
        ControllerError
            Where the controller, which says that the goal is reached, has followed something else.
        """
        passed = (self.get_clock().now().nanoseconds - sent_at) / conversions.NANOSECONDS
        duration = _duration(goal, sent_at)
        left = duration - passed * self._speed_scaling
        if left > LEFT_AT_MOST * duration:
            topic = self._hold.topic_name
            raise ControllerError(
                f'the controller reports the goal as reached {left:.2f} s before its last point: '
                f'it followed another trajectory, which came on {topic}, where these publish: '
                f'{publishers_of(self, topic)}', began=True)

    def _note_refusal(self, error: Rejection | ControllerError) -> str:
        code: Code = error.code if isinstance(error, Rejection) else 'CONTROLLER'
        text = error.text if isinstance(error, Rejection) else str(error)
        self._counters['refused'] += 1
        self._status.report('ERROR', code, text)
        return f'{code}: {text}'

    def _aborted(self, handle: Any, error: Rejection | ControllerError, code: int) -> Any:
        handle.abort()
        return Result(error_code=code, error_string=self._note_refusal(error))

    def _checked(self, goal: Any) -> tuple[Any, float]:
        """Return the goal for the controller, and how long it takes from now on [s].

        Raises
        ------
        PprsError
            As `_filled`, and where it has ended already.
        """
        filled = self._filled(goal)
        duration = _duration(filled, self.get_clock().now().nanoseconds)
        if duration < 0:
            raise Rejection('TIME', f'the trajectory ended {-duration:.3f} s ago')
        return filled, duration

    def _filled(self, goal: Any) -> Any:
        """Return the goal for the controller: of all drives, with their efforts.

        Raises
        ------
        PprsError
            Where it breaks a rule, or ends in motion.
        """
        model, node_values = self._settings.model, self._settings.node_values
        feedforward = Feedforward(model, node_values)
        answer = feedforward.answer(self._request(model, goal))
        if np.abs(answer.forces.drive_motion[1][-1]).max() > STILL:
            raise Rejection('LIMIT', 'the last point is in motion: the controller would never '
                            'report that the goal is reached; end at rest')
        drives = feedforward.ending_at_rest(answer, SETTLING)
        trajectory = drives.message(0, RobotNames.of(model))
        given = goal.trajectory if goal.trajectory.points else goal.multi_dof_trajectory
        trajectory.header = given.header  # a stamp of 0 means: at once, when it arrives
        return Goal(
            trajectory=trajectory, path_tolerance=goal.path_tolerance,
            goal_tolerance=goal.goal_tolerance, goal_time_tolerance=goal.goal_time_tolerance)

    def _request(self, model: Any, goal: Any) -> TrajectoryRequest:
        now = self.get_clock().now().nanoseconds
        missing = self._settings.node_values['missing_derivatives']
        if missing == SPLINE:
            _end_at_rest(goal)
        names = RobotNames.of(model)
        if model.robot.plans_poses and not goal.trajectory.points:
            return readers_for(model, names)[TRAJECTORY].of_message(
                goal.multi_dof_trajectory, now, missing)
        return RequestReader(JointTrajectory, names.joints).of_message(
            goal.trajectory, now, missing)


def _duration(goal: Any, now: int) -> float:
    """Return the duration of a goal's motion [s] if it is sent at a time [ns]."""
    start = conversions.nanoseconds(goal.trajectory.header.stamp) or now
    end = start + conversions.nanoseconds(goal.trajectory.points[-1].time_from_start)
    return (end - now) / conversions.NANOSECONDS


def _end_at_rest(goal: Any) -> None:
    """Let a goal whose last point has no velocities end at rest, where a spline would not."""
    if goal.trajectory.points and not len(goal.trajectory.points[-1].velocities):
        last = goal.trajectory.points[-1]
        last.velocities = [0.0] * len(last.positions)
    elif goal.multi_dof_trajectory.points and not goal.multi_dof_trajectory.points[-1].velocities:
        last = goal.multi_dof_trajectory.points[-1]
        last.velocities = [Twist()] * len(last.transforms)
