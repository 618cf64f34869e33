# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The effects that a model file may add, by name: the package's own and those of other packages.

Another package offers an effect through the entry point group `pprs_dynamics.effects`:

    [project.entry-points."pprs_dynamics.effects"]
    magnet_force = "my_package.magnet_force:MagnetForce"
"""

from __future__ import annotations

import inspect
import pkgutil
import sys
import warnings
from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.errors import EffectError, ModelError, WorkspaceError
from pprs_dynamics.physics.effects import laws
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, DriveRange, DriveSamples
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter, names
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = 'pprs_dynamics.effects'
# Parts of the drive forces and keys of the block `effects` that have these names already.
RESERVED = ('active', 'active_friction', 'measured', 'offset', 'passive_friction', 'rigid_body')


def guard(effect: type[CatalogueEffect]) -> None:
    """Let the public methods of an effect's class raise EffectError where they fail."""
    for name in dir(effect):
        method = inspect.getattr_static(effect, name)
        if name.startswith('_') and name != '__init__':
            continue
        if isinstance(method, (classmethod, staticmethod)):
            setattr(effect, name, type(method)(_guarded(effect, method.__func__)))
        elif inspect.isfunction(method):
            setattr(effect, name, _guarded(effect, method))


def _guarded(effect: type[CatalogueEffect], method: Callable[..., Any]) -> Callable[..., Any]:
    # On purpose: values of a file are wrong, or the mechanism, which is solved when an effect
    # first asks for it, cannot be there.
    passed = ModelError if method.__name__ in (
        '__init__', 'from_file', 'checked', 'check_memory') else WorkspaceError

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
    files = {getattr(sys.modules.get(parent.__module__), '__file__', None)
             for parent in effect.__mro__ if parent.__module__.split('.')[0] != 'pprs_dynamics'}
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


def _laws() -> dict[str, type[CatalogueEffect]]:
    """Return the effects of all files in `laws`, by name."""
    found: dict[str, type[CatalogueEffect]] = {}
    for _, name, _ in pkgutil.iter_modules(laws.__path__, f'{laws.__name__}.'):
        for law in vars(import_module(name)).values():
            if (inspect.isclass(law) and issubclass(law, CatalogueEffect)
                    and law.__module__ == name and hasattr(law, 'name')):
                found[law.name] = law
    return found


EFFECTS = _laws()
# What a diagnosis may name: a measured curve is in models like any effect, but no cause.
CATALOGUE = {name: effect for name, effect in EFFECTS.items() if name != 'measured_curve'}


def find_effect(name: str) -> type[CatalogueEffect] | None:
    """Return the effect of that name, or None; other packages are asked only where need be."""
    return EFFECTS.get(name) or catalogue().get(name)


def find_parameter(key: str) -> Parameter | None:
    """Return the parameter of a key EFFECT.PARAMETER or EFFECT.DRIVE.PARAMETER, or None."""
    name, _, rest = key.partition('.')
    effect = find_effect(name) if rest else None
    return None if effect is None else next(
        (p for p in effect.parameters if p.name == rest.rpartition('.')[2]), None)


@cache
def catalogue() -> dict[str, type[CatalogueEffect]]:
    """Return all effects by name, the package's own first.

    An effect of another package that cannot be used is left out with a warning that says why:
    it must not take the others with it.
    """
    from importlib.metadata import entry_points  # takes 20 ms, which most models do without

    effects = dict(CATALOGUE)
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value)):
        try:
            effect = _load(point, effects)
        except (_UnusableEffectError, EffectError) as error:
            package = f' of the package {point.dist.name}' if point.dist else ''
            warnings.warn(displayed(
                f'the effect {point.name} = {point.value}{package} is left out: {error}'),
                RuntimeWarning, stacklevel=2)
        else:
            effects[effect.name] = effect
    return effects


class _UnusableEffectError(Exception):
    """Another package's effect breaks a rule of the catalogue."""


def _load(point: EntryPoint, known: dict[str, type[CatalogueEffect]]) -> type[CatalogueEffect]:
    try:
        effect: Any = point.load()
    except (Exception, SystemExit) as error:  # another package's code may do anything
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        raise _UnusableEffectError(f'it cannot be imported ({reason})') from error
    if not (inspect.isclass(effect) and issubclass(effect, CatalogueEffect)
            and hasattr(effect, 'linear') and str(getattr(effect, 'name', '')).isidentifier()):
        raise _UnusableEffectError(
            'it must be a class derived from CatalogueEffect, e.g. a DriveEffect, with linear, a '
            'tuple of Parameter, and name, a word of letters, digits and _')
    if not effect.card.equation:
        raise _UnusableEffectError(f'the docstring of {effect.__name__} must have a section '
                                   'Equation')
    if effect.name in (*known, *EFFECTS, *RESERVED):
        raise _UnusableEffectError(f'the name {effect.name} is taken')
    guard(effect)
    if inspect.isabstract(effect):
        raise _UnusableEffectError(f'{effect.__name__} must define '
                                   f'{", ".join(sorted(effect.__abstractmethods__))}')
    if issubclass(effect, DriveEffect):
        check_columns(effect)
    return effect
