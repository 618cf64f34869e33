# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings that no motion should give: an answer or one sentence, and no warning of NumPy."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from single_axis import AXIS, TIME, axis, axis_recording

from pprs_dynamics.app.commands.pprs import main

MODEL = str(Path(__file__).parents[2] / 'config' / 'single_axis.yaml')
RUN = axis_recording(axis(**{'links.mass': (95.0,), 'friction.viscous': (200.0,)}))
POSITION, EFFORT = RUN.position[:, 0], RUN.effort[:, 0]
FEW = slice(0, 12)


def with_values(values: np.ndarray, rows: slice, value: float) -> np.ndarray:
    changed = values.copy()
    changed[rows] = value
    return changed


# Time, position and effort.
ODD: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {
    'stands': (TIME, 0 * POSITION + 0.1, EFFORT),
    'two places': (TIME, 0.1 * np.sign(POSITION), EFFORT),
    'coarse encoder': (TIME, POSITION.round(1), EFFORT),
    'constant effort': (TIME, POSITION, 0 * EFFORT + 3.0),
    'effort of zero': (TIME, POSITION, 0 * EFFORT),
    'no effort': (TIME, POSITION, np.nan * EFFORT),
    'effort every other time': (TIME, POSITION, with_values(EFFORT, slice(0, None, 2), np.nan)),
    'half of the effort': (TIME, POSITION, with_values(EFFORT, slice(0, 800), np.nan)),
    'impossible efforts': (TIME, POSITION, with_values(EFFORT, slice(99, 101), 1e282)),
    'huge efforts': (TIME, POSITION, 1e200 * EFFORT),
    'huge positions': (TIME, 1e150 * POSITION, EFFORT),
    'tiny efforts': (TIME, POSITION, 1e-200 * EFFORT),
    'few samples': (TIME[FEW], POSITION[FEW], EFFORT[FEW]),
    'one time': (0 * TIME, POSITION, EFFORT),
    'backwards': (TIME[::-1], POSITION, EFFORT)}


TRIED = [(command, name) for name in ODD for command in ('info', 'compare', 'fit')] + [
    ('diagnose', name) for name in ('stands', 'coarse encoder', 'half of the effort',
                                    'huge efforts', 'few samples')]  # takes a second each


@pytest.mark.parametrize(('command', 'name'), TRIED)
def test_an_odd_recording_gives_no_warning_of_numpy(
    command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    path, output = tmp_path / 'run.csv', tmp_path / 'fitted.yaml'
    path.write_text(f'time,{AXIS}/position,{AXIS}/effort\n' + ''.join(
        ','.join('' if np.isnan(cell) else repr(float(cell)) for cell in row) + '\n'
        for row in zip(*ODD[name], strict=True)))
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        status = main([command, str(path), '--model', MODEL,
                       *(['--output', str(output)] if command == 'fit' else [])])
    assert status in (0, 1, 2)
    printed = capsys.readouterr()
    assert 'Traceback' not in printed.err
    assert status == 0 or printed.err.startswith(f'pprs {command}: ')
