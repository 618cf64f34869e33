# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Guard of other packages' effects: whatever their code does wrong is an EffectError.

Models, diagnosis and nodes call effects in many places and rely on what they get. The methods of
an effect that comes from another package are therefore wrapped once, where it is loaded: an
exception, a wrong shape or a value that is not finite ends in one sentence that names the effect.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
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

# Errors that an effect may raise on purpose: a file's values are wrong ...
OF_FILES = (ModelError,)
# ... or the mechanism, solved when an effect first asks for it, cannot be where it should.
OF_MOTION = (WorkspaceError,)


class _WrongResultError(Exception):
    """What is wrong with a result, after "returned"."""


def guard(effect: type[CatalogueEffect]) -> None:
    """Make the methods of an effect's class raise EffectError where they fail."""
    for method, check in CHECKS.items():
        found = inspect.getattr_static(effect, method, None)
        if isinstance(found, (classmethod, staticmethod)):
            setattr(effect, method, type(found)(_guarded(effect, found.__func__, check)))
        elif found is not None:
            setattr(effect, method, _guarded(effect, found, check))


def _guarded(
    effect: type[CatalogueEffect], method: Callable[..., Any], check: Callable[..., Any],
) -> Callable[..., Any]:
    passed = OF_FILES if method.__name__ in ('__init__', 'from_file') else OF_MOTION

    @wraps(method)
    def call(*arguments: Any, **options: Any) -> Any:
        try:
            return check(method(*arguments, **options), effect, *arguments)
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


def _any(result: Any, *_: Any) -> Any:
    return result


def _array(result: Any, shape: tuple[int, ...], what: str = 'an array') -> Array:
    array = np.asarray(result, dtype=float)
    if array.shape != shape:
        raise _WrongResultError(f'{what} of shape {array.shape}, must be {shape}')
    return array


def _finite(array: Array, given: Sequence[Array], what: str = 'an array') -> Array:
    """Require finite values wherever all that was given, of the same shape, is finite.

    Absurd motions overflow in the model itself: that is not the effect's doing.
    """
    if np.isfinite(array).all():
        return array
    bad = ~np.isfinite(array)
    for each in given:
        bad &= np.isfinite(each)
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
    return tuple(_finite(_array(column, drive.velocity.shape), given) for column in columns)


def _force(result: Any, _: Any, __: Any, state: MechanismState, *___: Any) -> Array:
    given = (state.position, state.velocity, state.acceleration, state.friction_load,
             state.transmitted)
    return _finite(_array(result, state.velocity.shape), given)


def _sensed(result: Any, _: Any, __: Any, effort: Array, *___: Any) -> Array:
    return _finite(_array(result, effort.shape), (effort,))


def _sensor_columns(result: Any, effect: type[DriveEffect], _: Any, effort: Array,
                    *__: Any) -> Any:
    columns, wanted = tuple(result), max(1, len(effect.coefficients))
    if len(columns) != wanted:
        raise _WrongResultError(f'{len(columns)} arrays, must be {wanted}')
    return tuple(_finite(_array(column, effort.shape), (effort,)) for column in columns)


def _position_error(result: Any, _: Any, __: Any, ___: Any, given: Array) -> Array:
    return _finite(_array(result, given.shape), (given,))


def _averaged(
    result: Any, effect: type[DriveEffect], _: Any, drive: DriveSamples, __: float,
    shapes: Sequence[Mapping[str, float]],
) -> Any:
    shape = (len(shapes), len(effect.scanned), len(drive.velocity))
    return None if result is None else _finite(
        _array(result, shape), (drive.position, drive.velocity, drive.acceleration))


def _shapes(result: Any, effect: type[CatalogueEffect], *_: Any) -> Sequence[Any]:
    wanted = {parameter.name for parameter in effect.shape}
    trials = list(result)
    for trial in trials:
        if set(trial) != wanted:
            raise _WrongResultError(f'{trial}, must map {names(effect.shape) or "nothing"}')
    return trials


def _numbers(result: Any, wanted: Sequence[str]) -> Mapping[str, float]:
    for name in wanted:
        if name not in result or not np.isfinite(result[name]):
            raise _WrongResultError(f'{result}, must map {", ".join(wanted)} to finite numbers')
    found: Mapping[str, float] = result
    return found


def _coefficients(result: Any, effect: type[CatalogueEffect], *_: Any) -> Mapping[str, float]:
    return _numbers(result, [c.name for c in effect.coefficients])


def _parameters(result: Any, effect: type[CatalogueEffect], *_: Any) -> Mapping[str, float]:
    return _numbers(result, [p.name for p in effect.linear])


def _memory(result: Any, _: Any, effect: CatalogueEffect, *__: Any) -> Any:
    if isinstance(effect, DriveEffect) and result is not None and (
            not isinstance(result, Mapping) or set(result) != set(effect.drives)):
        raise _WrongResultError(f'{result!r:.80}, must be None or a memory per drive')
    return result


def _robot(result: Any, _: Any, __: Any, robot: Any) -> Any:
    if type(result) is not type(robot):
        raise _WrongResultError(f'{result!r:.80}, must be a {type(robot).__name__}')
    _finite(np.asarray(result.numbers, dtype=float), (), 'a robot')
    return result


def _load(result: Any, _: Any, __: Any, state: MechanismState) -> StructureLoad | None:
    if result is None:
        return None
    samples, given = len(state.velocity), (state.velocity.sum(axis=1, keepdims=True),)
    if not isinstance(result, StructureLoad):
        raise _WrongResultError(f'{result!r:.80}, must be a StructureLoad')
    known = [one.name for one in state.robot.passive_joints if one.has_position]
    torques = {}
    for joint, torque in result.torques.items():
        if joint not in known:
            raise _WrongResultError(f'a torque in {joint}, must be in a passive joint that has a '
                                    f'position: {", ".join(known) or "there is none"}')
        position = state.joint_position(joint)
        torques[joint] = _finite(_array(torque, position.shape, f'a torque in {joint}'),
                                 (position,), f'a torque in {joint}')
    return StructureLoad(
        _finite(_array(result.wrench, (samples, 6), 'a wrench'), given, 'a wrench'), torques)


def _state(result: Any, _: Any, __: Any, state: MechanismState) -> Any:
    if type(result) is not type(state):
        raise _WrongResultError(f'{result!r:.80}, must be a {type(state).__name__}')
    _finite(result.rigid_force, (state.rigid_force,), 'a state')
    return result


def _built(result: Any, effect: type[CatalogueEffect], *_: Any) -> CatalogueEffect:
    if not isinstance(result, effect):
        raise _WrongResultError(f'{result!r:.80}, must be a {effect.__name__}')
    return result


def _block(result: Any, *_: Any) -> Mapping[str, Any]:
    if not isinstance(result, Mapping):
        raise _WrongResultError(f'{result!r:.80}, must be a mapping')
    return result


CHECKS: dict[str, Callable[..., Any]] = {
    '__init__': _any, 'from_file': _built, 'to_file': _block,
    'to_coefficients': _coefficients, 'from_coefficients': _parameters,
    'drive_memory': _any, 'begin': _any, 'initial_memory': _memory, 'continued_memory': _memory,
    'columns': _columns, 'shares': _columns, 'force': _force, 'sensed': _sensed,
    'sensor_columns': _sensor_columns,
    'position_error': _position_error, 'loaded_position_error': _position_error,
    'shifts_positions': _any,
    'changed': _robot, 'load': _load, 'apply': _state,
    'trials': _shapes, 'alternatives': _shapes, 'averaged': _averaged}
