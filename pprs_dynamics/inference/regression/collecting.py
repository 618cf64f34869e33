# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Columns and full-rate motion, collected chunk by chunk while a model is evaluated."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.sensitivities import NUMBERS, Sensitivities
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction
from pprs_dynamics.physics.effects.drive_effect import MeasurementEffect
from pprs_dynamics.physics.model.forces import Forces
from pprs_dynamics.physics.model.keys import GAIN


class Column(NamedTuple):
    """Key of columns in a table, beside parts and variables."""

    name: str


def stacked_columns(tables: list[dict[Any, Array]]) -> dict[str, Array]:
    """Take the columns out of tables, (k, D, M) each by name."""
    stacked: dict[str, Array] = {}
    for key in [key for key in tables[0] if isinstance(key, Column)]:
        stacked[key.name] = np.concatenate([table.pop(key) for table in tables]).transpose(1, 2, 0)
    return stacked


class ColumnCollector:
    """Called chunk by chunk: gives columns to be treated, and keeps what drives did."""

    def __init__(self, sensitivities: Sensitivities, reconstruction: Reconstruction) -> None:
        self.sensitivities = sensitivities
        # A gain changes nothing of efforts that were not recorded as currents.
        self.without_gain = [k for k, number in enumerate(sensitivities.numbers)
                             if number.key == GAIN
                             and np.isnan(reconstruction.gain[number.element])]
        self.share = reconstruction.recorded_share(sensitivities.model)
        self.sensors = [effect.name for effect in sensitivities.model.effects
                        if isinstance(effect, MeasurementEffect)]
        self.kept: list[tuple[Array, ...]] = []

    def __call__(self, forces: Forces) -> dict[Column, Array]:
        s: Any = forces.mechanism
        effort = forces.total - sum((forces.parts[name] for name in self.sensors),
                                    np.zeros_like(forces.total))
        self.kept.append((s.velocity, s.acceleration, s.direction, s.friction_load,
                          s.transmitted, effort))
        columns = self.sensitivities.columns(forces)
        columns[NUMBERS][self.without_gain] = 0.0
        # Views: copies of all columns at full rate would take longer than their means.
        return {Column(name): (column if np.all(self.share == 1) else self.share * column)
                .transpose(1, 0, 2) for name, column in columns.items()}

    def full_rate(self, reconstruction: Reconstruction) -> FullRate:
        """Return what the drives did, with positions as the mechanism has them."""
        velocity, acceleration, direction, load, transmitted, effort = (
            np.concatenate(arrays) for arrays in zip(*self.kept, strict=True))
        return FullRate(
            reconstruction.time, reconstruction.position, velocity, acceleration, direction, load,
            transmitted, effort, reconstruction.effort, reconstruction.segments,
            reconstruction.treat, reconstruction.start, reconstruction.channels)
