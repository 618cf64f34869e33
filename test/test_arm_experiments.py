# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Motions that excite an arm: within its limits, at rest at both ends, and worth their time."""

from __future__ import annotations

import json
from pathlib import Path

import made_up_arm as arm
import numpy as np
import pandas as pd
import pytest

from pprs_dynamics import ArmModel
from pprs_dynamics.commands.pprs import main
from pprs_dynamics.experiments.arm_excitation import ArmLimits, _Search, excite_arm

DURATION = 12.0


@pytest.fixture(scope='module')
def model(tmp_path_factory: pytest.TempPathFactory) -> ArmModel:
    return arm.real_arm(tmp_path_factory.mktemp('arm'))


@pytest.fixture(scope='module')
def found(model: ArmModel):
    return excite_arm(model, ArmLimits(), DURATION, seed=1)


def test_it_keeps_the_limits_with_their_margin(model: ArmModel, found) -> None:
    motion = found.motion(np.linspace(0, DURATION, 5001))
    tree = model.arm.tree
    assert np.all(np.abs(motion.position) <= 0.901 * np.minimum(tree.upper, np.pi))
    assert np.all(np.abs(motion.velocity) <= 0.901 * tree.speed)
    assert np.all(np.abs(motion.acceleration) <= 0.901 * 5.0)
    assert np.all(np.abs(model.drive_forces(motion).total) <= 0.91 * tree.effort)
    assert max(found.limits.values()) <= 1.001


def test_it_is_a_motion_from_rest_to_rest(found) -> None:
    time = np.linspace(0, DURATION, 5001)
    motion = found.motion(time)
    for quantity in (motion.velocity, motion.acceleration):
        assert np.abs(quantity[[0, -1]]).max() < 1e-9
    for before, after in ((motion.position, motion.velocity),
                          (motion.velocity, motion.acceleration)):
        assert np.gradient(before, time, axis=0)[1:-1] == pytest.approx(after[1:-1], abs=2e-3)


def test_it_tells_more_than_motions_drawn_at_random(model: ArmModel, found) -> None:
    search = _Search(model, ArmLimits(), DURATION)
    random = np.random.default_rng(99)
    drawn = [search.within_limits(random.normal(size=found.series.coefficients.shape))
             for _ in range(20)]
    told = [np.sum(np.log1p(search.information(one))) for one in (found, *drawn)]
    assert told[0] > max(told[1:])


def test_the_command_writes_what_a_controller_can_play(tmp_path: Path) -> None:
    path = str(arm.write_arm(tmp_path))
    output, answer = str(tmp_path / 'next.csv'), tmp_path / 'next.json'
    assert main(['next-experiment', '--model', path, '--purpose', 'commission', '--output', output,
                 '--duration', '10', '--json', str(answer)]) == 0
    table = pd.read_csv(output)
    assert len(table) == 1001
    assert {f'{joint}/{name}' for joint in arm.JOINTS
            for name in ('position', 'velocity', 'acceleration')} < set(table.columns)
    assert 0 < json.loads(answer.read_text())['determined'] <= 42


def test_what_is_not_designed_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                         ) -> None:
    path = str(arm.write_arm(tmp_path))
    run = str(tmp_path / 'run.csv')
    assert main(['next-experiment', run, '--model', path,
                 '--output', str(tmp_path / 'next.csv')]) == 2
    assert 'only --purpose commission' in capsys.readouterr().err
