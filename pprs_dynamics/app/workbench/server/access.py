# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Access control of the workbench: token, cookie, Host and Origin of requests, sizes of bodies.

The server runs with the rights of its user, on an address that every page in the same browser can
reach. So each request has to name our own host (a foreign name that resolves to this machine is
DNS rebinding), come from our own page, and carry the cookie that a token from the terminal was
exchanged for. Answers may not be framed, and load and run nothing from elsewhere.

Starlette's own middleware does less: TrustedHostMiddleware ignores the port and a second Host
header, and SessionMiddleware knows no token that is valid once.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

TOKEN = 'token'  # in the query of the address
MOST_BYTES = 64_000  # of a body that is no upload
SAFE = ('GET', 'HEAD')
HEADERS = {
    'Content-Security-Policy':
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff', 'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer', 'Cache-Control': 'no-store',
    'Cross-Origin-Opener-Policy': 'same-origin', 'Cross-Origin-Resource-Policy': 'same-origin'}


@dataclass
class Keys:
    """Tokens that are good for one exchange each, and the cookie that they are exchanged for.

    Parameters
    ----------
    host : str
        That the server listens on.
    port : int
    """

    host: str
    port: int
    _token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    _cookie: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    @property
    def cookie_name(self) -> str:
        """Cookies know no ports: two workbenches on a machine need two names."""
        return f'pprs_workbench_{self.port}'

    @property
    def names(self) -> tuple[str, ...]:
        """Host and port as a browser may write them."""
        host = f'[{self.host}]' if ':' in self.host else self.host.lower()
        listed = [host, *(['localhost'] if self.host in ('127.0.0.1', '::1') else [])]
        return tuple(f'{name}:{self.port}' for name in listed)

    @property
    def address(self) -> str:
        """Address of the page, with a token that has not been used yet."""
        return f'http://{self.names[0]}/?{TOKEN}={self._token}'

    def exchange(self, token: str) -> str | None:
        """Return a cookie for the token, which is good no more; None for a wrong one."""
        with self._lock:
            if not secrets.compare_digest(token.encode(), self._token.encode()):
                return None
            self._token = secrets.token_urlsafe(32)
            return self._cookie

    def knows(self, cookie: str) -> bool:
        """Return whether this is the cookie."""
        return secrets.compare_digest(cookie.encode(), self._cookie.encode())


class AccessControl:
    """Refuses what does not come from our own page with our own cookie.

    Parameters
    ----------
    app : ASGI application
    keys : Keys
    uploads : mapping of path to int
        Largest bodies [bytes]; of all other paths they are small.
    used : callable
        Called after a token was exchanged.
    """

    def __init__(self, app: Any, keys: Keys, uploads: dict[str, int],
                 used: Callable[[], None] = lambda: None) -> None:
        self.app, self.keys, self.uploads, self.used = app, keys, uploads, used

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope['type'] != 'http':  # the start and the end; there are no websockets here
            await self.app(scope, receive, send)
            return
        request = Request(scope)

        async def send_with_headers(message: Any) -> None:
            if message['type'] == 'http.response.start':
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)
        answer = self._refusal(request)
        if answer is not None:
            await answer(scope, receive, send_with_headers)
            return
        most = self.uploads.get(request.url.path, MOST_BYTES)
        await self.app(scope, _bounded(receive, most), send_with_headers)

    def _refusal(self, request: Request) -> Response | None:
        headers = request.headers
        if _all(headers, 'host') not in [[name] for name in self.keys.names]:
            return _refuse(421, 'the host is not that of this workbench')
        ours = [f'http://{name}' for name in self.keys.names]
        origins = _all(headers, 'origin')
        if any(origin not in ours for origin in origins):
            return _refuse(403, 'the request comes from another page')
        if request.method not in SAFE and len(origins) != 1:
            return _refuse(403, 'the request does not say which page it comes from')
        if headers.get('sec-fetch-site', 'none') not in ('same-origin', 'none'):
            return _refuse(403, 'the request comes from another page')
        cookie = request.cookies.get(self.keys.cookie_name)
        known = cookie is not None and self.keys.knows(cookie)
        token = request.query_params.get(TOKEN)
        if request.url.path == '/' and request.method == 'GET' and token is not None:
            new = None if known else self.keys.exchange(token)
            if new is None and not known:
                return _refuse(403, 'the token is wrong or was used already: the terminal shows '
                               'a new address after each use')
            answer = RedirectResponse('/', 303)
            if new is not None:
                answer.set_cookie(self.keys.cookie_name, new, httponly=True, samesite='strict',
                                  path='/')
                self.used()
            return answer
        if not known:
            return _refuse(401, 'open the address in the terminal, with its token')
        length = headers.get('content-length', '0')
        most = self.uploads.get(request.url.path, MOST_BYTES)
        if not length.isdecimal() or len(length) > len(str(most)) or int(length) > most:
            return _refuse(413, f'the body is too long, must be at most {most} bytes')
        return None


class TooLongError(Exception):
    """A body that is longer than announced, or whose length is not announced."""


def _bounded(receive: Any, most: int) -> Any:
    seen = 0

    async def receive_bounded() -> Any:
        nonlocal seen
        message = await receive()
        seen += len(message.get('body', b''))
        if seen > most:
            raise TooLongError
        return message
    return receive_bounded


def _all(headers: Headers, name: str) -> list[str]:
    """Return every value of a header: two of them may mean different things to two readers."""
    return [value.lower() for value in headers.getlist(name)]


def _refuse(status: int, sentence: str) -> Response:
    return PlainTextResponse(sentence + '\n', status)
