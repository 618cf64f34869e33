# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""pprs compare from files to its page, and the page in a real browser."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from model_recordings import record, with_effects
from pprs_command import pprs
from rosbags.highlevel import AnyReader

from pprs_dynamics import DriveModel
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.report.charts import thinned
from pprs_dynamics.drives import DRIVES
from pprs_dynamics.measurement.files.recording import read_recording, write_recording


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulate a robot with a hidden effect, and compare the model with it."""
    folder = tmp_path_factory.mktemp('compare')
    # A name that would be a script where it is not escaped.
    run = folder / '<script>alert(1)</script>.mcap'.replace('/', '')
    done = pprs('simulate', '--output', run.name, '--effect', 'coulomb_friction', '--seed', '11',
                '--duration', '8', '--json', 'truth.json', cwd=folder)
    assert done.returncode == 0, done.stderr
    done = pprs('compare', run, '--json', folder / 'mcap.json', '--report', folder / 'page.html')
    assert done.returncode == 0, done.stderr
    (folder / 'stdout.txt').write_text(done.stdout)
    return folder


def test_compare_finds_the_injected_effects_drive_and_its_size(folder: Path) -> None:
    truth = json.loads((folder / 'truth.json').read_text())['effects'][0]['parameters']
    result = json.loads((folder / 'mcap.json').read_text())
    assert set(result['drives']) == set(DRIVES)
    for name, drive in result['drives'].items():
        assert set(drive) == {'rms', 'relative', 'bias', 'peak'}
        if name in truth:
            # Nearly all of the error of a dry friction is its size.
            assert drive['rms'] == pytest.approx(abs(truth[name]['force']), rel=0.25)
        else:
            assert drive['rms'] < 0.08
    assert result['where'], 'a dry friction stands out'
    first = result['where'][0]
    assert first['drive'] in truth
    assert first['variable'] in ('direction', 'velocity')
    assert set(first) == {'drive', 'variable', 'range', 'share_of_error', 'share_of_time', 'text'}
    squares = [drive['rms'] ** 2 for drive in result['drives'].values()]
    assert result['overall']['rms'] == pytest.approx(np.sqrt(np.mean(squares)))


def test_info_says_what_is_in_a_file_and_what_is_wrong_with_it(folder: Path) -> None:
    recording = read_recording(next(folder.glob('*.mcap')))
    broken = folder / 'broken.csv'
    write_recording(broken, recording)
    lines = broken.read_text().splitlines()
    del lines[3000:3500]
    broken.write_text('\n'.join(lines))
    done = pprs('info', broken, '--json', folder / 'info.json')
    assert done.returncode == 0
    for drive in DRIVES:
        assert drive in done.stdout
    content = json.loads((folder / 'info.json').read_text())['recordings'][0]
    assert 'gap' in [finding['kind'] for finding in content['findings']]
    assert len(content['segments']) == 2
    assert '1 gap' in done.stdout


def test_the_page_needs_no_network_and_escapes_names(folder: Path) -> None:
    text = (folder / 'page.html').read_text()
    assert not re.search(r'<(script|link|img)[^>]+(src|href)=', text)
    assert '<script>alert(1)' not in text
    assert '&lt;script&gt;alert(1)' in text


def test_curves_of_a_figure_share_their_samples_and_keep_every_peak() -> None:
    time = np.arange(100_000.0)
    first, second = np.zeros(100_000), np.zeros(100_000)
    first[40_000], second[70_001] = 3.0, -4.0
    times, curve, other = thinned(time, first, second)
    assert len(times) == len(curve) == len(other) <= 3000
    assert curve.max() == 3.0
    assert other.min() == -4.0


# compare --mcap: files for PlotJuggler and Foxglove.

RATE, OFFSET = 100.0, 0.7  # [Hz, N]


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording whose first slide needs more."""
    where = tmp_path_factory.mktemp('bag')
    better = with_effects(DriveModel.load(), {'effort_offset': {'slide_1.force': OFFSET}})
    write_recording(where / 'run.csv', record(better, 0.05, 1, time=np.arange(0, 8.0, 1 / RATE)))
    return where


def test_the_bag_holds_what_was_compared_at_the_measured_stamps(
    bag: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(bag)
    assert main(['compare', 'run.csv', '--mcap', 'out.mcap', '--json', 'said.json']) == 0
    found: dict[str, list[tuple[int, np.ndarray]]] = {}
    said = []
    with AnyReader([bag / 'out.mcap']) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == '/findings':
                said.append(message.msg)
                continue
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            found.setdefault(connection.topic, []).append((stamp, message.effort))
    content = json.loads((bag / 'said.json').read_text())
    assert said == [content['verdict'], *(place['text'] for place in content['where'])]
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
