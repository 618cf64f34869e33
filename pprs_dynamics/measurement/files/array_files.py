# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Tables of arrays: Parquet files and LeRobot datasets of them, MAT, NumPy and JSON files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from pprs_dynamics.drives import Column
from pprs_dynamics.errors import PprsError, UnreadableFileError, optional_library
from pprs_dynamics.measurement.files.samples import Progress, Series

KINDS = {'.parquet': 'Parquet', '.pq': 'Parquet', '.mat': 'MAT', '.npz': 'NumPy', '.npy': 'NumPy',
         '.json': 'JSON', '.jsonl': 'JSON', '.ndjson': 'JSON'}
BYTES_PER_CHARACTER = 8  # of JSON in memory
INFO = Path('meta') / 'info.json'  # of a LeRobot dataset
DEEPEST = 6  # objects within objects of a JSON file that are searched for a table
LARGEST = 2_000_000_000  # bytes of a file's arrays in memory: 1 000 Hz of 7 joints for three hours
WIDEST = 64  # elements of a list that may be joints
ELEMENT = re.compile(r'(.+)\[(\d+)\]')
MATRIX = 'array'  # what a NumPy file of one array calls it


@dataclass(frozen=True)
class ArrayTable:
    """Arrays by name.

    Parameters
    ----------
    path : Path
    names : list of str
        All that there are; `structure.field` of those that are nested.
    load : callable
        Returns arrays, (N,) or (N, K), by the names that are asked for.
    labels : mapping of str to sequence of K str
        What the elements of lists are, where the file says so.
    decimal : str
        As of `CsvTable`.
    """

    path: Path
    names: list[str]
    load: Callable[[Sequence[str]], Mapping[str, Any]]
    labels: Mapping[str, Sequence[str]]
    decimal: str = '.'

    def place(self, column: Column) -> tuple[str, int | None] | None:
        """Return the name that a column is under, and which element of its lists it is."""
        if column in self.names:
            return str(column), None
        element = ELEMENT.fullmatch(str(column))
        return (element[1], int(element[2])) if element and element[1] in self.names else None

    def read(self, wanted: Sequence[Column], progress: Progress | None = None) -> list[Any]:
        """Return columns, (N,) each.

        Raises
        ------
        UnreadableFileError
            For a column that holds no numbers or has another length than others.
        """
        known = [place for column in wanted if (place := self.place(column)) is not None]
        loaded = self.load(list(dict.fromkeys(name for name, _ in known)))
        arrays = [self._element(name, loaded[name], element) for name, element in known]
        lengths = list(map(len, arrays))
        if len({*lengths}) > 1:
            short = lengths.index(min(lengths))
            raise UnreadableFileError(
                self.path, f'column {wanted[short]!r} has {lengths[short]} rows, must have '
                f'{max(lengths)}, as others')
        return arrays

    def _element(self, name: str, values: Any, element: int | None) -> Any:
        array = self._numbers(name, values)
        if array.ndim == 1 and not element:
            return array
        if array.ndim != 2:
            raise UnreadableFileError(self.path, f'column {name!r} has the shape {array.shape}, '
                                      'must contain numbers, or lists of them')
        count = array.shape[1]
        if element is None or element >= count:
            raise UnreadableFileError(self.path, f'column {name!r} contains lists of {count}, must '
                                      f'be named {name}[0] to {name}[{count - 1}]')
        return array[:, element]

    def _numbers(self, name: str, values: Any) -> Any:
        """Return numbers, (N,) or (N, K), of which there are more than of elements."""
        array = np.asarray(values)
        if np.issubdtype(array.dtype, np.datetime64):
            array = array.astype('datetime64[ns]').astype(np.int64)
        if array.dtype.kind == 'c' and np.any(array.imag):
            raise UnreadableFileError(self.path, f'column {name!r} contains complex numbers, must '
                                      'hold real ones: take its real part')
        try:
            array = array if array.dtype.kind in 'iu' else array.real.astype(float)
        except (TypeError, ValueError):
            raise UnreadableFileError(self.path, f'column {name!r} contains something else than '
                                      'numbers') from None
        array = np.squeeze(array) if array.size > 1 else array.ravel()
        return array.T if array.ndim == 2 and array.shape[0] < array.shape[1] else array

    def series(self, most: int) -> Iterator[Series]:
        """Yield the first numbers of all columns and elements of lists."""
        for name in self.names:
            try:
                values = self._numbers(name, self.load([name])[name])[:most].astype(float)
            except UnreadableFileError:  # words, pictures
                continue
            if values.ndim == 1 and len(values) > 1:
                yield Series(name, name, values)
            elif values.ndim == 2 and values.shape[1] <= WIDEST:
                labels = self.labels.get(name, ())
                for k, column in enumerate(values.T):
                    label = f' {labels[k]}' if len(labels) == values.shape[1] else f'[{k}]'
                    yield Series(f'{name}[{k}]', '' if name == MATRIX else f'{name}{label}', column)


def is_lerobot(path: Path) -> bool:
    """Return whether a folder is a LeRobot dataset."""
    return (path / INFO).is_file()


def open_arrays(path: Path) -> ArrayTable | None:
    """Return the table of a file or a dataset of arrays; None where it is neither.

    Raises
    ------
    UnreadableFileError
        Where it promises to be one, and is not.
    MissingLibraryError
        For Parquet without pyarrow.
    """
    if path.is_dir():
        return _lerobot(path) if is_lerobot(path) else None
    kind = KINDS.get(path.suffix)
    if kind in (None, 'Parquet'):
        return _parquet(path, [path], {}) if kind else None
    with _readable(path, str(kind)):
        arrays = {'MAT': _mat, 'NumPy': _numpy, 'JSON': _json}[str(kind)](path)
    return ArrayTable(path, list(arrays), lambda wanted: arrays, {})


@contextmanager
def _readable(path: Path, kind: str) -> Iterator[None]:
    """Make one sentence of a library's errors, which are of any kind where bytes are damaged."""
    try:
        yield
    except PprsError:
        raise
    except NotImplementedError:
        raise UnreadableFileError(path, 'a MAT file of version 7.3, must be saved with -v7'
                                  ) from None
    except Exception as error:
        first = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise UnreadableFileError(path, f'no {kind} file ({first})') from None


def _lerobot(path: Path) -> ArrayTable:
    """Return the episodes of a LeRobot dataset, one after the other."""
    try:
        features = json.loads((path / INFO).read_text(encoding='utf-8'))['features']
        labels = {name: _labels(of.get('names')) for name, of in features.items()}
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        raise UnreadableFileError(path, f'{INFO} contains no features of a LeRobot dataset'
                                  ) from None
    files = sorted((path / 'data').rglob('*.parquet'))
    if not files:
        raise UnreadableFileError(path, 'a LeRobot dataset without a Parquet file below data')
    return _parquet(path, files, labels)


def _labels(names: Any) -> list[str]:
    """Return names of elements, which may be grouped: {motors: [shoulder, …]}."""
    if isinstance(names, Mapping):
        names = [name for group in names.values() for name in (
            group if isinstance(group, list) else [])]
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []


def _parquet(path: Path, files: Sequence[Path], labels: Mapping[str, Sequence[str]]) -> ArrayTable:
    parquet = optional_library('pyarrow.parquet', 'pyarrow', 'reading Parquet files', 'tables')

    def load(wanted: Sequence[str]) -> Mapping[str, Any]:
        with _readable(path, 'Parquet'):
            opened = [parquet.ParquetFile(file) for file in files]
            require_size(path, sum(_parquet_size(file, wanted) for file in opened))
            tables = [file.read(list(wanted)) for file in opened]
            return {name: np.concatenate([_plain(table[name].to_numpy()) for table in tables])
                    for name in wanted}

    with _readable(path, 'Parquet'):
        names = list(parquet.ParquetFile(files[0]).schema_arrow.names)
    return ArrayTable(path, names, load, labels)


def _parquet_size(file: Any, wanted: Sequence[str]) -> int:
    """Return the bytes of columns by the file's metadata: packed ones by their number of values."""
    metadata, size = file.metadata, 0
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            if column.path_in_schema.split('.')[0] in wanted:
                size += max(column.total_uncompressed_size, 8 * column.num_values)
    return size


def require_size(path: Path, size: int) -> None:
    """Raise UnreadableFileError for arrays of more bytes than are read."""
    if size > LARGEST:
        raise UnreadableFileError(path, f'its arrays have {size / 1e9:.3g} GB, must have at most '
                                  f'{LARGEST / 1e9:.3g} GB: split it into several files')


def _plain(values: Any) -> Any:
    """Return a column of lists as an array, (N, K), and any other column unchanged."""
    if values.dtype == object and len(values) and isinstance(values[0], np.ndarray):
        with suppress(ValueError):  # lists of several lengths are no table
            return np.stack(list(values))
    return values


def _mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat, whosmat

    # Headers have the sizes.
    require_size(path, sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)))
    content = loadmat(path, squeeze_me=True, simplify_cells=True)
    return dict(_leaves({name: value for name, value in content.items()
                         if not name.startswith('__')}))


def _numpy(path: Path) -> dict[str, Any]:
    if path.suffix == '.npy':
        require_size(path, path.stat().st_size)
        return {MATRIX: np.load(path, allow_pickle=False)}
    with ZipFile(path) as archive:
        require_size(path, sum(member.file_size for member in archive.infolist()))
    with np.load(path, allow_pickle=False) as content:
        return dict(content)


def _json(path: Path) -> dict[str, Any]:
    """Return the largest table within a JSON document, or one of a document in each line."""
    require_size(path, BYTES_PER_CHARACTER * path.stat().st_size)
    text = path.read_text(encoding='utf-8')
    try:
        content = json.loads(text)
    except ValueError:
        content = [json.loads(line) for line in text.splitlines() if line.strip()]
    table = _largest_table(content, DEEPEST)
    if not table:
        raise UnreadableFileError(path, 'it contains no table: a list of objects, or lists of '
                                  'numbers of one length')
    return table


def _leaves(content: Mapping[str, Any], before: str = '', title: str = '',
            ) -> Iterator[tuple[str, Any]]:
    """Yield elements of structures by `name.name`, of lists of them by `name[0].name`.

    With a title, a structure in a list that has an entry of that name is called by it.
    """
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f'{before}{name}.', title)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            yield from _leaves({
                f'{name}[{item.get(title, k) if isinstance(item, Mapping) else k}]': item
                for k, item in enumerate(value)}, before, title)
        else:
            yield f'{before}{name}', value


def _largest_table(content: Any, depth: int) -> dict[str, Any]:
    """Return lists of one length by name; of objects in a list, their numbers."""
    import pandas as pd

    if isinstance(content, list) and content and isinstance(content[0], Mapping):
        frame = pd.DataFrame([dict(_leaves(row, title='name')) for row in content
                              if isinstance(row, Mapping)])
        content = {str(name): frame[name].tolist() for name in frame}
    elif not isinstance(content, Mapping) or not depth:
        return {}
    lists = {name: value for name, value in content.items()
             if isinstance(value, list) and len(value) > 1 and not isinstance(value[0], Mapping)}
    longest = max(map(len, lists.values()), default=0)
    found = {}
    for name, value in lists.items():
        if len(value) == longest:
            with suppress(ValueError):  # lists of several lengths are no table
                found[name] = np.asarray(value)
    tables = [found, *(_largest_table(value, depth - 1) for value in content.values())]
    return max(tables, key=lambda table: sum(array.size for array in table.values()))
