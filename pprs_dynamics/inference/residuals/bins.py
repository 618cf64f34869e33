# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bins of a variable, each with enough samples."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

BINS = 12
# A bin must hold this share of the samples, else its mean is that of an incident.
LEAST_SHARE = 0.01
# A range that holds more of them is no place: it is all of the recording but an incident.
MOST_SHARE = 0.95


def bin_edges(values: Array, bins: int) -> Array:
    """Return edges halfway between equal widths and equal numbers of samples."""
    even = np.linspace(values.min(), values.max(), bins + 1)
    edges = 0.5 * (even + np.quantile(values, np.linspace(0, 1, bins + 1)))
    return populated_edges(values, edges)


def bin_of(values: Array, edges: Array) -> np.typing.NDArray[np.intp]:
    """Return in which bin between edges (B + 1,) each value lies; beyond them in the next."""
    return np.clip(np.searchsorted(edges, values, side='right') - 1, 0, len(edges) - 2)


def populated_edges(values: Array, edges: Array) -> Array:
    """Return edges (B + 1,) without those between which too few values (N,) lie."""
    kept = [edges[0]]
    least = LEAST_SHARE * len(values)
    ordered = np.sort(values)
    rank = np.searchsorted(ordered, edges)
    last = 0
    for edge, position in zip(edges[1:-1], rank[1:-1], strict=True):
        if position - last >= least and len(values) - position >= least:
            kept.append(edge)
            last = position
    return np.array([*kept, edges[-1]])
