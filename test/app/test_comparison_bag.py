# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""compare --mcap and --beside: files for PlotJuggler and Foxglove; two models on one recording."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.measurement.files.recording import Recording, write_recording
from pprs_dynamics.physics.mechanism.paths import Excitation

RATE, OFFSET = 100.0, 0.7  # [Hz, N]


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording whose first slide needs more, and another model."""
    where = tmp_path_factory.mktemp('bag')
    model = DriveModel.load()
    for name, seed, offset in (('run', 1, OFFSET), ('other', 2, 0.0)):
        motion = Excitation(8.0, seed=seed).motion(np.arange(0, 8.0, 1 / RATE))
        forces = model.drive_forces(motion)
        effort = forces.total + 0.05 * np.random.default_rng(seed).standard_normal((len(motion), 6))
        effort[:, 0] += offset
        write_recording(where / f'{name}.csv', Recording.from_arrays(
            name, np.arange(len(motion)) / RATE, forces.mechanism.position, effort=effort))
    text = (Path(__file__).parents[2] / 'config/paper.yaml').read_text()
    (where / 'better.yaml').write_text(text.rstrip() + f"""
    effects:
      active: [effort_offset]
      effort_offset: {{slide_1: {{force: {OFFSET}}}}}
""")
    return where


def test_the_bag_holds_what_was_compared_at_the_measured_stamps(
    folder: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(folder)
    assert main(['compare', 'run.csv', '--mcap', 'out.mcap', '--json', 'said.json']) == 0
    found: dict[str, list[tuple[int, np.ndarray]]] = {}
    said = []
    with AnyReader([folder / 'out.mcap']) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == '/findings':
                said.append(message.msg)
                continue
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            found.setdefault(connection.topic, []).append((stamp, message.effort))
    content = json.loads((folder / 'said.json').read_text())
    assert said == [content['verdict'], *(each['text'] for each in content['where'])]
    assert len(said) > 1
    parts = {topic for topic in found if topic.startswith('/parts/')}
    assert parts == {'/parts/rigid_body', '/parts/active_friction', '/parts/passive_friction'}
    stamps = [stamp for stamp, _ in found['/measured']]
    assert all(stamp % 10_000_000 == 0 for stamp in stamps)  # those of the recording
    arrays = {topic: np.array([effort for _, effort in rows]) for topic, rows in found.items()}
    assert all([stamp for stamp, _ in rows] == stamps for rows in found.values())
    np.testing.assert_allclose(arrays['/residual'], arrays['/measured'] - arrays['/model'])
    np.testing.assert_allclose(arrays['/model'], sum(arrays[topic] for topic in parts), atol=1e-9)
    assert arrays['/residual'][:, 0].mean() == pytest.approx(OFFSET, abs=0.02)


def test_errors_of_two_models_on_one_recording(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    beside = 'better.yaml'
    assert main(['compare', 'run.csv', '--beside', beside, '--json', 'both.json',
                 '--report', 'both.html']) == 0
    content = json.loads((folder / 'both.json').read_text())
    assert content['beside']['name'] == beside
    before, after = (one['drives']['slide_1']['rms'] for one in (content, content['beside']))
    assert before == pytest.approx(OFFSET, rel=0.05)
    assert after < 0.1
    assert beside in capsys.readouterr().out
    assert beside in (folder / 'both.html').read_text()
