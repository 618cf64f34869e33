# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random files of a slide and of a two-link arm, from equations that are written down here."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

MASS, LENGTH, CENTRE, INERTIA = (3.0, 1.5), 0.4, (0.2, 0.15), (0.04, 0.012)
VISCOUS, COULOMB = np.array([0.4, 0.2]), np.array([0.9, 0.5])
LOAD, SLIDE_VISCOUS, SLIDE_COULOMB = 8.0, 15.0, 6.0
ARM = '<robot name="arm"><link name="base"/>' + ''.join(
    f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    f'<origin xyz="0 0 {z}"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="60" '
    f'velocity="6"/></joint><link name="{child}"><inertial><mass value="{m}"/><origin xyz="0 0 '
    f'{c}"/><inertia ixx="{i}" iyy="{i}" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    for name, parent, child, z, m, c, i in (
        ('shoulder', 'base', 'upper', 0.3, MASS[0], CENTRE[0], INERTIA[0]),
        ('elbow', 'upper', 'fore', LENGTH, MASS[1], CENTRE[1], INERTIA[1]))) + '</robot>'
SLIDE = ('<robot name="lift"><link name="base"/><joint name="lift" type="prismatic"><parent '
         'link="base"/><child link="car"/><axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5" '
         'effort="300" velocity="3"/></joint><link name="car"><inertial><mass value="8"/><inertia '
         'ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>')
# Factors to SI, and what is added: 2048 ticks are the zero of servos.
ANGLES = ((1.0, 0.0), (np.pi / 180, 0.0), (2 * np.pi, 0.0), (np.pi / 2048, 0.0),
          (np.pi / 2048, -np.pi), (np.pi / 8192, 0.0), (np.pi / 512, -np.pi))
LENGTHS = ((1.0, 0.0), (1e-3, 0.0))
FORCES = (1.0, 1e-3)
RATE, DURATION = 100.0, 4.0


class Drawn(NamedTuple):
    """A file, the rate that is given with it, the truth, and whether it must be asked about.

    Positions are known to a tolerance, as encoders count.
    """

    path: Path
    rate: float | None
    truth: tuple[np.ndarray, ...]
    needs_question: bool
    tolerance: float


def motion(random: np.random.Generator, count: int, size: float) -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and accelerations of some drives."""
    time = np.arange(round(DURATION * RATE)) / RATE
    q, v, a = (np.zeros((len(time), count)) for _ in range(3))
    for j in range(count):
        for frequency, phase, share in zip(random.uniform(0.2, 1.2, 4), random.uniform(0, 6.28, 4),
                                           random.uniform(0.15, 0.4, 4), strict=True):
            w = 2 * np.pi * frequency
            q[:, j] += size * share * np.sin(w * time + phase)
            v[:, j] += size * share * w * np.cos(w * time + phase)
            a[:, j] -= size * share * w * w * np.sin(w * time + phase)
    return time, q, v, a


def arm_efforts(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the efforts of an arm that is upright at zero, gravity along -z."""
    (m1, m2), (c1, c2), (i1, i2) = MASS, CENTRE, INERTIA
    q1, q2 = q.T
    v1, v2 = v.T
    a1, a2 = a.T
    m12 = i2 + m2 * (c2**2 + LENGTH * c2 * np.cos(q2))
    m11 = i1 + m1 * c1**2 + i2 + m2 * (LENGTH**2 + c2**2 + 2 * LENGTH * c2 * np.cos(q2))
    h = m2 * LENGTH * c2 * np.sin(q2)
    g2 = -9.81 * m2 * c2 * np.sin(q1 + q2)
    g1 = g2 - 9.81 * (m1 * c1 + m2 * LENGTH) * np.sin(q1)
    effort = np.column_stack([m11 * a1 + m12 * a2 - h * (2 * v1 * v2 + v2**2) + g1,
                              m12 * a1 + (i2 + m2 * c2**2) * a2 + h * v1**2 + g2])
    return effort + VISCOUS * v + COULOMB * np.tanh(v / 0.005)


def drawn(folder: Path, seed: int) -> Drawn:
    """Write a robot and a file in units, signs, order and form that a seed draws."""
    random = np.random.default_rng(seed)
    is_arm = random.random() < 0.6
    time, q, v, a = motion(random, 2 if is_arm else 1, 1.0 if is_arm else 0.15)
    effort = arm_efforts(q, v, a) if is_arm else (
        LOAD * (a + 9.81) + SLIDE_VISCOUS * v + SLIDE_COULOMB * np.tanh(v / 0.005))
    effort += random.normal(0, 0.03, effort.shape)
    units = ANGLES if is_arm else LENGTHS
    scale, offset = units[random.integers(len(units))]
    forces = (*FORCES, *([0.0980665] if is_arm else []))
    force, name = float(random.choice(forces)), 'tau'
    constants = random.uniform(5.0, 40.0, q.shape[1])
    has_time, has_velocity, has_names, interleaved, negated, in_amperes, wrong = (
        random.random(7) < (0.6, 0.7, 0.6, 0.4, 0.2, 0.15, 0.3))
    recorded = effort / (constants if in_amperes else force) * (-1 if negated else 1)
    is_counted = is_arm and scale < np.pi / 180
    counts = (q - offset) / scale
    groups = [('q', np.round(counts) if is_counted else counts),
              *([('dq', v / scale)] if has_velocity else []), (name, recorded)]
    # What was asked for some samples ago, accelerations, and a thermometer.
    has_command, has_acceleration, has_more, lead = *(random.random(3) < (0.3, 0.2, 0.2)), (
        random.integers(2, 6) / RATE)
    if has_command:
        ahead = (q + lead * v + lead ** 2 / 2 * a - offset) / scale
        groups.insert(random.integers(len(groups) + 1),
                      ('q_cmd', np.round(ahead) if is_counted else ahead))
    if has_acceleration:
        groups.insert(random.integers(len(groups) + 1), ('ddq', a / scale))
    if has_names:
        random.shuffle(groups)
    columns = [(f'{name}{j + 1}', values[:, j]) for j in range(q.shape[1])
               for name, values in groups] if interleaved else [
                   (f'{name}{j + 1}', values[:, j]) for name, values in groups
                   for j in range(q.shape[1])]
    if has_more:
        columns.append(('warmth', 30 + np.cumsum(random.normal(0, 1e-3, len(time)))))
    if has_time:
        columns.insert(0, ('time', time))
    path = folder / 'run.csv'
    np.savetxt(path, np.column_stack([values for _, values in columns]), delimiter=',',
               fmt='%.7g', comments='', header=','.join(
                   name for name, _ in columns) if has_names else '')
    if not has_names:
        path.write_text(path.read_text().lstrip('\n'))
    (folder / 'robot.urdf').write_text(ARM if is_arm else SLIDE)
    # Without velocities inertia beside a known weight shows a rate that is far too high.
    times = random.choice([0.5, 1.25, 5.0])
    is_shown = has_velocity or (times == 5.0 and not in_amperes)
    is_wrong = bool(wrong and not has_time and is_shown)
    rate = None if has_time else RATE * (times if is_wrong else 1.0)
    return Drawn(path, rate, (time, q, effort), bool(in_amperes or is_wrong),
                 scale if is_counted else 1e-3)
