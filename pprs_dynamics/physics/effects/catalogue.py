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
import warnings
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pprs_dynamics.errors import EffectError
from pprs_dynamics.physics.effects import laws
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.foreign_effects import check_columns, guard
from pprs_dynamics.system.plain_text import displayed

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = 'pprs_dynamics.effects'
# Parts of the drive forces and keys of the block `effects` that have these names already.
RESERVED = ('active', 'active_friction', 'measured', 'offset', 'passive_friction', 'rigid_body')


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
            warnings.warn(displayed(f'{_origin(point)} is left out: {error}'), RuntimeWarning,
                          stacklevel=2)
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
    if not (inspect.isclass(effect) and issubclass(effect, CatalogueEffect)):
        raise _UnusableEffectError('it must be a class derived from CatalogueEffect, e.g. a '
                                   'DriveEffect')
    if not isinstance(getattr(effect, 'name', None), str):
        raise _UnusableEffectError(f'{effect.__name__} must have name, a str')
    if not effect.card.equation:
        raise _UnusableEffectError(f'the docstring of {effect.__name__} must have a section '
                                   'Equation')
    if not hasattr(effect, 'parameters'):
        raise _UnusableEffectError(f'{effect.__name__} must have linear, a tuple of Parameter')
    if not effect.name.isidentifier():
        raise _UnusableEffectError(
            f'its name {effect.name!r} must be one word of letters, digits and _')
    if effect.name in (*known, *EFFECTS, *RESERVED):
        raise _UnusableEffectError(f'the name {effect.name} is taken')
    guard(effect)
    if inspect.isabstract(effect):
        raise _UnusableEffectError(f'{effect.__name__} must define '
                                   f'{", ".join(sorted(effect.__abstractmethods__))}')
    if issubclass(effect, DriveEffect):
        check_columns(effect)
    return effect


def _origin(point: EntryPoint) -> str:
    package = f' of the package {point.dist.name}' if point.dist else ''
    return f'the effect {point.name} = {point.value}{package}'
