# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Nodes as processes, apart from every other ROS 2 on this machine."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Domains above 101 would need ports that Linux hands out to clients.
FIRST_DOMAIN, LAST_DOMAIN = 1, 100
PORT_BASE = 32768


def reserve_domain() -> tuple[int, socket.socket]:
    """Return a domain id that nobody else here uses, and the socket that holds it.

    A domain is taken by binding a TCP port that belongs to it, as ament's domain coordinator
    does; it is free again when the socket is closed.
    """
    count = LAST_DOMAIN - FIRST_DOMAIN + 1
    for step in range(count):
        domain = FIRST_DOMAIN + (os.getpid() + step) % count
        holder = socket.socket()
        try:
            holder.bind(('127.0.0.1', PORT_BASE + domain))
        except OSError:
            holder.close()
            continue
        return domain, holder
    raise RuntimeError(f'all ROS domains from {FIRST_DOMAIN} to {LAST_DOMAIN} are in use')


def environment(domain: int) -> dict[str, str]:
    """Return the environment of a node in that domain, seen on this machine only."""
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'PYTHONUNBUFFERED': '1'}


def executable(name: str) -> str:
    """Return the installed executable: next to this Python, where colcon put it, or on PATH."""
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    places = (Path(sys.executable).parent,
              *(Path(prefix) / 'lib' / 'pprs_dynamics' for prefix in prefixes))
    found = next((str(place / name) for place in places if (place / name).exists()),
                 shutil.which(name))
    if not found:
        raise FileNotFoundError(f'{name} is not installed')
    return found


@contextmanager
def node_process(
    command: list[str], domain: int, log: Path, env: dict[str, str] | None = None,
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node while the block lasts; end it with SIGINT, as Ctrl-C would.

    What the node said is printed where the block fails.
    """
    with log.open('wb') as output:
        process = subprocess.Popen(
            command, env=env or environment(domain), stdout=output, stderr=subprocess.STDOUT)
        try:
            yield process
        except BaseException:
            print(f'{command[0]}, status {process.poll()}:\n{log.read_text(errors="replace")}')
            raise
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait(10)
