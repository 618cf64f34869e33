# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Checks of effects of other packages: their results when loaded, exceptions at every call."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from functools import wraps
from traceback import walk_tb
from typing import Any

import numpy as np

from pprs_dynamics.errors import EffectError, ModelError, WorkspaceError
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import CatalogueEffect, names
from pprs_dynamics.system.plain_text import displayed

METHODS = (
    '__init__', 'from_file', 'to_coefficients', 'from_coefficients', 'columns', 'force',
    'changed', 'load', 'apply', 'sense', 'measured', 'position_error',
    'loaded_position_error', 'drive_memory', 'begin', 'initial_memory', 'continued_memory',
    'check_memory', 'sensor_columns', 'shifts_positions', 'trials', 'alternatives', 'averaged')


def guard(effect: type[CatalogueEffect]) -> None:
    """Let the methods of an effect's class raise EffectError where they fail."""
    for name in METHODS:
        method = inspect.getattr_static(effect, name, None)
        if isinstance(method, (classmethod, staticmethod)):
            setattr(effect, name, type(method)(_guarded(effect, method.__func__)))
        elif method is not None:
            setattr(effect, name, _guarded(effect, method))


def _guarded(effect: type[CatalogueEffect], method: Callable[..., Any]) -> Callable[..., Any]:
    # On purpose: values of a file are wrong, or the mechanism, which is solved when an effect
    # first asks for it, cannot be there.
    passed = ModelError if method.__name__ in (
        '__init__', 'from_file', 'check_memory') else WorkspaceError

    @wraps(method)
    def call(*arguments: Any, **options: Any) -> Any:
        try:
            return method(*arguments, **options)
        except (passed, EffectError):
            raise
        except (Exception, SystemExit) as error:  # another package's code may do anything
            reason = displayed(' '.join(
                f'{type(error).__name__}: {error}'.split())).removesuffix(':')
            raise EffectError(
                effect.name, f'{method.__name__} raised {reason}{_place(effect, error)}') from error

    return call


def _place(effect: type[CatalogueEffect], error: BaseException) -> str:
    """Return where in the effect's own files an exception came from, for the end of a sentence."""
    files = {getattr(sys.modules.get(each.__module__), '__file__', None)
             for each in effect.__mro__ if each.__module__.split('.')[0] != 'pprs_dynamics'}
    lines = [f' ({frame.f_code.co_filename}, line {line})'
             for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename in files]
    return lines[-1] if lines else ''


def check_columns(effect: type[DriveEffect]) -> None:
    """Raise EffectError where the columns of three samples of a drive are not what they must be."""
    row = np.array([0.1, 0.2, 0.3])
    drive = DriveSamples(row, row, row, row, np.ones(3), row, row, effect.drive_memory())
    defaults = {p.name: p.default for p in effect.shape if p.default is not None}
    columns: Any = effect.columns(
        drive, **{**defaults, **effect.trials(DriveRange(1.0, 0.1, 0.2, 0.3))[0]})
    count = len(effect.coefficients)
    if not isinstance(columns, tuple) or len(columns) != count:
        raise EffectError(effect.name, f'columns returned {columns!r:.80}, must be a tuple of '
                          f'{count} arrays ({names(effect.coefficients) or "none"})')
    for column in columns:
        if np.shape(column) != row.shape or not np.all(np.isfinite(column)):
            raise EffectError(effect.name, f'columns returned {column!r:.80} for three samples, '
                              'must be three finite numbers')
