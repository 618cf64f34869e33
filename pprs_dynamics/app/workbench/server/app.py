# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Routes of the workbench (HTTP and WebSocket): each one call of the session, and its result."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, nullcontext, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
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
from pprs_dynamics.app.workbench.errors import SessionError, StaleError
from pprs_dynamics.app.workbench.masks import (
    drawn_samples,
    quantities,
    quantity,
    region_mask,
    shares_in,
    span_mask,
    spans_of,
)
from pprs_dynamics.app.workbench.robot_motion import robot_motion
from pprs_dynamics.app.workbench.server.access import AccessControl, Keys, TooLongError
from pprs_dynamics.app.workbench.server.hub import Hub
from pprs_dynamics.app.workbench.server.wire import BadRequestError, Fields, attached, binary
from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.app.workbench.view_state import units_to_dict
from pprs_dynamics.arrays import root_mean_square
from pprs_dynamics.errors import PprsError
from pprs_dynamics.simulation.motion_files import write_motion
from pprs_dynamics.system.numbers import finite

UPLOAD = '/api/upload'
MOST_UPLOADED = 256_000_000  # bytes: an hour of six drives at 500 Hz as CSV
HEARTBEAT = 15.0  # [s] between signs of life
VENDORED = {'uplot.js': CURVES, 'uplot.css': CURVES_STYLE}
TYPES = {'.mjs': 'text/javascript', '.js': 'text/javascript', '.css': 'text/css'}

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
        hub.start(asyncio.get_running_loop())
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
    kind = TYPES.get(Path(name).suffix)
    if kind is None or name not in {*assets(), *VENDORED}:
        raise HTTPException(404)
    content = vendored(VENDORED[name]) if name in VENDORED else packaged(name)
    return Response(content, media_type=kind)


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
        """Return what is asked for by GET, with a query."""
        return {'model.yaml': self.model, 'session.json': self.session,
                'experiment.csv': self.experiment_file, 'live/machine': self.live_machine,
                **{work.__name__: work for work in (
                    self.screen, self.curves, self.scatter, self.robot, self.files, self.live)}}

    def changes(self) -> dict[str, Callable[[Fields], Response]]:
        """Return what is asked for by POST, with a JSON object."""
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
                 'quantities': quantities(data)},
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
        """Say what unticked effects explain in a brush, and when that was."""
        ticks = self.hub.the_session.ticks
        if 'x' in body:
            mask = region_mask(ticks, body.text('x'), body.text('y'), body.range('x_range'),
                               body.range('y_range'), body.text('drive'))
        else:
            drive = body.get('drive')
            mask = span_mask(ticks, *body.range('time'), None if drive is None else [str(drive)])
        fits, view = ticks.fits, ticks.view
        return JSONResponse({'shares': [asdict(share) for share in shares_in(mask, fits, view)],
                             'before': finite(root_mean_square(fits.before[mask])),
                             'now': finite(root_mean_square(view.residual[mask])),
                             'spans': spans_of(fits.design.residuals, mask),
                             'samples': int(mask.sum()), 'revision': ticks.revision})

    def experiment_file(self, query: Any) -> Response:
        """Answer the poses, or the joints' positions, of the designed motion."""
        session = self.hub.the_session
        found = session.jobs.experiment
        if found is None:
            raise SessionError('no experiment is designed yet')
        return self._download('next.csv', 'text/csv', lambda path: write_motion(
            path, session.ticks.fits.drives, found.motion))

    def model(self, query: Any) -> Response:
        """Answer the model file, with what is ticked where that is asked for."""
        session, with_ticked = self.hub.the_session, query.get('ticked') == '1'
        return self._download('ticked.yaml' if with_ticked else 'model.yaml', 'application/yaml',
                              lambda path: session.export(path, with_ticked))

    def session(self, query: Any) -> Response:
        """Answer what `pprs workbench` goes on with."""
        return self._download('session.json', 'application/json', self.hub.save)

    @staticmethod
    def _download(name: str, kind: str, write: Callable[[Path], None]) -> Response:
        with TemporaryDirectory(prefix='pprs_workbench_') as folder:
            write(Path(folder) / name)
            return attached(name, kind, (Path(folder) / name).read_bytes())

    def scatter(self, query: Any) -> Response:
        """Answer two quantities of a drive."""
        ticks = self.hub.the_session.ticks
        drives = ticks.fits.drives
        if query.get('drive') not in drives:
            raise BadRequestError(f'drive must be one of {", ".join(drives)}')
        with ticks.steady():
            x, y = (quantity(ticks.fits, ticks.view, query.get(axis, ''),
                             drives.index(query['drive'])) for axis in ('x', 'y'))
        at = drawn_samples(x, y)
        return binary({}, {'x': x[at], 'y': y[at]})

    def robot(self, query: Any) -> Response:
        """Answer the robot's joints along the recordings, and the errors there."""
        drawn, arrays = robot_motion(self.hub.the_session)
        return binary({'lines': [asdict(line) for line in drawn.lines], 'face': drawn.face,
                       'joints': list(drawn.joints.values()), 'labels': drawn.labels}, arrays)

    def files(self, query: Any) -> Response:
        """Answer what may be opened."""
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
        return JSONResponse(self._live.to_dict())

    def live_set(self, body: Fields) -> Response:
        """Set the model with the ticked effects on the running nodes, all or none."""
        return JSONResponse(self._live.set_model(
            self.hub.the_session.ticks.ticked_model(), body.text('confirmed')))

    def live_restore(self, body: Fields) -> Response:
        """Set the running nodes back to what they had before."""
        return JSONResponse(self._live.restore(body.text('confirmed')))

    def live_machine(self, query: Any) -> Response:
        """Answer what would be set, for a person to confirm."""
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
            queue = self.hub.subscribe()
            try:
                yield b'data: 0\n\n'
                while not self.hub.is_over:
                    with suppress(TimeoutError):
                        await asyncio.wait_for(queue.get(), HEARTBEAT)
                    yield b'data: %d\n\n' % self.hub.version
            finally:
                self.hub.unsubscribe(queue)
        return StreamingResponse(lines(), media_type='text/event-stream')
