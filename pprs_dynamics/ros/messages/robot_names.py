# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How a robot is named on topics: its joints, and the frame of its poses and forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pprs_dynamics.drives import DRIVES
from pprs_dynamics.physics.model.force_model import ForceModel

BASE = 'base'


class RobotNames(NamedTuple):
    """Joints in the order of the model's drives, and the frame.

    Parameters
    ----------
    joints : tuple of D str
        By `joint_map` and `joint_prefix` of the model.
    frame : str
        Of `header.frame_id`, in what comes and in what goes out; an empty one always means it.
    """

    joints: tuple[str, ...]
    frame: str

    @classmethod
    def of(cls, model: ForceModel, frame: str = '') -> RobotNames:
        """Return the names of a model's drives; `frame` '' for that of its kind."""
        return cls(model.recorded.joints, frame or frame_of(model.drives))


def frame_of(drives: Sequence[str]) -> str:
    """Return the frame of what drives say: a platform's `base`; that of joints means nothing."""
    return BASE if tuple(drives) == DRIVES else ''
