# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Bins of a variable, each with enough samples."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array

BINS = 12
# A bin must hold this share of the samples, else its mean is that of an incident.
LEAST_SHARE = 0.01


def bin_edges(values: Array, bins: int) -> Array:
    """Return edges halfway between equal widths and equal numbers of samples."""
    even = np.linspace(values.min(), values.max(), bins + 1)
    edges = 0.5 * (even + np.quantile(values, np.linspace(0, 1, bins + 1)))
    return populated_edges(values, edges)


def populated_edges(values: Array, edges: Array) -> Array:
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
