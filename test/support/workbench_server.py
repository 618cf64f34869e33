# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs workbench` as a process, and a client that sends whatever it is told to."""

from __future__ import annotations

import http.client
import json
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ros_processes import executable

PATIENCE = 120.0  # [s], on a busy machine


class Answer:
    """Status, headers and body of an answer."""

    def __init__(self, response: http.client.HTTPResponse) -> None:
        self.status, self.headers, self.body = response.status, response.headers, response.read()

    @property
    def json(self) -> Any:
        return json.loads(self.body)

    @property
    def header(self) -> dict[str, Any]:
        """Of a binary answer."""
        length = int.from_bytes(self.body[:4], 'little')
        found: dict[str, Any] = json.loads(self.body[4:4 + length])
        return found


class Workbench:
    """A running workbench and a browser's cookie for it."""

    def __init__(self, process: subprocess.Popen[str], address: str) -> None:
        self.process, self.address = process, address
        self.port = int(re.search(r':(\d+)/', address).group(1))  # type: ignore[union-attr]
        self.token = address.rpartition('=')[2]
        self.cookie = ''

    @property
    def host(self) -> str:
        return f'127.0.0.1:{self.port}'

    def send(self, method: str, path: str, body: bytes | None = None, host: str | None = None,
             cookie: str | None = None, **headers: str) -> Answer:
        """Send one request with exactly these headers."""
        connection = http.client.HTTPConnection('127.0.0.1', self.port, timeout=PATIENCE)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        connection.putheader('Host', host or self.host)
        if cookie or (cookie is None and self.cookie):
            connection.putheader('Cookie', cookie or self.cookie)
        for name, value in headers.items():
            connection.putheader(name.replace('_', '-'), value)
        if body is not None and not {'Transfer_Encoding', 'Content_Length'} & {*headers}:
            connection.putheader('Content-Length', str(len(body)))
        connection.endheaders()
        if body is not None:
            with suppress(BrokenPipeError, ConnectionResetError):  # refused before it was read
                connection.send(body)
        answer = Answer(connection.getresponse())
        connection.close()
        return answer

    def enter(self) -> None:
        """Exchange the token for a cookie."""
        self.entered = self.send('GET', f'/?token={self.token}', cookie='')
        self.cookie = self.entered.headers['Set-Cookie'].partition(';')[0]

    def get(self, path: str) -> Answer:
        return self.send('GET', path)

    def post(self, path: str, **body: Any) -> Answer:
        """Send JSON as the page does."""
        return self.send('POST', path, json.dumps(body).encode(), Origin=f'http://{self.host}',
                         Content_Type='application/json')

    def screen(self) -> dict[str, Any]:
        return self.get('/api/screen').header

    def wait(self, holds: Callable[[dict[str, Any]], Any], seconds: float = PATIENCE,
             ) -> dict[str, Any]:
        """Return the screen once a condition holds for it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            screen = self.screen()
            if holds(screen):
                return screen
            time.sleep(0.05)
        raise AssertionError(f'it did not come about: {screen}')

    def settled(self) -> dict[str, Any]:
        return self.wait(lambda screen: screen.get('is_settled'))

    def at_rest(self) -> dict[str, Any]:
        """Return the screen once nothing changes it any more: the diagnosis has ended as well."""
        return self.wait(lambda screen: screen.get('is_settled') and screen['verdict'] and not any(
            job['is_running'] for job in screen['jobs'].values()))


@contextmanager
def workbench(*arguments: object, folder: Path) -> Iterator[Workbench]:
    """Run `pprs workbench --no-browser` while the block lasts."""
    with (folder / 'workbench.log').open('w') as log:
        process = subprocess.Popen(
            [executable('pprs'), 'workbench', '--no-browser', *map(str, arguments)], text=True,
            stdout=subprocess.PIPE, stderr=log, process_group=0)
        try:
            assert process.stdout is not None
            yield Workbench(process, process.stdout.readline().strip())
        finally:
            process.terminate()
            process.wait(30)
            if process.stdout is not None:
                process.stdout.close()
