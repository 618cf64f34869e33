# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The server: its socket, the address with the token, and the event loop."""

from __future__ import annotations

import socket
import webbrowser
from types import FrameType
from typing import Any

from pprs_dynamics.errors import MissingLibraryError, PprsError
from pprs_dynamics.system.plain_text import displayed

MOST_CONNECTIONS = 100
LAST_WORDS = 1  # [s] that open connections get at the end


class ListenError(PprsError, OSError):
    """An address that cannot be listened on."""


def listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 is any that is free.

    Raises
    ------
    ListenError
        Where the address is taken, or not of this machine.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family, backlog=MOST_CONNECTIONS)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, 'strerror', None) or str(error)
        raise ListenError(f'{displayed(host)}:{port}: cannot be listened on: {reason}; '
                          '--host must be an address of this machine, --port a free port') from None


def serve(hub: Any, host: str, port: int, opens_browser: bool) -> None:
    """Print the address with its token, and serve until the process is stopped.

    Raises
    ------
    ListenError
        As `listening`.
    MissingLibraryError
        Without starlette and uvicorn.
    """
    try:
        import uvicorn

        from pprs_dynamics.app.workbench.server.access import Keys
        from pprs_dynamics.app.workbench.server.app import application
    except ImportError:
        raise MissingLibraryError('starlette and uvicorn', 'the workbench', 'workbench') from None
    bound = listening(host, port)
    keys = Keys(host, bound.getsockname()[1])
    print(keys.address, flush=True)

    def used() -> None:
        # The one before is good no more.
        print(f'for one more browser: {keys.address}', flush=True)
    if opens_browser:
        webbrowser.open(keys.address)

    class Server(uvicorn.Server):
        """Server that closes the event streams of browsers at shutdown, which it would wait for."""

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            # Ctrl-C reaches a process of `ros2 launch` twice. The second would end the server
            # without its shutdown: the node of --live would go on, and the process abort.
            if not self.should_exit:
                super().handle_exit(sig, frame)

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            hub.is_over = True
            await super().shutdown(sockets)
    config = uvicorn.Config(
        application(hub, keys, used), log_level='warning', access_log=False, server_header=False,
        date_header=False, limit_concurrency=MOST_CONNECTIONS, proxy_headers=False,
        timeout_graceful_shutdown=LAST_WORDS,
        ws='none')  # an upgrade is a request like others
    with bound:
        Server(config).run(sockets=[bound])
