# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Positions of all joints of an exported URDF, passive ones too, for those of the drives."""

from __future__ import annotations

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.model.force_model import ForceModel
from pprs_dynamics.simulation.export.exported_robot import FREE, export_robot
from pprs_dynamics.simulation.export.expressed import URDF, express


class TreePositions:
    """The joints of a model's URDF; free bodies, which are no joints of a message, are left out.

    Parameters
    ----------
    model : ForceModel

    Attributes
    ----------
    names : tuple of J str

    Raises
    ------
    ModelError
        As `export_robot`.
    """

    def __init__(self, model: ForceModel) -> None:
        robot = export_robot(express(model, URDF), URDF)
        self._mechanism = robot.mechanism
        joints = [body for body in robot.bodies if body.kind != FREE]
        self.names = tuple(body.joint for body in joints)
        self._rows = np.array([body.row for body in joints])

    def at(self, position: Array) -> Array:
        """Return the positions [rad, m], (J,), for those of the drives, (D,).

        Raises
        ------
        WorkspaceError, SingularityError
            See `Mechanism.at`.
        """
        given = np.array(position, dtype=float)[None]
        still = np.zeros_like(given)
        q = self._mechanism.at(given, still, still).motion.q[0]
        t, rows = self._mechanism.structure.tables, self._rows
        return t.ratio[rows] * q[t.coordinate[rows]] + t.offset[rows]
