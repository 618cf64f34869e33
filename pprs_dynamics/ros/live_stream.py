# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Joint states of a topic, merged and compared with a model: for the monitor and the workbench."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import EffectError, PprsError
from pprs_dynamics.inference.residuals.live import ERROR_SPAN, Compared, LiveComparison
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.ros.messages.conversions import NANOSECONDS, RobotNames
from pprs_dynamics.ros.messages.measured_states import MeasuredStates
from pprs_dynamics.ros.messages.status_codes import Code, Rejection
from pprs_dynamics.ros.node.qos import MEASURED, subscription
from pprs_dynamics.ros.node.senders import publishers_of

TOPIC = 'joint_states'
PATIENCE = 2.0  # [s] without a comparison before the reason is reported


class LiveStream:
    """A subscription to joint states and their comparison with the model.

    The executor's thread takes messages and calls `compare`; other threads take `lock` to read.

    Parameters
    ----------
    node : Node
    model : DriveModel
    take : callable
        Called with stamp [ns], positions and efforts (D,) of every sample.
    reject : callable
        Called with the Rejection of a message, or of samples that the model cannot follow.
    is_active : callable, optional
        Returns whether messages are taken.
    topic : str
    window, span : float, optional
        As `LiveComparison`.

    Attributes
    ----------
    counters : dict of int
        `received` messages, `samples` of all drives, `compared` ones.
    trouble : Rejection or None
        Why the last message or comparison failed.
    """

    def __init__(
        self, node: Node, model: DriveModel, take: Callable[[int, Array, Array], None],
        reject: Callable[[Rejection], None], is_active: Callable[[], bool] = lambda: True,
        topic: str = TOPIC, window: float | None = None, span: float = ERROR_SPAN,
    ) -> None:
        self._node, self._topic, self._take = node, topic, take
        self._reject, self._is_active = reject, is_active
        self._joints = RobotNames.of(model).joints
        self._window, self._span = window, span
        self.lock = threading.Lock()
        self.counters = {'received': 0, 'samples': 0, 'compared': 0, 'gaps': 0, 'bridged': 0}
        self._subscription: Any = None
        self.begin(model)

    def begin(self, model: DriveModel) -> None:
        """Begin with a stream anew."""
        with self.lock:
            self.model = model
            self.comparison = LiveComparison(model, self._window, self._span)
            self._states = MeasuredStates(self._joints)
            self.origin: int | None = None
            self._stamp = 0
            self._begins_anew = self._cannot_begin = False
            self.trouble: Rejection | None = None
            now = time.monotonic()
            self._received = self._advanced = self._measured = self._compared = now

    def listen(self) -> None:
        """Subscribe; best effort, which hears reliable publishers as well."""
        self._subscription = subscription(
            self._node, JointState, self._topic, self._on_state, profile=MEASURED)

    def close(self) -> None:
        """Unsubscribe."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._subscription = None

    def use_model(self, model: DriveModel) -> None:
        """Compare with another model from the next comparison on."""
        with self.lock:
            self.model, self._begins_anew = model, True

    def _on_state(self, data: bytes) -> None:
        if not self._is_active():
            return
        self.counters['received'] += 1
        self._received = time.monotonic()
        try:
            with self.lock:
                self._push(data)
        except Rejection as rejection:
            self.trouble = rejection
            self._reject(rejection)

    def _push(self, data: bytes) -> None:
        samples = self._states.read(data)
        self.counters['samples'] += len(samples)
        for stamp, position, effort in samples:
            if stamp != self._stamp:
                self._advanced = self._received
            if np.isfinite(effort).any():
                self._measured = self._received
            self._stamp = stamp
            self._take(stamp, position, effort)
            if self._cannot_begin:
                continue  # samples would pile up
            if self.origin is None:
                self.origin = stamp
            # Counted from the first stamp: seconds since 1970 would cost digits.
            self.comparison.push((stamp - self.origin) / NANOSECONDS, position, effort)

    def compare(self) -> Compared | None:
        """Return the samples compared since the last call; None for none."""
        try:
            with self.lock:
                if self._begins_anew:
                    self._cannot_begin = True
                    self.comparison.use_model(self.model)
                    self._begins_anew = self._cannot_begin = False
                compared = self.comparison.evaluate()
        except PprsError as error:
            # The memory of an effect that failed may be half advanced.
            self._begins_anew |= isinstance(error, EffectError)
            self.trouble = Rejection.of(error)
            self._reject(self.trouble)
            return None
        self.counters.update(gaps=self.comparison.gaps, bridged=self.comparison.bridged)
        if compared is not None:
            self.trouble = None
            self.counters['compared'] += len(compared.time)
            self._compared = time.monotonic()
        return compared

    def stamp_of(self, moment: float) -> int:
        """Return the stamp [ns] of a time of `Compared` [s]."""
        return (self.origin or 0) + round(moment * NANOSECONDS)

    @property
    def measures_no_effort(self) -> bool:
        """Whether no effort has been a number for a while."""
        return time.monotonic() - self._measured > PATIENCE

    def waits_for(self) -> tuple[Code, str] | None:
        """Return why nothing has been compared for `PATIENCE`, as code and sentence."""
        now = time.monotonic()
        if now - self._compared <= PATIENCE:
            return None
        topic = self._node.resolve_topic_name(self._topic)
        if now - self._received > PATIENCE:
            publishers = publishers_of(self._node, self._topic) or 'nobody'
            return 'WAITING', (f'no joint states on {topic} for {now - self._received:.0f} s; '
                               f'publishers: {publishers}')
        if self.trouble is not None:
            return self.trouble.code, self.trouble.text
        if now - self._advanced > PATIENCE:
            return 'TIME', (f'header.stamp of {topic} stays at {self._stamp / NANOSECONDS:g} s: it '
                            'must be the time of the measurement')
        return 'GAPS', (f'joint states of {topic} come with gaps, or more slowly than 10 Hz: '
                        'no window of samples is complete')
