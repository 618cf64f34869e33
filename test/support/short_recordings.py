# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The benchmark's recordings with hidden effects, shorter than it makes them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from benchmarks.hidden import recordings


@contextmanager
def short_recordings(duration: float) -> Iterator[None]:
    """Let recordings last that long [s]; what was prepared for others is forgotten."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recordings, 'DURATION', duration)
        forget()
        yield
    forget()


def forget() -> None:
    """Empty the caches of scenes and motions."""
    recordings.scene.cache_clear()
    recordings._motion.cache_clear()
