# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""How well the parameters of a model's effects are known: the block `uncertainties` of its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pprs_dynamics.errors import ModelError, UnknownNameError
from pprs_dynamics.physics.effects.catalogue import find_effect
from pprs_dynamics.physics.model.keys import Key
from pprs_dynamics.physics.model.ledger import NOT_KNOWN, read_steps

UNCERTAINTIES = 'uncertainties'


def effect_uncertainties(values: Mapping[str, Any], effect: str) -> dict[str, float]:
    """Return the standard deviation of each parameter of an effect, by drive.parameter.

    What the file says; of files from before there was a block for it, what the ledger's last step
    with the parameter says. A parameter of which neither says anything is taken as exact.
    """
    prefix = f'{UNCERTAINTIES}.{effect}.'
    found: dict[str, float] = {}
    for step in read_steps(values):
        if step.effect == effect:
            found.update((key, std) for key, std in zip(step.parameters, step.std, strict=False)
                         if std < NOT_KNOWN)
    found.update((key.removeprefix(prefix), float(std)) for key, std in values.items()
                 if key.startswith(prefix))
    return found


def with_uncertainties(values: Mapping[str, Any], effect: str,
                       known: Mapping[str, float]) -> dict[str, Any]:
    """Return values with the standard deviations of some parameters of an effect."""
    return {**values, **{f'{UNCERTAINTIES}.{effect}.{key}': std for key, std in known.items()}}


def check_uncertainties(parameters: Mapping[str, Any]) -> None:
    """Raise ModelError for an uncertainty that is none, or of nothing that an effect has."""
    active = parameters.get('effects.active') or ()
    for key, value in parameters.items():
        if not key.startswith(f'{UNCERTAINTIES}.'):
            continue
        _, name, *rest = key.split('.')
        if find_effect(name) is None or not rest:
            raise UnknownNameError('key', key, [
                f'{UNCERTAINTIES}.{one}' for one in active])
        if name in active and f'effects.{name}.{".".join(rest)}' not in parameters:
            raise ModelError(key, value, f'belong to effects.{name}.{".".join(rest)}, which is '
                             'not there: take the line out')
        Key(key, 'a standard deviation', lower=0).check(value)
