# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What comes with every message is told once in a while, each kind for itself."""

from __future__ import annotations

from typing import Any

import pytest

from pprs_dynamics.ros.node import throttled_log
from pprs_dynamics.ros.node.throttled_log import ThrottledLog


class Told(list[str]):
    """Stands for a node and its logger."""

    def get_logger(self) -> Told:
        return self

    def warning(self, text: str) -> None:
        self.append(text)


def test_each_kind_is_told_once_in_its_period(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(throttled_log.time, 'monotonic', lambda: now)
    told: Any = Told()
    log = ThrottledLog(told)
    for k in range(30):
        now = 100.0 + 0.1 * k
        log.warning('rejected', f'rejected {k}')
        log.warning('clock', f'clock {k}', 2.0)
    assert told == ['rejected 0', 'clock 0', 'rejected 10', 'rejected 20', 'clock 20']
