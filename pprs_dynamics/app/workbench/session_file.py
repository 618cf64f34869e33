# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""A session in a file: its recordings, its model with what was adopted, and what is ticked.

Recordings stay where they are: the file names them, with hashes. What was done before and could be
taken back is not kept, nor is a diagnosis, which is made again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.workbench.errors import SessionError
from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.measurement.files.fingerprint import fingerprint
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.system.bounded_yaml import read_text
from pprs_dynamics.system.files import write_text
from pprs_dynamics.system.plain_text import displayed

ENDING = '.json'
FORMAT = 'pprs workbench session 1'  # another number where older versions could not read it


@dataclass(frozen=True)
class SavedTick:
    """An effect that takes part.

    Parameters
    ----------
    effect : str
    drives : tuple of str or None
        That it sits on; None in the structure.
    values : mapping of str to float
        That somebody chose, by key as in the effect's estimates.
    """

    effect: str
    drives: tuple[str, ...] | None
    values: Mapping[str, float]


@dataclass(frozen=True)
class SavedSession:
    """What a session goes on from.

    Parameters
    ----------
    inputs : Inputs
        Recordings, and the model as it was given.
    model : DriveModel
        With what was adopted.
    ticks : tuple of SavedTick
    """

    inputs: Inputs
    model: DriveModel
    ticks: tuple[SavedTick, ...]

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file.

        Raises
        ------
        SessionError
            For a recording that is in no file.
        UnreadableFileError
            Where a recording is gone, or the file cannot be written.
        """
        given = self.inputs
        if missing := [name for name in (*given.recordings, *given.validation)
                       if name not in given.paths]:
            raise SessionError(f'recording {displayed(missing[0])} is in no file, must be in one '
                               'for the session to be saved')
        references = given.reference_paths
        write_text(path, json.dumps({
            'format': FORMAT,
            'model': {'source': given.model.source, 'given': given.model.values,
                      'now': self.model.values},
            'recordings': _named(given.recordings), 'held_out': _named(given.validation),
            'topic': given.topic, 'as_it_is': given.as_it_is,
            'has_reference': given.reference is not None,
            'reference': None if references is None else [str(Path(path).absolute())
                                                          for path in references],
            'ticks': [{'effect': tick.effect, 'drives': tick.drives, 'values': dict(tick.values)}
                      for tick in self.ticks]}, indent=1))

    @classmethod
    def read(cls, path: str | PathLike[str]) -> SavedSession:
        """Read a file, and the recordings that it names.

        Raises
        ------
        UnreadableFileError
            Where it is no session, larger or deeper than one, or where a recording is gone.
        SessionError
            Where a recording is not the one that it was.
        PprsError
            As `Inputs.read`; where the model is none by now.
        """
        text = read_text(path)
        try:
            found = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UnreadableFileError(path, f'cannot be read as a session: {error}') from None
        if not isinstance(found, dict) or found.get('format') != FORMAT:
            raise UnreadableFileError(path, f'is no session, must have the format {FORMAT!r}, as '
                                      'the workbench saves it')
        try:
            given, now = (replace(DriveModel.from_parameters(found['model'][which]),
                                  source=str(found['model']['source']))
                          for which in ('given', 'now'))
            recordings, held_out = (dict(found[which]) for which in ('recordings', 'held_out'))
            reference = tuple(found['reference'] or ()) if found['has_reference'] else None
            ticks = tuple(SavedTick(entry['effect'], None if entry['drives'] is None
                                    else tuple(entry['drives']), dict(entry['values']))
                          for entry in found['ticks'])
            topic, as_it_is = found['topic'] or None, bool(found['as_it_is'])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise UnreadableFileError(
                path, f'is no session as the workbench saves it: {error}') from None
        for name, sha256 in {**recordings, **held_out}.items():
            if fingerprint(name) != sha256:
                raise SessionError(f'recording {displayed(name)} has changed since the session '
                                   f'{displayed(path)} was saved, must be the same')
        inputs = replace(Inputs.read(given, [*recordings], [*held_out], topic), as_it_is=as_it_is)
        return cls(inputs.since(reference), now, ticks)


def _named(recordings: Mapping[str, Any]) -> dict[str, str]:
    """Return absolute paths of recordings and the hashes of what they hold."""
    return {str(Path(name).absolute()): fingerprint(name) for name in recordings}
