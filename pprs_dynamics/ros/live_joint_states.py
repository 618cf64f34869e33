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
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray, String

from pprs_dynamics.errors import PprsError, UnreadableFileError
from pprs_dynamics.inference.residuals.live import ERROR_SPAN
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.live_stream import LiveStream
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.incoming_bytes import message_in
from pprs_dynamics.ros.messages.status_codes import Rejection
from pprs_dynamics.ros.model_transaction import ACTIVE, PATIENCE, ModelSteps, running
from pprs_dynamics.ros.node.clocks import steady_timer
from pprs_dynamics.ros.node.qos import LATCHED, MEASURED
from pprs_dynamics.system.numbers import finite

NAME = 'workbench'
COMPARED = 0.05  # [s] between looks at what came in
MOST_SAMPLES = 300_000  # in the ring: ten minutes at 500 Hz
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
        Names of the nodes that get effects, absolute or in the namespace of this one.
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
        self.stream = LiveStream(self, model, self._take, self._reject, topic=topic)
        self.stream.listen()
        self._monitor: list[float] | None = None
        self._diagnosis: dict[str, Any] | None = None
        self._heard = 0.0
        # Raw, as what is no message of the kind would end the executor.
        self.create_subscription(Float64MultiArray, f'{monitor}/error', self._on_error, MEASURED,
                                 raw=True)
        self.create_subscription(String, f'{monitor}/diagnosis', self._on_diagnosis, LATCHED,
                                 raw=True)
        self._statuses: dict[str, dict[str, Any]] = {}
        for name in (monitor, feedforward):
            self.create_subscription(String, f'{name}/status', partial(self._on_status, name),
                                     LATCHED, raw=True)
        steady_timer(self, COMPARED, self._compare)
        self.clients_of = {name: AsyncParameterClient(self, name)
                           for name in (monitor, feedforward)}

    def full_name(self, name: str) -> str:
        """Return a node's name with its namespace."""
        return name if name.startswith('/') else f'{self.get_namespace().rstrip("/")}/{name}'

    def machines(self, names: Iterable[str]) -> list[str]:
        """Return which robot each node has a model of, and which nodes take its commands."""
        found = dict[str, None]()
        for name in names:
            status = self._statuses.get(name, {})
            files = ', '.join(Path(each['file']).name for each in status.get(
                'model', {}).get('files', ()))
            if robot := status.get('robot'):
                found[f'robot {robot}' + (f' of {files}' if files else '')] = None
            if takers := self._takers(self.full_name(name)):
                found[f'commands of {name} go to {", ".join(takers)}'] = None
        return list(found)

    def _takers(self, full_name: str) -> list[str]:
        """Return the nodes that listen to what a node tells drives."""
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

    def _on_status(self, name: str, data: bytes) -> None:
        with suppress(Rejection, ValueError):
            found = json.loads(message_in(data, String).data, parse_constant=lambda _: None)
            if isinstance(found, dict):
                self._statuses[name] = found

    @property
    def model(self) -> DriveModel:
        """What is compared with."""
        return self.stream.model

    def _take(self, stamp: int, position: Any, effort: Any) -> None:
        self._arrived = time.monotonic()
        self._ring.append((stamp, position, effort))

    def _reject(self, rejection: Rejection) -> None:
        self._rejected += 1

    def _on_error(self, data: bytes) -> None:
        with suppress(Rejection):
            self._monitor = list(message_in(data, Float64MultiArray).data)
            self._heard = time.monotonic()

    def _on_diagnosis(self, data: bytes) -> None:
        with suppress(Rejection, ValueError):  # no JSON: not of our monitor
            found = json.loads(message_in(data, String).data, parse_constant=lambda _: None)
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

    def taken(self) -> Recording:
        """Return what the ring holds.

        Raises
        ------
        PprsError
            Where that is no recording.
        """
        with self.stream.lock:
            samples = list(self._ring)
        if not samples:
            raise UnreadableFileError('joint_states', 'nothing has come in yet')
        # Here and not above: it brings multiprocessing, which this node does without.
        from pprs_dynamics.ros.diagnosis_worker import StreamWindow

        return StreamWindow.of(samples).recording('live', self.model.drives)

    def to_dict(self) -> dict[str, Any]:
        """Return how it stands, and what was left of late [N]."""
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
                'effects': list(self.model.values.get(ACTIVE, ())),
                'error': [finite(value) for value in running],
                'monitor_error': [finite(value) for value in self._monitor]
                if self._monitor is not None and now - self._heard < ERROR_SPAN else None,
                'time': [moment for moment, _ in late[::step]],
                'residual': [[finite(value) for value in column] for column in zip(
                    *(values.tolist() for _, values in late[::step]), strict=True)]}


class LiveNodes:
    """The node in a thread of its own, for callers of other threads.

    Parameters
    ----------
    model : DriveModel
        That running nodes have as well.
    topic, monitor, feedforward : str
        As `LiveJointStates`.
    namespace : str
        In which relative names are resolved.
    arguments : sequence of str
        Of ROS 2, with --ros-args: remappings, use_sim_time, QoS overrides.
    """

    def __init__(self, model: DriveModel, topic: str = 'joint_states', monitor: str = 'monitor',
                 feedforward: str = 'feedforward', namespace: str = '',
                 arguments: Sequence[str] = ()) -> None:
        self._context = Context()
        rclpy.init(args=list(arguments), context=self._context,
                   signal_handler_options=SignalHandlerOptions.NO)
        self._node = LiveJointStates(model, topic, monitor, feedforward, namespace=namespace,
                                     context=self._context)
        self._steps = ModelSteps(self._node.clients_of)
        self._models: list[DriveModel] = []  # before each step
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name='live', daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def close(self) -> None:
        """End it, and leave the graph."""
        self._executor.shutdown()
        self._thread.join(PATIENCE)
        self._node.destroy_node()
        self._context.try_shutdown()

    def to_dict(self) -> dict[str, Any]:
        """Return state and running errors."""
        return {**self._node.to_dict(), 'can_restore': self.can_restore}

    def take(self, path: Path) -> None:
        """Write what the ring holds as a recording."""
        write_recording(path, self._node.taken())

    def machine(self) -> str:
        """Return what would be set, in words: nodes, robot, and who takes the commands."""
        there = running(self._node.clients_of)
        if not there:
            return ''
        return '; '.join((f'nodes {", ".join(self._node.full_name(name) for name in there)}',
                          *self._node.machines(there)))

    def set_model(self, model: DriveModel, confirmed: str) -> dict[str, Any]:
        """Set a model's effects on the running nodes, all or none, and compare with it here.

        Parameters
        ----------
        model : DriveModel
        confirmed : str
            `machine` as a person has read it.

        Returns
        -------
        dict
            `is_set`, and `nodes`: what each said; '' where it took everything.
        """
        answer = self._steps.set_model(
            model.values, self._node.model.values, self._confirmed(confirmed))
        if answer.is_done:
            self._models.append(self._node.model)
            self._node.stream.use_model(model)
        return {'is_set': answer.is_done, 'nodes': answer.said}

    def restore(self, confirmed: str) -> dict[str, Any]:
        """Set the nodes back to what they had before the last model; see `set_model`."""
        answer = self._steps.restore(self._confirmed(confirmed))
        if answer.is_done:
            self._node.stream.use_model(self._models.pop())
        return {'is_set': answer.is_done, 'nodes': answer.said}

    @property
    def can_restore(self) -> bool:
        """Whether a model was set that can be taken back."""
        return self._steps.can_restore

    def _confirmed(self, confirmed: str) -> list[str]:
        """Return the names of the running nodes, where a person has confirmed just these."""
        if not (now := self.machine()):
            raise UnconfirmedError('no node runs that could be set')
        if confirmed != now:
            raise UnconfirmedError(f'not confirmed: what would be set is {now}')
        return running(self._node.clients_of)
