# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Loads of effects on a mechanism, in addition to bodies and gravity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pprs_dynamics.arrays import Array


class StructureLoad(NamedTuple):
    """Loads on the mechanism in addition to bodies and gravity.

    Parameters
    ----------
    wrench : (N, 6) array
        Force [N] and moment [N m] that the tool applies at its origin, in `base`.
    torques : mapping of str to (N,) or (N, 3) array
        By passive joint, what resists a growing position [N m, N]; a column for each of several
        joints of one name.
    """

    wrench: Array
    torques: Mapping[str, Array] = {}

    def __add__(self, other: StructureLoad) -> StructureLoad:  # type: ignore[override]
        torques = dict(self.torques)
        for name, torque in other.torques.items():
            torques[name] = torques[name] + torque if name in torques else torque
        return StructureLoad(self.wrench + other.wrench, torques)

    def at(self, samples: Any) -> StructureLoad:
        """Return the loads at samples that a slice, a mask or indices select."""
        return StructureLoad(self.wrench[samples], {
            name: torque[samples] for name, torque in self.torques.items()})
