# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""State that all browsers share: the session, its worker thread, and uploads."""

from __future__ import annotations

import asyncio
import logging
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, mkdtemp
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.fleet.recordings import ENDINGS
from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.app.workbench.server.offered import Offered
from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.app.workbench.session_file import SavedSession
from pprs_dynamics.errors import PprsError

if TYPE_CHECKING:
    from pprs_dynamics.ros.live_joint_states import LiveNodes

MOST_UPLOADS, LONGEST_NAME = 20, 80
NOT_PLAIN = re.compile('[^A-Za-z0-9._-]+')  # in names of files from elsewhere
BREATH = 0.02  # [s] that the answer to a tick has to go out, before more is computed
LAST_WORDS = 2.0  # [s] that work in the background gets to end
IDLE = 0.5  # [s] without a tick, after which the diagnosis begins


class Hub:
    """The session, its worker, and the subscribed browsers.

    Parameters
    ----------
    inputs : Inputs
        Of the command line; a session begins with its recordings, or with the first that is opened.
    offered : Offered
        What browsers may choose from.
    live : LiveNodes, optional
    saved : SavedSession, optional
        What is taken over once the session has begun.
    """

    def __init__(self, inputs: Inputs, offered: Offered, live: LiveNodes | None = None,
                 saved: SavedSession | None = None) -> None:
        self.inputs, self.offered, self.live, self.saved = inputs, offered, live, saved
        self.session: Session | None = None
        self.failure = ''
        self.is_beginning = True
        self._is_unjudged = False
        self._uploads = TemporaryDirectory(prefix='pprs_workbench_')
        self.version = 0  # counts changes of the state
        self._uploaded, self._lock, self._opening = 0, Lock(), Lock()
        self._work = Event()
        self.is_over = False
        self._waiting: set[asyncio.Queue[None]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._diagnosed: object = None  # once for each model, also where it fails
        self._worker = Thread(target=self._run, name='workbench', daemon=True)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start the worker; changes are announced in this loop."""
        self._loop = loop
        self._worker.start()

    def end(self) -> None:
        """End what browsers listen to; to be called in the loop, before connections are closed."""
        self.is_over = True
        self._put()

    def stop(self) -> None:
        """Call all work off."""
        self.is_over = True
        self._work.set()
        if self.session is not None:
            for job in list(self.session.jobs.of_kind.values()):
                job.cancel()
                with suppress(Exception):  # whatever it ended with
                    job.result(LAST_WORDS)
        if self.live is not None:
            self.live.close()
        self._worker.join(10)
        self._uploads.cleanup()

    # Those who listen

    def subscribe(self) -> asyncio.Queue[None]:
        """Return a queue that gets an entry after changes; to be called in the loop."""
        queue: asyncio.Queue[None] = asyncio.Queue(1)
        self._waiting.add(queue)
        return queue

    def unsubscribe(self, queue: asyncio.Queue[None]) -> None:
        """Listen no more."""
        self._waiting.discard(queue)

    def notify(self) -> None:
        """Notify all browsers of a change."""
        with self._lock:
            self.version += 1
        if self._loop is not None and not self._loop.is_closed():
            with suppress(RuntimeError):  # it closes just now
                self._loop.call_soon_threadsafe(self._put)

    def _put(self) -> None:
        for queue in self._waiting:
            if not queue.full():
                queue.put_nowait(None)

    # The session

    @property
    def the_session(self) -> Session:
        """The session, or a SessionError where there is none yet."""
        if self.session is None:
            raise SessionError('no recording is open, must be one')
        return self.session

    def open(self, path: Path, is_held_out: bool = False) -> None:
        """Add a recording to the session, or begin one with it.

        Raises
        ------
        PprsError
            As `Inputs.with_more`; where the model cannot follow the recording.
        """
        with self._opening:
            if self.session is None:
                if is_held_out:
                    raise SessionError('there is nothing to fit yet: the first recording must '
                                       'not be held out')
                self._use(Session.of(self.inputs.with_more(path)))
            else:
                self.session.ticks.change_recordings(
                    lambda inputs: inputs.with_more(path, is_held_out))
        self._changed()

    @contextmanager
    def upload(self, name: str) -> Iterator[Path]:
        """Give the path for an upload, in a folder of its own, with what is plain of its name.

        After an error inside the block nothing remains, and the upload does not count.

        Raises
        ------
        SessionError
            For an ending that no reader has, or after too many uploads.
        """
        ending = next((ending for ending in ENDINGS if name.lower().endswith(ending)), None)
        if ending is None:
            raise SessionError(f'a recording must end in {", ".join(ENDINGS)}')
        with self._lock:
            if self._uploaded >= MOST_UPLOADS:
                raise SessionError(f'{MOST_UPLOADS} recordings were uploaded already, must be no '
                                   'more')
            self._uploaded += 1
        folder = Path(mkdtemp(dir=self._uploads.name))
        stem = NOT_PLAIN.sub('_', name.replace('\\', '/').rpartition('/')[2][:-len(ending)])
        try:
            yield folder / f'{stem.strip(".")[:LONGEST_NAME] or "recording"}{ending}'
        except BaseException:
            rmtree(folder, ignore_errors=True)
            with self._lock:
                self._uploaded -= 1
            raise

    def save(self, path: Path) -> None:
        """Write the session; errors as `Session.save`."""
        session = self.the_session
        inputs = session.ticks.inputs
        for name in (*inputs.recordings, *inputs.validation):
            if Path(name).is_relative_to(self._uploads.name):
                raise SessionError(f'{Path(name).name} came from the browser and is gone with the '
                                   'server, must be opened from a folder for the session to be '
                                   'saved')
        session.save(path)

    def _use(self, session: Session) -> None:
        self.session, self.failure = session, ''
        session.ticks.subscribe(self._changed)

    def _changed(self) -> None:
        self._work.set()
        self.notify()

    def _run(self) -> None:
        """Settle after every change; look for what is missing once nothing happens."""
        try:
            with self._opening:  # what a browser opens meanwhile comes on top
                if self.inputs.recordings:
                    begun = Session.of(self.inputs)
                    if self.saved is not None:
                        begun.resume(self.saved)
                    self._use(begun)
                    self._is_unjudged = True
        except Exception as error:
            self._fail(error)
        self.is_beginning = False
        self._changed()
        while not self.is_over:
            if not self._work.wait(IDLE):
                self._find_mistakes()
                self._diagnose()
                self._work.wait()
            self._work.clear()
            time.sleep(BREATH)
            session = self.session
            if session is None or self.is_over:
                continue
            if not session.ticks.view.is_settled:
                try:
                    session.ticks.settle()
                    self.failure = ''
                except Exception as error:
                    self._fail(error)
                    self.notify()

    def _find_mistakes(self) -> None:
        """Look at units and signs of what the command line gave, once the page stands."""
        if self.session is not None and self._is_unjudged:
            self._is_unjudged = False
            try:
                self.session.ticks.change_recordings(Inputs.checked)
            except PprsError as error:
                self.failure = str(error)
                self.notify()

    def _fail(self, error: Exception) -> None:
        """Say on the page what went wrong; a defect of ours stands in the terminal as well."""
        self.failure = str(error)
        if not isinstance(error, PprsError):
            self.failure = f'{type(error).__name__}: {error}'
            logging.getLogger(__name__).exception('the workbench goes on')

    def _diagnose(self) -> None:
        session = self.session
        if session is not None and session.ticks.fits is not self._diagnosed and not any(
                job.is_running for job in session.jobs.of_kind.values()):
            self._diagnosed = session.ticks.fits
            session.jobs.diagnose()
