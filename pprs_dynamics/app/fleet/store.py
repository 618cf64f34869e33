# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The store of a survey: Parquet files, one per recording, in a folder per robot.

A file is called after the recording's content, the model, the options and the package's version,
and is written whole or not at all. So a survey that is run again knows what is missing, and a
recording is never in it twice.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from urllib.parse import quote

from pprs_dynamics.app.fleet.manifest import filesystem, is_remote, reached
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.system.output_files import new_file

DONE, FAILED = '.parquet', '.failed.parquet'
AUTO = 'auto'  # options of a survey that diagnosed
OWN = 'model'  # stands for an effect's name in rows of the model's own numbers
KEY_LENGTH = 40  # hexadecimal digits of the key: 160 bits, as of a git object

# Name, Arrow type, unit, meaning; docs/fleets.md prints this table. `robot` is the folder.
COLUMNS: tuple[tuple[str, str, str, str], ...] = (
    ('recording', 'string', '', 'name of the file or bag'),
    ('path', 'string', '', 'where it was read from'),
    ('sha256', 'string', '', 'of its content; null where it could not be read'),
    ('time', 'timestamp', 'UTC', "of the manifest, else of the recording's first stamp"),
    ('duration', 'float64', 's', 'of its segments together'),
    ('model', 'string', '', "SHA-256 of the model's values"),
    ('options', 'string', '', 'auto, or the effects that were fitted'),
    ('version', 'string', '', 'of this package'),
    ('drive', 'string', '', "null for the structure and the model's own numbers"),
    ('effect', 'string', '', "name in the catalogue; model for the model's own numbers; null in "
     "a drive's first row"),
    ('parameter', 'string', '', 'coefficient of the effect, or key of the model file'),
    ('value', 'float64', 'unit', 'as fitted'),
    ('std', 'float64', 'unit', 'its standard deviation; null where it is not known'),
    ('unit', 'string', '', 'of value and std'),
    ('evidence', 'float64', '1', 'by which the cost rises without the effect'),
    ('rms', 'float64', 'N', 'of measured minus model, of the drive'),
    ('relative', 'float64', '1', 'rms over the rms of the changing part of the effort'),
    ('noise', 'float64', 'N', "rms of the drive's noise"),
    ('verdict', 'string', '', 'of diagnose; fitted where only named effects were'),
    ('seconds', 'float64', 's', 'of work on the recording'),
    ('conditions', 'map', '', 'further columns of the manifest'),
    ('error', 'string', '', 'why there is no result; null where there is one'),
)


def arrow() -> Any:
    """Return pyarrow with its parquet and dataset modules, or raise MissingLibraryError."""
    try:
        import pyarrow
        import pyarrow.dataset
        import pyarrow.parquet
    except ImportError:
        raise MissingLibraryError('pyarrow', 'a survey', 'fleet') from None
    return pyarrow


def schema() -> Any:
    """Return the Arrow schema of every file of a store."""
    pa = arrow()
    types = {'string': pa.string(), 'float64': pa.float64(),
             'timestamp': pa.timestamp('us', tz='UTC'), 'map': pa.map_(pa.string(), pa.float64())}
    return pa.schema([(name, types[kind]) for name, kind, _, _ in COLUMNS])


def key_of(content: str, model: str, options: str, version: str) -> str:
    """Return what names a recording's rows.

    Parameters
    ----------
    content : str
        SHA-256 of the recording, or its path where that could not be read.
    model, options, version : str
    """
    text = json.dumps([content, model, options, version])
    return hashlib.sha256(text.encode(errors='surrogateescape')).hexdigest()[:KEY_LENGTH]


@dataclass(frozen=True)
class Store:
    """A folder of rows, on a disk or wherever fsspec writes.

    Parameters
    ----------
    path : str
    """

    path: str

    def place(self, robot: str, key: str, ending: str = DONE) -> str:
        """Return where the rows of a recording are."""
        return f'{self.path.rstrip("/")}/robot={quote(robot, safe="")}/{key}{ending}'

    def begin(self) -> None:
        """Make the folder; errors as `write`, before work is done in vain."""
        system, path = filesystem(self.path)
        with reached(self.path):
            system.makedirs(path, exist_ok=True)

    def has(self, robot: str, key: str) -> bool:
        """Return whether a recording is done: its part is there, and whole."""
        pa, (system, path) = arrow(), filesystem(self.place(robot, key))
        with reached(self.path):
            if not system.exists(path):
                return False
            content = system.cat_file(path)
        try:
            pa.parquet.read_table(BytesIO(content), schema=schema())
        except (pa.ArrowException, OSError):  # torn, or bytes flipped: done again
            return False
        return True

    def write(self, robot: str, key: str, rows: Sequence[Mapping[str, Any]],
              failed: bool = False) -> None:
        """Write the rows of a recording.

        Parameters
        ----------
        robot, key : str
        rows : sequence of mapping
            Of `COLUMNS`; what one does not name is null.
        failed : bool
            True where another attempt may succeed: the recording is not done.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        pa = arrow()
        # A value that could not be computed is null, as one that is not known.
        table = pa.Table.from_pylist(
            [{name: None if isinstance(value, float) and not math.isfinite(value) else value
              for name, value in row.items()} for row in rows], schema=schema())
        buffer = BytesIO()
        pa.parquet.write_table(table, buffer, compression='zstd')
        place = self.place(robot, key, FAILED if failed else DONE)
        with reached(place):
            self._put(place, buffer.getvalue())
            if not failed:
                system, path = filesystem(self.place(robot, key, FAILED))
                if system.exists(path):
                    system.rm_file(path)

    @staticmethod
    def _put(place: str, content: bytes) -> None:
        if is_remote(place):
            # Object stores show a new object whole or not at all.
            system, path = filesystem(place)
            system.makedirs(path.rpartition('/')[0], exist_ok=True)
            system.pipe_file(path, content)
            return
        # Readers of Parquet folders pass over names that begin with a dot, as unfinished ones do.
        os.makedirs(place.rpartition('/')[0], exist_ok=True)
        with new_file(place) as file:
            file.write(content)

    def read(self, columns: Sequence[str] | None = None, filters: Any = None) -> Any:
        """Return the rows as an Arrow table, with the column robot.

        Raises
        ------
        UnreadableFileError
            Where there is no store.
        """
        pa = arrow()
        system, path = filesystem(self.path)
        with reached(self.path):
            if not system.isdir(path):
                raise UnreadableFileError(self.path, 'there is no store of pprs survey')
        every = schema().append(pa.field('robot', pa.string()))
        partitioning = pa.dataset.partitioning(pa.schema([('robot', pa.string())]), flavor='hive')
        try:
            data = pa.dataset.dataset(path, schema=every, filesystem=system, format='parquet',
                                      partitioning=partitioning)
            # Parquet files may be somebody else's.
            first = next(data.get_fragments(), None)
            if first is None or 'sha256' not in first.physical_schema.names:
                raise UnreadableFileError(self.path, 'there is no store of pprs survey')
            return data.to_table(columns=list(columns) if columns else None, filter=filters)
        except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
            raise UnreadableFileError(
                self.path, 'a part of the store is damaged; pprs survey on the same recordings '
                f'makes it anew: {str(error).splitlines()[0]}') from None
