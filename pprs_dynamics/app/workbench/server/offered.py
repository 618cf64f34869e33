# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings that browsers may open: in folders of the command line, and no others."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from pprs_dynamics.errors import PprsError
from pprs_dynamics.system.numbers import parse_whole
from pprs_dynamics.system.plain_text import displayed

ENDINGS = ('.csv', '.mcap', '.db3')
METADATA = 'metadata.yaml'  # makes a folder a rosbag2 recording
MOST_LISTED, DEEPEST = 2000, 6


class NotOfferedError(PprsError, ValueError):
    """A recording that is in no folder of the command line."""


@dataclass(frozen=True)
class Offered:
    """What browsers may choose from.

    Parameters
    ----------
    folders : tuple of Path
        With all recordings in them.
    """

    folders: tuple[Path, ...] = ()

    @classmethod
    def of(cls, paths: Sequence[str]) -> Offered:
        """Return what is in the folders among the paths that are no recordings themselves."""
        return cls(tuple(Path(path) for path in paths if is_folder(path)))

    def in_folders(self) -> list[str]:
        """Return what may be opened, each as `number/path within its folder`."""
        found: list[str] = []
        for number, root in enumerate(self.folders):
            for place, folders, files in os.walk(root):
                inside = Path(place).relative_to(root)
                if METADATA in files:
                    found.append(f'{number}/{inside.as_posix()}')
                    folders.clear()
                    continue
                found += [f'{number}/{(inside / name).as_posix()}' for name in sorted(files)
                          if name.lower().endswith(ENDINGS)]
                folders[:] = sorted(name for name in folders if not name.startswith('.'))
                if len(inside.parts) >= DEEPEST:
                    folders.clear()
                if len(found) >= MOST_LISTED:
                    return found[:MOST_LISTED]
        return found

    def path(self, name: str) -> Path:
        """Return the path of a name of `in_folders`.

        Raises
        ------
        NotOfferedError
            For any other, by whatever way it leads outside: `..`, an absolute path, a link.
        """
        number, _, inside = name.partition('/')
        at = index_of(number, len(self.folders))
        if at is not None and inside:
            root = self.folders[at].resolve()
            # Too long, or with characters that no file system has.
            with suppress(OSError, ValueError):
                path = (root / inside).resolve()
                if path != root and path.is_relative_to(root) and path.exists():
                    return path
        raise NotOfferedError(f'{displayed(name)!r} is not among the recordings of the folders '
                              'that were given')


def index_of(text: str, count: int) -> int | None:
    """Return a place in a list of so many entries, None where the text is none."""
    with suppress(ValueError):
        at = parse_whole(text)
        return at if at < count else None
    return None


def is_folder(path: str) -> bool:
    """Return whether a path is a folder that holds recordings, and none itself."""
    # An empty name would be the present folder, which nobody named.
    return bool(path) and Path(path).is_dir() and not (
        (Path(path) / METADATA).exists() or any(Path(path).glob('*.db3')))
