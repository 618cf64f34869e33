# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What every result can do: say itself in text, HTML, JSON, tables and a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.record import record_of
from pprs_dynamics.app.report.terminal import as_html, as_text
from pprs_dynamics.errors import MissingLibraryError

if TYPE_CHECKING:
    # What results return, named for all of them.
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame as DataFrame

WIDTH = 100  # characters of a line of text


class Result(ABC):
    """An answer of the package's calls.

    Printed, it is what the command prints; in a notebook it shows the same.
    """

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return what the command writes with --json."""

    @abstractmethod
    def view(self, details: bool = False) -> Any:
        """Return what the terminal shows, for rich's console; all there is with `details`.

        Raises
        ------
        MissingLibraryError
            Where rich is not installed.
        """

    @abstractmethod
    def page(self) -> Page:
        """Return what the command writes with --report.

        Raises
        ------
        MissingLibraryError
            Where plotly is not installed.
        """

    @abstractmethod
    def table(self) -> DataFrame:
        """Return the numbers as a table of pandas."""

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
        """Return what a result is of: date, version, command, model and recordings with hashes."""
        inputs = getattr(self, 'inputs', None)
        return (record_of(None, {}, {}, command) if inputs is None else
                record_of(inputs.model, inputs.recordings, inputs.validation, command))

    def __str__(self) -> str:
        return as_text(self.view(), WIDTH)

    def __repr__(self) -> str:
        try:
            return str(self)
        except MissingLibraryError:
            return object.__repr__(self)

    def _repr_html_(self) -> str:
        return as_html(self.view(), WIDTH)


def data_frame(rows: Sequence[Mapping[str, Any]], index: Sequence[str] | None = None,
               name: str | None = None) -> DataFrame:
    """Return rows as a table of pandas."""
    import pandas as pd

    return pd.DataFrame(list(rows), index=None if index is None else pd.Index(index, name=name))
