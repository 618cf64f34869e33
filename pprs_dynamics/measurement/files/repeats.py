# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings that hold the same samples, whatever their files, formats and clocks are called.

Given twice, a recording counts twice as evidence; fitted and held out, it confirms itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pprs_dynamics.measurement.files.recording import Recording

# So many samples in a row that are equal to the last bit, while drives move, are no chance, even
# of one coarse encoder with coarse efforts.
WINDOW = 50
# Share of the shorter recording below which two have only touched, as split ones may.
LEAST_SHARE = 0.01
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)  # odd, of irregular bits


def shared_samples(first: Recording, second: Recording) -> int:
    """Return the number of consecutive samples that two recordings share.

    Positions and efforts are compared, not times: another format may count them from elsewhere.
    """
    ours, theirs = _windows(first), _windows(second)
    same = np.isin(theirs, ours[ours > 0]) & (theirs > 0)
    covered = np.zeros(len(second.time) + 1, dtype=np.int64)
    np.add.at(covered, np.flatnonzero(same), 1)
    np.add.at(covered, np.flatnonzero(same) + WINDOW, -1)
    count = int(np.sum(np.cumsum(covered[:-1]) > 0))
    return count if count >= LEAST_SHARE * min(len(first.time), len(second.time)) else 0


def find_repeat(
    recordings: Sequence[Recording], earlier: Sequence[Recording] = (),
) -> tuple[int, str] | None:
    """Return the first recording that repeats one before it, and how, as a clause.

    Parameters
    ----------
    recordings : sequence of Recording
    earlier : sequence of Recording
        That come before all of them.

    Returns
    -------
    (index, clause) or None
    """
    for index, recording in enumerate(recordings):
        for other in (*earlier, *recordings[:index]):
            count = shared_samples(other, recording)
            if count:
                which = 'all' if count == len(recording.time) else f'{count}'
                return index, (f'{which} of its {len(recording.time)} samples are those of '
                               f'{other.name}, too')
    return None


def _windows(recording: Recording) -> NDArray[np.uint64]:
    """Return a number for every `WINDOW` samples in a row, (N - WINDOW + 1,); 0 at rest."""
    from pandas import DataFrame  # takes a third of a second
    from pandas.util import hash_pandas_object

    count = len(recording.time) - WINDOW + 1
    if count < 1:
        return np.zeros(0, dtype=np.uint64)
    # The same bits for NaN of any kind, and for 0 of either sign.
    values = np.concatenate((recording.position, recording.effort), axis=1) + 0.0
    values[np.isnan(values)] = np.nan
    rows = hash_pandas_object(DataFrame(values), index=False).to_numpy()
    with np.errstate(over='ignore'):
        found = np.zeros(count, dtype=np.uint64)
        for k in range(WINDOW):
            found = found * _MULTIPLIER + rows[k:k + count]
    moves = np.any(np.diff(recording.position, axis=0) != 0, axis=1)
    moving = np.convolve(moves, np.ones(WINDOW - 1), mode='valid') >= WINDOW / 2
    return np.where(moving, np.maximum(found, np.uint64(1)), np.uint64(0))
