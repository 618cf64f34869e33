# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joint states as they come in, for the workbench: kept in a ring, compared, and made a recording.

The node runs in a thread of the workbench; everything that the workbench asks is answered from
what the node has noted, and changes of running nodes go out as parameters.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.inference.residuals.live import ERROR_SPAN
from pprs_dynamics.measurement.files.recording import write_recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.recorded_names import PREFIX
from pprs_dynamics.ros.live_stream import LiveStream
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.incoming_bytes import only_whole
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.node.clocks import steady_timer
from pprs_dynamics.ros.node.model_owner import ModelOwner
from pprs_dynamics.ros.node.parameters import ACTIVE, overrides, plain_value
from pprs_dynamics.ros.node.qos import LATCHED, MEASURED, subscription

NAME = 'workbench'
COMPARED = 0.05  # [s] between looks at what came in
MOST_SAMPLES = 300_000  # in the ring: ten minutes at 500 Hz
PATIENCE = 5.0  # [s] for a running node's answer
SHOWN = 20.0  # [s] of residuals that are kept to be drawn
COMMANDS = {'std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/JointState',
            'trajectory_msgs/msg/JointTrajectory'}  # what drives take


class UnconfirmedError(PprsError):
    """A person has confirmed another machine than the one that would be set, or none."""


class LiveJointStates(Node):
    """Compares joint states with a model, and keeps the last of them.

    Parameters
    ----------
    model : DriveModel
    topic : str
        Of sensor_msgs/JointState.
    monitor, feedforward : str
        Names of the node that reports errors and of the node that drives, absolute or in the
        namespace of this one.
    options
        Of `rclpy.node.Node`.
    """

    def __init__(self, model: DriveModel, topic: str, monitor: str, feedforward: str,
                 **options: Any) -> None:
        super().__init__(NAME, **options)
        self._ring: deque[tuple[int, Any, Any]] = deque(maxlen=MOST_SAMPLES)
        self._residuals: deque[tuple[float, Any]] = deque()
        self._arrived = 0.0
        self._rejected = 0
        self.stream = LiveStream(self, self.with_prefix(model), self._take, self._reject,
                                 topic=topic)
        self.stream.listen()
        self._monitor: list[float] | None = None
        self._diagnosis: dict[str, Any] | None = None
        self._heard = 0.0
        subscription(self, Float64MultiArray, f'{monitor}/error',
                     only_whole(Float64MultiArray, self._on_error), MEASURED)
        subscription(self, String, f'{monitor}/diagnosis', only_whole(String, self._on_diagnosis),
                     LATCHED)
        self.owner = ModelOwner(self, feedforward, lambda: self.model, self._follow)
        self.restoring = self.create_client(Trigger, f'{feedforward}/restore')
        steady_timer(self, COMPARED, self._compare)

    def machine(self) -> str:
        """Return the node that drives, its robot and who takes its commands; '' where none runs."""
        if not self.owner.is_there:
            return ''
        name, status = self.owner.name, self.owner.status
        full_name = name if name.startswith('/') else (f'{self.get_namespace().rstrip("/")}/{name}')
        parts = [f'node {full_name}']
        if status.robot:
            parts.append(f'robot {status.robot}'
                         + (f' of {", ".join(status.files)}' if status.files else ''))
        if takers := self._takers(full_name):
            parts.append(f'commands go to {", ".join(takers)}')
        return '; '.join(parts)

    def with_prefix(self, model: DriveModel) -> DriveModel:
        """Return a model with the parameter `joint_prefix` of this node, if it is given."""
        prefix = overrides(self).get(PREFIX)
        return model if prefix is None else DriveModel.from_parameters(
            {**model.values, PREFIX: prefix}, model.source)

    def _follow(self, parameters: Sequence[Parameter]) -> None:
        with suppress(PprsError):  # then the fingerprints differ, and nothing can be set
            self.stream.use_model(DriveModel.from_parameters({
                **self.model.values,
                **{new.name: plain_value(new.value) for new in parameters}}, self.model.source))

    def _takers(self, full_name: str) -> list[str]:
        """Return the nodes that subscribe to a node's commands."""
        namespace, _, name = full_name.rpartition('/')
        try:
            topics = self.get_publisher_names_and_types_by_node(name, namespace or '/')
        except RuntimeError:  # the public base of rclpy's own: it is not known any more
            return []
        return sorted({
            f'{taker.node_namespace.rstrip("/")}/{taker.node_name}'
            for topic, kinds in topics if COMMANDS & set(kinds) and not topic.endswith('/error')
            for taker in self.get_subscriptions_info_by_topic(topic)} - {
                self.get_fully_qualified_name()})

    @property
    def model(self) -> DriveModel:
        """Model in force, with which efforts are compared."""
        return self.stream.model

    def _take(self, stamp: int, position: Any, effort: Any) -> None:
        self._arrived = time.monotonic()
        self._ring.append((stamp, position, effort))

    def _reject(self, rejection: Rejection) -> None:
        self._rejected += 1

    def _on_error(self, message: Float64MultiArray) -> None:
        self._monitor = list(message.data)
        self._heard = time.monotonic()

    def _on_diagnosis(self, message: String) -> None:
        with suppress(ValueError):  # no JSON: not of our monitor
            found = json.loads(message.data, parse_constant=lambda _: None)
            if isinstance(found, dict):
                self._diagnosis = found

    def _compare(self) -> None:
        compared = self.stream.compare()
        if compared is None:
            return
        with self.stream.lock:
            self._residuals.extend(zip(compared.time.tolist(), compared.residual, strict=True))
            last = self._residuals[-1][0]
            while not last - SHOWN <= self._residuals[0][0] <= last:  # stamps may go back, too
                self._residuals.popleft()

    def take(self, path: Path) -> None:
        """Write the joint states of the ring as a recording.

        Raises
        ------
        PprsError
            Where they are no recording.
        """
        with self.stream.lock:
            samples = list(self._ring)
        if not samples:
            raise UnreadableFileError('joint_states', 'no message has arrived yet')
        # Here and not above: it brings multiprocessing, which this node does without.
        from pprs_dynamics.ros.diagnosis_worker import StreamWindow

        write_recording(path, StreamWindow.of(samples).recording('live', self.model.drives))

    def to_dict(self) -> dict[str, Any]:
        """Return state and latest residuals [N], for JSON."""
        now = time.monotonic()
        with self.stream.lock:
            running = self.stream.comparison.running_error().tolist()
            late = list(self._residuals)
            span = ((self._ring[-1][0] - self._ring[0][0]) / conversions.NANOSECONDS
                    if self._ring else 0.0)
            age = now - self._arrived if self._arrived else None
        step = max(1, len(late) // 1000)
        waits = self.stream.waits_for()
        trouble = str(self.stream.trouble or '') or (waits[1] if waits else '')
        return {'received': self.stream.counters['received'], 'rejected': self._rejected,
                'drives': list(self.model.drives), 'age': age, 'kept': span,
                'trouble': trouble, 'diagnosis': self._diagnosis,
                'can_restore': self.owner.status.changes > 0,
                'effects': list(self.model.values.get(ACTIVE, ())),
                'error': running, 'monitor_error': self._monitor
                if self._monitor is not None and now - self._heard < ERROR_SPAN else None,
                'time': [moment for moment, _ in late[::step]],
                'residual': [*zip(*(values.tolist() for _, values in late[::step]), strict=True)]}


class LiveNodes(LiveJointStates):
    """The node in a thread of its own, for callers of other threads.

    Parameters
    ----------
    model : DriveModel
        That running nodes have as well.
    topic, monitor, feedforward : str
        As `LiveJointStates`.
    arguments : sequence of str
        Of ROS 2, with --ros-args: namespace, remappings, joint_prefix, use_sim_time, QoS.
    """

    def __init__(self, model: DriveModel, topic: str = 'joint_states', monitor: str = 'monitor',
                 feedforward: str = 'feedforward', arguments: Sequence[str] = ()) -> None:
        context = Context()
        rclpy.init(args=list(arguments), context=context,
                   signal_handler_options=SignalHandlerOptions.NO)
        super().__init__(model, topic, monitor, feedforward, context=context)
        self._served_by = SingleThreadedExecutor(context=context)
        self._served_by.add_node(self)
        self._thread = threading.Thread(target=self._spin, name='live', daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._served_by.spin()

    def close(self) -> None:
        """Stop the thread and leave the graph."""
        self._served_by.shutdown()
        self._thread.join(PATIENCE)
        self.destroy_node()
        self.context.try_shutdown()

    def set_model(self, model: DriveModel, confirmed: str) -> dict[str, Any]:
        """Set a model on the node that drives, all or none, and compare with it here.

        Parameters
        ----------
        model : DriveModel
        confirmed : str
            `machine` as a person has read it.

        Returns
        -------
        dict
            `is_set`, and `nodes`: the reason of each that refused, '' of each that took it.
        """
        self._check(confirmed)
        answer = self._answer(self.owner.set_model(model.values))
        if answer is not None and answer.result.successful:
            self.stream.use_model(self.with_prefix(model))
        return self._result(answer and answer.result.successful, answer and answer.result.reason)

    def restore(self, confirmed: str) -> dict[str, Any]:
        """Undo the last change of the model of the node that drives; see `set_model`."""
        self._check(confirmed)
        answer = self._answer(self.restoring.call_async(Trigger.Request()))
        return self._result(answer and answer.success, answer and answer.message)

    def _answer(self, future: Future[Any]) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        return future.result() if done.wait(PATIENCE) else None

    def _result(self, is_set: bool | None, reason: str | None) -> dict[str, Any]:
        return {'is_set': bool(is_set), 'nodes': {self.owner.name: '' if is_set else (
            reason or f'has not answered within {PATIENCE:g} s')}}

    def _check(self, confirmed: str) -> None:
        """Raise UnconfirmedError where a person has not confirmed this machine."""
        if not (now := self.machine()):
            raise UnconfirmedError('no node runs that could be set')
        if confirmed != now:
            raise UnconfirmedError(f'not confirmed: what would be set is {now}')
