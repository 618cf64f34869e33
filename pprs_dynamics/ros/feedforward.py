# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `feedforward`: trajectories of a platform or of joints in, the drives' efforts out."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.effects.laws.measured_curve import MeasuredCurve
from pprs_dynamics.physics.model.drive_model import Margins, margins
from pprs_dynamics.ros import force_command
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, RobotNames, efforts, joint_state
from pprs_dynamics.ros.messages.incoming_bytes import only_whole
from pprs_dynamics.ros.messages.status_codes import REJECTIONS, Rejection
from pprs_dynamics.ros.messages.trajectory_request import (
    TRAJECTORY,
    RequestReader,
    Timing,
    readers_for,
)
from pprs_dynamics.ros.node.clocks import CommandWatchdog
from pprs_dynamics.ros.node.controller_watch import STATE_TOPIC, ControllerWatch, hold_controller
from pprs_dynamics.ros.node.managed_node import AUTOSTART, ManagedNode
from pprs_dynamics.ros.node.model_parameters import ModelParameters
from pprs_dynamics.ros.node.parameters import drive_count
from pprs_dynamics.ros.node.preparation import prepare_beside
from pprs_dynamics.ros.node.provenance import arguments_of, hardware_of
from pprs_dynamics.ros.node.qos import SETPOINTS, publisher, subscription
from pprs_dynamics.ros.node.senders import PASSED_OVER, Senders, publishers_of
from pprs_dynamics.ros.node.status import Durations, StatusReporter

try:
    from control_msgs.msg import JointTrajectoryControllerState
except ImportError:  # then nothing is known of a controller
    JointTrajectoryControllerState = None

# Poses of a stream hardly differ within that time [s], and margins cost as much as the model.
MARGINS_PERIOD = 0.01
ACKNOWLEDGE_TIME = Duration(seconds=0.3)  # that a listener gets to take the last command
STOP_TIME = 0.25  # [s] of a stop along a path where `stop_time` gives none


class FeedforwardNode(ManagedNode):
    """Answers every valid trajectory with friction-compensated efforts of the drives.

    A message that breaks a rule is rejected whole: nothing goes out, a counter rises, and the
    reason stands in `~/status` and in the log. When commands go stale, when an effect of another
    package fails, and when the node is deactivated or ended, `timeout_action` is done once.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('feedforward', allow_undeclared_parameters=True, **options)
        arguments = arguments_of(options)
        self._parts: dict[str, Any] = {}
        self._current: Any = None
        self._watchdog: CommandWatchdog | None = None
        parameters = force_command.parameters_for(drive_count(self))
        self._settings = ModelParameters(
            self, arguments, parameters, self._use_settings, drives=True)
        node_values = self._settings.node_values
        for name, assumed in self._settings.model.assumed_at_start.items():
            self.get_logger().info(f'the memory of {name} is reset: {assumed}')
        self._preparation = prepare_beside(self, self._settings.model)
        # Which drives there are, and by which message they are asked for, stays.
        self._names = names = RobotNames.of(self._settings.model, node_values['frame_id'])
        self._readers = readers_for(self._settings.model, names)
        self._controller = ControllerWatch(names.joints)
        self._feedforward = force_command.Feedforward(self._settings.model, node_values)
        self._timing = Timing.of(node_values)
        self._counters = {'received': 0, 'accepted': 0, 'clamped': 0, 'stale': 0, PASSED_OVER: 0,
                          **dict.fromkeys(REJECTIONS, 0)}
        self._senders = Senders()
        self._margins_due, self._margins, self._beyond_curve = 0.0, Margins(None, 1.0, ''), ''
        # When its margins were not due.
        self._last_unchecked: force_command.ForceCommand | None = None
        self._compute_time, self._lag = Durations(), Durations()
        self._counted = (0, 0, time.monotonic())
        self._status = StatusReporter(
            self, self._counters, hardware_of(self._settings.model), self._refresh,
            ('~/commands',))
        self._refresh()
        self.begin(node_values[AUTOSTART.name])

    # --- life -----------------------------------------------------------------------------------

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer messages from now on."""
        model = self._settings.model
        self.get_logger().info(
            f'{model.title}, effects {", ".join(effect.name for effect in model.effects)}; ready')
        force_command.warn_without_limits(self, model, self._settings.node_values)
        return super().on_activate(state)

    def _create_topics(self) -> None:
        # The last trajectory for a controller, and whether there was ever one.
        self._sent: force_command.DriveTrajectory | None = None
        self._has_sent = False
        # Its memory begins anew.
        self._feedforward = force_command.Feedforward(self._settings.model,
                                                      self._settings.node_values)
        self._commands = self._publisher(Float64MultiArray, '~/commands')
        self._joint_command = self._publisher(JointState, '~/joint_command')
        self._joint_trajectory = self._publisher(JointTrajectory, '~/joint_trajectory')
        self._watchdog = CommandWatchdog(
            self, lambda: self._settings.node_values['command_timeout'], self._on_stale)
        self._create_parts()
        # Raw: message objects of a long trajectory would take longer than the model.
        for topic, reader in self._readers.items():
            self._until_cleanup(self.destroy_subscription, subscription(
                self, reader.message, topic, partial(self._on_trajectory, reader),
                profile=SETPOINTS))
        if JointTrajectoryControllerState is not None:
            self._until_cleanup(self.destroy_subscription, subscription(
                self, JointTrajectoryControllerState, self._controller_topic,
                only_whole(JointTrajectoryControllerState, self._on_controller)))

    def _create_parts(self) -> None:
        known = self._settings.model.knows_currents
        if self._current is not None and not known:
            self.destroy_publisher(self._current)
            self._current = None
        elif self._current is None and known:
            self._current = publisher(self, Float64MultiArray, '~/current')
        names = self._feedforward.parts
        for name in self._parts.keys() - set(names):
            self.destroy_publisher(self._parts.pop(name))
        for name in names:
            if name not in self._parts:
                self._parts[name] = publisher(self, JointState, f'~/effort/{name}')

    def destroy_topics(self) -> None:
        super().destroy_topics()
        if self._watchdog is not None:
            self._watchdog.destroy()
        for topic in (*self._parts.values(), self._current):
            if topic is not None:
                self.destroy_publisher(topic)
        self._watchdog = self._current = None
        self._parts = {}

    def _use_settings(self) -> None:
        node_values = self._settings.node_values
        self._feedforward.use(self._settings.model, node_values)
        self._timing = Timing.of(node_values)
        if self._watchdog is not None:
            self._create_parts()
            self._watchdog.rearm()

    # --- messages -------------------------------------------------------------------------------

    def _on_trajectory(self, reader: RequestReader, data: bytes, info: dict[str, Any]) -> None:
        began, worked = time.perf_counter(), time.process_time()
        passed_over = self._senders.passed_over(info)
        if self.state != 'active' or self._watchdog is None:
            return
        self._counters['received'] += 1
        self._counters[PASSED_OVER] += passed_over
        node_values, now = self._settings.node_values, self.get_clock().now().nanoseconds
        try:
            request = reader.read(data, now, node_values['missing_derivatives'])
            self._timing.check(request, now, _since(info['source_timestamp']))
            answer = self._feedforward.answer(request)
            # All that the node did not compute it stood still: suspended, or without a processor.
            self._timing.check_pause(time.perf_counter() - began - (time.process_time() - worked))
        except PprsError as error:
            self._reject(Rejection.of(error))
            return
        self._command(answer)
        # The rest is not urgent: the drives have their command.
        self._compute_time.append(time.perf_counter() - began)
        self._counters['accepted'] += 1
        self._counters['clamped'] += answer.clamped
        # Without a clock nothing can be said of a stamp, and a wait for it would not end.
        self._watchdog.feed(request.end - (self.get_clock().now().nanoseconds or request.start))
        self._publish_rest(answer)
        if info['received_timestamp']:
            waited = _since(info['received_timestamp']) - (time.perf_counter() - began)
            self._lag.append(max(0.0, waited))
        self._report_condition(answer)

    def _command(self, command: force_command.ForceCommand) -> None:
        """Send efforts to the drives, and the currents that give them where they are known."""
        effort = command.effort[0]
        self._commands.publish(efforts(effort))
        if self._current is not None:
            self._current.publish(efforts(self._settings.model.currents(effort)))

    def _send_setpoint(self, command: force_command.ForceCommand, stamp: int) -> None:
        """Send positions, velocities and efforts of a time [ns] as one setpoint."""
        if self._joint_command.get_subscription_count():
            position, velocity, _ = command.forces.drive_motion
            self._joint_command.publish(joint_state(
                stamp, command.effort[0], position[0], velocity[0], self._names))

    def _publish_rest(self, answer: force_command.ForceCommand) -> None:
        request = answer.request
        self._send_setpoint(answer, request.first_stamp)
        self._sent = None
        if self._joint_trajectory.get_subscription_count():
            drives = self._feedforward.ending_at_rest(
                answer, self._settings.node_values['stop_time'])
            self._has_sent = True
            self._joint_trajectory.publish(drives.message(request.start, self._names))
            left = request.start + int(drives.offsets[-1]) - self.get_clock().now().nanoseconds
            timeout = self._settings.node_values['command_timeout']
            # A controller discards what has ended, and never goes to its last pose.
            self._sent = drives if left > -timeout * NANOSECONDS else None
            self._controller.sent(drives.drive_motion[0], left / NANOSECONDS,
                                  not drives.ends_at_rest)
        for name, topic in self._parts.items():
            if topic.get_subscription_count():
                topic.publish(joint_state(
                    request.first_stamp, self._feedforward.part(answer, name), names=self._names))

    def _report_condition(self, answer: force_command.ForceCommand) -> None:
        node_values, report, now = self._settings.node_values, self._status.report, time.monotonic()
        self._last_unchecked = None if now > self._margins_due else answer
        if self._last_unchecked is None:
            self._margins_due = now + MARGINS_PERIOD
            self._margins = left = margins(self._settings.model, answer.forces.mechanism)
            if left.singularity is not None:
                self._status.content.singularity_margin = round(left.singularity, 6)
            self._status.content.workspace_margin = round(left.workspace, 6)
            self._beyond_curve = next((
                remark for effect in self._settings.model.effects
                if isinstance(effect, MeasuredCurve)
                and (remark := effect.left(answer.forces.mechanism))), '')
        left = self._margins
        fault = self._controller_fault
        if fault:
            report('ERROR', 'CONTROLLER', fault)
        elif self._senders.take_turns:
            report('WARN', 'CONFLICT', 'the drives follow several publishers in turn, all on '
                   f'{self.resolve_topic_name(TRAJECTORY)}: {publishers_of(self, TRAJECTORY)}')
        elif answer.clamped:
            report('WARN', 'CLAMPED', f'{answer.clamp_reason}; the effort was clamped')
        elif left.singularity is not None and left.singularity < node_values['warning_margin']:
            report('WARN', 'NEAR_SINGULAR', f'{left.singularity:.3f} of the way to the limits of '
                   f'conditioning remains, warning_margin is {node_values["warning_margin"]:g}')
        elif left.workspace < node_values['warning_margin']:
            report('WARN', 'NEAR_WORKSPACE', f'{left.drive} has {left.workspace:.3f} of half its '
                   f'range left, warning_margin is {node_values["warning_margin"]:g}')
        elif self._beyond_curve:
            report('WARN', 'CURVE', self._beyond_curve)
        elif self._status.content.lagging:
            report('WARN', 'LAG', 'the median wait of messages exceeds lag_warning, or most are '
                   'dropped: they arrive faster than the node answers, or the machine is busy')
        else:
            report('OK', 'OK', 'commands follow the trajectory')

    @property
    def _controller_topic(self) -> str:
        """Topic of the state of the controller that gets `~/joint_trajectory`."""
        return f'{self._joint_trajectory.topic_name.rpartition("/")[0]}/{STATE_TOPIC}'

    @property
    def _controller_fault(self) -> str:
        """Fault of the controller of `~/joint_trajectory`; '' where none is known."""
        if not self._joint_trajectory.get_subscription_count() or not (
                self._controller.was_heard
                or self.count_publishers(self._controller_topic)):
            return ''
        fault = self._controller.fault()
        return f'{self._joint_trajectory.topic_name}: {fault}' if fault else ''

    def _on_controller(self, state: Any) -> None:
        """Let a controller hold with gravity where it would hold without."""
        self._controller.heard(state, self._has_sent)
        if (self._watchdog is not None and self.state == 'active' and not self._watchdog.fresh
                and self._settings.node_values['timeout_action'] == force_command.HOLD_GRAVITY):
            hold_controller(self, self._controller, self._feedforward.hold_at, self._send_hold)

    def _send_hold(self, held: force_command.DriveTrajectory) -> None:
        """Let the trajectory controller hold a pose at rest from now on."""
        self._sent = held
        self._joint_trajectory.publish(held.message(0, self._names))

    def _reject(self, rejection: Rejection) -> None:
        self._counters[rejection.code] += 1
        text, watchdog = rejection.text, self._watchdog
        if rejection.code == 'EFFECT' and watchdog is not None and watchdog.fresh:
            # Not the message is wrong but the model: waiting for a better one would help nothing.
            watchdog.stop()
            self._counters['stale'] += 1
            text = f'{text}; {self._do_timeout_action()}'
        self._status.report('ERROR', rejection.code, text)

    # --- stale commands -------------------------------------------------------------------------

    def _on_stale(self, clock_stands: bool) -> None:
        fault, timeout = self._controller_fault, self._settings.node_values['command_timeout']
        done = self._do_timeout_action()
        ended = self._feedforward.has_come_to_rest and not clock_stands
        self._counters['stale'] += not ended
        if fault:
            self._status.report('ERROR', 'CONTROLLER', f'{fault}; sent: {done}')
        elif ended:
            self._status.report('OK', 'DONE', f'the trajectory has ended at rest: {done}')
        else:
            text = ('ROS time does not advance' if clock_stands
                    else f'no valid trajectory for {timeout:g} s') + f': {done}'
            self._status.report('STALE', 'STALE', text)

    def finish(self) -> None:
        """Do the timeout's action now where a command is in force, and see it off."""
        if self._watchdog is None or not self._watchdog.fresh:
            return
        self._watchdog.stop()
        self.get_logger().info(f'ends: {self._do_timeout_action()}')
        for topic in (self._commands, self._joint_command, self._joint_trajectory, self._current):
            if topic is not None:
                topic.wait_for_all_acked(ACKNOWLEDGE_TIME)

    def _do_timeout_action(self) -> str:
        """Send what the action says on every topic, once, and return it in words.

        Efforts are those of the pose on the path at the present ROS time. Who follows
        `~/joint_command` has got no setpoint but the first of the trajectory, and stays there.
        """
        action = self._settings.node_values['timeout_action']
        left = 0 if self._watchdog is None else self._watchdog.left
        if action == force_command.SILENT:
            return 'nothing is published, the last command remains in force'
        gravity = action == force_command.HOLD_GRAVITY
        try:
            held = self._feedforward.hold(gravity, left)
            setpoint = self._feedforward.hold_setpoint(gravity)
            self._command(held)
            self._send_setpoint(setpoint, self.get_clock().now().nanoseconds)
            controller = self._end_trajectory(held, left, gravity)
        except PprsError as error:
            return f'the last command remains in force, no new one can be computed: {error}'
        failed = [name for name in self._feedforward.parts if name not in held.forces.parts]
        pose = 'the last pose' if left <= 0 else 'the pose on the path'
        done = f'{pose} is held at rest' if gravity else 'efforts are zero'
        return (f'{done}, without {", ".join(failed)}' if gravity and failed else done) + controller

    def _end_trajectory(self, held: force_command.ForceCommand, left: int, gravity: bool) -> str:
        """Let the trajectory controller come to rest on its path; return how, in words.

        A controller that holds a trajectory which ends at rest gets nothing: any other message
        would replace the rest of the path by a straight line.
        """
        if self._sent is None:
            return ''
        if left > 0:
            if self._sent.ends_at_rest:
                return '; a trajectory controller completes its trajectory, which ends at rest'
            stop_time = self._settings.node_values['stop_time']
            if stop_time < force_command.SHORTEST_STOP:
                stop_time = STOP_TIME
            self._sent = self._feedforward.stop(left, stop_time, gravity)
            self._joint_trajectory.publish(self._sent.message(0, self._names))
            return f'; a trajectory controller stops along the path in {stop_time:g} s'
        if not self._sent.ends_as(held):
            # At its present position: beyond the last pose, if a stop was added to the path.
            self._send_hold(
                force_command.DriveTrajectory.holding(self._sent.drive_motion, held.effort))
        return ''

    # --- status ---------------------------------------------------------------------------------

    def _refresh(self) -> None:
        """Update the content that is published once a second."""
        if self._last_unchecked is not None and self._status.content.code == 'OK':
            # No message followed: its margins are still to be reported.
            self._report_condition(self._last_unchecked)
        accepted, passed, now = (self._counters['accepted'], self._counters[PASSED_OVER],
                                 time.monotonic())
        before, passed_before, then = self._counted
        self._counted = (accepted, passed, now)
        threshold = self._settings.node_values['lag_warning']
        lag = self._lag.summary()
        waits = (lag.p50 or 0.0) > threshold or passed - passed_before > accepted - before
        content = self._status.content
        content.model = self._settings.provenance
        content.changes = len(self._settings.history or ())
        content.state, content.assumed = self.state, self._settings.model.assumed_at_start
        content.preparing = self._preparation is not None and self._preparation.is_alive()
        content.rate = round((accepted - before) / max(now - then, 1e-3), 1)
        content.compute_time, content.lag = self._compute_time.summary(), lag
        content.lagging = bool(threshold and accepted > before and waits)


def _since(stamp: int) -> float:
    """Return for how long the middleware's stamp [ns] has passed [s]; 0 where it gives none."""
    return max(0.0, (time.time_ns() - stamp) / NANOSECONDS) if stamp else 0.0
