"""Errors of the package: one root, each composing its sentence from what it keeps."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.plain_text import displayed


class Missing:
    """Stands for a value that is not there, which is not the same as None."""

    def __repr__(self) -> str:
        return 'missing'


MISSING = Missing()


class PprsError(Exception):
    """Root of every error that a user's input can cause."""


class ModelError(PprsError, ValueError):
    """A key of a model is unknown, missing, of the wrong type or impossible.

    Parameters
    ----------
    key : str
        Full dotted name, e.g. ``geometry.rod_length``.
    value : object
        What was found there; MISSING where nothing was.
    rule : str
        What is required, completing "it must ...".
    source : str, optional
        Where the value came from, e.g. a file name.
    """

    def __init__(self, key: str, value: Any, rule: str, source: str = '') -> None:
        self.key, self.value, self.rule, self.source = key, value, rule, source
        place = f'{source}: ' if source else ''
        found = 'is missing' if value is MISSING else f'is {_shorten(value)}'
        super().__init__(f'{place}{key} {found}, but it must {rule}')


class UnreadableFileError(PprsError, OSError):
    """A file that does not exist, cannot be read, or is not what it should be."""

    def __init__(self, path: object, reason: str) -> None:
        self.path, self.reason = displayed(path), reason
        super().__init__(f'{self.path}: {reason}')

    def __str__(self) -> str:
        return f'{self.path}: {self.reason}'


class MotionError(PprsError, ValueError):
    """A platform motion that is not one: shape, finiteness, unit length or times.

    Parameters
    ----------
    quantity : str
        The quantity of the motion, e.g. ``orientation``.
    found : str
        What was found, with the sample.
    rule : str
        What is required.
    kind : {'shape', 'finite', 'unit_length', 'time'}
        Which sort of rule was broken.
    """

    def __init__(self, quantity: str, found: str, rule: str, kind: str) -> None:
        self.quantity, self.found, self.rule, self.kind = quantity, found, rule, kind
        super().__init__(f'{quantity}: {found}, but it must {rule}')


class WorkspaceError(PprsError, ValueError):
    """A pose that the mechanism cannot reach, or may not by its limits.

    Parameters
    ----------
    sample : int
        Index of the first such sample.
    found : str
        What was found there.
    rule : str
        What is required.
    """

    def __init__(self, sample: int, found: str, rule: str) -> None:
        self.sample, self.found, self.rule = sample, found, rule
        super().__init__(f'sample {sample}: {found}; {rule}')


class SingularityError(WorkspaceError, ArithmeticError):
    """A pose at which drive forces are not defined, or closer to it than allowed."""


class ConvergenceError(PprsError, ArithmeticError):
    """Forward kinematics found no pose of the right assembly mode."""

    def __init__(self, sample: int, found: str, rule: str) -> None:
        self.sample, self.found, self.rule = sample, found, rule
        super().__init__(f'sample {sample}: {found}; {rule}')


class LimitError(PprsError, ValueError):
    """A drive force over its limit."""

    def __init__(self, sample: int, drive: str, force: float, limit: float) -> None:
        self.sample, self.drive, self.force, self.limit = sample, drive, force, limit
        super().__init__(
            f'sample {sample}: {drive} needs {force:.6g} N, limits.effort allows {limit:.6g} N')


class MissingLibraryError(PprsError, ImportError):
    """An optional library is not installed."""

    def __init__(self, library: str, purpose: str, extra: str) -> None:
        super().__init__(
            f'{purpose} needs the library {library}, which is not installed: '
            f"pip install 'pprs_dynamics[{extra}]'")


def _shorten(value: Any) -> str:
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 120 else text[:117] + '...'
