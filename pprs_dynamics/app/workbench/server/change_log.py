# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Deltas of the state: the parts that changed since a version that a browser has."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Lock
from typing import Any

EFFECTS = 'effects'  # a list of objects with names, that change one by one


class ChangeLog:
    """Parts of a state, each with the version at which it became what it is.

    Attributes
    ----------
    version : int
        Counts what may have changed the state, and looks that found it changed.
    """

    def __init__(self) -> None:
        self.version = 0
        self._lock = Lock()
        self._parts: dict[tuple[str, str], Any] = {}
        self._changed: dict[tuple[str, str], int] = {}

    def count(self) -> None:
        """Count that something may have changed; from any thread, after it did."""
        with self._lock:
            self.version += 1

    def update(self, state: Mapping[str, Any], version: int) -> int:
        """Take a state, later than all before, and return the version that it is.

        Parameters
        ----------
        state : mapping of str to Any
        version : int
            As it was before the state was looked at.
        """
        effects = {(EFFECTS, effect['name']): effect for effect in state.get(EFFECTS, ())}
        parts = {(key, ''): value for key, value in state.items() if key != EFFECTS} | effects
        parts['effect_names', ''] = [name for _, name in effects]
        changed = [key for key, part in parts.items()
                   if key not in self._parts or self._parts[key] != part]
        self._parts |= parts
        if not changed:
            return version
        with self._lock:
            self.version += 1
            self._changed |= dict.fromkeys(changed, self.version)
            # What was counted meanwhile may not be in this state: it has to be asked for again.
            return self.version if self.version == version + 1 else version

    def since(self, version: int) -> dict[str, Any]:
        """Return the parts that changed after a version, all of them after -1."""
        late = {key: self._parts[key] for key, at in self._changed.items() if at > version}
        names = self._parts['effect_names', '']
        return {key: part for (key, name), part in late.items() if not name} | {
            EFFECTS: [part for (_, name), part in late.items() if name in names]}
