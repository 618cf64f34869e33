# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Node `monitor`: measured efforts against the model, live."""

from __future__ import annotations

import json
from contextlib import suppress
from threading import Thread
from typing import Any

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import common_effort
from pprs_dynamics.errors import PprsError
from pprs_dynamics.inference.residuals.live import ERROR_SPAN, GEAR_WINDOW, WINDOW, Compared
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.keys import is_described
from pprs_dynamics.ros.diagnosis_worker import ADOPTED, DiagnosisWorker, StreamWindows
from pprs_dynamics.ros.force_command import FRAME
from pprs_dynamics.ros.live_stream import LiveStream
from pprs_dynamics.ros.messages import conversions
from pprs_dynamics.ros.messages.conversions import RobotNames
from pprs_dynamics.ros.messages.status_codes import REJECTIONS, Rejection
from pprs_dynamics.ros.node.clocks import steady_timer
from pprs_dynamics.ros.node.managed_node import AUTOSTART, ManagedNode
from pprs_dynamics.ros.node.model_owner import ModelOwner, NotSetError, changes
from pprs_dynamics.ros.node.model_parameters import ModelParameters
from pprs_dynamics.ros.node.parameters import node_parameter, overrides, with_changed
from pprs_dynamics.ros.node.preparation import prepare_beside
from pprs_dynamics.ros.node.provenance import arguments_of, hardware_of
from pprs_dynamics.ros.node.qos import LATCHED
from pprs_dynamics.ros.node.status import StatusReporter
from pprs_dynamics.simulation.export.exported_robot import TreePose, TreePositions
from pprs_dynamics.system.json_records import for_json

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # it comes with a ROS 2 installation only
    TFMessage = None

PARAMETERS = (
    AUTOSTART,
    FRAME,
    node_parameter('tf_prefix', '', 'prefix of all frames on /tf: two robots need two', stays=True),
    node_parameter('window', WINDOW, 'length of the smoothing that gives velocities and '
                   'accelerations; answers lag by half [s]', lower=0.01, upper=2.0, stays=True),
    node_parameter('error_span', ERROR_SPAN, 'time over which ~/error is averaged [s]', lower=0.05,
                   upper=600.0, stays=True),
    node_parameter('update_rate', 50.0, 'how often the new samples are compared [Hz]',
                   lower=1.0, upper=1000.0, stays=True),
    node_parameter('diagnose_every', 0.0, 'period of the diagnosis of the latest window, '
                   'in another process [s]; 0: never', lower=0.0, upper=86400.0, stays=True),
    node_parameter('diagnose_span', 60.0, 'longest window that is diagnosed [s]', lower=5.0,
                   upper=3600.0, stays=True),
    node_parameter('diagnose_since', (), 'recordings of days on which the machine was correct: '
                   'windows are diagnosed for changes since then', stays=True),
    node_parameter('feedforward', 'feedforward', 'node whose effects ~/adopt_confirmed sets; '
                   'absolute, or in the namespace of this node', stays=True),
)

# `~/diagnosis` before the first window that was diagnosed.
NOTHING: dict[str, Any] = {'effects': [], 'withdrawn': [], 'confirmed': False, 'note': '',
                           'since': None, 'text': '', 'window': None}
# Of the samples of a second: from fewer compared ones on the stream is called broken.
FEW = 0.5
ENOUGH = 20  # samples in a second from which their compared share is reported
LOOK = 0.2  # [s] between looks for an answer of the diagnosis


class AllJoints:
    """The joints of a model's URDF, whose tree is made in a thread of its own at the first call.

    That takes half a second, and as long as compilers take where nothing is compiled yet.
    """

    def __init__(self) -> None:
        self._model: DriveModel | None = None
        self._made: list[TreePositions | PprsError] = []

    def at(self, model: DriveModel, position: Array) -> tuple[TreePositions, TreePose] | None:
        """Return the names, and where all is, for positions of the drives, (D,) [m, rad].

        None while the tree is being made.

        Raises
        ------
        PprsError
            As `TreePositions`.
        """
        if self._model is not model:
            self._model, self._made = model, []
            # Another list for each model: one that comes late is of no use any more.
            Thread(target=_make, args=(model, position, self._made), name='all_joints',
                   daemon=True).start()
        if not self._made:
            return None
        if isinstance(tree := self._made[0], PprsError):
            raise tree
        return tree, tree.at(position - model.position_error(position[None])[0])


def _make(model: DriveModel, position: Array, made: list[TreePositions | PprsError]) -> None:
    try:
        # Made anew here: buffers of a model serve one thread at a time.
        tree = TreePositions(DriveModel.from_parameters(model.values, model.source))
        with suppress(PprsError):  # it is there to load what is compiled
            tree.at(position)
        made.append(tree)
    except PprsError as error:
        made.append(error)


class MonitorNode(ManagedNode):
    """Publishes what the model says at every measured stamp, and how wrong it is.

    Configured, it listens; it compares while it is active, and begins with a stream anew each time.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('monitor', allow_undeclared_parameters=True, **options)
        arguments = arguments_of(options)
        self._worker = DiagnosisWorker()
        parameters = (with_changed(PARAMETERS, 'window', default=GEAR_WINDOW)
                      if is_described(overrides(self)) else PARAMETERS)
        self._settings = ModelParameters(self, arguments, parameters, self._use)
        node_values = self._settings.node_values
        prepare_beside(self, self._settings.model)
        self._names = RobotNames.of(self._settings.model, node_values['frame_id'])
        self._stream = LiveStream(
            self, self._settings.model, self._take, self._reject, lambda: self.state == 'active',
            window=node_values['window'], span=node_values['error_span'])
        self._counters = self._stream.counters
        self._counters.update(dict.fromkeys(REJECTIONS, 0))
        self._share, self._counted = 1.0, (0, 0)
        self._joints = AllJoints()
        self._adoptable: dict[str, Any] = {}  # values of the model with what is claimed
        self._diagnosed = self._settings.model  # the latest window against it
        self._begin_stream()
        self._owner = ModelOwner(self, node_values['feedforward'], lambda: self._settings.model,
                                 self.set_parameters_atomically)
        # In a group of its own: while it waits for the owner, all else is served.
        self.create_service(Trigger, '~/adopt_confirmed', self._adopt,
                            callback_group=ReentrantCallbackGroup())
        self._status = StatusReporter(
            self, self._counters, hardware_of(self._settings.model), self._refresh)
        self._refresh()
        self.begin(node_values[AUTOSTART.name])

    # --- life -----------------------------------------------------------------------------------

    def _begin_stream(self) -> None:
        node_values = self._settings.node_values
        self._stream.begin(self._settings.model)
        self._windows = StreamWindows(node_values['diagnose_every'], node_values['diagnose_span'])
        self._changed = ''
        self._latest: tuple[int, Array] | None = None

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the comparison."""
        self._begin_stream()
        self.get_logger().info(
            f'answers lag by half the window of {self._settings.node_values["window"]:g} s; ready')
        return super().on_activate(state)

    def finish(self) -> None:
        """End the process that diagnoses."""
        self._worker.close()

    def _create_topics(self) -> None:
        node_values = self._settings.node_values
        self._model_effort = self._publisher(JointState, '~/model_effort')
        self._residual = self._publisher(JointState, '~/residual')
        self._error = self._publisher(Float64MultiArray, '~/error')
        self._all_joints = self._publisher(JointState, '~/joint_states_full')
        self._tf = self._publisher(TFMessage, '/tf') if TFMessage else None
        self._stream.listen()
        clocks = [(1.0 / node_values['update_rate'], self._compare)]
        if node_values['diagnose_every']:
            self._diagnosis = self._publisher(String, '~/diagnosis', LATCHED)
            clocks.append((LOOK, self._diagnose))
        for period, callback in clocks:
            self._until_cleanup(self.destroy_timer, steady_timer(self, period, callback))

    def destroy_topics(self) -> None:
        self._stream.close()
        super().destroy_topics()

    def _use(self) -> None:
        self._stream.use_model(self._settings.model)
        self._changed, self._adoptable = '', {}  # they were of the model before

    # --- measurements -----------------------------------------------------------------------------

    def _take(self, stamp: int, position: Array, effort: Array) -> None:
        self._latest = stamp, position
        self._windows.push(stamp, position, effort)

    def _draw(self) -> None:
        """Publish where all joints are, for programs that draw the robot."""
        if self._latest is None or not self._all_joints.get_subscription_count():
            return  # tf is of no use without the joints, which robot_state_publisher listens to
        (stamp, position), self._latest = self._latest, None
        try:
            found = self._joints.at(self._settings.model, position)
        except PprsError as error:
            self.get_logger().warning(f'not drawn: {error}', throttle_duration_sec=5.0)
            return
        if found is None:
            return
        tree, pose = found
        self._all_joints.publish(conversions.joint_state(
            stamp, position=pose.joints, names=RobotNames(tuple(tree.names), '')))
        if tree.bodies and self._tf is not None:
            self._tf.publish(TFMessage(
                transforms=conversions.transforms(
                    stamp, tree.base, tree.bodies, pose.bodies,
                    self._settings.node_values['tf_prefix'])))

    def _compare(self) -> None:
        if self.state != 'active':
            return
        self._draw()
        if (compared := self._stream.compare()) is None:
            return
        self._publish(compared)
        running = self._stream.comparison.running_error()
        self._error.publish(Float64MultiArray(data=running.tolist()))
        self._status.content.error = [round(value, 6) if np.isfinite(value) else None
                                      for value in running.tolist()]
        unit = common_effort(self._settings.model.units)
        text = (f'largest running error {np.nanmax(running):.4g} {unit}'
                if np.isfinite(running).any() else
                'no running error: efforts are not measured, or no joint moves')
        text += f'; {self._share:.0%} of the samples are compared'
        if self._stream.measures_no_effort:
            self._status.report('WARN', 'WAITING', f'nothing is compared: {text}')
        elif drives := self._stream.comparison.unexplained():
            self._status.report(
                'WARN', 'UNEXPLAINED', f'the error of {", ".join(drives)} is as large as the '
                f'effort: this is another machine, or its efforts are no measurement; {text}')
        elif self._share < FEW:
            self._status.report(
                'WARN', 'GAPS', f'joint states are missing, {self._counters["gaps"]} times more '
                f'than two in a row; {text}')
        elif self._changed:
            self._status.report('WARN', 'CHANGED', f'{self._changed}; {text}')
        elif different := self._owner.difference():
            self._status.report('WARN', 'MODEL', f'{different}: the monitor compares another '
                                f'model than the one in force; {text}')
        else:
            self._status.report('OK', 'OK', text)

    def _refresh(self) -> None:
        """Bring the share of samples that are compared up to date; warn where there are none."""
        if self.state == 'active' and (reason := self._stream.waits_for()):
            code, text = reason
            self._status.report('WARN', code, f'nothing is compared: {text}')
        samples, compared = self._counters['samples'], self._counters['compared']
        came, were = samples - self._counted[0], compared - self._counted[1]
        self._counted = samples, compared
        # The first window, and what is still on its way, is none that is missing.
        if came >= ENOUGH and compared > came:
            self._share = min(1.0, were / came)
        self._status.content.model = self._settings.provenance
        self._status.content.compared_share = round(self._share, 3)

    def _diagnose(self) -> None:
        """Publish the worker's diagnosis, and submit the next window."""
        if self.state != 'active':
            return
        if (answer := self._worker.poll()) is not None:
            self._adoptable = answer.pop(ADOPTED, {})
            if error := answer.pop('error', ''):
                self.get_logger().warning(f'a window was not diagnosed: {error}')
                answer = {**NOTHING, **answer, 'note': error}
            changed = answer.get('text', '')
            if changed != self._changed:
                self.get_logger().warning(changed or 'the reported change has ended')
            self._changed = changed
            self._diagnosis.publish(String(data=json.dumps(for_json(answer))))
        if not self._worker.busy and (samples := self._windows.take()) is not None:
            self._diagnosed = model = self._settings.model
            self._worker.submit(model.values, model.source, samples,
                                tuple(self._settings.node_values['diagnose_since']))

    def _to_adopt(self) -> dict[str, Any]:
        """Return the model values that may be adopted now, or raise PprsError."""
        if self._diagnosed.values != self._settings.model.values:
            raise NotSetError('the latest window was diagnosed against another model than is '
                              'in force')
        if not self._changed:
            raise NotSetError('no effect is confirmed')
        if not self._adoptable:
            raise NotSetError('the latest window names other effects than are confirmed, and '
                              'its numbers were fitted together; the next one decides')
        return self._adoptable

    async def _adopt(self, request: Any, response: Any) -> Any:
        """Set the confirmed effects on the node that drives, which this one follows."""
        try:
            values = self._to_adopt()
            result = ((await self._owner.set_model(values)).result if self._owner.is_there
                      else self.set_parameters_atomically(changes(self._settings.model, values)))
            response.success = result.successful
            response.message = result.reason or 'the confirmed effects are in the model'
        except PprsError as error:
            response.message = str(error)
        self.get_logger().warning(f'adopt_confirmed: {response.message}')
        return response

    def destroy_node(self) -> None:
        """Take the process that diagnoses along."""
        self._worker.close()
        super().destroy_node()

    def _publish(self, compared: Compared) -> None:
        for topic, efforts in ((self._model_effort, compared.model),
                               (self._residual, compared.residual)):
            if topic.get_subscription_count():
                for time, effort in zip(compared.time, efforts, strict=True):
                    topic.publish(conversions.joint_state(
                        self._stream.stamp_of(time), effort, names=self._names))

    def _reject(self, rejection: Rejection) -> None:
        self._counters[rejection.code] += 1
        self._status.report('ERROR', rejection.code, rejection.text)
