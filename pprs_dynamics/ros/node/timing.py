# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Running statistics of durations."""

from __future__ import annotations

from typing import Any

import numpy as np

WINDOW = 1000


class Durations:
    """The last thousand durations [s], and the longest of all."""

    def __init__(self) -> None:
        self._recent, self._count, self._longest = np.zeros(WINDOW), 0, 0.0

    def add(self, duration: float) -> None:
        """Take one more [s]."""
        self._recent[self._count % WINDOW] = duration
        self._count += 1
        if duration > self._longest:
            self._longest = duration

    @property
    def median(self) -> float:
        """Of the last thousand [s]; 0 where there was none."""
        return float(np.median(self._recent[:self._count])) if self._count else 0.0

    def summary(self) -> dict[str, Any]:
        """Return p50 and p99 of the last thousand, and max of all [s], None where none was."""
        if not self._count:
            return {'p50': None, 'p99': None, 'max': None}
        p50, p99 = np.percentile(self._recent[:self._count], (50, 99))
        return {'p50': round(float(p50), 7), 'p99': round(float(p99), 7),
                'max': round(self._longest, 7)}
