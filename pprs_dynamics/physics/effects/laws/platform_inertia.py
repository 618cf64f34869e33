# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""More moments of inertia of what carries the tool than the model says."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.physics.effects.effect import Parameter
from pprs_dynamics.physics.effects.structure_effect import MOMENTS, PRODUCTS, BodyEffect


class PlatformInertia(BodyEffect):
    """Inertia more about the centre of mass, without mass.

    Equation
    --------
    [I] -> [I] + [I_xx I_xy I_xz; I_xy I_yy I_yz; I_xz I_yz I_zz], in the tool's axes

    Symptom
    -------
    Errors that follow the angular acceleration of the platform, and nothing at rest, at steady
    speed or while it keeps its orientation.

    Causes
    ------
    A wide or long payload taken as a point, an inertia from a drawing that left out the
    gripper, axes of the tensor mixed up.

    Confirmation
    ------------
    Turn the platform back and forth about one axis, with its position kept: the error must
    grow with the square of the frequency.

    References
    ----------
    Swevers, Verdonck, De Schutter, IEEE Control Systems Magazine 27, 2007.
    """

    name = 'platform_inertia'
    is_in_payload = True
    idealised = False
    linear = (
        *(Parameter(axes, f'I_{axes}', 'kg m^2', f'moment of inertia beyond {axes} of the model',
                    -1e3, 1e3, scale=0.005) for axes in MOMENTS),
        *(Parameter(axes, f'I_{axes}', 'kg m^2', f'tensor element beyond {axes} of the model',
                    -1e3, 1e3, 0.0, scale=0.005) for axes in PRODUCTS))
    variants = (MOMENTS, MOMENTS + PRODUCTS)

    def changed(self, robot: Any) -> Any:
        """Return the robot with the other inertia."""
        added = [self.values[axes] for axes in ('xx', 'xy', 'yy', 'xz', 'yz', 'zz')]
        return robot.with_body(robot.structure.tool, np.array([0.0] * 4 + added))
