# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The monitor's live diagnosis: windows of the stream, diagnosed in a process of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.system.worker_process import EndedError, WorkerProcess

if TYPE_CHECKING:
    from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
    from pprs_dynamics.measurement.files.recording import Recording

# A tenth of a node's share of a busy processor: at 19 a machine under load never answered.
LOW_PRIORITY = 10
ADOPTED = 'adopted'  # of an answer: values of the model with what is claimed
LEAST_WINDOW = 0.5  # share of the span that a window must have to be diagnosed


class StreamWindow(NamedTuple):
    """Joint states of one window: stamps [ns] (N,), position and effort (N, D)."""

    stamp: np.typing.NDArray[np.int64]
    position: Array
    effort: Array

    @classmethod
    def of(cls, states: Iterable[tuple[int, Array, Array]]) -> StreamWindow:
        """Return joint states that came in one by one, at least one."""
        stamp, position, effort = zip(*states, strict=True)
        return cls(np.array(stamp), np.stack(position), np.stack(effort))

    def recording(self, name: str, drives: tuple[str, ...]) -> Recording:
        """Return the recording that these are, counted from the first; or raise PprsError."""
        # Here and not above: a node that diagnoses nothing starts without it.
        from pprs_dynamics.measurement.files.recording import Recording

        return Recording.from_arrays(name, (self.stamp - self.stamp[0]) / 1e9, self.position,
                                     effort=self.effort, drives=drives)


class StreamWindows:
    """Cuts a stream of joint states into windows that do not overlap.

    Parameters
    ----------
    every : float
        Between diagnoses [s], by the stream's stamps; 0: never.
    span : float
        Longest window [s].
    """

    def __init__(self, every: float, span: float) -> None:
        self._every, self._span = round(every * 1e9), round(span * 1e9)
        self._ring: deque[tuple[int, Array, Array]] = deque()
        self._due: int | None = None

    def push(self, stamp: int, position: Array, effort: Array) -> None:
        """Take one sample; stamps that go back begin a new stream."""
        if not self._every:
            return
        if self._ring and stamp <= self._ring[-1][0]:
            self._ring.clear()
            self._due = None
        if self._due is None:
            self._due = stamp + max(self._every, round(LEAST_WINDOW * self._span))
        self._ring.append((stamp, position, effort))
        while self._ring[0][0] < stamp - self._span:
            self._ring.popleft()

    def take(self) -> StreamWindow | None:
        """Return the window that is due, None where none is; its samples are given away."""
        if self._due is None or not self._ring or self._ring[-1][0] < self._due:
            return None
        length = self._ring[-1][0] - self._ring[0][0]
        self._due += self._every
        if length < LEAST_WINDOW * self._span:
            return None
        rows = list(self._ring)
        self._ring.clear()
        return StreamWindow.of(rows)


class DiagnosisWorker:
    """A process that diagnoses windows one after the other, and stores the reported effects.

    It is ended with the node, and started anew where it ended by itself.
    """

    def __init__(self) -> None:
        self._process: WorkerProcess | None = None
        self.busy = False

    def submit(self, values: Mapping[str, Any], source: str, samples: StreamWindow,
               reference: tuple[str, ...] = ()) -> None:
        """Begin with a window; with another model than before all is forgotten.

        `reference` names the reference runs.
        """
        self._process = self._process or WorkerProcess(LOW_PRIORITY)
        self._process.submit(_diagnosed, (dict(values), source, reference), samples)
        self.busy = True

    def poll(self) -> dict[str, Any] | None:
        """Return the answer of `LiveDiagnosis.to_dict`, and `ADOPTED`; None: not yet.

        With a sentence as `error` where the window was not diagnosed; with that alone where
        nothing is known any more.
        """
        if self._process is None or not self.busy:
            return None
        try:
            answer: dict[str, Any] = self._process.answer(0.0)
        except TimeoutError:
            return None
        except EndedError:
            self.close()
            return {'error': 'the diagnosis process has ended; its state is lost'}
        self.busy = False
        return answer

    def close(self) -> None:
        """End the process, whatever it does."""
        if self._process is not None:
            self._process.close()
        self._process, self.busy = None, False


Asked = tuple[dict[str, Any], str, tuple[str, ...]]
"""Values of the model, its file, and reference runs."""

_LAST: list[tuple[Asked, LiveDiagnosis]] = []  # at most one, in the process that diagnoses


def _diagnosed(asked: Asked, samples: StreamWindow, progress: Any) -> dict[str, Any]:
    """Return the live diagnosis after a window of the same model."""
    from pprs_dynamics.errors import PprsError
    from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
    from pprs_dynamics.inference.fit.reference_runs import read_reference
    from pprs_dynamics.physics.model.drive_model import DriveModel

    failed: dict[str, Any] = {}
    try:
        if not _LAST or _LAST[0][0] != asked:
            _LAST.clear()
            values, source, runs = asked
            model = DriveModel.from_parameters(values, source)
            _LAST.append((asked, LiveDiagnosis(
                model, reference=read_reference(model, runs) if runs else None)))
        live = _LAST[0][1]
        _LAST[0] = asked, live.with_window(samples.recording(
            'the last window', live.model.drives), int(samples.stamp[0]) / 1e9)
    except PprsError as error:
        if not _LAST:
            return {'error': str(error)}
        # What is known of this model remains, though this window says nothing.
        failed = {'withdrawn': [], 'error': str(error)}
    live = _LAST[0][1]
    return {**live.to_dict(), ADOPTED: live.adopted(), **failed}
