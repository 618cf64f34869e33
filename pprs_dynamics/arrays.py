# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Types of numbers that all modules share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# In kernels, which are run on one sample or on many: a number or one a sample, and which sample.
Value = float | Array
Sample = int | slice
