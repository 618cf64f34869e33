# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The recursion of everything that settles with a time constant."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array


def first_order(kept: Array | float, driven: Array, before: float) -> Array:
    """Return y_k = kept_k y_{k-1} + driven_k, (N,), from y_{-1} = before.

    Pieces of a stream give the same to the bit as all at once: every step is taken by the solver,
    whether that rounds a product or not.

    Parameters
    ----------
    kept : (N,) array or float
    driven : (N,) array
    before : float
    """
    # Here: few models have it. scipy.signal, which has a filter as well, takes 0.4 s to import.
    from scipy.linalg.blas import dtbsv

    # y_k - kept_k y_{k-1} = driven_k: a triangular system with one band below its diagonal.
    bands = np.zeros((2, len(driven) + 1), order='F')
    bands[1, :-1] = -np.asarray(kept)
    found: Array = dtbsv(1, bands, np.concatenate(([before], driven)), lower=1, diag=1)
    return found[1:]
