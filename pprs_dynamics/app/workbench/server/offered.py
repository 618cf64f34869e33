# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings that browsers may open: in folders of the command line, and no others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from pprs_dynamics.app.fleet.recordings import BAG, recordings_in
from pprs_dynamics.errors import PprsError
from pprs_dynamics.system.plain_text import displayed

MOST_LISTED = 2000


class NotOfferedError(PprsError, ValueError):
    """A recording that is in no folder of the command line."""


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
        """Return the path of a name of `files`; NotOfferedError for any other."""
        if (path := self.files().get(name)) is None:
            raise NotOfferedError(f'{displayed(name)!r} is not among the recordings of the folders '
                                  'that were given')
        return path


def is_folder(path: str) -> bool:
    """Return whether a path is a folder that holds recordings, and none itself."""
    # An empty name would be the present folder, which nobody named.
    return bool(path) and Path(path).is_dir() and not (
        (Path(path) / BAG).exists() or any(Path(path).glob('*.db3')))
