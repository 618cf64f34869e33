# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""State of the drives along a motion, for every kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from pprs_dynamics.arrays import Array


class DriveStates(Protocol):
    """Protocol of N samples of D drives, whatever they move, as effects on drives take them."""

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""

    @property
    def time(self) -> Array | None:
        """[s], (N,), where known."""

    @property
    def channels(self) -> Mapping[str, Array]:
        """Measured channels in addition to the motion, by name, (N, D) each."""

    @property
    def position(self) -> Array:
        """[m], (N, D)."""

    @property
    def velocity(self) -> Array:
        """[m/s], (N, D)."""

    @property
    def acceleration(self) -> Array:
        """[m/s^2], (N, D)."""

    @property
    def direction(self) -> Array:
        """Sign of the velocities, sgn, (N, D)."""

    @property
    def friction_load(self) -> Array:
        """What the drive's guide or gear carries, without a sign [N, N m], (N, D)."""

    @property
    def transmitted(self) -> Array:
        """What gears or screws pass on to the mechanism, without friction [N], (N, D)."""
