"""Dry friction that falls as the drive leaves rest: F_s exp(-(q_dot / v_s)^2) sgn(q_dot).

References
----------
B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and
compensation methods for the control of machines with friction, Automatica 30 (1994).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pprs_dynamics.effects.effect import DriveEffect, DriveSamples, Parameter
from pprs_dynamics.mechanism.robot import Array


class StribeckFriction(DriveEffect):
    """Extra friction at low speed: boundary lubrication in greased guides and screws."""

    name: ClassVar[str] = 'stribeck_friction'
    linear = (Parameter('force', 'F_s', 'N', 'breakaway force beyond Coulomb friction', -1e6, 1e6),)
    shape = (Parameter('velocity', 'v_s', 'm/s', 'Stribeck velocity', 1e-6, 10.0),)

    def columns(self, drive: DriveSamples, **shape: float) -> tuple[Array, ...]:
        """Return (exp(-(q_dot / v_s)^2) sgn q_dot,)."""
        return (np.exp(-(drive.velocity / shape['velocity']) ** 2) * drive.direction,)
