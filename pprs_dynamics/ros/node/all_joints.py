# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Poses of all joints and free bodies of a robot, prepared in a thread of its own."""

from __future__ import annotations

from contextlib import suppress
from threading import Thread

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import PprsError
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.simulation.export.exported_robot import TreePose, TreePositions


class AllJoints:
    """The joints of a model's URDF, whose tree is made in a thread of its own at the first call.

    That takes half a second, and as long as compilers take where nothing is compiled yet.
    """

    def __init__(self) -> None:
        self._model: DriveModel | None = None
        self._made: list[TreePositions | PprsError] = []

    def at(self, model: DriveModel, position: Array) -> tuple[TreePositions, TreePose] | None:
        """Return the names, and where all is, for positions of the drives, (D,) [m, rad].

        None while the tree is being made.

        Raises
        ------
        PprsError
            As `TreePositions`.
        """
        if self._model is not model:
            self._model, self._made = model, []
            # Another list for each model: one that comes late is of no use any more.
            Thread(target=_make, args=(model, position, self._made), name='all_joints',
                   daemon=True).start()
        if not self._made:
            return None
        if isinstance(tree := self._made[0], PprsError):
            raise tree
        return tree, tree.at(position - model.position_error(position[None])[0])


def _make(model: DriveModel, position: Array, made: list[TreePositions | PprsError]) -> None:
    try:
        # Made anew here: buffers of a model serve one thread at a time.
        tree = TreePositions(DriveModel.from_parameters(model.values, model.source))
        with suppress(PprsError):  # it is there to load what is compiled
            tree.at(position)
        made.append(tree)
    except PprsError as error:
        made.append(error)
