# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The one writer: complete or not there, nothing but files, behind links."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from pprs_dynamics.errors import UnreadableFileError
from pprs_dynamics.system.files import new_file, new_folder, require_file, write_text


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


def a_device(path: Path) -> None:
    os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3))


NO_FILES: dict[str, Callable[[Path], None]] = {
    'a pipe': lambda path: os.mkfifo(path), 'a socket': a_socket, 'a folder': Path.mkdir,
    'a device': a_device}


@pytest.mark.parametrize('linked', [False, True])
@pytest.mark.parametrize('kind', NO_FILES)
def test_what_is_no_file_is_neither_written_nor_read(
    kind: str, linked: bool, tmp_path: Path,
) -> None:
    place = tmp_path / 'place.csv'
    try:
        NO_FILES[kind](place)
    except PermissionError:
        pytest.skip('only root makes devices')
    before = place.lstat()
    path = place
    if linked:
        path = tmp_path / 'link.csv'
        path.symlink_to(place)
    with pytest.raises(UnreadableFileError, match=f'cannot be written: it is {kind}'):
        write_text(path, 'new')
    with pytest.raises(UnreadableFileError, match=f'it is {kind}, must be a file'):
        require_file(path)
    assert (place.lstat().st_ino, place.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert sorted(tmp_path.iterdir()) == sorted({place, path})


def test_of_a_link_the_target_is_written(tmp_path: Path) -> None:
    (tmp_path / 'below').mkdir()
    target, link, loose = (tmp_path / name for name in ('below/a.csv', 'link.csv', 'loose.csv'))
    target.write_text('old')
    link.symlink_to(target)
    loose.symlink_to(tmp_path / 'below' / 'new.csv')
    write_text(link, 'new')
    write_text(loose, 'made')
    assert target.read_text() == 'new'
    assert (tmp_path / 'below' / 'new.csv').read_text() == 'made'
    assert link.is_symlink()
    assert loose.is_symlink()


@pytest.mark.parametrize('error', [KeyboardInterrupt, OSError(28, 'No space left on device')])
def test_what_ends_early_leaves_nothing(error: BaseException, tmp_path: Path) -> None:
    def write_half_a_file() -> None:
        with new_file(tmp_path / 'old.csv') as file:
            file.write(b'half')
            raise error

    def write_half_a_folder() -> None:
        with new_folder(tmp_path / 'bag') as folder:
            folder.mkdir()
            (folder / 'half').write_text('half')
            raise error

    (tmp_path / 'old.csv').write_text('old')
    for write in (write_half_a_file, write_half_a_folder):
        with pytest.raises((KeyboardInterrupt, UnreadableFileError)):
            write()
    assert list(tmp_path.iterdir()) == [tmp_path / 'old.csv']
    assert (tmp_path / 'old.csv').read_text() == 'old'


def test_a_folder_that_is_there_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / 'loose').symlink_to(tmp_path / 'nowhere')
    for name in ('', 'loose'):
        with (pytest.raises(UnreadableFileError, match='never overwritten'),
              new_folder(tmp_path / name)):
            pass
    with new_folder(tmp_path / 'new') as folder:
        folder.mkdir()
    assert (tmp_path / 'new').is_dir()


@pytest.mark.parametrize(('length', 'fits'), [(250, True), (300, False)])
def test_names_are_as_long_as_the_file_system_takes(
    length: int, fits: bool, tmp_path: Path,
) -> None:
    path = tmp_path / f'{"a" * (length - 5)}.json'
    if fits:
        write_text(path, 'text')
        assert path.read_text() == 'text'
    else:
        with pytest.raises(UnreadableFileError, match='File name too long'):
            write_text(path, 'text')
