# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""State that all browsers share: the session and its worker, files on offer, and uploads."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, mkdtemp
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.fleet.recordings import recordings_in
from pprs_dynamics.app.workbench.session import Session
from pprs_dynamics.app.workbench.ticks import SessionError
from pprs_dynamics.errors import PprsError
from pprs_dynamics.measurement.files.bag_storage import is_bag_folder
from pprs_dynamics.measurement.files.recording import ENDINGS
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from pprs_dynamics.ros.live_joint_states import LiveNodes

MOST_LISTED = 2000
MOST_UPLOADS, LONGEST_NAME = 20, 80
BREATH = 0.02  # [s] that the answer to a tick has to go out, before more is computed
LAST_WORDS = 2.0  # [s] that work in the background gets to end
IDLE = 0.5  # [s] without a tick, after which the diagnosis begins


@dataclass(frozen=True)
class Offered:
    """Recordings to choose from.

    Parameters
    ----------
    folders : tuple of Path
        With all recordings in them.
    """

    folders: tuple[Path, ...] = ()

    @classmethod
    def of(cls, paths: Sequence[str]) -> Offered:
        """Return the folders among the paths that are no recordings themselves."""
        return cls(tuple(Path(path) for path in paths if is_folder(path)))

    def files(self) -> dict[str, Path]:
        """Return recordings by `number/path within its folder`, without links to elsewhere."""
        found = ((f'{number}/{path.relative_to(root).as_posix()}', path)
                 for number, root in enumerate(self.folders) for path in recordings_in(root)
                 if path.resolve().is_relative_to(root.resolve()))
        return dict(islice(found, MOST_LISTED))

    def path(self, name: str) -> Path:
        """Return the path of a name of `files`; SessionError for any other."""
        if (path := self.files().get(name)) is None:
            raise SessionError(f'{displayed(name)!r} is not among the recordings of the folders '
                               'that were given')
        return path


def is_folder(path: str) -> bool:
    """Return whether a path is a folder that holds recordings, and none itself."""
    # An empty name would be the present folder, which nobody named.
    return bool(path) and Path(path).is_dir() and not is_bag_folder(Path(path))


NOT_PLAIN = re.compile('[^A-Za-z0-9._-]+')  # in names of files from elsewhere


class Hub:
    """The session, and its worker.

    Parameters
    ----------
    inputs : Inputs
        Of the command line; a session begins with its recordings, or with the first that is opened.
    offered : Offered
        What browsers may choose from.
    live : LiveNodes, optional
    """

    def __init__(self, inputs: Inputs, offered: Offered, live: LiveNodes | None = None) -> None:
        self.inputs, self.offered, self.live = inputs, offered, live
        self.session: Session | None = None
        self.failure = ''
        self.is_beginning = True
        self._uploads = TemporaryDirectory(prefix='pprs_workbench_')
        self.version = 0  # counts changes of the state
        self._uploaded, self._lock, self._opening = 0, Lock(), Lock()
        self._work = Event()
        self.is_over = False
        self._diagnosed: object = None  # once for each model, also where it fails
        self._worker = Thread(target=self._run, name='workbench', daemon=True)

    def start(self) -> None:
        """Start the worker."""
        self._worker.start()

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
        """Yield the path of an upload, in its own folder and with a safe name.

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

    def _use(self, session: Session) -> None:
        self.session, self.failure = session, ''
        session.ticks.subscribe(self._changed)

    def _notify(self) -> None:
        """Let all browsers know of a change."""
        with self._lock:
            self.version += 1

    def _changed(self) -> None:
        self._work.set()
        self._notify()

    def _run(self) -> None:
        """Refine the fits after every change, and diagnose when the user is idle."""
        with self._opening:  # what a browser opens meanwhile comes on top
            is_unjudged = bool(self.inputs.recordings) and self._done(
                lambda: self._use(Session.of(self.inputs)))
        self.is_beginning = False
        self._changed()
        while not self.is_over:
            if not self._work.wait(IDLE):
                if is_unjudged and self.session is not None:
                    # Check units and signs of the given recordings after the page is shown.
                    is_unjudged, change = False, self.session.ticks.change_recordings
                    self._done(partial(change, Inputs.checked))
                self._diagnose()
                self._work.wait()
            self._work.clear()
            time.sleep(BREATH)
            session = self.session
            if session is not None and not self.is_over and not session.ticks.view.is_settled and (
                    self._done(session.ticks.settle)):
                self.failure = ''

    def _done(self, work: Callable[[], object]) -> bool:
        """Return whether work succeeds; say on the page what went wrong.

        A defect of ours is logged in the terminal as well.
        """
        try:
            work()
        except Exception as error:
            self.failure = str(error)
            if not isinstance(error, PprsError):
                self.failure = f'{type(error).__name__}: {error}'
                logging.getLogger(__name__).exception('the workbench goes on')
            self._notify()
            return False
        return True

    def _diagnose(self) -> None:
        session = self.session
        if session is not None and session.ticks.fits is not self._diagnosed and not any(
                job.is_running for job in session.jobs.of_kind.values()):
            self._diagnosed = session.ticks.fits
            session.jobs.diagnose()
