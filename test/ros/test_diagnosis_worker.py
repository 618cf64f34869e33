# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Windows of a stream, and the process that diagnoses them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel
from pprs_dynamics.errors import WorkspaceError
from pprs_dynamics.inference.diagnosis import live_diagnosis
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.ros import diagnosis_worker
from pprs_dynamics.ros.diagnosis_worker import (
    ADOPTED,
    DiagnosisWorker,
    StreamWindow,
    StreamWindows,
)

SECOND = 1_000_000_000
EPOCH = 1_700_000_000 * SECOND
PATIENCE = 120.0  # [s] for one window on a busy machine


def pushed(windows: StreamWindows, seconds: float, rate: float, start: int) -> list[StreamWindow]:
    """Return the windows that are due while a stream runs."""
    found = []
    for k in range(round(seconds * rate)):
        windows.push(start + round(k * SECOND / rate), np.full(6, k), np.zeros(6))
        if (samples := windows.take()) is not None:
            found.append(samples)
    return found


def test_windows_do_not_overlap_and_are_no_longer_than_the_span() -> None:
    found = pushed(StreamWindows(10.0, 10.0), 35.0, 20.0, EPOCH)
    assert len(found) == 3
    for one, following in pairwise(found):
        assert one.stamp[-1] < following.stamp[0]
    assert all(one.stamp[-1] - one.stamp[0] <= 10 * SECOND for one in found)


def test_a_short_period_waits_until_half_a_span_is_there() -> None:
    found = pushed(StreamWindows(2.0, 10.0), 30.0, 20.0, EPOCH)
    assert all(one.stamp[-1] - one.stamp[0] >= 5 * SECOND for one in found)


def test_a_clock_that_is_set_back_begins_a_new_stream() -> None:
    windows = StreamWindows(10.0, 10.0)
    pushed(windows, 8.0, 20.0, EPOCH)
    found = pushed(windows, 12.0, 20.0, EPOCH - 3600 * SECOND)
    assert [one.stamp[0] for one in found] == [EPOCH - 3600 * SECOND]


def test_never_takes_no_memory() -> None:
    windows = StreamWindows(0.0, 10.0)
    assert pushed(windows, 20.0, 20.0, EPOCH) == []
    assert not windows._ring


def test_the_process_answers_and_is_started_anew_where_it_was_killed() -> None:
    model = DriveModel.load()
    motion = Excitation(15.0, seed=1).motion(np.arange(0, 15.0, 0.01))
    forces = model.drive_forces(motion)
    effort = forces.total + 0.05 * np.random.default_rng(0).standard_normal(forces.total.shape)
    stamp = EPOCH + np.arange(len(effort), dtype=np.int64) * SECOND // 100
    samples = StreamWindow(stamp, forces.mechanism.position, effort)
    worker = DiagnosisWorker()
    try:
        worker.submit(model.values, model.source, samples)
        os.kill(worker._process.pid, signal.SIGKILL)
        assert 'ended' in waited_for(worker)['error']
        worker.submit(model.values, model.source, samples)
        assert os.getpriority(os.PRIO_PROCESS, worker._process.pid) >= 0
        answer = waited_for(worker)
        assert answer['effects'] == []
        assert answer['verdict'] == 'adequate'
        assert answer['window'][0] == EPOCH / SECOND
    finally:
        worker.close()
    assert not worker.busy


def test_a_window_is_given_away_at_once_whatever_the_process_does() -> None:
    model, worker = DriveModel.load(), DiagnosisWorker()
    count = 30_000  # a minute at 500 Hz, more than a pipe holds
    still = StreamWindow(EPOCH + np.arange(count) * SECOND // 500, np.zeros((count, 6)),
                         np.zeros((count, 6)))

    def submit() -> None:
        giving = threading.Thread(
            target=worker.submit, args=(model.values, model.source, still), daemon=True)
        giving.start()
        giving.join(10.0)
        assert not giving.is_alive()

    try:
        submit()
        assert 'stands' in waited_for(worker)['note']
        os.kill(worker._process.pid, signal.SIGSTOP)
        submit()
        assert worker.poll() is None
        os.kill(worker._process.pid, signal.SIGCONT)
        assert 'stands' in waited_for(worker)['note']
        os.kill(worker._process.pid, signal.SIGSTOP)
        submit()
        os.kill(worker._process.pid, signal.SIGKILL)  # as the system does where memory runs out
        assert 'ended' in waited_for(worker)['error']
    finally:
        if worker._process is not None:
            worker._process.kill()
        worker.close()


class Windows:
    """The node's end of a pipe to the process: some windows, and what is answered to them."""

    def __init__(self, *windows: tuple[Any, ...]) -> None:
        self.windows = list(windows)
        self.answers: list[dict[str, Any]] = []

    def recv(self) -> tuple[Any, ...]:
        if not self.windows:
            raise EOFError
        return self.windows.pop(0)

    def send(self, answer: dict[str, Any]) -> None:
        self.answers.append(answer)


class Claiming:
    """A live diagnosis that claims a change with the first window, and fails at the second."""

    def __init__(self, model: DriveModel, text: str = '', reference: object = None) -> None:
        self.model, self.text, self.reference = model, text, reference

    def with_window(self, recording: Any, start: float) -> Claiming:
        if self.text:
            raise WorkspaceError(0, 'slide_1 is at 3 m', 'must be in its stroke')
        return Claiming(self.model, 'payload mass')

    def to_dict(self) -> dict[str, Any]:
        return {'text': self.text, 'confirmed': bool(self.text), 'withdrawn': ['gone before']}

    def adopted(self) -> dict[str, Any]:
        return {'masses.payload': 1.0} if self.text else {}


def test_what_is_claimed_stands_where_a_window_cannot_be_diagnosed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live_diagnosis, 'LiveDiagnosis', Claiming)
    monkeypatch.setattr(os, 'nice', lambda by: 0)
    model = DriveModel.load()
    still = StreamWindow(EPOCH + np.arange(100) * SECOND // 100, np.zeros((100, 6)),
                         np.zeros((100, 6)))
    pipe = Windows((model.values, '', (), still), (model.values, '', (), still),
                   ({'masses.payload': -1.0}, '', (), still))
    diagnosis_worker._work(pipe)
    claimed, failed, unknown = pipe.answers
    assert claimed['text'] == failed['text'] == 'payload mass'
    assert claimed[ADOPTED] == failed[ADOPTED] == {'masses.payload': 1.0}
    assert 'slide_1' in failed['error']
    assert failed['withdrawn'] == []
    assert set(unknown) == {'error'}


def test_the_process_tells_what_has_changed_since_a_reference(tmp_path: Path,
                                                              monkeypatch: pytest.MonkeyPatch,
                                                              ) -> None:
    """What was always there is no change; a file that is not there is one sentence."""
    monkeypatch.setattr(os, 'nice', lambda by: 0)
    model = arm.real_arm(tmp_path)
    moved = arm.motion(20.0, seed=0)

    def window(seed: int, change: float) -> Recording:
        clean = arm.record(model, moved, 0.05, seed)
        effort = clean.effort + np.tanh(3 * np.sin(4 * moved.position))
        effort[:, 1] += change * np.tanh(moved.velocity[:, 1] / 0.002)
        return Recording.from_arrays('run', clean.time, clean.position, None, effort, clean.drives)

    def sent(one: Recording) -> StreamWindow:
        return StreamWindow(EPOCH + np.rint(one.time * SECOND).astype(np.int64), one.position,
                            one.effort)

    healthy = tmp_path / 'healthy.csv'
    write_recording(healthy, window(1, 0.0))
    values, source = dict(model.values), model.source
    pipe = Windows(*((values, source, reference, sent(window(seed, change)))
                     for reference, seed, change in (
                         ((str(healthy),), 2, 0.0), ((str(healthy),), 3, 0.6),
                         ((str(tmp_path / 'gone.csv'),), 4, 0.0))))
    diagnosis_worker._work(pipe)
    same, changed, gone = pipe.answers
    assert same['verdict'] == 'adequate', same
    assert [(one['name'], one['drives']) for one in changed['effects']] == [
        ('coulomb_friction', ['swing'])]
    assert set(gone) == {'error'}
    assert 'gone.csv' in gone['error']


def waited_for(worker: DiagnosisWorker) -> dict[str, Any]:
    """Return the worker's answer."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if (answer := worker.poll()) is not None:
            return answer
        time.sleep(0.05)
    raise AssertionError('no answer')


NODE = """
import os, signal
import numpy as np
from pprs_dynamics.ros.diagnosis_worker import DiagnosisWorker, StreamWindow
if __name__ == '__main__':
    signals = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    worker = DiagnosisWorker()
    worker.submit({}, '', StreamWindow(np.zeros(1, dtype=np.int64), np.zeros((1, 6)),
                                       np.zeros((1, 6))))
    os.kill(os.getpid(), signal.SIGTERM)
    print(signal.sigtimedwait(signals, 5).si_signo == signal.SIGTERM)
    worker.close()
"""


def test_a_node_with_a_diagnosis_still_waits_for_its_stop_signals(tmp_path: Path) -> None:
    """Unblocked by multiprocessing, SIGTERM would end the node on the spot, without a last word."""
    script = tmp_path / 'node.py'
    script.write_text(NODE)
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert ended.stdout == 'True\n', ended
