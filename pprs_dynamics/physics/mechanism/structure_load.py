# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Loads on a mechanism beside its bodies and gravity, as effects state them."""

from __future__ import annotations

from typing import Any, NamedTuple

from pprs_dynamics.arrays import Array


class StructureLoad(NamedTuple):
    """Loads on the mechanism beside bodies and gravity.

    Parameters
    ----------
    wrench : (N, 6) array
        Force [N] and moment [N m] that the platform, or the tool of a mechanism, applies at its
        origin, in `base`.
    hinge : (N, 3) array or 0
        Of a 3-PPRS: moment about n_i that resists growing u_i in C_i [N m]. No other mechanism
        has these joints.
    """

    wrench: Array
    hinge: Array | float = 0.0

    def __add__(self, other: StructureLoad) -> StructureLoad:  # type: ignore[override]
        return StructureLoad(self.wrench + other.wrench, self.hinge + other.hinge)

    def at(self, samples: Any) -> StructureLoad:
        """Return the loads at samples that a slice, a mask or indices select."""
        return StructureLoad(self.wrench[samples], self.hinge if isinstance(self.hinge, float)
                             else self.hinge[samples])
