# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Surveys on clusters of separate processes: killed, interrupted, unreachable, encrypted, in S3."""

from __future__ import annotations

import json
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.fleets.cluster_kills import (
    PATIENCE,
    files,
    kill_one_after_another,
    rows,
    running,
    survey,
    wait_for,
    write_axes,
)
from pprs_dynamics.app.commands.pprs import main
from pprs_dynamics.app.fleet.engine import cluster, run_each

COUNT = 24
# Two tests' clusters beside each other would only wait for the same two cores.
pytestmark = pytest.mark.xdist_group('clusters')


@pytest.fixture(scope='module')
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_axes(tmp_path_factory.mktemp('fleet'), COUNT)


@pytest.fixture(scope='module')
def reference(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the store of a survey that nothing happened to."""
    store = tmp_path_factory.mktemp('reference') / 'store'
    _, wrong = survey(recordings, store, '--workers', '2').communicate(timeout=PATIENCE)
    assert wrong == ''
    assert len(files(store)) == COUNT
    return store


def test_worker_scheduler_and_client_killed_leave_the_same_store(
        recordings: Path, reference: Path, tmp_path: Path) -> None:
    lost, said = kill_one_after_another(recordings, tmp_path / 'store', (0.1, 0.3, 0.6), COUNT)
    assert rows(tmp_path / 'store') == rows(reference)
    assert lost.startswith('pprs survey: the scheduler has gone; what was written stays')
    assert lost.count('\n') == 1
    done, before = map(int, re.search(r'(\d+) done, (\d+) done before', said).groups())
    assert done + before == COUNT
    assert before >= 0.6 * COUNT


def test_interrupted_it_ends_in_one_line_and_goes_on_from_there(
        recordings: Path, reference: Path, tmp_path: Path) -> None:
    store = tmp_path / 'store'
    # As a terminal does it: all processes of the command hear the signal. One worker, and at once,
    # so that a busy machine does not finish before it is interrupted.
    process = survey(recordings, store, '--workers', '1', start_new_session=True)
    wait_for(lambda: len(files(store)) >= 1)
    os.killpg(process.pid, signal.SIGINT)
    _, wrong = process.communicate(timeout=PATIENCE)
    assert (process.returncode, wrong) == (130, 'pprs survey: interrupted\n')
    kept = files(store)
    assert 1 <= len(kept) < COUNT
    said, _ = survey(recordings, store, '--workers', '2').communicate(timeout=PATIENCE)
    assert f'{len(kept)} done before' in said
    assert rows(store) == rows(reference)
    assert {name: files(store)[name] for name in kept} == kept


@pytest.mark.parametrize('address', ['tcp://127.0.0.1:9', 'tcp://no.such.host.invalid:8786',
                                     'nonsense://x', 'tls://127.0.0.1:9', '127.0.0.1'])
def test_a_scheduler_that_is_not_there_is_one_sentence(
        recordings: Path, tmp_path: Path, address: str, capfd: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('pprs_dynamics.app.fleet.engine.REACHED_WITHIN', '1s')
    assert main(['survey', str(recordings), '--output', str(tmp_path / 'store'),
                 '--scheduler', address]) == 2
    said = capfd.readouterr().err
    assert said.startswith(f'pprs survey: --scheduler {address}: cannot be reached')
    assert said.count('\n') == 1


def test_certificates_of_dasks_configuration_are_used(
        recordings: Path, reference: Path, tmp_path: Path) -> None:
    from distributed.security import Security

    own = Security.temporary()
    certificate, key = tmp_path / 'certificate.pem', tmp_path / 'key.pem'
    certificate.write_text(own.tls_ca_file)
    key.write_text(own.tls_client_key)
    settings = {'DASK_DISTRIBUTED__COMM__TLS__CA_FILE': str(certificate),
                'DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION': 'True'}
    for role in ('SCHEDULER', 'WORKER', 'CLIENT'):
        settings[f'DASK_DISTRIBUTED__COMM__TLS__{role}__CERT'] = str(certificate)
        settings[f'DASK_DISTRIBUTED__COMM__TLS__{role}__KEY'] = str(key)
    store = tmp_path / 'store'
    with running(1, settings, 'tls') as one:
        assert one.address.startswith('tls://')
        process = survey(recordings, store, '--scheduler', one.address, settings=settings)
        _, wrong = process.communicate(timeout=PATIENCE)
        assert (process.returncode, wrong) == (0, '')
    assert rows(store) == rows(reference)
    bare = survey(recordings, store, '--scheduler', one.address)
    assert bare.communicate(timeout=PATIENCE)[1] == (
        f"pprs survey: --scheduler {one.address}: cannot be reached: Dask's configuration names no "
        'certificates (distributed.comm.tls)\n')
    other = survey(recordings, store, '--scheduler', 'tcp://127.0.0.1:9', settings=settings)
    assert other.communicate(timeout=PATIENCE)[1].endswith(
        'requires encryption, an address must begin with tls://\n')


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Give an S3 server of this machine with one bucket."""
    import s3fs
    from moto.server import ThreadedMotoServer

    logging.getLogger('werkzeug').setLevel(logging.WARNING)  # its remark on every request
    server = ThreadedMotoServer('127.0.0.1', 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in (('AWS_ENDPOINT_URL', f'http://{host}:{port}'), ('AWS_ACCESS_KEY_ID', 'x'),
                        ('AWS_SECRET_ACCESS_KEY', 'x'), ('AWS_DEFAULT_REGION', 'us-east-1')):
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir('fleet')
    yield 's3://fleet'
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def test_recordings_and_store_may_lie_in_s3(
        bucket: str, recordings: Path, reference: Path, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    import s3fs

    system = s3fs.S3FileSystem()
    system.put(str(recordings), 'fleet/recordings', recursive=True)
    store, summary = f'{bucket}/store', tmp_path / 'survey.json'
    process = survey(f'{bucket}/recordings', store, '--workers', '1', '--json', str(summary))
    _, wrong = process.communicate(timeout=PATIENCE)
    assert (process.returncode, wrong) == (0, '')
    system.invalidate_cache()
    # Reasons name the address, and no copy of the file.
    assert [row.replace(f'{bucket}/recordings', str(recordings)) for row in rows(store)] == rows(
        reference)
    assert json.loads(summary.read_text())['done'] == COUNT - 1
    assert main(['trend', store]) == 0
    assert 'No change on 3 robots.' in capsys.readouterr().out
    again = survey(f'{bucket}/recordings', store, '--workers', '1')
    assert f'0 done, {COUNT} done before' in again.communicate(timeout=PATIENCE)[0]


def _half(number: int) -> float:
    if number == 3:
        raise ValueError('three is odd')
    return number / 2


def test_any_work_runs_on_the_engine_and_says_what_failed() -> None:
    with cluster(1) as client:
        found = {item: (value, error) for item, value, error in run_each(client, _half, range(5))}
    assert found.pop(3) == (None, 'ValueError: three is odd')
    assert found == {k: (k / 2, None) for k in (0, 1, 2, 4)}


def test_the_command_is_quiet_in_a_pipe(recordings: Path, reference: Path) -> None:
    """Nothing but the summary, and that where nothing is left to do, too."""
    result = subprocess.run(
        [sys.executable, '-m', 'pprs_dynamics.app.commands.pprs', 'survey', str(recordings),
         '--model', 'config/single_axis.yaml', '--effects', 'coulomb_friction', '--output',
         str(reference), '--workers', '1'], capture_output=True, text=True, check=True)
    assert result.stderr == ''
    assert result.stdout.splitlines()[0].startswith(f'{COUNT} recordings: 0 done')
