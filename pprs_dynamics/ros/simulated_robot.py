# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `simulated_robot`: a robot in a physics engine to run against, in real time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pprs_dynamics.errors import ModelError, PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.node.clocks import steady_timer
from pprs_dynamics.ros.node.model_parameters import watch_parameters
from pprs_dynamics.ros.node.parameters import (
    current_values,
    declare_node_parameters,
    declared_model,
    node_parameter,
)
from pprs_dynamics.ros.node.provenance import arguments_of, hardware_of
from pprs_dynamics.ros.node.qos import publisher, subscription
from pprs_dynamics.ros.node.status import StatusReporter
from pprs_dynamics.ros.setpoints import SetpointQueue
from pprs_dynamics.simulation.drive_control import Setpoint
from pprs_dynamics.simulation.plant import Plant
from pprs_dynamics.simulation.simulated_robot import (
    BANDWIDTH,
    DAMPING_RATIO,
    SensorSettings,
    SimulatedRobot,
)

PARAMETERS = (
    node_parameter('rate', 500.0, 'rate of joint_states [Hz]', lower=10, upper=500),
    node_parameter('bandwidth', BANDWIDTH, 'natural frequency of the PD loop at home [Hz]', lower=0,
                   upper=50),
    node_parameter('damping_ratio', DAMPING_RATIO, 'of the PD loop [1]', lower=0, upper=10),
    node_parameter('use_effort', True, 'true: the effort of ~/joint_command is the feedforward; '
                   'false: it is ignored, and the PD loop compensates gravity by itself'),
    node_parameter('command_timeout', 0.1, 'time without a command after which the drives hold '
                   'their positions [s]; 0: never', lower=0, upper=3600),
    node_parameter('actuation_delay', 0.0, 'delay from command to force [s]', lower=0, upper=1),
    node_parameter('encoder_resolution', 1e-6, 'step of positions; 0: none [m, rad]', lower=0),
    node_parameter('effort_noise', 0.005, 'standard deviation of the noise (64 % white, 36 % '
                   'coloured) over the largest effort of an excitation [1]', lower=0, upper=1),
    node_parameter('injected_effects', (), 'names of effects that the model lacks, or random for a '
                   'random one; drives may follow: '
                   'coulomb_friction:lift_1,lift_2'),
    node_parameter('injected_scale', 1.0, 'multiplies the strength of injected effects', lower=0),
    node_parameter('seed', 0, 'seed of noise and injected effects', lower=0),
)
# What changes while the robot runs: injected effects, and parameters of ROS 2 itself.
CHANGEABLE = ('injected_effects', 'seed', 'injected_scale')
OF_ROS = ('use_sim_time', 'start_type_description_service')
# A node that was stopped for longer than this [s], or whose clock was set back by more, goes on
# from now instead of catching up or waiting.
LONGEST_CATCH_UP = 0.5
# Between them the executor takes one command: with more, commands at 200 Hz would pile up.
CYCLES_AT_ONCE = 2
LATE_SHARE = 0.001


class SimulatedRobotNode(Node):
    """Publishes joint_states, and follows setpoints with efforts, or efforts alone.

    Setpoints are executed at their stamps, interpolated between them; a stamp that has passed is
    executed at once. What the robot refuses, or cannot do, stands in `~/status` and in the log.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('simulated_robot', allow_undeclared_parameters=True, **options)
        node_values = declare_node_parameters(self, PARAMETERS)
        self._model = declared_model(self, arguments_of(options), node_values)
        self._names = RobotNames.of(self._model)
        self._use_effort = node_values['use_effort']
        self._robot = _simulated(self._model, node_values)
        self._queue = SetpointQueue(self._robot.control)
        self._period = round(conversions.NANOSECONDS / node_values['rate'])
        self._counters = {'cycles': 0, 'late': 0, 'commands': 0, 'refused': 0}
        self._late_before, self._cycles_before = 0, 0
        # Hidden effects are in the log only, and on no topic.
        self._status = StatusReporter(self, self._counters, f'simulated {hardware_of(self._model)}')
        self._states = publisher(self, JointState, 'joint_states')
        for kind, topic, take in ((JointState, '~/joint_command', self._take_setpoint),
                                  (Float64MultiArray, '~/commands', self._take_efforts)):
            subscription(self, kind, topic, partial(self._on_command, take))
        self.get_logger().info(
            f'{self._model.title}, {node_values["rate"]:g} Hz, PD loop of '
            f'{node_values["bandwidth"]:g} Hz, injected: {self._injected()}; holding at home')
        self._robot.tick()
        self._start = self.get_clock().now().nanoseconds
        # Time by which the simulation is permanently behind the clock, where it was too slow.
        self._lag = 0.0
        self._status.report('OK', 'HOLD', 'the robot holds; waiting for commands')
        steady_timer(self, self._period / conversions.NANOSECONDS, self._on_timer)
        steady_timer(self, 1.0, self._judge_timing)
        self._injected_effects = watch_parameters(self, self._validated, self._inject)

    def _validated(self, changes: list[Parameter]) -> dict[str, Any]:
        """Return the parameters of injected effects; all others stay as they were at the start."""
        before, after = current_values(self), current_values(self, changes)
        for name in (change.name for change in changes):
            if name not in (*CHANGEABLE, *OF_ROS) and before.get(name) != after.get(name):
                raise ModelError(name, after.get(name), 'stay as it was at the start: of a running '
                                 f'robot only {", ".join(CHANGEABLE)} change')
        values = {known.name: known.check(after.get(known.name)) for known in PARAMETERS
                  if known.name in CHANGEABLE}
        self._robot.plant.choices(*(values[name] for name in CHANGEABLE))
        return values

    def _inject(self, values: dict[str, Any], changes: list[Parameter]) -> None:
        if values == self._injected_effects:
            return
        self._injected_effects = values
        self._robot.plant.inject(*(values[name] for name in CHANGEABLE))
        self.get_logger().info(f'from {self._robot.time + self._lag:.3f} s after the start on, '
                               f'injected effects: {self._injected()}')

    def _injected(self) -> str:
        """Return the injected effects in words."""
        return '; '.join(f'{effect["name"]} {effect["parameters"]}'
                         for effect in self._robot.plant.injected) or 'none'

    def _on_timer(self) -> None:
        behind = self._now() - self._lag - self._robot.time
        if abs(behind) > LONGEST_CATCH_UP:  # where it is negative, the clock was set back
            self._lag += behind
            if behind < 0:
                self._queue.clear()
        # A few cycles at a time, so that commands are read even on a machine that is too slow.
        for _ in range(CYCLES_AT_ONCE):
            late = self._now() - self._lag - self._robot.time
            if late < 0:
                break
            self._counters['cycles'] += 1
            self._counters['late'] += late * conversions.NANOSECONDS > self._period
            self._cycle()

    def _cycle(self) -> None:
        robot = self._robot
        now = robot.time + self._lag
        stamp = self._start + round(now * conversions.NANOSECONDS)
        held = robot.control.holding
        if not self._queue.advance(now, self._lag):
            self._counters['refused'] += 1
            self._queue.clear()
        measured = robot.tick()
        self._states.publish(conversions.joint_state(
            stamp, measured.effort, measured.position, measured.velocity, self._names))
        if held and not robot.control.holding:
            self._status.report('OK', 'OK', 'following commands')
        for note in robot.notes:
            self._status.report('WARN' if note.code == 'HOLD' else 'ERROR', note.code, note.message)
        robot.notes.clear()

    def _on_command(self, take: Callable[[bytes], None], data: bytes) -> None:
        self._counters['commands'] += 1
        try:
            take(data)
        except PprsError as error:
            self._counters['refused'] += 1
            self._status.report('ERROR', 'REFUSED', f'a command was refused: {error}')

    def _take_setpoint(self, data: bytes) -> None:
        message = message_in(data, JointState)
        fields = ('position', 'velocity', 'effort')[:3 if self._use_effort else 2]
        setpoint = Setpoint(*(conversions.read_drives(message, field, drives=self._names.joints)
                              for field in fields))
        stamp = conversions.nanoseconds(message.header.stamp)
        time = (stamp - self._start) / conversions.NANOSECONDS if stamp else self._now()
        self._queue.add(time, setpoint)

    def _take_efforts(self, data: bytes) -> None:
        self._queue.clear()
        self._queue.add(self._now(), Setpoint(
            effort=np.array(message_in(data, Float64MultiArray).data)))

    def _judge_timing(self) -> None:
        late = self._counters['late'] - self._late_before
        cycles = self._counters['cycles'] - self._cycles_before
        self._late_before, self._cycles_before = self._counters['late'], self._counters['cycles']
        if late > LATE_SHARE * cycles:
            self._status.report('WARN', 'LATE', f'{late} of {cycles} cycles of the last second '
                                'were late: this machine is too busy for the simulation')

    def _now(self) -> float:
        """Return the time since the start [s]."""
        return (self.get_clock().now().nanoseconds - self._start) / conversions.NANOSECONDS


def _simulated(model: DriveModel, values: Mapping[str, Any]) -> SimulatedRobot:
    """Return the simulated robot of a model with the node's settings."""
    plant = Plant(model, values['injected_effects'], values['seed'], values['injected_scale'],
                  values['rate'])
    control = plant.gains(values['bandwidth'], values['damping_ratio'],
                          gravity_compensation=not values['use_effort'],
                          command_timeout=values['command_timeout'] or np.inf,
                          actuation_delay=values['actuation_delay'])
    return SimulatedRobot(
        plant, seed=values['seed'], control=control,
        sensors=SensorSettings(values['encoder_resolution'], values['effort_noise']))
