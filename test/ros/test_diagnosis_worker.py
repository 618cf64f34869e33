# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Windows of a stream, and the process that diagnoses them."""

from __future__ import annotations

import os
import signal
import time
from itertools import pairwise
from typing import Any

import numpy as np
from single_axis import axis, axis_recording

from pprs_dynamics.ros.diagnosis_worker import DiagnosisWorker, StreamWindow, StreamWindows

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
    for window, following in pairwise(found):
        assert window.stamp[-1] < following.stamp[0]
    assert all(window.stamp[-1] - window.stamp[0] <= 10 * SECOND for window in found)


def test_a_short_period_waits_until_half_a_span_is_there() -> None:
    found = pushed(StreamWindows(2.0, 10.0), 30.0, 20.0, EPOCH)
    assert all(window.stamp[-1] - window.stamp[0] >= 5 * SECOND for window in found)


def test_a_clock_that_is_set_back_begins_a_new_stream() -> None:
    windows = StreamWindows(10.0, 10.0)
    pushed(windows, 8.0, 20.0, EPOCH)
    found = pushed(windows, 12.0, 20.0, EPOCH - 3600 * SECOND)
    assert [window.stamp[0] for window in found] == [EPOCH - 3600 * SECOND]


def test_the_process_answers_and_is_started_anew_where_it_was_killed() -> None:
    model = axis()
    run = axis_recording(model)
    stamp = EPOCH + np.rint(run.time * SECOND).astype(np.int64)
    samples = StreamWindow(stamp, run.position, run.effort)
    worker = DiagnosisWorker()
    try:
        worker.submit(model.values, model.source, samples)
        os.kill(process_of(worker), signal.SIGKILL)
        assert 'ended' in waited_for(worker)['error']
        worker.submit(model.values, model.source, samples)
        assert os.getpriority(os.PRIO_PROCESS, process_of(worker)) >= 0
        answer = waited_for(worker)
        assert answer['effects'] == []
        assert answer['verdict'] == 'adequate'
        assert answer['window'][0] == EPOCH / SECOND
    finally:
        worker.close()
    assert not worker.busy


def process_of(worker: DiagnosisWorker) -> int:
    assert worker._process is not None
    return worker._process._process.pid


def waited_for(worker: DiagnosisWorker) -> dict[str, Any]:
    """Return the worker's answer."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if (answer := worker.poll()) is not None:
            return answer
        time.sleep(0.05)
    raise AssertionError('no answer')
