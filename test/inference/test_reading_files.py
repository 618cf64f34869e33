# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random files of a two-link arm: read as they were written, or a question, never wrongly.

Motion and efforts come from equations that are written down here, not from the package.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pprs_dynamics.app.api.first_model import FirstModel, first_model
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.recording import read_recording

MASS, LENGTH, CENTRE, INERTIA = (3.0, 1.5), 0.4, (0.2, 0.15), (0.04, 0.012)
VISCOUS, COULOMB = np.array([0.4, 0.2]), np.array([0.9, 0.5])
URDF = '<robot name="arm"><link name="base"/>' + ''.join(
    f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    f'<origin xyz="0 0 {z}"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="60" '
    f'velocity="6"/></joint><link name="{child}"><inertial><mass value="{m}"/><origin xyz="0 0 '
    f'{c}"/><inertia ixx="{i}" iyy="{i}" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    for name, parent, child, z, m, c, i in (
        ('shoulder', 'base', 'upper', 0.3, MASS[0], CENTRE[0], INERTIA[0]),
        ('elbow', 'upper', 'fore', LENGTH, MASS[1], CENTRE[1], INERTIA[1]))) + '</robot>'
ANGLES = {'rad': 1.0, 'deg': np.pi / 180, 'turns': 2 * np.pi}
EFFORTS = {'N m': 1.0, 'mN m': 1e-3, 'kgf cm': 0.0980665}


def arm(random: np.random.Generator, rate: float, duration: float = 12.0,
        ) -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and efforts, upright at zero, gravity along -z."""
    time = np.arange(round(duration * rate)) / rate
    q, v, a = (np.zeros((len(time), 2)) for _ in range(3))
    for j in range(2):
        for frequency, phase, size in zip(random.uniform(0.1, 0.8, 4), random.uniform(0, 6.28, 4),
                                          random.uniform(0.15, 0.4, 4), strict=True):
            w = 2 * np.pi * frequency
            q[:, j] += size * np.sin(w * time + phase)
            v[:, j] += size * w * np.cos(w * time + phase)
            a[:, j] -= size * w * w * np.sin(w * time + phase)
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
    effort += VISCOUS * v + COULOMB * np.tanh(v / 0.005)
    return time, q, v, effort + random.normal(0, 0.03, effort.shape)


def write(folder: Path, seed: int) -> tuple[Path, float | None, tuple[np.ndarray, ...]]:
    """Write a file in units, columns, order and form that a seed draws."""
    random = np.random.default_rng(seed)
    rate = float(random.choice([50.0, 100.0, 200.0]))
    time, q, v, effort = arm(random, rate)
    angle, force = (float(random.choice(list(units.values()))) for units in (ANGLES, EFFORTS))
    has_time, has_velocity, has_names, interleaved = random.random(4) < (0.7, 0.7, 0.5, 0.4)
    groups = [('q', q / angle), *([('dq', v / angle)] if has_velocity else []),
              ('tau', effort / force)]
    if has_names:
        random.shuffle(groups)
    columns = [(f'{name}{j + 1}', values[:, j]) for j in range(2) for name, values in groups
               ] if interleaved else [(f'{name}{j + 1}', values[:, j]) for name, values in groups
                                      for j in range(2)]
    if has_time:
        columns.insert(0, ('time', time))
    path = folder / 'run.csv'
    np.savetxt(path, np.column_stack([values for _, values in columns]), delimiter=',',
               fmt='%.7g', comments='', header=','.join(
                   name for name, _ in columns) if has_names else '')
    if not has_names:
        path.write_text(path.read_text().lstrip('\n'))
    return path, None if has_time else rate, (time, q, v, effort)


def outcome(folder: Path, seed: int) -> str:
    """Return `right`, `asked` or what is wrong of a random file."""
    (folder / 'arm.urdf').write_text(URDF)
    path, rate, (time, q, _, effort) = write(folder, seed)
    try:
        first: FirstModel = first_model(folder / 'arm.urdf', [path], folder / 'arm.yaml', rate=rate)
    except PprsError:
        return 'asked'
    if first.questions or not first.has_efforts:
        return 'asked'
    found = read_recording(path, first.model.recorded)
    if not np.allclose(found.time, time, atol=1e-5):
        return 'time'
    if not np.allclose(found.position, q, atol=1e-3):
        return 'position'
    # Efforts of a file are right where their unit is.
    return 'right' if np.allclose(found.effort, effort, atol=0.01) else 'effort'


FILES = 300


@pytest.mark.parametrize('part', range(6))
def test_random_files_are_read_rightly_or_asked_about(part: int, tmp_path: Path) -> None:
    seeds = range(part * FILES // 6, (part + 1) * FILES // 6)
    found = {seed: outcome(tmp_path, seed) for seed in seeds}
    assert {seed: what for seed, what in found.items() if what not in ('right', 'asked')} == {}
    assert sum(what == 'asked' for what in found.values()) <= 0.05 * len(found)
