# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of the surveys that were given on the command line, robot by robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pprs_dynamics.app.fleet.store import Store
from pprs_dynamics.app.workbench.server.folders import NotOfferedError
from pprs_dynamics.app.workbench.server.request_fields import index_of
from pprs_dynamics.system.plain_text import displayed

PREFIX = 'survey'
MOST_LISTED = 2000


@dataclass(frozen=True)
class Surveyed:
    """One recording of a survey.

    Parameters
    ----------
    path : Path
    robot, recording, time, verdict : str
        As the store has them.
    """

    path: Path
    robot: str
    recording: str
    time: str
    verdict: str


@dataclass(frozen=True)
class Surveys:
    """Recordings that surveys name, as far as they are there.

    Parameters
    ----------
    recordings : tuple of Surveyed
        By robot, the latest first.
    """

    recordings: tuple[Surveyed, ...] = ()

    @classmethod
    def of(cls, paths: Sequence[str]) -> Surveys:
        """Return those of the paths that are stores of `pprs survey`.

        Raises
        ------
        PprsError
            Where a store cannot be read.
        """
        found: dict[Path, Surveyed] = {}
        for path in paths:
            if not is_store(path):
                continue
            rows = Store(path).read(['robot', 'recording', 'path', 'time', 'verdict']).to_pylist()
            for row in sorted(rows, key=lambda row: str(row['time']), reverse=True):
                there = Path(row['path'] or '')
                if row['path'] and there.exists() and there not in found:
                    found[there] = Surveyed(there, row['robot'] or '', row['recording'] or '',
                                            str(row['time'] or '')[:19], row['verdict'] or '')
        return cls(tuple(sorted(found.values(), key=lambda one: one.robot))[:MOST_LISTED])

    def listed(self) -> list[dict[str, Any]]:
        """Return what may be opened."""
        return [{'name': f'{PREFIX}/{number}', 'robot': displayed(one.robot),
                 'recording': displayed(one.recording), 'time': one.time, 'verdict': one.verdict}
                for number, one in enumerate(self.recordings)]

    def path(self, name: str) -> Path:
        """Return the path of a name from `listed`.

        Raises
        ------
        NotOfferedError
            For any other.
        """
        at = index_of(name.partition('/')[2], len(self.recordings))
        if at is not None:
            return self.recordings[at].path
        raise NotOfferedError(f'{displayed(name)!r} is not among the recordings of the surveys')


def is_store(path: str) -> bool:
    """Return whether a path is a store of `pprs survey`."""
    return Path(path).is_dir() and any(Path(path).glob('robot=*'))
