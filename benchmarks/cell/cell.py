# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A controller_manager with hardware of its own, nodes of the package, and a probe."""

from __future__ import annotations

import json
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from ament_index_python.packages import get_package_prefix
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_processes import environment, executable, node_process, reserve_domain
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from pprs_dynamics.arrays import Array

CONFIG = Path(__file__).parents[2] / 'config' / 'ros2_control'
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE = 90.0  # [s] for a node that compiles its equations on a busy machine
WARN = 30  # of rcl_interfaces/Log
STRICT = 2  # of controller_manager_msgs/SwitchController: all of it or nothing
MOCK = {'plugin': 'mock_components/GenericSystem'}
TOPICS = {'plugin': 'joint_state_topic_hardware_interface/JointStateTopicSystem',
          'joint_commands_topic': '/hardware_commands', 'joint_states_topic': '/hardware_states',
          'trigger_joint_command_threshold': '-1'}


def configured(name: str, **changed: Any) -> dict[str, Any]:
    """Return the content of a file that users copy, with parameters of its controller set."""
    content: dict[str, Any] = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    content[name]['ros__parameters'].update(changed)
    return content


def described(joints: Mapping[str, float], commands: Sequence[str], hardware: Mapping[str, str],
              ) -> str:
    """Return the URDF of slides that start at positions [m], with their hardware."""
    links = ''.join(
        f'<link name="{name}_link"/><joint name="{name}" type="prismatic"><parent link="base"/>'
        f'<child link="{name}_link"/><axis xyz="0 0 1"/>'
        '<limit lower="-10" upper="10" effort="1000" velocity="10"/></joint>' for name in joints)
    given = ''.join(f'<param name="{name}">{value}</param>' for name, value in hardware.items()
                    if name != 'plugin')
    interfaces = ''.join(
        f'<joint name="{name}">'
        + ''.join(f'<command_interface name="{command}"/>' for command in commands)
        + f'<state_interface name="position"><param name="initial_value">{start}</param>'
          '</state_interface>'
          '<state_interface name="velocity"><param name="initial_value">0.0</param>'
          '</state_interface><state_interface name="effort"/></joint>'
        for name, start in joints.items())
    return (f'<robot name="slides"><link name="base"/>{links}<ros2_control name="slides" '
            f'type="system"><hardware><plugin>{hardware["plugin"]}</plugin>{given}</hardware>'
            f'{interfaces}</ros2_control></robot>')


class Cell:
    """Starts everything in a domain of its own and keeps what is said.

    Parameters
    ----------
    stack : ExitStack
        Which ends the processes.
    """

    def __init__(self, stack: ExitStack) -> None:
        self._domain, holder = reserve_domain()
        self._stack, self._executables = stack, 0
        stack.callback(holder.close)
        self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self._domain)
        stack.callback(self.context.try_shutdown)
        self.node = Node('probe', context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        stack.callback(self.node.destroy_node)
        self.log: list[tuple[float, str, str]] = []  # when, who and what, from warnings on
        self._listeners: list[Any] = []
        self._managers: list[subprocess.Popen[bytes]] = []
        self.listen(Log, '/rosout', self._on_log, QoSProfile(depth=1000))

    # --- time -----------------------------------------------------------------------------------

    def spin(self, duration: float) -> None:
        """Take what comes for a time [s]."""
        end = time.monotonic() + duration
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def wait(self, condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> None:
        """Take what comes until a condition holds.

        Raises
        ------
        TimeoutError, RuntimeError
        """
        end = time.monotonic() + patience
        while not condition():
            if any(manager.poll() is not None for manager in self._managers):
                raise RuntimeError(f'a controller manager has ended; {self._last_lines()}')
            if time.monotonic() > end:
                raise TimeoutError(f'{what}: not within {patience:g} s; {self.log[-3:]}; '
                                   + self._last_lines())
            self._executor.spin_once(timeout_sec=0.05)

    def answered(self, future: Any, what: str) -> Any:
        """Return the answer of a service or an action."""
        self.wait(future.done, what)
        return future.result()

    # --- processes ------------------------------------------------------------------------------

    def run(self, command: Sequence[str], *arguments: str) -> subprocess.Popen[bytes]:
        """Start a process that ends with the cell."""
        self._executables += 1
        log = self._folder / f'{self._executables}_{Path(command[0]).name}.log'
        return self._stack.enter_context(node_process(
            [*command, '--ros-args', *arguments], self._domain, log, environment(self._domain)))

    def start(self, name: str, *given: str, **parameters: Any) -> subprocess.Popen[bytes]:
        """Start a node of the package, of the paper's robot."""
        assigned = [f'{key}:={str(value).lower() if isinstance(value, bool) else value}'
                    for key, value in parameters.items()]
        return self.run([executable(name)], *given,
                        *(word for value in assigned for word in ('-p', value)))

    def _last_lines(self) -> str:
        return '; '.join(f'{file.name}: {file.read_text(errors="replace")[-300:]}'
                         for file in sorted(self._folder.glob('*.log')))

    # --- what is said ---------------------------------------------------------------------------

    def listen(self, kind: type, topic: str, callback: Callable[[Any], None], qos: Any = 1000,
               ) -> None:
        """Hand what comes on a topic to a callback."""
        self._listeners.append(self.node.create_subscription(kind, topic, callback, qos))

    def _on_log(self, message: Any) -> None:
        if message.level >= WARN:
            self.log.append((time.monotonic(), message.name, message.msg))

    def said(self, words: str, since: float = 0.0) -> int:
        """Return how often a warning or an error with these words came since a moment."""
        return sum(words in text and when >= since for when, _, text in self.log)

    def status(self, node: str) -> list[dict[str, Any]]:
        """Return a list that fills with what a node says of itself."""
        found: list[dict[str, Any]] = []
        self.listen(String, f'/{node}/status', lambda message: found.append(
            {'at': time.monotonic(), **json.loads(message.data)}), LATCHED)
        return found

    # --- controllers ----------------------------------------------------------------------------

    def manage(self, content: Mapping[str, Any], joints: Mapping[str, float],
               commands: Sequence[str] = ('effort',), hardware: Mapping[str, str] = MOCK,
               namespace: str = '') -> None:
        """Start a controller manager with the parameters of its controllers, and its hardware."""
        self._executables += 1
        where = f'/{namespace}' if namespace else ''
        file = self._folder / f'{self._executables}.yaml'
        file.write_text(yaml.safe_dump(
            {f'{where}/{name}' if where else name: value for name, value in content.items()}))
        described_on = self.node.create_publisher(String, f'{where}/robot_description', LATCHED)
        described_on.publish(String(data=described(joints, commands, hardware)))
        prefix = get_package_prefix('controller_manager')
        self._managers.append(self.run(
            [f'{prefix}/lib/controller_manager/ros2_control_node'], '-r', f'__ns:={where or "/"}',
            '--params-file', str(file)))

    def end_manager(self, how: signal.Signals) -> None:
        """Send a signal to the controller manager that was started last, and miss it no more."""
        self._managers.pop().send_signal(how)

    def activate(self, *names: str, namespace: str = '') -> None:
        """Load, configure and activate controllers, as a spawner does."""
        from controller_manager_msgs.srv import ConfigureController, LoadController

        for name in names:
            for kind, service in ((LoadController, 'load_controller'),
                                  (ConfigureController, 'configure_controller')):
                if not self._call(kind, service, namespace, name=name).ok:
                    raise RuntimeError(f'{service} {name}: {self.log[-5:]}')
        self.switch(activate=names, namespace=namespace)

    def switch(self, activate: Sequence[str] = (), deactivate: Sequence[str] = (),
               namespace: str = '') -> None:
        """Activate and deactivate controllers that are configured."""
        from controller_manager_msgs.srv import SwitchController

        answer = self._call(
            SwitchController, 'switch_controller', namespace, strictness=STRICT,
            activate_controllers=list(activate), deactivate_controllers=list(deactivate))
        if not answer.ok:
            raise RuntimeError(f'switching {activate} {deactivate}: {self.log[-5:]}')

    def _call(self, kind: Any, service: str, namespace: str, **request: Any) -> Any:
        where = f'/{namespace}' if namespace else ''
        client = self.node.create_client(kind, f'{where}/controller_manager/{service}')
        self.wait(client.service_is_ready, f'{service} is not served')
        answer = self.answered(client.call_async(kind.Request(**request)), service)
        self.node.destroy_client(client)
        return answer


@contextmanager
def cell() -> Iterator[Cell]:
    """Give a cell that ends with the block."""
    with ExitStack() as stack:
        yield Cell(stack)


class States:
    """States of a joint_trajectory_controller as they come, as arrays.

    Parameters
    ----------
    running : Cell
    controller : str
        With its namespace, without a leading slash.
    joints : sequence of str
        Whose values are kept, in order.
    """

    def __init__(self, running: Cell, controller: str, joints: Sequence[str]) -> None:
        from control_msgs.msg import JointTrajectoryControllerState

        self._joints = list(joints)
        self.rows: list[tuple[float, Array, Array, Array]] = []
        running.listen(JointTrajectoryControllerState, f'/{controller}/controller_state',
                       self._on_state)

    def _on_state(self, state: Any) -> None:
        places = [state.joint_names.index(name) for name in self._joints]
        nothing = np.full(len(state.joint_names), np.nan)
        # By the controller's clock: messages wait for this probe on a busy machine.
        late = time.time() - state.header.stamp.sec - 1e-9 * state.header.stamp.nanosec
        self.rows.append((time.monotonic() - late, *(
            (np.array(values) if len(values) else nothing)[places] for values in (
                state.reference.positions, state.reference.velocities, state.output.effort))))

    def since(self, moment: float) -> tuple[Array, Array, Array, Array]:
        """Return times [s] after a moment, positions, velocities and efforts from then on."""
        found = [row for row in self.rows if row[0] >= moment]
        if not found:
            raise TimeoutError('no controller_state came')
        when, *rest = zip(*found, strict=True)
        position, velocity, effort = (np.array(row) for row in rest)
        return np.array(when) - moment, position, velocity, effort


class Efforts:
    """Efforts of joint_states, in an order of joints."""

    def __init__(self, running: Cell, joints: Sequence[str], topic: str = '/joint_states') -> None:
        self._joints = list(joints)
        self.rows: list[Array] = []
        self.order: list[str] = []
        running.listen(JointState, topic, self._on_state)

    def _on_state(self, state: Any) -> None:
        self.order = list(state.name)
        if len(state.effort) == len(state.name):
            values = dict(zip(state.name, state.effort, strict=True))
            self.rows.append(np.array([values[name] for name in self._joints]))
