# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a session, fitted or held out."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from threading import Lock

from pprs_dynamics.app.api.inputs import Inputs
from pprs_dynamics.app.workbench.ticks import Ticks


class Recordings:
    """Adds, removes and checks the recordings that ticks are fitted to, one change at a time."""

    def __init__(self, ticks: Ticks) -> None:
        self._ticks, self._changing = ticks, Lock()

    def add(self, path: str | PathLike[str], is_held_out: bool = False) -> None:
        """Add a recording.

        Raises
        ------
        PprsError
            Where it cannot be read, repeats another one, or the model cannot follow it.
        """
        self._change(lambda inputs: inputs.with_more(path, is_held_out))

    def remove(self, name: str) -> None:
        """Remove a recording; ticks and model remain.

        Raises
        ------
        InputError
            For a name that is not listed, or the last recording that is fitted.
        """
        self._change(lambda inputs: inputs.without(name))

    def find_mistakes(self) -> None:
        """Add wrong units, signs and orders of drives to the findings of each recording.

        Raises
        ------
        UnreadableFileError
            For positions that are not in metres.
        """
        self._change(Inputs.checked)

    def _change(self, change: Callable[[Inputs], Inputs]) -> None:
        with self._changing:
            self._ticks.take(change(self._ticks.inputs))
