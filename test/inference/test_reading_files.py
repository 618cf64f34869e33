# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Random files of a slide and of a two-link arm: read as they were written, or a question.

Motion and efforts come from equations of their own, not from the package.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_files import ARM, arm_efforts, drawn, motion

from pprs_dynamics.app.api.first_model import first_model
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.bag_files import write_bag
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.measurement.files.samples import Samples
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.parameter_file import parse_parameters


def outcome(folder: Path, seed: int) -> str:
    """Return `right`, `asked`, `asked in vain` or what is wrong of a random file."""
    file = drawn(folder, seed)
    time, q, effort = file.truth
    asked = 'asked' if file.needs_question else 'asked in vain'
    try:
        first = first_model(folder / 'robot.urdf', [file.path], folder / 'robot.yaml',
                            rate=file.rate)
    except PprsError:
        return asked
    if first.questions or not first.has_efforts:
        return asked
    found = read_recording(file.path, first.model.recorded)
    if not np.allclose(found.time, time, atol=1e-5):
        return 'time'
    if not np.allclose(found.position, q, atol=max(file.tolerance, 1e-3)):
        return 'position'
    # Efforts of a file are right where their unit is.
    return 'right' if np.allclose(found.effort, effort, rtol=1e-3, atol=0.01) else 'effort'


@pytest.mark.parametrize('suffix', ['csv', 'mcap'])
@pytest.mark.parametrize('names', ['position effort', 'effort', 'position'])
def test_the_line_for_exchanged_drives_reads_them_rightly(names: str, suffix: str, tmp_path: Path,
                                                          ) -> None:
    time, q, v, a = motion(np.random.default_rng(3), 2, 1.0)
    effort = arm_efforts(q, v, a) + np.random.default_rng(4).normal(0, 0.03, q.shape)
    (tmp_path / 'robot.urdf').write_text(ARM)
    joints = ('shoulder', 'elbow')
    position, other = (values[:, ::-1] if quantity in names else values
                       for quantity, values in (('position', q), ('effort', effort)))
    path = tmp_path / f'run.{suffix}'
    if suffix == 'mcap':
        write_bag(path, {'/joint_states': Samples(joints, time, position, None, other)})
    else:
        np.savetxt(path, np.column_stack([time, position, other]), delimiter=',', comments='',
                   header=','.join(('time', *(f'{joint}/{quantity}' for quantity in (
                       'position', 'effort') for joint in joints))))
    first = first_model(tmp_path / 'robot.urdf', [path], tmp_path / 'robot.yaml')
    line = first.questions[0].partition('write ')[2]
    model = DriveModel.from_parameters(parse_parameters(
        f'{first.text}    {line}\n', 'robot.yaml'), source=str(tmp_path / 'robot.yaml'))
    found = read_recording(path, model.recorded)
    np.testing.assert_allclose(found.position, q)
    np.testing.assert_allclose(found.effort, effort)


@pytest.mark.parametrize(('first', 'count'), [
    (0, 10), pytest.param(10, 140, marks=pytest.mark.slow)])
def test_random_files_are_read_rightly_or_asked_about(first: int, count: int, tmp_path: Path,
                                                      ) -> None:
    found = {seed: outcome(tmp_path, seed) for seed in range(first, first + count)}
    assert {seed: what for seed, what in found.items()
            if what not in ('right', 'asked', 'asked in vain')} == {}
    assert sum(what == 'asked in vain' for what in found.values()) <= max(1, 0.05 * count)
