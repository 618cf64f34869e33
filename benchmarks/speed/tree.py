# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How fast robots with loops are beside Pinocchio's bare `rnea` of their trees: ratios of one run.

`rnea` gets all joints' positions, velocities and accelerations and gives the tree's efforts: no
closing of loops, no reactions, no friction. Rounds as in `benchmarks.speed.model`, which take turns
so that a busy machine slows all alike; of each the best and the median are printed.

    python -m benchmarks.speed.tree [rounds]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

import numpy as np
import pinocchio as pin

from benchmarks import ROOT
from benchmarks.speed.model import CALLS, _print, _rounds
from pprs_dynamics import DriveModel
from pprs_dynamics.physics.mechanism.tree_evaluation import NO_FRICTION, Evaluation
from pprs_dynamics.simulation.injection import draw_motion

BATCH = 5000
ROUNDS = 25
DURATION = 25.0  # [s], at 200 Hz
ROBOTS = ('hexapod', 'delta')
FIRST = ('from pprs_dynamics import DriveModel; '
         'from pprs_dynamics.physics.model.preparation import prepare; '
         'prepare(DriveModel.load("config/hexapod.yaml"))')


def main(rounds: int) -> None:
    """Print all tables."""
    for name in ROBOTS:
        compare(name, rounds)
    steps(rounds)
    first_start()


def compare(name: str, rounds: int) -> None:
    """Print one sample and one motion of a robot beside `rnea`."""
    model = DriveModel.load(f'config/{name}.yaml')
    motion = draw_motion(model, DURATION, 1, BATCH / DURATION)
    tree = pin.buildModelFromUrdf(model.robot.structure.description.path)
    data, q = tree.createData(), pin.neutral(tree)
    v, a = np.full((2, tree.nv), 0.1)
    ones = [motion[k:k + 1] for k in range(CALLS)]
    state = model.initial_state()

    def bare(calls: int) -> None:
        for _ in range(calls):
            pin.rnea(tree, data, q, v, a)

    def alone() -> None:
        for one in ones:
            model.drive_forces(one)

    def streamed() -> None:
        for one in ones:
            model.drive_forces(one, state)

    _print(f'{name}, one sample from Python, friction in every joint', _rounds(
        {'in a stream': streamed, 'alone, from home': alone,
         'rnea of its tree': lambda: bare(CALLS)}, rounds), 1e6 / CALLS)
    _print(f'{name}, one motion', _rounds(
        {'model': lambda: model.drive_forces(motion), 'rnea of its tree': lambda: bare(BATCH)},
        rounds), 1e6 / BATCH)


def steps(rounds: int) -> None:
    """Print what single steps save in a motion of the hexapod."""
    model = DriveModel.load('config/hexapod.yaml')
    motion = draw_motion(model, DURATION, 1, BATCH / DURATION)
    given = motion.position, motion.velocity, motion.acceleration
    robot, evaluation = model.robot, model.robot.structure.evaluation
    t, count = evaluation.tables, len(evaluation.tables.passive)
    later = [[*range(k + 1, count)] for k in range(count)]
    ends = np.cumsum([0, *map(len, later)])
    every = np.array([place for one in later for place in one])
    full = Evaluation(t._replace(starts=np.column_stack((ends, ends, ends)), swap=every,
                                 below=every, right=every), robot.structure.home)
    friction = model.mechanism(motion).friction
    bodies = robot.by_joint, robot.gravity_row

    def kept() -> None:
        rows, _ = evaluation.forward_kinematics(*given)
        evaluation.forces(rows, *bodies, {})

    _print('hexapod, one motion', _rounds({
        'in one pass, nothing kept': lambda: evaluation.inverse_dynamics(
            given, *bodies, NO_FRICTION),
        'with friction of every joint': lambda: evaluation.inverse_dynamics(
            given, *bodies, friction),
        'all elements eliminated': lambda: full.inverse_dynamics(given, *bodies, NO_FRICTION),
        'links and loads kept': kept}, rounds), 1e6 / BATCH)


def first_start() -> None:
    """Print how long a hexapod takes in a fresh process, before and after it was compiled."""
    with tempfile.TemporaryDirectory() as cache:
        print(f'\\nhexapod, a fresh process until it answers compiled{"":<4}elapsed  processor [s]')
        for state in ('nothing compiled', 'compiled before', 'compiled before'):
            begin, before = time.perf_counter(), os.times()
            subprocess.run([sys.executable, '-c', FIRST], check=True, cwd=ROOT,
                           env={**os.environ, 'NUMBA_CACHE_DIR': cache})
            after = os.times()
            used = (after.children_user + after.children_system - before.children_user
                    - before.children_system)
            print(f'{state:<52}{time.perf_counter() - begin:>7.1f}{used:>11.1f}')


if __name__ == '__main__':
    main(int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS)
