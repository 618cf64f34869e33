# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Commands that went over topics, held against the model's."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


def assert_are_the_models(came: np.ndarray, commands: np.ndarray, least: float) -> None:
    """Assert that commands that came are the model's, in their order, and more than so many.

    Both have the columns of `closed_loop.Tracking`. Times are not looked at: a player that was kept
    goes on later, and of a burst of messages some may be lost.
    """
    assert len(came) > least
    distance, row = cKDTree(commands[:, 1:]).query(came[:, 1:])
    assert np.max(distance) < 1e-9
    assert np.all(np.diff(row) >= 0)
