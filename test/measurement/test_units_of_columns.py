# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Keys below `columns` turn the numbers of a file into SI units."""

from __future__ import annotations

from pathlib import Path

import made_up_arm as arm
import numpy as np
import pytest

from pprs_dynamics import DriveModel, ModelError
from pprs_dynamics.measurement.files.recording import Recording, read_recording, write_recording

TIME = np.arange(200) / 100
POSITION = np.sin(TIME[:, None] * [1.0, 2.0, 3.0])
EFFORT = np.cos(TIME[:, None] * [1.0, 2.0, 3.0])


def read(folder: Path, position: np.ndarray, effort: np.ndarray, lines: str, suffix: str = '.csv',
         ) -> Recording:
    path = arm.write_arm(folder)
    path.write_text(path.read_text() + lines)
    run = folder / f'run{suffix}'
    write_recording(run, Recording.from_arrays('run', TIME, position, None, effort, arm.JOINTS))
    return read_recording(run, DriveModel.load(path).recorded)


@pytest.mark.parametrize('suffix', ['.csv', '.mcap'])
def test_encoder_ticks_whose_zero_is_in_the_middle(tmp_path: Path, suffix: str) -> None:
    ticks = np.round(POSITION * 4096 / (2 * np.pi)) + 2048
    keys = f'{{position_scale: {2 * np.pi / 4096!r}, position_offset: {-np.pi!r}}}'
    found = read(tmp_path, ticks, EFFORT, '    columns: {' + ', '.join(
        f'{joint}: {keys}' for joint in arm.JOINTS) + '}\n', suffix)
    np.testing.assert_allclose(found.position, POSITION, atol=2 * np.pi / 4096)


def test_efforts_whose_sign_is_a_bit(tmp_path: Path) -> None:
    load = np.round(np.abs(EFFORT) * 500) + 1024 * (EFFORT < 0)
    found = read(tmp_path, POSITION, load, '    columns: {' + ', '.join(
        f'{joint}: {{effort_sign_bit: 10, effort_scale: 0.002}}' for joint in arm.JOINTS) + '}\n')
    np.testing.assert_allclose(found.effort, EFFORT, atol=1.1e-3)
    with pytest.raises(ModelError, match='effort_sign_bit is 0, must be the number of a bit'):
        read(tmp_path, POSITION, load, '    columns: {turn: {effort_sign_bit: 0}}\n')


def test_a_unit_of_efforts_that_is_not_the_si_unit(tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path)
    text = path.read_text()
    path.write_text(text.replace('      base: ', '      effort_unit: kgf cm\n      base: '))
    run = tmp_path / 'run.csv'
    write_recording(run, Recording.from_arrays(
        'run', TIME, POSITION, None, EFFORT / 0.0980665, arm.JOINTS))
    found = read_recording(run, DriveModel.load(path).recorded)
    np.testing.assert_allclose(found.effort, EFFORT)


def test_a_table_below_a_preamble_with_a_line_of_units(tmp_path: Path) -> None:
    path = arm.write_arm(tmp_path)
    columns = {joint: {'position': f'{joint} deg', 'effort': f'{joint} f N'}
               for joint in arm.JOINTS}
    path.write_text(path.read_text() + f'    columns: {{time: t s, {str(columns)[1:]}\n')
    run = tmp_path / 'run.csv'
    np.savetxt(run, np.column_stack([TIME, POSITION, EFFORT]), delimiter=';', comments='',
               header='Log 7\nChannels;7\nRate;100;Hz\n' + ';'.join(
                   ['t', *arm.JOINTS, *(f'{joint} f' for joint in arm.JOINTS)]) + '\n'
               + ';'.join(['s', *['deg'] * 3, *['N'] * 3]))
    found = read_recording(run, DriveModel.load(path).recorded)
    np.testing.assert_allclose(found.position, POSITION)
    np.testing.assert_allclose(found.effort, EFFORT)
