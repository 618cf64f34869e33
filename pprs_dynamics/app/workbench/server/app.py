# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Routes of the workbench: checked requests, each one call of the session, and its answer."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, nullcontext
from dataclasses import asdict
from functools import partial
from mimetypes import guess_type
from pathlib import Path
from sys import float_info
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from pprs_dynamics.app.report.page import CURVES, CURVES_STYLE, assets, vendored
from pprs_dynamics.app.report.page import asset as packaged
from pprs_dynamics.app.workbench import masks
from pprs_dynamics.app.workbench.server.access import AccessControl, Keys, TooLongError
from pprs_dynamics.app.workbench.server.hub import Hub
from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.app.workbench.ticks import SessionError, StaleError
from pprs_dynamics.app.workbench.view_state import units_to_dict
from pprs_dynamics.arrays import Array, root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.system.json_records import for_json

LARGEST = float_info.max  # whole numbers of JSON may be larger
UPLOAD = '/api/upload'
MOST_UPLOADED = 256_000_000  # bytes: an hour of six drives at 500 Hz as CSV
HEARTBEAT = 15.0  # [s] between signs of life
LOOK = 0.02  # [s] between looks at whether something has changed


class BadRequestError(PprsError, ValueError):
    """A request that is not what the page sends."""


class Fields(dict[str, Any]):
    """Fields of a request. What reads one raises `BadRequestError` for any other."""

    @classmethod
    def of(cls, content: bytes) -> Fields:
        """Return the fields of a JSON object, all numbers finite and all text Unicode."""
        try:
            body = json.loads(content)
            json.dumps(body, ensure_ascii=False, allow_nan=False).encode()
        except (ValueError, RecursionError):
            raise BadRequestError('the body is no JSON of finite numbers and of text') from None
        if not isinstance(body, dict):
            raise BadRequestError('the body must be an object')
        return cls(body)

    def text(self, key: str) -> str:
        """Return a text."""
        return str(self._checked(key, lambda value: isinstance(value, str), 'a text'))

    def number(self, key: str) -> float:
        """Return a number."""
        return float(self._checked(key, _is_number, 'a number'))

    def range(self, key: str) -> tuple[float, float]:
        """Return two numbers."""
        first, last = self._checked(key, lambda value: isinstance(value, list) and len(
            value) == 2 and all(map(_is_number, value)), 'two numbers')
        return float(first), float(last)

    def revision(self) -> int:
        """Return the revision that a change counts on."""
        return int(self._checked('revision', lambda value: _is_number(value) and value == int(
            value), 'a whole number'))

    def drives(self) -> list[str] | None:
        """Return names of drives, None where none are given."""
        names: list[str] | None = self._checked('drives', lambda value: value is None or (
            isinstance(value, list) and value and all(isinstance(name, str) for name in value)),
            'a list of names')
        return names

    def _checked(self, key: str, is_right: Callable[[Any], object], rule: str) -> Any:
        if not is_right(value := self.get(key)):
            raise BadRequestError(f'{key} must be {rule}')
        return value


def _is_number(value: Any) -> bool:
    return (isinstance(value, (int, float)) and not isinstance(value, bool)
            and abs(value) <= LARGEST)


def packed(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """Return the length of the header (uint32), the header, and float32 arrays; little-endian.

    The header gets `arrays`: name and shape of each, in order. What is not known is NaN.
    """
    parts = [np.ascontiguousarray(array, dtype='<f4') for array in arrays.values()]
    shapes = [{'name': name, 'shape': part.shape} for name, part in zip(arrays, parts, strict=True)]
    text = json.dumps({**header, 'arrays': shapes}, allow_nan=False).encode()
    text += b' ' * (-len(text) % 4)  # so that numbers begin at a multiple of their size
    return b''.join((len(text).to_bytes(4, 'little'), text, *(part.tobytes() for part in parts)))


def binary(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Response:
    """Return an answer of a header and numbers."""
    return Response(packed(header, arrays), media_type='application/octet-stream')


VENDORED = {'uplot.js': CURVES, 'uplot.css': CURVES_STYLE}

# What the session is asked to do by POST, with a JSON object; all are answered by the screen.
CHANGES: dict[str, Callable[[Session, Fields], object]] = {
    'choose': lambda session, body: session.ticks.choose(
        body.text('effect'), body.text('key'), body.number('value'), body.revision()),
    'release': lambda session, body: session.ticks.release(body.text('effect'), body.revision()),
    'back': lambda session, body: session.ticks.back(body.revision()),
    'forward': lambda session, body: session.ticks.forward(body.revision()),
    'remove': lambda session, body: session.ticks.change_recordings(
        lambda inputs: inputs.without(body.text('name'))),
    'adopt': lambda session, body: session.jobs.adopt(
        body.text('effect'), revision=body.revision()),
    'cancel': lambda session, body: session.jobs.cancel(body.text('kind')),
    'experiment': lambda session, body: session.jobs.next_experiment(body.number('duration')),
}


def application(hub: Hub, keys: Keys, used: Callable[[], None] = lambda: None) -> Any:
    """Return the application, guarded."""
    @asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        hub.start()
        yield
        await run_in_threadpool(hub.stop)

    api = Api(hub, keys)
    routes = [Route('/', page), Route('/static/{name}', asset), Route('/api/events', api.events),
              Route(UPLOAD, api.upload, methods=['POST']),
              *(Route(f'/api/{path}', in_thread(work)) for path, work in api.answers().items()),
              *(Route(f'/api/{path}', with_body(work), methods=['POST'])
                for path, work in api.changes().items())]
    app = Starlette(routes=routes, lifespan=lifespan, exception_handlers={
        StaleError: _status(409), PprsError: _status(400), TooLongError: _status(413),
        ClientDisconnect: _status(400)})
    return AccessControl(app, keys, {UPLOAD: MOST_UPLOADED}, used)


def _status(status: int) -> Callable[[Request, Exception], Response]:
    def answer(request: Request, error: Exception) -> Response:
        return JSONResponse({'error': str(error) or 'the body is too long or incomplete'}, status)
    return answer


def in_thread(work: Callable[[Any], Response]) -> Callable[[Request], Awaitable[Response]]:
    """Return an endpoint that works in a thread."""
    async def endpoint(request: Request) -> Response:
        return await run_in_threadpool(work, request.query_params)
    return endpoint


def with_body(work: Callable[[Fields], Response]) -> Callable[[Request], Awaitable[Response]]:
    """Return an endpoint that takes a JSON object."""
    async def endpoint(request: Request) -> Response:
        if request.headers.get('content-type') != 'application/json':
            raise BadRequestError('the body must be application/json')
        return await run_in_threadpool(work, Fields.of(await request.body()))
    return endpoint


async def page(request: Request) -> Response:
    """Answer the page."""
    return Response(packaged('workbench.html'), media_type='text/html')


async def asset(request: Request) -> Response:
    """Answer a file of the page; only those that are shipped are files."""
    name = request.path_params['name']
    if name not in {*assets(), *VENDORED}:
        raise HTTPException(404)
    content = vendored(VENDORED[name]) if name in VENDORED else packaged(name)
    return Response(content, media_type=guess_type(name)[0])


class Api:
    """Handlers of the requests of the page.

    Parameters
    ----------
    hub : Hub
    keys : Keys
    """

    def __init__(self, hub: Hub, keys: Keys) -> None:
        self.hub, self.keys = hub, keys

    def answers(self) -> dict[str, Callable[[Any], Response]]:
        """Return the functions that answer GET requests, by path."""
        return {'model.yaml': self.model, 'experiment.csv': self.experiment_file,
                'live/machine': self.live_machine, **{work.__name__: work for work in (
                    self.screen, self.curves, self.scatter, self.robot, self.files, self.live)}}

    def changes(self) -> dict[str, Callable[[Fields], Response]]:
        """Return the functions that answer POST requests, by path."""
        return {'live/set': self.live_set, 'live/restore': self.live_restore,
                'live/take': self.live_take, **{work.__name__: work for work in (
                    self.tick, self.shares, self.open, self.invite)},
                **{name: partial(self._change, change) for name, change in CHANGES.items()}}

    def _change(self, change: Callable[[Session, Fields], object], body: Fields) -> Response:
        change(self.hub.the_session, body)
        return self.screen(body)

    def screen(self, query: Any) -> Response:
        """Answer the state, and the errors now unless the browser has drawn them already."""
        hub = self.hub
        # Read first: what changes meanwhile has a later version, which is asked for again.
        session, version = hub.session, hub.version
        with session.ticks.steady() if session else nullcontext():
            state = {'failure': hub.failure,
                     'is_beginning': hub.is_beginning, 'has_live': hub.live is not None,
                     'has_folders': bool(hub.offered.folders),
                     'is_empty': session is None, 'version': version,
                     **(session.to_dict() if session else units_to_dict(hub.inputs.model))}
            state['drawn'] = ' '.join(
                str(state.get(key)) for key in ('fitted_since', 'revision', 'stage'))
            if session is None or (query or {}).get('drawn') == state['drawn']:
                return binary(state, {})
            return binary(state, {'now': session.ticks.view.residual.T})

    def curves(self, query: Any) -> Response:
        """Answer times and the error before."""
        ticks = self.hub.the_session.ticks
        with ticks.steady():
            data = ticks.fits.design.residuals
            # Times of a long recording have more digits than float32: seconds and the rest.
            whole = np.floor(data.time)
            return binary(
                {'fitted_since': ticks.fitted_since, 'drives': list(ticks.fits.drives),
                 'quantities': masks.quantities(data)},
                {'seconds': whole, 'rest': data.time - whole, 'segment': data.segment.astype(float),
                 'before': ticks.fits.before.T})

    def tick(self, body: Fields) -> Response:
        """Tick or untick an effect."""
        effect, revision = body.text('effect'), body.revision()
        if body.get('is_ticked', True):
            self.hub.the_session.ticks.tick(effect, body.drives(), revision)
        else:
            self.hub.the_session.ticks.untick(effect, revision)
        return self.screen(body)

    def shares(self, body: Fields) -> Response:
        """Answer the shares that unticked effects explain of a selection, and its times."""
        ticks = self.hub.the_session.ticks
        if 'x' in body:
            mask = masks.region_mask(ticks, body.text('x'), body.text('y'), body.range('x_range'),
                                     body.range('y_range'), body.text('drive'))
        else:
            drive = body.get('drive')
            mask = masks.span_mask(
                ticks, *body.range('time'), None if drive is None else [str(drive)])
        fits, view = ticks.fits, ticks.view
        shares = masks.shares_in(mask, fits, view)
        return JSONResponse({'shares': [asdict(share) for share in shares],
                             'before': for_json(root_mean_square(fits.before[mask])),
                             'now': for_json(root_mean_square(view.residual[mask])),
                             'spans': masks.spans_of(fits.design.residuals, mask),
                             'samples': int(mask.sum()), 'revision': ticks.revision})

    def experiment_file(self, query: Any) -> Response:
        """Answer the poses, or the joints' positions, of the designed motion."""
        found = self.hub.the_session.jobs.experiment
        if found is None:
            raise SessionError('no experiment is designed yet')
        return self._download('next.csv', 'text/csv', found.save)

    def model(self, query: Any) -> Response:
        """Answer the model file, with the ticked effects on request."""
        session, with_ticked = self.hub.the_session, query.get('ticked') == '1'
        return self._download('ticked.yaml' if with_ticked else 'model.yaml', 'application/yaml',
                              lambda path: session.export(path, with_ticked))

    @staticmethod
    def _download(name: str, kind: str, write: Callable[[Path], None]) -> Response:
        with TemporaryDirectory(prefix='pprs_workbench_') as folder:
            write(Path(folder) / name)
            return Response((Path(folder) / name).read_bytes(), media_type=kind, headers={
                'Content-Disposition': f'attachment; filename="{name}"'})

    def scatter(self, query: Any) -> Response:
        """Answer two quantities of a drive."""
        ticks = self.hub.the_session.ticks
        drives = ticks.fits.drives
        if query.get('drive') not in drives:
            raise BadRequestError(f'drive must be one of {", ".join(drives)}')
        with ticks.steady():
            x, y = (masks.quantity(ticks.fits, ticks.view, query.get(axis, ''),
                                   drives.index(query['drive'])) for axis in ('x', 'y'))
        at = masks.drawn_samples(x, y)
        return binary({}, {'x': x[at], 'y': y[at]})

    def robot(self, query: Any) -> Response:
        """Answer the robot's joints along the recordings, and the errors there."""
        drawn, arrays = masks.robot_motion(self.hub.the_session.ticks)
        return binary({'lines': [asdict(line) for line in drawn.lines], 'face': drawn.face,
                       'joints': list(drawn.joints.values()), 'labels': drawn.labels}, arrays)

    def files(self, query: Any) -> Response:
        """Answer the names of the files that can be opened."""
        return JSONResponse({'files': [*self.hub.offered.files()]})

    def open(self, body: Fields) -> Response:
        """Open a recording of the folders that were given."""
        self.hub.open(self.hub.offered.path(body.text('name')), body.get('is_held_out') is True)
        return self.screen(body)

    async def upload(self, request: Request) -> Response:
        """Take a recording from the browser."""
        with self.hub.upload(request.query_params.get('name', '')) as path:
            with path.open('xb') as file:
                async for part in request.stream():
                    await run_in_threadpool(file.write, part)
            held_out = request.query_params.get('held_out') == '1'
            await run_in_threadpool(self.hub.open, path, held_out)
        return await run_in_threadpool(self.screen, request.query_params)

    def invite(self, body: Fields) -> Response:
        """Answer an address for one more browser."""
        return JSONResponse({'address': self.keys.address})

    def live(self, query: Any) -> Response:
        """Answer how live data stand."""
        return JSONResponse(for_json(self._live.to_dict()))

    def live_set(self, body: Fields) -> Response:
        """Set the model with the ticked effects on the running nodes, all or none."""
        return JSONResponse(self._live.set_model(
            self.hub.the_session.ticks.ticked_model(), body.text('confirmed')))

    def live_restore(self, body: Fields) -> Response:
        """Set the running nodes back to what they had before."""
        return JSONResponse(self._live.restore(body.text('confirmed')))

    def live_machine(self, query: Any) -> Response:
        """Answer the changes that need confirmation."""
        return JSONResponse({'machine': self._live.machine()})

    def live_take(self, body: Fields) -> Response:
        """Make what came in last a recording of the session."""
        with self.hub.upload('live.csv') as path:
            self._live.take(path)
            self.hub.open(path)
        return self.screen(body)

    @property
    def _live(self) -> Any:
        if self.hub.live is None:
            raise SessionError('no live data: pprs workbench was started without --live')
        return self.hub.live

    async def events(self, request: Request) -> Response:
        """Stream the version of the state after each change."""
        async def lines() -> AsyncIterator[bytes]:
            yield b'data: 0\n\n'
            version_sent, due = 0, 0.0
            while not self.hub.is_over:
                if self.hub.version != version_sent or time.monotonic() > due:
                    version_sent, due = self.hub.version, time.monotonic() + HEARTBEAT
                    yield b'data: %d\n\n' % version_sent
                await asyncio.sleep(LOOK)
        return StreamingResponse(lines(), media_type='text/event-stream')
