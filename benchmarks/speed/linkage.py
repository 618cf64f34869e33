# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How fast a 6-UPS is beside Pinocchio's bare `rnea` of its tree: ratios from one run.

`rnea` gets all joints' positions, velocities and accelerations and gives the tree's efforts: no
closing of loops, no reactions, no friction. Rounds as in `benchmarks.speed.model`.

    python -m benchmarks.speed.linkage [rounds]
"""

from __future__ import annotations

import sys

import numpy as np
import pinocchio as pin

from benchmarks.speed.model import CALLS, _print, _rounds
from pprs_dynamics import ArmModel
from pprs_dynamics.simulation.arm_run import draw_motion

BATCH = 5000
ROUNDS = 25
DURATION = 25.0  # [s], at 200 Hz


def main(rounds: int) -> None:
    """Print both tables."""
    model = ArmModel.load('config/hexapod.yaml')
    motion = draw_motion(model, DURATION, 1, BATCH / DURATION)
    tree = pin.buildModelFromUrdf(model.robot.structure.description.path)
    data, q = tree.createData(), pin.neutral(tree)
    v, a = np.full((2, tree.nv), 0.1)
    ones = [motion[k:k + 1] for k in range(CALLS)]

    def bare(calls: int) -> None:
        for _ in range(calls):
            pin.rnea(tree, data, q, v, a)

    def single() -> None:
        for one in ones:
            model.drive_forces(one)

    _print('6-UPS, one sample from Python, friction in every joint', _rounds(
        {'model': single, 'rnea of its tree': lambda: bare(CALLS)}, rounds), 1e6 / CALLS)
    _print('6-UPS, one motion', _rounds(
        {'model': lambda: model.drive_forces(motion), 'rnea of its tree': lambda: bare(BATCH)},
        rounds), 1e6 / BATCH)


if __name__ == '__main__':
    main(int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS)
