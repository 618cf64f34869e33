# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Bags as files: rosbag2 and ROS 1, whole, split or packed, opened with rosbags.

Messages are CDR whatever the bag, so that what reads them need not know of it.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from heapq import merge
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pprs_dynamics.errors import UnreadableFileError, optional_library
from pprs_dynamics.measurement.files.array_files import is_lerobot
from pprs_dynamics.measurement.files.csv_files import ZSTANDARD, zstd
from pprs_dynamics.measurement.files.joint_states import deserialized, message_types
from pprs_dynamics.measurement.files.samples import Defect
from pprs_dynamics.system.files import readable, require_file

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

# First bytes of a bare storage file, and the suffix by which rosbags knows it.
MAGIC = {b'\x89MCAP': '.mcap', b'SQLite format 3\x00': '.db3', b'#ROSBAG V': '.bag'}
ZSTANDARD_MAGIC = b'\x28\xb5\x2f\xfd'  # no message begins so
SUFFIXES = ('.mcap', '.db3', '.bag')
METADATA = 'metadata.yaml'  # in the folder of a rosbag2 recording


def storage_suffix(path: Path) -> str | None:
    """Return '.mcap', '.db3' or '.bag' by a file's first bytes, None for anything else."""
    require_file(path)
    with path.open('rb') as file:
        start = file.read(16)
    return next((suffix for magic, suffix in MAGIC.items() if start.startswith(magic)), None)


def is_storage(path: Path) -> bool:
    """Return whether a file is a bag, or promises to be one; a folder does, unless of LeRobot."""
    if path.is_dir():
        return not is_lerobot(path)
    return _promises(path) or storage_suffix(path) is not None


def is_bag(path: Path) -> bool:
    """Return whether a recording is a bag, or else a table.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, or is empty.
    """
    with readable(path):
        # A name that promises a bag is read as one, for the reason why it is none.
        found = is_storage(path)
        if not path.is_dir() and not path.stat().st_size:
            raise UnreadableFileError(path, 'the file is empty')
    return found


def is_bag_folder(path: Path) -> bool:
    """Return whether a folder is one recording of rosbag2, and not a folder of recordings."""
    return (path / METADATA).is_file()


def _promises(path: Path) -> bool:
    return path.suffix in SUFFIXES or (
        path.suffix in ZSTANDARD and Path(path.stem).suffix in SUFFIXES)


@dataclass(frozen=True)
class Bag:
    """An open bag.

    Parameters
    ----------
    path : Path
    readers : sequence of rosbags' readers
        Of the files that it is split into.
    is_ros1 : bool
    """

    path: Path
    readers: Sequence[Any]
    is_ros1: bool

    @property
    def connections(self) -> list[Connection]:
        """Topics with their types, of every file."""
        return [c for reader in self.readers for c in reader.connections]

    def messages(self, connections: Collection[Connection],
                 ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield messages as CDR, and when they were received [ns], in that order.

        Raises
        ------
        UnreadableFileError
            Where the bag is damaged.
        """
        types = self.types(connections) if self.is_ros1 else None
        try:
            chosen = [(reader, [c for c in connections if c in reader.connections])
                      for reader in self.readers]
            # All connections is what a reader makes of none.
            streams = [reader.messages(own) for reader, own in chosen if own]
            for connection, stamp, data in merge(*streams, key=lambda message: message[1]):
                if not (isinstance(stamp, int) and isinstance(data, (bytes, memoryview))):
                    # A cell of sqlite is of any type, and a flipped bit makes it another one.
                    raise TypeError('a message is no bytes')
                if data[:4] == ZSTANDARD_MAGIC:  # packed, which only lost metadata say
                    data = zstd().decompress(data)
                yield connection, stamp, bytes(data) if types is None else bytes(
                    types.ros1_to_cdr(data, connection.msgtype))
        except Exception as error:
            raise UnreadableFileError(self.path, damaged(error)) from None

    def decoded(self, connections: Collection[Connection], most: int | None = None,
                ) -> Iterator[tuple[Connection, int, Any]]:
        """Yield as `messages`, of the first ones or all, messages themselves.

        Bytes that are no message of their type are left out.
        """
        types = self.types(connections)
        for connection, received, data in islice(self.messages(connections), most):
            message = deserialized(types, data, connection.msgtype)
            if message is not None:
                yield connection, received, message

    def types(self, connections: Collection[Connection]) -> Any:
        """Return the message types of ROS 2 and those that the bag defines."""
        from rosbags.typesys import get_types_from_msg

        store = message_types()
        for connection in connections:
            if connection.msgtype not in store.types and connection.msgdef.data:
                found = get_types_from_msg(connection.msgdef.data, connection.msgtype)
                store.register({name: fields for name, fields in found.items()
                                if name not in store.types})
        return store


@contextmanager
def opened_bag(path: Path) -> Iterator[tuple[Bag, list[Defect]]]:
    """Open a bag directory, a folder of storage files, or one of these.

    Raises
    ------
    UnreadableFileError
        Where it is none, or damaged.
    MissingLibraryError
        Where rosbags is not installed.
    """
    with ExitStack() as stack:
        storages, findings = _storages_of(path)
        for storage in storages:
            _check_lengths(path, storage)
        optional_library('rosbags', 'rosbags', 'reading bags', 'bags')
        if any(storage.suffix in ZSTANDARD for storage in storages):
            folder = Path(stack.enter_context(TemporaryDirectory()))
            storages = [_unpacked(storage, folder) if storage.suffix in ZSTANDARD else storage
                        for storage in storages]
        from rosbags import rosbag1, rosbag2

        is_ros1 = storages[0].suffix == '.bag'
        readers = []
        for storage in storages:
            # Damaged bytes surface in rosbags as errors of any kind, from struct's to sqlite's.
            try:
                reader = (rosbag1 if is_ros1 else rosbag2).Reader(storage)
                reader.open()
            except Exception as error:
                raise UnreadableFileError(path, damaged(error)) from None
            stack.callback(reader.close)
            readers.append(reader)
        yield Bag(path, readers, is_ros1), findings


def _storages_of(path: Path) -> tuple[list[Path], list[Defect]]:
    """Return the paths that rosbags can open: a folder with metadata, or files."""
    if not path.is_dir():
        suffix = storage_suffix(path)
        if suffix is not None and path.suffix != suffix:
            raise UnreadableFileError(
                path, f'its content is a {suffix} file of a bag: its name must end so')
        return [path], []
    if is_bag_folder(path):
        return [path], []
    found = sorted(file for file in path.iterdir() if file.is_file() and _promises(file))
    kinds = {'.bag' in file.suffixes for file in found}
    if not found:
        raise UnreadableFileError(path, f'not a rosbag2 directory: there is no {METADATA}')
    if len(kinds) > 1:
        raise UnreadableFileError(path, 'it contains files of ROS 1 and ROS 2: name one of them')
    if kinds == {True}:
        return found, []  # ROS 1 has no metadata
    return found, [Defect('no_metadata', len(found), f'the bag has no {METADATA}')]


def _unpacked(path: Path, folder: Path) -> Path:
    target, library = folder / path.stem, zstd()
    try:
        with library.open(path, 'rb') as packed, target.open('wb') as file:
            shutil.copyfileobj(packed, file)
    except Exception as error:  # the library's own, and the disk's
        raise UnreadableFileError(path, f'it cannot be unpacked ({error})') from None
    return target


def _check_lengths(path: Path, storage: Path) -> None:
    """Refuse databases shorter than they say: SQLite itself reads zeros where they end."""
    for file in [f for f in storage.iterdir() if not f.is_dir()] if storage.is_dir() else [storage]:
        require_file(file)
        with file.open('rb') as data:
            head = data.read(32)
        if head.startswith(b'SQLite format 3') and len(head) == 32:
            # A page size of 1 stands for 65536, which two bytes cannot hold.
            page, pages = int.from_bytes(head[16:18]), int.from_bytes(head[28:32])
            length = pages * (page if page > 1 else 2**16)
            if file.stat().st_size < length:
                raise UnreadableFileError(
                    path, f'it is truncated: {file.stat().st_size} bytes of {length}')


def damaged(error: Exception) -> str:
    """Return the error for a bag that a library cannot read."""
    reason = ' '.join(str(error).split()) or type(error).__name__
    return f'cannot be read as a bag, it is truncated, damaged or something else ({reason[:160]})'
