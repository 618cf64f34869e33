# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Feedforward in a control loop of one's own at 1 kHz, without ROS, and how long each call takes.

    python docs/own_loop.py [MODEL.yaml] [--seconds 10] [--rate 1000]

The drives of an arm swing about home; of a 3-PPRS the platform does.
"""

from __future__ import annotations

import argparse
import gc
import time

import numpy as np

from pprs_dynamics import DriveModel, JointMotion, PlatformMotion

SWING, TURN = 0.02, np.pi  # [rad, m], [rad/s]
HOME = np.array([0.0, 0.0, 0.5])  # [m], of a 3-PPRS's platform


def one_sample(model: DriveModel, t: float) -> JointMotion | PlatformMotion:
    """Return the motion at a time [s]: arrays of one row.

    In a loop of your own these are your trajectory's next setpoint.
    """
    shape = (1, 3 if model.robot.plans_poses else len(model.drives))
    q, v, a = (np.full(shape, SWING * value) for value in (
        np.sin(TURN * t), TURN * np.cos(TURN * t), -TURN**2 * np.sin(TURN * t)))
    stamp = np.array([t])  # what effects with a memory count from
    if not model.robot.plans_poses:
        structure = model.robot.structure
        home = structure.home[structure.tables.drives]
        return JointMotion(home + q, v, a, time=stamp)
    still = np.zeros(shape)
    return PlatformMotion(HOME + q, np.array([[0.0, 0.0, 0.0, 1.0]]), v, still, a, still,
                          time=stamp)


def run(path: str, seconds: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Run a loop in real time.

    Returns
    -------
    (N,) array
        How long each call took, motion and forces, from Python [s].
    (N,) array
        How late each cycle began [s].
    """
    model = DriveModel.load(path)
    # Compiles at the first call: 15 s or more after an installation, a second later on.
    model.drive_forces(one_sample(model, 0.0))
    state = model.initial_state()  # the memory of effects that have one; each loop has its own
    gc.collect()
    gc.freeze()  # what was imported is not looked through again
    gc.disable()  # a collection takes milliseconds; the loop leaves no rings of objects
    count = round(seconds * rate)
    took, late = np.zeros(count), np.zeros(count)
    start = time.perf_counter()
    for k in range(count):
        due = start + k / rate
        while (left := due - time.perf_counter()) > 0:
            if left > 3e-4:  # sleep wakes up to some 0.1 ms late; the rest is waited for
                time.sleep(left - 2e-4)
        begun = time.perf_counter()
        forces = model.drive_forces(one_sample(model, k / rate), state=state).total[0]
        took[k], late[k] = time.perf_counter() - begun, begun - due
        send(forces)
    gc.enable()
    return took, late


def send(forces: np.ndarray) -> None:
    """Replace this by the function that commands your drives."""


def main() -> None:
    """Run the loop and print how long its calls took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('model', nargs='?', default='config/paper.yaml')
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--rate', type=float, default=1000.0)
    options = parser.parse_args()
    took, late = run(options.model, options.seconds, options.rate)
    for name, values in (('a call takes', took), ('a cycle begins late by', late)):
        median, most, longest = 1e6 * np.quantile(values, [0.5, 0.99, 1.0])
        print(f'{name}: {median:.0f} us in the middle, {most:.0f} us in 99 of 100, '
              f'{longest:.0f} us at most')
    print(f'{100 * np.mean(took + late < 1 / options.rate):.1f} % of {len(took)} cycles were '
          f'done within their {1e3 / options.rate:g} ms')


if __name__ == '__main__':
    main()
