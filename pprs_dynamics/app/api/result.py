# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Base class of results: text, HTML, JSON, tables and a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from pprs_dynamics import __version__
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.terminal import as_html, as_text
from pprs_dynamics.errors import MissingLibraryError, UnreadableFileError
from pprs_dynamics.measurement.files.fingerprint import fingerprint, samples_fingerprint
from pprs_dynamics.measurement.files.recording import Recording, describe
from pprs_dynamics.system.json_records import JsonRecord

if TYPE_CHECKING:
    # What results return, named for all of them.
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame as DataFrame

WIDTH = 100  # characters of a line of text


def _described(recordings: Mapping[str, Recording]) -> Iterator[str]:
    for name, recording in recordings.items():
        summary = describe(recording)
        try:
            digest = fingerprint(name) if Path(name).exists() else samples_fingerprint(recording)
        except UnreadableFileError:
            digest = samples_fingerprint(recording)
        yield (f'{recording.name}: {summary.used} samples, {summary.duration:.2f} s at '
               f'{summary.rate:.6g} Hz, sha256 {digest}')


class Result(JsonRecord, ABC):
    """An answer of the package's calls.

    Printed, it is what the command prints; in a notebook it shows the same.
    """

    rows: ClassVar[str]

    @abstractmethod
    def view(self) -> Any:
        """Return the result for rich's console.

        Raises
        ------
        MissingLibraryError
            Where rich is not installed.
        """

    @abstractmethod
    def page(self) -> Page:
        """Return the page that the command writes with --report.

        Raises
        ------
        MissingLibraryError
            Where plotly is not installed.
        """

    def table(self) -> DataFrame:
        """Return the numbers as a table of pandas: the entry `rows` of the dictionary."""
        return data_frame(self.to_dict()[self.rows])

    @abstractmethod
    def plot(self) -> Figure:
        """Return a picture, for notebooks or its `savefig`.

        Raises
        ------
        MissingLibraryError
            Where matplotlib is not installed.
        """

    def report(self, path: str | PathLike[str]) -> Path:
        """Write the page of all figures, which needs no network, and return its file."""
        page = self.page()
        page.record(self.record())
        return page.write(path)

    def record(self, command: str = '') -> list[tuple[str, str]]:
        """Return the record of a result: date, version, command, hashes of model and recordings."""
        found = [('date', datetime.now(UTC).isoformat(timespec='seconds')),
                 ('version', f'pprs_dynamics {__version__}'), ('command', command)]
        if (inputs := getattr(self, 'inputs', None)) is not None:
            name = Path(inputs.model.source).name or 'built in memory'
            found.append(('model', f'{name}, sha256 of its values {inputs.model.fingerprint}'))
            found += [('recording', text) for text in _described(inputs.recordings)]
            found += [('held out', text) for text in _described(inputs.validation)]
        return [(label, text) for label, text in found if text]

    def __str__(self) -> str:
        return as_text(self.view(), WIDTH)

    def __repr__(self) -> str:
        try:
            return str(self)
        except MissingLibraryError:
            return object.__repr__(self)

    def _repr_html_(self) -> str:
        return as_html(self.view(), WIDTH)


def data_frame(rows: Mapping[str, Mapping[str, Any]] | Sequence[Mapping[str, Any]]) -> DataFrame:
    """Return rows as a table of pandas, by their names where they have any."""
    import pandas as pd

    return (pd.DataFrame.from_dict(dict(rows), orient='index') if isinstance(rows, Mapping)
            else pd.DataFrame(list(rows)))
