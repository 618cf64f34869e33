# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Force commands: the model called for a request, its memory, scale and limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import LimitError, PprsError
from pprs_dynamics.measurement.files.samples import Indices
from pprs_dynamics.physics.mechanism.joint_motion import DrivePath, JointMotion
from pprs_dynamics.physics.mechanism.motion import load_splines
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import RIGID_BODY, DriveLimits, Forces, ModelState
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, RobotNames, write_joint_trajectory
from pprs_dynamics.ros.messages.conversions import time as time_of
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.messages.trajectory_request import REJECT, SPLINE, Motion, TrajectoryRequest
from pprs_dynamics.ros.node.managed_node import AUTOSTART
from pprs_dynamics.ros.node.parameters import NodeParameter, node_parameter

REVERSAL_VELOCITY = 'friction.reversal_velocity'
CLAMP = 'clamp'
HOLD_GRAVITY, ZERO, SILENT = 'hold_gravity', 'zero', 'silent'
RAMP_TIME = 2.0  # [s]; a person sees the efforts change and can stop it
STILL = 1.1920929e-07  # [m/s, rad/s] joint_trajectory_controller's own bound for standing
SAME_EFFORT = 1e-9  # [N, N m]
SHORTEST_STOP = 1e-3  # [s]; the points of a shorter one would have equal times

FRAME = node_parameter('frame_id', '', 'frame of poses and forces; empty: base, for a platform',
                       stays=True)

_PARAMETERS = (
    AUTOSTART,
    FRAME,
    node_parameter('max_age', 0.1, 'oldest header stamp that is accepted, and longest time since a '
                   'message without one was sent [s]; 0: any', lower=0),
    node_parameter('max_ahead', 0.5, 'longest time by which a first point may be early; it '
                   'is executed at once [s]; 0: any', lower=0),
    node_parameter('max_duration', 600.0, 'longest trajectory that is accepted [s]: its command is '
                   'not stale before its end', lower=0.001, upper=3600),
    node_parameter('missing_derivatives', REJECT, 'points without velocities or accelerations: '
                   'reject the message, or take them from a spline through the points',
                   choices=(REJECT, SPLINE)),
    node_parameter('feedforward_scale', 1.0, 'multiplies every published effort [1]: less than 1 '
                   'during commissioning', lower=0, upper=1),
    node_parameter('ramp_time', RAMP_TIME, 'duration of the change of efforts when the model or '
                   'feedforward_scale changes [s]; 0: at once', lower=0, upper=60),
    node_parameter('stop_time', 0.0, 'time from a moving last point of ~/joint_trajectory to an '
                   'added point at rest [s]; below 1 ms: none is added', lower=0, upper=10),
    node_parameter('effort_limits', (), 'largest published absolute effort, per drive [N, N m]; '
                   'the smaller of this and the limit of the model counts', size=6, positive=True),
    node_parameter('limit_policy', REJECT, 'an effort over its limit: reject the message, or clamp '
                   'the effort to the limit', choices=(REJECT, CLAMP)),
    node_parameter('command_timeout', 0.1, 'time from the end of the last accepted trajectory '
                   'until its command is stale [s]; 0: never', lower=0, upper=3600),
    node_parameter('timeout_action', HOLD_GRAVITY, 'what is published once when the command '
                   'is stale: the efforts that hold the last pose at rest, zeros, or nothing',
                   choices=(HOLD_GRAVITY, ZERO, SILENT)),
    node_parameter('warning_margin', 0.1, 'warn if less than this share of the way to a limit of '
                   'workspace or conditioning remains [1]', lower=0, upper=1),
    node_parameter('lag_warning', 0.02, 'warn if the median waiting time of messages is longer '
                   '[s]; 0: never', lower=0, upper=3600),
)


def parameters_for(drives: int) -> tuple[NodeParameter, ...]:
    """Return the parameters of a node with so many drives."""
    return tuple(replace(parameter, size=drives) if parameter.size else parameter
                 for parameter in _PARAMETERS)


class ForceCommand(NamedTuple):
    """Command for a request.

    Parameters
    ----------
    request : TrajectoryRequest
    forces : Forces
        As the model gave them.
    effort : (N, D) array
        What goes out [N, N m]: scaled and within the limits.
    clamp_reason : str
        Which effort was clamped; empty where none was.
    """

    request: TrajectoryRequest
    forces: Forces
    effort: Array
    clamp_reason: str = ''

    @property
    def clamped(self) -> bool:
        """Whether an effort was over its limit."""
        return bool(self.clamp_reason)


class DriveTrajectory(NamedTuple):
    """Motion and efforts of the drives, for a trajectory controller.

    Parameters
    ----------
    offsets : (N,) array of int
        time_from_start [ns].
    drive_motion : three (N, D) arrays
        Position, velocity and acceleration.
    effort : (N, D) array
        [N, N m].
    """

    offsets: Indices
    drive_motion: tuple[Array, ...]
    effort: Array

    @property
    def ends_at_rest(self) -> bool:
        """Whether the last point is at rest, by the bound of joint_trajectory_controller."""
        return bool((np.abs(self.drive_motion[1][-1]) <= STILL).all())

    def message(self, start: int, names: RobotNames) -> JointTrajectory:
        """Return the message that starts at a time [ns]; 0: when it arrives."""
        return write_joint_trajectory(JointMotion(*self.drive_motion), time_of(start),
                                      self.offsets.tolist(), names, self.effort)

    @classmethod
    def holding(cls, drive_motion: tuple[Array, ...], effort: Array) -> DriveTrajectory:
        """Return the trajectory of one point, with efforts (1, D), at the end of a motion."""
        last = drive_motion[0][-1:]
        return cls(np.zeros(1, np.int64), (last, np.zeros_like(last), np.zeros_like(last)), effort)

    def ends_as(self, held: ForceCommand) -> bool:
        """Return whether the last point is a pose at rest with the efforts of a command."""
        return (self.ends_at_rest and not self.drive_motion[2][-1].any()
                and bool((np.abs(self.effort[-1] - held.effort[0]) <= SAME_EFFORT).all()))


class _Ramp(NamedTuple):
    """Model in force before a change, during the ramp to the present one.

    Parameters
    ----------
    model : DriveModel
    memory : ModelState
        As it was at the change: what an effect did since then fades with the model.
    scale : float
    since, duration : float
        [s]
    earlier : _Ramp, optional
        Ramp that was not complete at the change.
    """

    model: Any
    memory: ModelState
    scale: float
    since: float
    duration: float
    earlier: _Ramp | None

    def is_over(self, now: float) -> bool:
        """Return whether the ramp is complete."""
        return now >= self.since + self.duration

    def blended(self, motion: Motion, offsets: Indices, effort: Array, now: float) -> Array:
        """Return efforts (N, D) that change over `ramp_time` from the previous ones to the new.

        Parameters
        ----------
        motion : PlatformMotion or JointMotion
        offsets : (N,) array of int
            time_from_start [ns], the first of which is now.
        effort : (N, D) array
            Of now.
        now : float
            [s]
        """
        moments = now - self.since + (offsets - offsets[0]) / NANOSECONDS
        share = np.minimum(moments / self.duration, 1.0)[:, None]
        before = self.scale * self.model.drive_forces(motion, self.memory.copy()).total
        if self.earlier is not None and not self.earlier.is_over(now):
            before = self.earlier.blended(motion, offsets, before, now)
        return np.asarray(before + share * (effort - before))


class Feedforward:
    """The model in force with the memory of its effects and the limits of commands.

    Parameters
    ----------
    model : DriveModel
    node_values : mapping
        The node's parameters, see `parameters_for`.
    clock : callable, optional
        Returns a time that only goes on [s].
    """

    def __init__(self, model: DriveModel, node_values: Mapping[str, Any],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ramp: _Ramp | None = None
        self._scale: float = node_values['feedforward_scale']
        self._model: Any = model
        self._memory: ModelState | None = None
        self._remembers = False
        # The model that remembered last, and what.
        self._before: tuple[DriveModel, ModelState] | None = None
        self._epoch: int | None = None
        self._last: ForceCommand | None = None
        self.use(model, node_values)

    def use(self, model: DriveModel, node_values: Mapping[str, Any]) -> None:
        """Go on with another model; effects that both have keep their memory.

        Efforts change to those of the other model in `ramp_time`.
        """
        ramp_time, scale = node_values.get('ramp_time', 0.0), node_values['feedforward_scale']
        if self._last is not None and self._memory is not None and (
                scale != self._scale or model.fingerprint != self._model.fingerprint):
            self._ramp = _Ramp(
                self._model, self._memory, self._scale, self._clock(), ramp_time,
                self._ramp) if ramp_time else None
        if self._memory is not None:
            self._before = self._model, self._memory
        # Made with the next answer, which is refused where an effect fails at it.
        self._memory = None
        self._model, self._scale = model, node_values['feedforward_scale']
        self._scales = self._scale != 1
        if node_values['missing_derivatives'] == SPLINE:
            load_splines()
        self._clamps = node_values['limit_policy'] == CLAMP
        self._limits = limits_of(model, node_values)

    @property
    def parts(self) -> list[str]:
        """Names of the force parts of the model in force."""
        return [RIGID_BODY, *(e.name for e in self._model.effects if not e.is_measurement)]

    def part(self, answer: ForceCommand, name: str) -> Array:
        """Return one part of the first forces, scaled as they are, (D,)."""
        return self._scale * answer.forces.parts[name][0]

    def answer(self, request: TrajectoryRequest) -> ForceCommand:
        """Return the command for a request.

        Raises
        ------
        Rejection, WorkspaceError, SingularityError, LimitError, EffectError
            Where nothing may; the memory is then what it was.
        """
        if self._epoch is None:
            self._epoch = request.start
        memory = self._memory or self._made_memory()
        if not self._remembers:
            forces = self._model.drive_forces(request.motion, memory)
            answer = self._checked(request, forces)
        else:
            # Memory advances with what is executed, the first point, once that is accepted.
            motion, ahead = self._timed(request), memory.copy()
            answer = self._checked(request, self._model.drive_forces(motion, ahead))
            if len(motion) > 1:
                ahead = memory.copy()
                self._model.drive_forces(motion[:1], ahead)
            self._memory = ahead
        self._last = answer
        return answer

    def _made_memory(self) -> ModelState:
        self._memory = memory = (self._model.continued_state(*self._before) if self._before
                                 else self._model.initial_state(0.0))
        self._remembers = memory.has_memory
        return memory

    @property
    def has_come_to_rest(self) -> bool:
        """Whether the last accepted trajectory ended at rest, and did not merely break off.

        At rest is what moves less than the speed in which friction turns over. Accelerations say
        nothing: the paper's path, as many profiles, still brakes at its last point.
        """
        if self._last is None:
            return False
        _, velocity, _ = self._last.forces.drive_motion
        return bool((abs(velocity[-1]) <= self._model.values[REVERSAL_VELOCITY]).all())

    def ending_at_rest(self, answer: ForceCommand, duration: float) -> DriveTrajectory:
        """Return a trajectory that ends at rest, for a trajectory controller.

        A last point in motion, where the drives would be for good without another message, is
        followed by one at rest with its gravity, a constant deceleration later. So is one that is
        accelerated: a controller would hold the effort of its inertia for good.

        Parameters
        ----------
        answer : ForceCommand
            The last one.
        duration : float
            [s]; nothing is added below `SHORTEST_STOP`.
        """
        found = DriveTrajectory(answer.request.offsets, answer.forces.drive_motion, answer.effort)
        position, velocity, acceleration = found.drive_motion
        if duration < SHORTEST_STOP or not (velocity[-1].any() or acceleration[-1].any()):
            return found
        rest = np.zeros_like(velocity[-1:])
        stop = np.clip(position[-1:] + velocity[-1:] * duration / 2, self._limits.lower,
                       self._limits.upper)
        try:
            # Over so short a way gravity's efforts hardly change.
            effort = self.hold(gravity=True).effort
        except PprsError:
            return found
        return DriveTrajectory(
            np.append(found.offsets, found.offsets[-1] + round(duration * NANOSECONDS)),
            (np.concatenate((position, stop)), np.concatenate((velocity, rest)),
             np.concatenate((acceleration, rest))), np.concatenate((found.effort, effort)))

    def hold_at(self, position: Array, gravity: bool = True) -> ForceCommand:
        """Return the command that holds the drives at rest at a position, (D,).

        Raises
        ------
        Rejection, PprsError
            Where the robot cannot be there, or there is no such force.
        """
        rest = np.zeros((1, len(position)))
        motion = JointMotion(position[None], rest, rest).held()
        return self._at_rest(TrajectoryRequest(motion, 0, np.zeros(1, dtype=np.int64)), gravity)

    def hold(self, gravity: bool, left: int = 0) -> ForceCommand:
        """Return the command that holds a pose of the last accepted trajectory at rest.

        Effects of other packages that fail are left out: a drive must be held without them, too.

        Parameters
        ----------
        gravity : bool
            False: all efforts are zero.
        left : int
            Time from the pose to the end of the trajectory [ns].

        Raises
        ------
        Rejection, PprsError
            Where there is no such force, e.g. as the model has changed since.
        """
        last = self._accepted()
        if left <= 0:
            return self._at_rest(last.request, gravity)
        path, now = _path_of(last), (int(last.request.offsets[-1]) - left) / NANOSECONDS
        return self.hold_at(path.at(np.array([now])).position[0], gravity)

    def hold_setpoint(self, gravity: bool) -> ForceCommand:
        """Return the command that holds the first pose of the last accepted trajectory at rest.

        Parameters and errors as `hold`.
        """
        request = self._accepted().request
        return self._at_rest(TrajectoryRequest(
            request.motion[:1], request.start, request.offsets[:1]), gravity)

    def stop(self, left: int, duration: float, gravity: bool) -> DriveTrajectory:
        """Return a trajectory along the last accepted one that comes to rest.

        Parameters
        ----------
        left : int
            Time from where it begins to the end of the accepted one [ns].
        duration : float
            Of the stop [s].
        gravity : bool
            False: all efforts are zero.

        Raises
        ------
        Rejection, PprsError
            Where there are no such forces.
        """
        last = self._accepted()
        now = (int(last.request.offsets[-1]) - left) / NANOSECONDS
        path = _path_of(last).stop(now, duration)
        lower, upper = self._limits.lower, self._limits.upper
        motion = JointMotion(np.clip(path.position, lower, upper), path.velocity, path.acceleration)
        forces = self._model.sound_at(motion).drive_forces(motion)
        assert path.time is not None  # `stop` gives it
        return DriveTrajectory(
            np.array([round(moment * NANOSECONDS) for moment in path.time]), forces.drive_motion,
            self._allowed(forces, gravity))

    def _accepted(self) -> ForceCommand:
        if self._last is None:
            raise Rejection('EMPTY', 'no trajectory has been accepted')
        return self._last

    def _at_rest(self, request: TrajectoryRequest, gravity: bool) -> ForceCommand:
        # The forces at rest, not those of the way there: no memory of it.
        motion = request.motion.held()
        forces = self._model.sound_at(motion).drive_forces(motion)
        return ForceCommand(request, forces, self._allowed(forces, gravity))

    def _allowed(self, forces: Forces, gravity: bool) -> Array:
        """Return scaled forces within the limits, or zeros, (N, D); raise where not finite."""
        effort = self._limits.clamped(self._scale * forces.total) if gravity else (
            np.zeros_like(forces.total))
        if not np.all(np.isfinite(effort)):
            raise Rejection('OUTPUT', 'the model gave an effort that is not finite')
        return np.asarray(effort)

    def _checked(self, request: TrajectoryRequest, forces: Forces) -> ForceCommand:
        """Return the command with clamped efforts; raise Rejection or LimitError where refused."""
        effort = self._scale * forces.total if self._scales else forces.total
        if self._ramp is not None:
            effort = self._ramped(request, effort)
        position, velocity, acceleration = forces.drive_motion
        for name, quantity in (('n effort', effort), (' drive velocity', velocity),
                               (' drive acceleration', acceleration)):
            if not np.isfinite(quantity).all():
                raise Rejection('OUTPUT', f'the model gave a{name} that is not finite')
        self._limits.check_strokes(position)
        try:
            self._limits.check_efforts(effort)
        except LimitError as error:
            if not self._clamps:
                raise
            return ForceCommand(request, forces, self._limits.clamped(effort), str(error))
        return ForceCommand(request, forces, effort)

    def _ramped(self, request: TrajectoryRequest, effort: Array) -> Array:
        """Return efforts (N, D) that change gradually after a change of the model."""
        ramp, now = self._ramp, self._clock()
        if ramp is None or ramp.is_over(now):
            self._ramp = None
            return effort
        try:
            motion = self._timed(request) if ramp.memory.has_memory else request.motion
            return ramp.blended(motion, request.offsets, effort, now)
        except PprsError:  # the model of before cannot follow: there is nothing to ramp from
            self._ramp = None
            return effort

    def _timed(self, request: TrajectoryRequest) -> Motion:
        """Return the motion on one time scale for all messages, which memories go by."""
        assert self._epoch is not None  # `answer` sets it
        return request.motion.with_time(
            (request.start - self._epoch + request.offsets) / NANOSECONDS)


def limits_of(model: DriveModel, node_values: Mapping[str, Any]) -> DriveLimits:
    """Return the limits of commands: those of the model, and smaller ones of the node."""
    given = node_values['effort_limits']
    return model.limits.with_efforts(given) if given else model.limits


def warn_without_limits(node: Node, model: DriveModel, node_values: Mapping[str, Any]) -> None:
    """Warn in the log of drives whose effort nothing limits."""
    efforts = limits_of(model, node_values).efforts
    if free := [name for name, most in zip(model.drives, efforts, strict=True) if np.isinf(most)]:
        node.get_logger().warning(
            f'no limit of effort is known for {", ".join(free)}: every finite effort is '
            'published; set limits.effort in the model file, or effort_limits')


def _path_of(command: ForceCommand) -> DrivePath:
    """Return the path of the drives, its times counted from the start of the request [s]."""
    position, velocity, _ = command.forces.drive_motion
    return DrivePath(command.request.offsets / NANOSECONDS, position, velocity)
