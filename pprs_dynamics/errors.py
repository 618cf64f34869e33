# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Exceptions of the package, all derived from PprsError."""

from __future__ import annotations

import difflib
import errno
import os
import re
from collections.abc import Iterable, Sequence
from importlib import import_module
from itertools import islice
from typing import Any

from pprs_dynamics.system.plain_text import displayed

# Likeness, by difflib, from which a whole name, or a part of one, is what was meant; a part counts
# for less.
LIKE, LIKE_PART, PART = 0.6, 0.8, 0.75
MOST_FILES = 2000  # of a folder that are looked at
# Names that are all listed where one is unknown: the drives' are. Of more, one like it is.
FEW = 6
# Names that are all listed where none is like the unknown one: the effects' are, not all keys'.
MANY = 40


def meant(name: str, known: Iterable[str]) -> str:
    """Return the known name that is most like a misspelt one, '' where none is like it.

    A beginning or one word of a name will do, as `stribek` for `stribeck_friction`.
    """
    def likeness(other: str) -> float:
        whole, *parts = (
            difflib.SequenceMatcher(None, name.lower(), part.lower()).ratio()
            for part in (other, other[:len(name)], *re.findall(r'[^_./\-]{3,}', other)))
        return whole if whole >= LIKE else PART * max(parts) if max(parts) >= LIKE_PART else 0.0

    likely = max(known, key=likeness, default='')
    return likely if name and likely and likeness(likely) > 0 else ''


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return ' (did you mean …?)' for a misspelt name, '' where none is like it."""
    close = meant(name, known)
    return f' (did you mean {close}?)' if close else ''


def beside(path: object) -> str:
    """Return the name of a similar file in the folder of a file that does not exist."""
    folder, name = os.path.split(os.fspath(path) if isinstance(path, os.PathLike) else str(path))
    try:
        with os.scandir(folder or '.') as entries:
            names = [entry.name for entry in islice(entries, MOST_FILES)]
    except (OSError, ValueError):
        return ''
    close = meant(name, names)
    return os.path.join(folder, close) if close and close != name else ''


MISSING = object()  # a value that is absent, unlike None


class PprsError(Exception):
    """Root of every error that a user's input can cause."""


class ModelError(PprsError, ValueError):
    """A key of a model is unknown, missing, of the wrong type or impossible.

    Parameters
    ----------
    key : str
        Full dotted name, e.g. ``geometry.rod_length``.
    value : object
        The value there; MISSING if there is none.
    rule : str
        What is required, completing "must ...".
    source : str, optional
        Where the value came from, e.g. a file name.
    """

    def __init__(self, key: str, value: Any, rule: str, source: str = '') -> None:
        self.key, self.value, self.rule, self.source = key, value, rule, source
        super().__init__(key, value, rule, source)

    @property
    def sentence(self) -> str:
        """The error without its source."""
        found = 'is missing' if self.value is MISSING else f'is {_shorten(self.value)}'
        return f'{self.key} {found}, must {self.rule}'

    def __str__(self) -> str:
        return f'{self.source}: {self.sentence}' if self.source else self.sentence


class UnknownNameError(ModelError):
    """A key, an effect or a drive that does not exist.

    Parameters
    ----------
    kind, name : str
        What was named, and how, e.g. ``key``, ``masses.paylod``.
    known : sequence of str
        Names that exist, of which one or all are suggested.
    place : str, optional
        The key under which the name stands, where it is not a key itself.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], place: str = '') -> None:
        super().__init__(place or name, name, f'be a known {kind}')
        self.kind, self.known, self.place = kind, tuple(known), place
        self.args = (kind, name, self.known, place)

    @property
    def sentence(self) -> str:
        """The error without its source."""
        hint = f' ({self.hint})' if self.hint else ''
        place = f'{self.place}: ' if self.place else ''
        return f'{place}unknown {self.kind} {self.value}{hint}'

    @property
    def hint(self) -> str:
        """The similar name to use, or all known names."""
        close = meant(self.value, self.known) if len(self.known) > 1 else ''
        known = f'known: {", ".join(self.known)}' if len(self.known) <= (
            FEW if close else MANY) else ''
        return '; '.join(filter(None, (known, f'did you mean {close}?' if close else '')))


class UnreadableFileError(PprsError, OSError):
    """A file that does not exist, cannot be read, or has an unexpected content."""

    def __init__(self, path: object, reason: str) -> None:
        if reason == os.strerror(errno.ENOENT):
            reason += ''.join(f' (did you mean {displayed(close)}?)'
                              for close in filter(None, [beside(path)]))
        self.path, self.reason = displayed(path), reason
        super().__init__(f'{self.path}: {reason}')

    def __str__(self) -> str:
        return f'{self.path}: {self.reason}'


class MisreadError(PprsError, ValueError):
    """A recording that can be read, but looks as if its numbers meant something else.

    Parameters
    ----------
    recording : str
        Its name.
    looks : sequence of str
        What it looks like, as clauses.
    lines : sequence of str
        Of a model file, that say so; '' where none can.
    """

    def __init__(self, recording: str, looks: Sequence[str], lines: Sequence[str]) -> None:
        self.recording, self.looks = recording, tuple(looks)
        self.lines = tuple(dict.fromkeys(filter(None, lines)))
        way = (f'if so, write into the model file  {"; ".join(self.lines)}' if self.lines
               else 'if so, record it anew')
        super().__init__(f'{recording}: {"; ".join(looks)}: {way}; if not, go on with --as-it-is')


class MotionError(PprsError, ValueError):
    """A platform motion that is not one: shape, finiteness, unit length or times.

    Parameters
    ----------
    quantity : str
        The quantity of the motion, e.g. ``orientation``.
    found : str
        The value, with the sample.
    rule : str
        What is required.
    kind : {'shape', 'finite', 'unit_length', 'time'}
        Which sort of rule was broken.
    """

    def __init__(self, quantity: str, found: str, rule: str, kind: str) -> None:
        self.quantity, self.found, self.rule, self.kind = quantity, found, rule, kind
        super().__init__(f'{quantity}: {found}, must {rule}')


class WorkspaceError(PprsError, ValueError):
    """A pose that the mechanism cannot reach, or may not by its limits.

    Parameters
    ----------
    sample : int
        Index of the first such sample.
    found : str
        The value there.
    rule : str
        What is required.
    """

    def __init__(self, sample: int, found: str, rule: str) -> None:
        self.sample, self.found, self.rule = sample, found, rule
        super().__init__(f'sample {sample}: {found}; {rule}')


class SingularityError(WorkspaceError, ArithmeticError):
    """A pose at which drive forces are not defined, or closer to it than allowed."""


class LimitError(PprsError, ValueError):
    """A drive force over its limit."""

    def __init__(self, sample: int, drive: str, force: float, limit: float, unit: str = 'N',
                 source: str = 'limits.effort') -> None:
        self.sample, self.drive, self.force, self.limit = sample, drive, force, limit
        super().__init__(f'sample {sample}: {drive} needs {force:.6g} {unit}, {source} allows '
                         f'{limit:.6g} {unit}')


class EffectError(PprsError, RuntimeError):
    """An effect of another package failed, or returned an invalid value.

    Parameters
    ----------
    effect : str
        Its name.
    found : str
        Which method did what.
    """

    def __init__(self, effect: str, found: str) -> None:
        self.effect, self.found = effect, found
        super().__init__(f'effect {effect}: {found}')


class MissingLibraryError(PprsError, ImportError):
    """An optional library is not installed."""

    def __init__(self, library: str, purpose: str, extra: str) -> None:
        super().__init__(
            f'{purpose} needs the library {library}, which is not installed: '
            f"pip install 'pprs_dynamics[{extra}]'")


def optional_library(module: str, library: str, purpose: str, extra: str) -> Any:
    """Import a module, or raise MissingLibraryError, which names the extra that installs it."""
    try:
        return import_module(module)
    except ImportError:
        raise MissingLibraryError(library, purpose, extra) from None


def _shorten(value: Any) -> str:
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 120 else text[:117] + '...'
