# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What encoders behind the gears tell: how drives wind up, and what they lead their links by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.terms import FullRate
from pprs_dynamics.inference.residuals.reconstruction import Reconstruction
from pprs_dynamics.physics.effects.drive_effect import (
    Clearance,
    Windup,
)
from pprs_dynamics.physics.effects.laws.elastic_joint import told_by_windup


@dataclass(frozen=True)
class SecondEncoders:
    """What encoders behind the gears tell of the drives that have one.

    Parameters
    ----------
    windups : mapping of drive to Windup
        Of drives that wind up under their loads.
    clearances : mapping of drive to Clearance
        Of drives that lead their links by one of two distances.
    """

    windups: Mapping[int, Windup]
    clearances: Mapping[int, Clearance]

    @classmethod
    def of(cls, recordings: Sequence[FullRate], reconstructions: Sequence[Reconstruction],
           ) -> SecondEncoders:
        """Return it for recordings and their motion as it was read."""
        read = [(one.transmitted, one.direction, found.windup) for one, found in zip(
            recordings, reconstructions, strict=False) if found.windup is not None]
        windups, clearances = {}, {}
        for d in range(read[0][0].shape[1] if read else 0):
            load, direction = (np.concatenate([one[k][:, d] for one in read]) for k in (0, 1))
            lead = np.concatenate([one[:, :, d] for *_, one in read], axis=1)
            if not np.any(lead):
                continue
            if np.ptp(load):
                stiffness, damping, windup = told_by_windup(load, lead)
                if stiffness > 0:
                    windups[d] = Windup(1 / stiffness, damping / stiffness,
                                        float(np.var(windup) / np.var(load)))
            clearances[d] = max(
                _clearance(lead[0], direction, 'motion'),
                _clearance(lead[0], np.sign(load), 'load'), key=lambda one: one.explained)
        return cls(windups, clearances)


def _clearance(lead: Array, side: Array, of: str) -> Clearance:
    """Return by how much a drive leads its link on either side, (N,)."""
    lead, side = lead - lead.mean(), side - side.mean()
    size = float(side @ lead / max(float(side @ side), 1e-300))
    left = float(np.var(lead - size * side))
    return Clearance(2 * size, of, 1 - left / max(float(np.var(lead)), 1e-300))
