# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Attacks on the workbench's server, each as it would be sent."""

from __future__ import annotations

import json
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_processes import executable
from workbench_bench import AXIS, write_axis
from workbench_server import Workbench, workbench

from pprs_dynamics.app.workbench.server.hub import MOST_UPLOADS, Offered
from pprs_dynamics.app.workbench.ticks import SessionError

AT_ONCE = struct.pack('ii', 1, 0)  # closes with a reset
SECRET = 'no business of a browser'


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('safety')
    (folder / 'given').mkdir()
    write_axis(folder / 'run.csv', 1)
    write_axis(folder / 'given' / 'one.csv', 2)
    (folder / 'secret.csv').write_text(SECRET)
    (folder / 'given' / 'link.csv').symlink_to(folder / 'secret.csv')
    return folder


@pytest.fixture(scope='module')
def bench(folder: Path) -> Iterator[Workbench]:
    with workbench('--model', AXIS, folder / 'run.csv', folder / 'given', folder=folder) as running:
        running.enter()
        running.wait(lambda screen: not screen['is_beginning'])
        yield running


PATHS = ('/', '/api/screen', '/api/curves', '/api/events', '/api/model.yaml',
         '/static/workbench.mjs', '/nothing')


@pytest.mark.parametrize('path', PATHS)
@pytest.mark.parametrize('cookie', ['', 'other=1', 'pprs_workbench_{port}=guess',
                                    'pprs_workbench_{port}='])
def test_without_the_cookie_nothing_is_served(bench: Workbench, path: str, cookie: str) -> None:
    answer = bench.send('GET', path, cookie=cookie.format(port=bench.port) or 'a=b')
    assert answer.status == 401
    assert b'terminal' in answer.body


def test_a_token_is_good_once_and_a_wrong_one_never(bench: Workbench, folder: Path) -> None:
    assert bench.send('GET', f'/?token={bench.token}', cookie='a=b').status == 403
    assert bench.send('GET', '/?token=guess', cookie='a=b').status == 403
    assert bench.send('GET', '/?token=', cookie='a=b').status == 403
    # Whoever has the cookie may follow an old link.
    assert bench.send('GET', f'/?token={bench.token}').status == 303
    new = bench.post('/api/invite').json['address'].rpartition('=')[2]
    answer = bench.send('GET', f'/?token={new}', cookie='a=b')
    assert answer.status == 303
    assert bench.send('GET', f'/?token={new}', cookie='a=b').status == 403


def test_the_cookie_is_for_this_page_alone(bench: Workbench) -> None:
    cookie = bench.entered.headers['Set-Cookie'].lower()
    assert 'httponly' in cookie
    assert 'samesite=strict' in cookie
    line = bench.process.stdout.readline()  # type: ignore[union-attr]
    assert f'http://127.0.0.1:{bench.port}/?token=' in line
    assert bench.token not in line


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:{port}', '127.0.0.1',
                                  'localhost.evil.example:{port}', '127.0.0.1:1',
                                  '192.168.0.7:{port}', '0.0.0.0:{port}'])
def test_dns_rebinding_is_refused_with_the_right_cookie_too(bench: Workbench, host: str) -> None:
    name = host.format(port=bench.port)
    assert bench.send('GET', '/api/screen', host=name).status == 421
    assert bench.send('GET', f'/?token={bench.token}', host=name).status == 421


@pytest.mark.parametrize('origin', ['http://evil.example', 'null', 'http://127.0.0.1:1',
                                    'https://127.0.0.1:{port}', 'http://127.0.0.1:{port}.evil'])
def test_another_page_may_neither_read_nor_change(bench: Workbench, origin: str) -> None:
    name = origin.format(port=bench.port)
    before = bench.screen()['revision']
    body = json.dumps({'effect': 'payload_mass', 'revision': before}).encode()
    for headers in ({'Origin': name}, {'Origin': name, 'Content_Type': 'application/json'}):
        assert bench.send('POST', '/api/tick', body, **headers).status == 403
    assert bench.send('GET', '/api/screen', Origin=name).status == 403
    assert bench.screen()['revision'] == before


def test_a_change_says_where_it_comes_from_and_is_json(bench: Workbench) -> None:
    before = bench.screen()['revision']
    body = json.dumps({'effect': 'payload_mass', 'revision': before}).encode()
    ours = f'http://{bench.host}'
    assert bench.send('POST', '/api/tick', body, Content_Type='application/json').status == 403
    # A form of another page can send plain text without asking first.
    assert bench.send('POST', '/api/tick', body, Origin=ours,
                      Content_Type='text/plain').status == 400
    assert bench.send('GET', '/api/tick?effect=payload_mass').status == 405
    assert bench.send('GET', '/api/screen', Sec_Fetch_Site='cross-site').status == 403
    assert bench.screen()['revision'] == before


def test_answers_run_and_load_nothing_from_elsewhere_and_cannot_be_framed(bench: Workbench) -> None:
    for path, cookie in (('/', None), ('/api/screen', None), ('/', 'a=b'), ('/nothing', None)):
        headers = bench.send('GET', path, cookie=cookie).headers
        policy = headers['Content-Security-Policy']
        assert policy.startswith("default-src 'none'")
        assert 'unsafe' not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers['X-Content-Type-Options'] == 'nosniff'
        assert headers['Referrer-Policy'] == 'no-referrer'
        assert headers['Cache-Control'] == 'no-store'
        assert 'Access-Control-Allow-Origin' not in headers


@pytest.mark.parametrize('name', [
    '../secret.csv', '0/../secret.csv', '0//etc/passwd', '/etc/passwd', '0/link.csv', '1/one.csv',
    '0/', '0', '', '0/one.csv\0', '-1/one.csv', '0/..', '0/./../secret.csv', '\u0660/one.csv',
    '0/' + 'x' * 5000 + '.csv', '0/' + 'x/' * 5000, '9' * 5000 + '/one.csv', '0/\ud800.csv',
    'survey/' + '9' * 5000])
def test_no_path_outside_the_given_folders_is_opened(
    bench: Workbench, folder: Path, name: str,
) -> None:
    answer = bench.post('/api/open', name=name)
    assert answer.status == 400
    assert SECRET.encode() not in answer.body
    with pytest.raises(SessionError):
        Offered.of([str(folder / 'given')]).path(name)


@pytest.mark.parametrize('path', ['/static/../hub.py', '/static/..%2fhub.py', '/static/hub.py',
                                  '/static/%2e%2e/%2e%2e/setup.py', '//etc/passwd'])
def test_only_the_files_of_the_page_are_files(bench: Workbench, path: str) -> None:
    assert bench.get(path).status == 404


def test_a_recording_of_a_given_folder_is_opened(bench: Workbench) -> None:
    assert '0/one.csv' in bench.get('/api/files').json['files']
    before = len(bench.screen()['recordings'])
    assert bench.post('/api/open', name='0/one.csv').status == 200
    assert len(bench.screen()['recordings']) == before + 1
    assert bench.post('/api/open', name='0/one.csv').status == 400  # the same samples again


def upload(bench: Workbench, body: bytes, name: str = 'a.csv', **headers: str) -> int:
    return bench.send('POST', f'/api/upload?name={name}', body, Origin=f'http://{bench.host}',
                      **headers).status


def test_uploads_are_bounded_and_read_by_the_strict_readers(bench: Workbench, folder: Path) -> None:
    before = len(bench.screen()['recordings'])
    assert upload(bench, b'', Content_Length=str(10**12)) == 413
    assert upload(bench, b'time,\n1,2\n') == 400
    assert upload(bench, b'\x89MCAP0\r\n', 'a.mcap') == 400
    assert upload(bench, b'#!/bin/sh', 'a.sh') == 400
    assert upload(bench, b'x', '..%2f..%2fa.csv') == 400
    for _ in range(MOST_UPLOADS):  # what failed does not count
        assert upload(bench, b'time,\n1,2\n') == 400
    assert len(bench.screen()['recordings']) == before
    other = write_axis(folder / 'other.csv', 3)
    assert upload(bench, other.read_bytes(), '..%2f..%2fother.csv') == 200
    assert len(bench.screen()['recordings']) == before + 1
    assert not (folder.parent / 'other.csv').exists()
    assert bench.screen()['recordings'][-1]['name'] == 'other.csv'


def test_a_body_that_goes_on_is_cut_off(bench: Workbench) -> None:
    assert bench.post('/api/tick', effect='x' * 100_000, revision=0).status == 413
    # Without a length it is counted as it comes.
    piece = b'x' * 65_000
    chunks = b''.join(b'%x\r\n%s\r\n' % (len(part), part) for part in (piece, piece)) + b'0\r\n\r\n'
    answer = bench.send('POST', '/api/tick', chunks, Origin=f'http://{bench.host}',
                        Content_Type='application/json', Transfer_Encoding='chunked')
    assert answer.status == 413


@pytest.mark.parametrize('body', [
    b'', b'[]', b'{', b'[' * 20_000, b'{"effect": 1, "revision": 1}', b'\xff',
    b'{"effect": "payload_mass"}', b'{"effect": "payload_mass", "revision": true}',
    b'{"effect": "payload_mass", "revision": 1, "drives": [[]]}',
    b'{"effect": "../../etc/passwd", "revision": 1}', b'{"effect": "\\ud800", "revision": 1}',
    b'{"effect": "payload_mass", "revision": ' + b'9' * 400 + b'}',
    b'{"effect": "payload_mass", "revision": 1.5}', b'{"effect": "x", "revision": 1e999}'])
def test_a_bad_body_is_a_sentence(bench: Workbench, body: bytes) -> None:
    answer = bench.send('POST', '/api/tick', body, Origin=f'http://{bench.host}',
                        Content_Type='application/json')
    assert answer.status == 400
    assert answer.json['error']
    assert b'Traceback' not in answer.body


@pytest.mark.parametrize('number', ['NaN', 'Infinity', '1e18', '-1', '1e999', '9' * 400, 'true',
                                    '"20"', '[]'])
def test_a_number_that_is_none_is_a_sentence(bench: Workbench, number: str) -> None:
    revision = bench.screen()['revision']
    for path, body in (
            ('experiment', f'{{"duration": {number}}}'),
            ('choose', f'{{"effect": "x", "key": "y", "value": {number}, "revision": {revision}}}'),
            ('shares', f'{{"time": [0, {number}], "drive": []}}'),
            ('shares', f'{{"x": "time", "y": "time", "x_range": [0, {number}], "y_range": [0, 1], '
             '"drive": "\\udfff"}')):
        answer = bench.send('POST', f'/api/{path}', body.encode(), Origin=f'http://{bench.host}',
                            Content_Type='application/json')
        assert answer.status == 400, (path, answer.body)
        assert answer.json['error']


def test_nobody_else_on_the_network_is_listened_to(bench: Workbench) -> None:
    others = {entry[4][0] for entry in socket.getaddrinfo(socket.gethostname(), None)
              if not str(entry[4][0]).startswith(('127.', '::1'))}
    for address in others:
        with pytest.raises((ConnectionRefusedError, TimeoutError)):
            socket.create_connection((str(address), bench.port), 2).close()
    listening = Path('/proc/net/tcp').read_text()
    assert f'0100007F:{bench.port:04X}' in listening
    assert f'00000000:{bench.port:04X}' not in listening


def test_a_port_that_is_taken_is_one_line(bench: Workbench) -> None:
    done = subprocess.run([executable('pprs'), 'workbench', '--no-browser', '--port',
                           str(bench.port)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert f'127.0.0.1:{bench.port}: cannot be listened on' in done.stderr


def test_clients_that_go_away_in_the_middle_leave_no_traceback(
    bench: Workbench, folder: Path,
) -> None:
    head = (f'HTTP/1.1\r\nHost: {bench.host}\r\nOrigin: http://{bench.host}\r\n'
            f'Cookie: {bench.cookie}\r\n')
    body = 'Content-Type: {}\r\nContent-Length: 1000\r\n\r\n{}'
    requests = [f'GET {path} {head}\r\n' for path in PATHS] + [
        f'GET {PATHS[1]} HT', f'GET {PATHS[1]} {head}',
        f'POST /api/upload?name=x.csv {head}' + body.format('application/octet-stream', 'time,'),
        f'POST /api/tick {head}' + body.format('application/json', '{"effect":')]
    for request in requests:
        for is_reset in (False, True):
            with socket.create_connection(('127.0.0.1', bench.port)) as client:
                client.sendall(request.encode())
                time.sleep(0.05)
                if is_reset:
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
    time.sleep(0.5)
    assert bench.get('/api/files').status == 200
    assert 'Traceback' not in (folder / 'workbench.log').read_text()
