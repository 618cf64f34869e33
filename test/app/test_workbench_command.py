# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs workbench` on what else it may be given: nothing, folders, a single axis."""

from __future__ import annotations

import http.client
import signal
import time
from pathlib import Path

import pytest
from workbench_bench import AXIS, write_axis
from workbench_server import workbench

from pprs_dynamics.measurement.files.recording import read_recording, write_bag


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('command')
    (folder / 'data').mkdir()
    write_axis(folder / 'data' / 'run.csv', 1)
    return folder


def test_what_the_page_opens_is_read_as_the_command_line_says(folder: Path) -> None:
    bags = folder / 'bags'
    bags.mkdir()
    write_axis(bags / 'plain.csv', 4)
    for seed, name in ((1, 'first.mcap'), (2, '../other.mcap')):
        samples = read_recording(write_axis(folder / 'spare.csv', seed), ('axis',))
        write_bag(bags / name, {'/left/joint_states': samples, '/right/joint_states': samples})
    with workbench('--model', AXIS, bags, '--topic', '/right/joint_states', '--validate',
                   folder / 'other.mcap', folder=folder) as bench:
        bench.enter()
        bench.wait(lambda screen: not screen['is_beginning'])
        refused = bench.post('/api/open', name='0/first.mcap', is_held_out=True)
        assert refused.status == 400
        assert 'nothing to fit yet' in refused.json['error']
        assert bench.screen()['is_empty']
        for name in ('first.mcap', 'plain.csv'):
            answer = bench.post('/api/open', name=f'0/{name}')
            assert answer.status == 200, answer.body
        screen = bench.screen()
        assert [run['name'] for run in screen['recordings']] == ['first.mcap', 'plain.csv']
        assert [run['name'] for run in screen['held_out']] == ['other.mcap']


def test_a_motion_that_the_model_cannot_follow_is_a_sentence_on_the_page(folder: Path) -> None:
    short = write_axis(folder / 'short.csv', 1, 0.6)
    with workbench('--model', AXIS, short, folder=folder) as bench:
        bench.enter()
        screen = bench.wait(lambda screen: not screen['is_beginning'])
        assert 'must contain at least 100 of a drive' in screen['failure']
        assert 'Error' not in (folder / 'workbench.log').read_text()


def test_it_ends_at_once_and_in_a_line_while_a_browser_listens(folder: Path) -> None:
    with workbench('--model', AXIS, folder / 'data', folder=folder) as bench:
        bench.enter()
        bench.wait(lambda screen: not screen['is_beginning'])
        connection = http.client.HTTPConnection('127.0.0.1', bench.port, timeout=60)
        connection.request('GET', '/api/events', headers={'Cookie': bench.cookie})
        events = connection.getresponse()
        assert events.readline() == b'data: 0\n'
        for _ in range(2):  # as Ctrl-C does under `ros2 launch`
            bench.process.send_signal(signal.SIGINT)
            time.sleep(0.05)
        assert b'Error' not in events.read()  # to its end
        assert bench.process.wait(60) == 128 + signal.SIGINT
        connection.close()
    assert (folder / 'workbench.log').read_text() == 'pprs workbench: interrupted\n'
