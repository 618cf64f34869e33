# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The same samples under two names: told by info, refused where they would count twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_recordings import judged, measured
from pprs_command import pprs

from pprs_dynamics.measurement.files.recording import Recording, read_recording, write_recording
from pprs_dynamics.measurement.files.repeats import shared_samples


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('repeats')
    run = judged(measured())
    for name in ('run.csv', 'copy.csv', 'same.mcap', 'same.db3'):
        write_recording(folder / name, run)
    write_recording(folder / 'other.csv', judged(measured(seed=1)))
    return folder


def part_of(recording: Recording, samples: slice) -> Recording:
    return Recording.from_arrays('part', recording.time[samples], recording.position[samples],
                                 None, recording.effort[samples])


@pytest.mark.parametrize('name', ['copy.csv', 'same.mcap', 'same.db3'])
def test_the_same_samples_in_another_file_or_format_are_found(folder: Path, name: str) -> None:
    first, second = read_recording(folder / 'run.csv'), read_recording(folder / name)
    assert shared_samples(first, second) == len(second.time)


def test_clocks_and_cuts_hide_nothing(folder: Path) -> None:
    run = read_recording(folder / 'run.csv')
    later = replace(run, time=run.time + 5.0, epoch=1_700_000_000)
    assert shared_samples(run, later) == len(run.time)
    assert shared_samples(run, part_of(run, slice(200, 500))) == 300
    assert shared_samples(part_of(run, slice(200, 500)), run) == 300


def test_the_same_motion_with_other_noise_is_another_recording(folder: Path) -> None:
    run, other = read_recording(folder / 'run.csv'), read_recording(folder / 'other.csv')
    assert shared_samples(run, other) == 0
    noise = np.random.default_rng(3).normal(0, 0.01, run.effort.shape)
    assert shared_samples(run, replace(run, effort=run.effort + noise)) == 0
    # The two halves of one recording share nothing.
    assert shared_samples(part_of(run, slice(0, 500)), part_of(run, slice(500, 1000))) == 0


def test_recordings_of_a_robot_at_rest_are_alike_and_no_repeats() -> None:
    time = np.arange(500) * 0.002
    still = np.full((500, 6), 0.1)
    one, other = (Recording.from_arrays(name, time, still, None, np.ones((500, 6)))
                  for name in 'ab')
    assert shared_samples(one, other) == 0


def test_info_says_what_repeats(folder: Path) -> None:
    done = pprs('info', 'run.csv', 'same.db3', cwd=folder)
    assert done.returncode == 0
    assert ('! same.db3: all of its 1000 samples are those of run.csv, too'
            in ' '.join(done.stdout.split()))
