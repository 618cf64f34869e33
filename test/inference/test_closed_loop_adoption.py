# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Control gets better too: what is found in the run's own recording goes into its feedforward.

Processes over DDS, without a launch file. How late a busy machine's commands come, and how many
of them it loses, is no property of a model: those that came are the model's, in their order, and
all of the model's are executed in simulated time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from closed_loop import RATE, Case, Tracking, commands_for, execute, run_case
from pprs_command import pprs
from scipy.spatial import cKDTree

from pprs_dynamics.measurement.files.recording import write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation

pytestmark = [pytest.mark.nodes, pytest.mark.slow]

HIDDEN = 'coulomb_friction'
DURATION, SEED = 6.0, 1  # [s]
PATH = ['source:=excitation', f'duration:={DURATION}', f'seed:={SEED}']


@dataclass
class Runs:
    """Commands over the topics and those of the model, and the platform's errors with them."""

    came: tuple[np.ndarray, np.ndarray]
    sent: tuple[np.ndarray, np.ndarray]
    known: Tracking
    hidden: Tracking
    adopted: Tracking


@pytest.fixture(scope='module')
def runs(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Runs:
    folder = tmp_path_factory.mktemp('closed_loop')
    path = Excitation(duration=DURATION, seed=SEED)
    hidden = Case('hidden', 'friction', (HIDDEN,))
    # Commands do not depend on the robot: they are the same if nothing is hidden in it.
    paper = commands_for(hidden, path)
    on_time = execute(hidden, paper)
    write_recording(folder / 'run.mcap', on_time.recording('run'))
    done = pprs('adopt', HIDDEN, folder / 'run.mcap', '--output', folder / 'adopted.yaml')
    assert done.returncode == 0, done.stdout + done.stderr
    adopted = Case('adopted', 'friction', (HIDDEN,), folder / 'adopted.yaml')
    better = commands_for(adopted, path)
    came = (run_case(hidden, PATH, DURATION, ros_domain, folder).commands,
            run_case(adopted, PATH, DURATION, ros_domain, folder).commands)
    return Runs(came, (paper, better), execute(Case('known', 'friction'), paper), on_time,
                execute(adopted, better))


def test_every_command_over_the_topics_is_the_models(runs: Runs) -> None:
    for came, sent in zip(runs.came, runs.sent, strict=True):
        assert len(came) > DURATION * RATE
        distance, row = cKDTree(sent[:, 1:]).query(came[:, 1:])
        assert np.max(distance) < 1e-9
        assert np.all(np.diff(row) >= 0)


def test_the_platform_follows_as_if_nothing_were_hidden(runs: Runs) -> None:
    for error in ('position_rms', 'angle_rms'):
        known, hidden, adopted = (
            getattr(one, error) for one in (runs.known, runs.hidden, runs.adopted))
        assert hidden > 2 * known
        # What is left, a few micrometres of encoders that count them, is in docs/feedforward.md.
        assert hidden - adopted > 0.9 * (hidden - known), error
