# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Guard of other packages' effects: an exception or a wrong force is an EffectError.

The methods of an effect of another package are wrapped once, where it is loaded. A force, column,
load, reading or robot is checked where it comes in; all other results are taken as they are.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from traceback import walk_tb
from typing import Any

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.errors import EffectError, ModelError, WorkspaceError
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveSamples
from pprs_dynamics.physics.effects.effect import CatalogueEffect, names
from pprs_dynamics.physics.mechanism.state import MechanismState
from pprs_dynamics.physics.mechanism.structure_load import StructureLoad
from pprs_dynamics.system.plain_text import displayed


class _WrongResultError(Exception):
    """What is wrong with a result, after "returned"."""


def guard(effect: type[CatalogueEffect]) -> None:
    """Make the methods of an effect's class raise EffectError where they fail."""
    for method in METHODS:
        found, check = inspect.getattr_static(effect, method, None), CHECKS.get(method)
        if isinstance(found, (classmethod, staticmethod)):
            setattr(effect, method, type(found)(_guarded(effect, found.__func__, check)))
        elif found is not None:
            setattr(effect, method, _guarded(effect, found, check))


def _guarded(
    effect: type[CatalogueEffect], method: Callable[..., Any], check: Callable[..., Any] | None,
) -> Callable[..., Any]:
    # On purpose: values of a file are wrong, or the mechanism, which is solved when an effect
    # first asks for it, cannot be there.
    passed = ModelError if method.__name__ in (
        '__init__', 'from_file', 'check_memory') else WorkspaceError

    @wraps(method)
    def call(*arguments: Any, **options: Any) -> Any:
        try:
            result = method(*arguments, **options)
            return result if check is None else check(result, effect, *arguments)
        except passed:
            raise
        except EffectError as error:
            # Of a method that this one called, perhaps of another effect that it derives from.
            raise EffectError(effect.name, error.found) from error
        except _WrongResultError as error:
            raise EffectError(effect.name, f'{method.__name__} returned {error}') from None
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


# --- what results must be: (result, class, self or class, further arguments) -> result ------------


def _finite(result: Any, shape: tuple[int, ...], given: Sequence[Array],
            what: str = 'an array') -> Array:
    """Require the shape, and finite values wherever all that was given is finite.

    Absurd motions overflow in the model itself: that is not the effect's doing.
    """
    array = np.asarray(result, dtype=float)
    if array.shape != shape:
        raise _WrongResultError(f'{what} of shape {array.shape}, must be {shape}')
    bad = ~np.isfinite(array)
    if bad.any():
        bad &= np.logical_and.reduce([np.isfinite(each) for each in given])
    if bad.any():
        raise _WrongResultError(f'{what} with {array[bad][0]}, must be finite')
    return array


def _columns(result: Any, effect: type[DriveEffect], _: Any, drive: DriveSamples) -> Any:
    columns, wanted = tuple(result), effect.coefficients
    if len(columns) != len(wanted):
        raise _WrongResultError(
            f'{len(columns)} arrays, must be {len(wanted)} ({names(wanted) or "none"})')
    given = (drive.position, drive.velocity, drive.acceleration, drive.friction_load,
             drive.transmitted, *drive.channels.values())
    return tuple(_finite(column, drive.velocity.shape, given) for column in columns)


def _force(result: Any, _: Any, __: Any, state: MechanismState, *___: Any) -> Array:
    given = (state.position, state.velocity, state.acceleration, state.friction_load,
             state.transmitted)
    return _finite(result, state.velocity.shape, given)


def _like_given(result: Any, _: Any, __: Any, *arguments: Any) -> Array:
    """Check a result that has the shape of the first array among the arguments."""
    given = next(each for each in arguments if isinstance(each, np.ndarray))
    return _finite(result, given.shape, (given,))


def _robot(result: Any, _: Any, __: Any, robot: Any) -> Any:
    if type(result) is not type(robot):
        raise _WrongResultError(f'{result!r:.80}, must be a {type(robot).__name__}')
    return result


def _load(result: Any, _: Any, __: Any, state: MechanismState) -> StructureLoad | None:
    if result is not None:
        _finite(result.wrench, (len(state.velocity), 6),
                (state.velocity.sum(axis=1, keepdims=True),), 'a wrench')
    return result  # type: ignore[no-any-return]


def _state(result: Any, _: Any, __: Any, state: MechanismState) -> Any:
    _finite(result.rigid_force, state.velocity.shape, (state.rigid_force,), 'a state')
    return result


CHECKS: dict[str, Callable[..., Any]] = {
    'columns': _columns, 'shares': _columns, 'force': _force, 'changed': _robot, 'load': _load,
    'apply': _state, 'sensed': _like_given, 'position_error': _like_given,
    'loaded_position_error': _like_given}
METHODS = (
    *CHECKS, '__init__', 'from_file', 'to_file', 'to_coefficients', 'from_coefficients',
    'drive_memory', 'begin', 'initial_memory', 'continued_memory', 'check_memory', 'sensor_columns',
    'shifts_positions', 'trials', 'alternatives', 'averaged')
