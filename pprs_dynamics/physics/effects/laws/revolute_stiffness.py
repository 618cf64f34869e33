# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Stiffness in the revolute joints C_i: k (u_i - u_0), alike in all three chains.

References
----------
L. L. Howell, Compliant Mechanisms, 2001, on flexures as torsional springs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np

from pprs_dynamics.physics.effects.effect import Card, Parameter
from pprs_dynamics.physics.effects.relaxed_position import FARTHEST, relaxed_position
from pprs_dynamics.physics.effects.structure_effect import BodyEffect
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.physics.three_pprs.state import MechanismState


class RevoluteStiffness(BodyEffect):
    """A spring between lift and rod; what is fitted is k u_i + M with M = -k u_0."""

    name: ClassVar[str] = 'revolute_stiffness'
    linear = (
        Parameter('stiffness', 'k', 'N m/rad', 'moment per angle', -1e6, 1e6, scale=0.1),
        Parameter('angle', 'u_0', 'rad', 'rod angle at which it is slack', -FARTHEST, FARTHEST,
                  scale=0.1))
    coefficients = (
        linear[0],
        Parameter('moment', 'M', 'N m', 'moment at rod angle 0, -k u_0', -1e6, 1e6, scale=0.1))
    unphysical_below: ClassVar[dict[str, float]] = {'stiffness': 0.0}
    card = Card(
        'moment k (u_i - u_0) about n_i in C_i',
        'errors that follow the rod angles u_i whatever the speed, above all on the lifts: the '
        'same at every pass through a pose, in both directions',
        'flexures in place of bearings, a cable loom or hose across the joint, a seal or boot '
        'that is bent',
        'free the loom or take off the boot and repeat; move slowly: the error must stay',
        'Howell, Compliant Mechanisms, 2001')

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__(values)
        # As long as a model file is being read, values may be missing.
        self.exact = self.to_coefficients(values) if len(values) == len(self.linear) else {}

    @classmethod
    def at(cls, coefficients: Mapping[str, float]) -> Self:
        """Return the effect with exactly these coefficients, which no u_0 may stand for."""
        effect = super().at(coefficients)
        effect.exact = {c.name: float(coefficients.get(c.name, 0.0)) for c in cls.coefficients}
        return effect

    @classmethod
    def to_coefficients(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return k and M = -k u_0."""
        k = values['stiffness']
        return {'stiffness': k, 'moment': -k * values['angle']}

    @classmethod
    def from_coefficients(cls, coefficients: Mapping[str, float]) -> dict[str, float]:
        """Return k and u_0; see `relaxed_position`."""
        k, angle = relaxed_position(coefficients['stiffness'], coefficients['moment'])
        return {'stiffness': k, 'angle': angle}

    def load(self, state: MechanismState) -> StructureLoad:
        """Return k u_i + M about n_i."""
        u = np.arctan2(state.chains.sin_u, state.chains.cos_u)
        hinge = self.exact['stiffness'] * u + self.exact['moment']
        return StructureLoad(np.zeros((len(hinge), 6)), hinge)
