# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a fit may say of an effect and no machine can have: then it is no finding.

A base that leans as none does, a gain that is another unit, and values whose interval holds
nothing at all. Negative friction and inertia are a matter of cost (`search.possible_totals`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pprs_dynamics.inference.diagnosis.quantities import INTERVAL, with_uncertainty
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.effects.laws.effort_gain import EffortGain


def why_impossible(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                   decisions: Decisions) -> str:
    """Return why what a fit says of an effect cannot be, as a clause; '' where it can.

    Parameters
    ----------
    effect : type of CatalogueEffect
    parameters : mapping of str to Estimate
        By drive.parameter, or parameter.
    decisions : Decisions
    """
    return next(_reasons(effect, parameters, decisions), '')


def why_nothing(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                in_model: Mapping[str, float]) -> str:
    """Return why what a fit says of an effect may be nothing, as a clause; '' where it is not.

    One number of several may be nothing. Of an effect that the model has, as `in_model` says, what
    is otherwise may be no more than the uncertainty.

    Parameters
    ----------
    effect : type of CatalogueEffect
    parameters : mapping of str to Estimate
        By drive.parameter, or parameter.
    in_model : mapping of str to float
        By the same; empty for an effect that the model lacks.
    """
    if in_model:
        return '' if any(abs(one.value - in_model[key]) > INTERVAL * one.std
                         for key, one in parameters.items() if key in in_model) else (
            'it holds what the model has')
    sizes = _sizes(effect, parameters)
    if not sizes or any(abs(one.value) > INTERVAL * one.std for one in sizes.values()):
        return ''
    key, one = max(sizes.items(), key=lambda item: abs(item[1].value) / item[1].std)
    return f'{key} is {with_uncertainty(one.value, one.std, one.unit)}, which holds 0'


def _sizes(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
           ) -> dict[str, Estimate]:
    """Return the numbers that make an effect as large as it is, without those left at 0."""
    linear = {parameter.name for parameter in effect.linear}
    return {key: one for key, one in parameters.items()
            if effect.place_and_parameter(key)[1] in linear and one.value}


def _reasons(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
             decisions: Decisions) -> Iterator[str]:
    for key, one in _sizes(effect, parameters).items():
        drive, _ = effect.place_and_parameter(key)
        at = f' of {drive}' if drive else ''
        if effect is EffortGain:
            factor = 1 + one.value
            if max(factor, 1 / factor if factor > 0 else np.inf) > decisions.most_gain:
                yield (f'the effort{at} would be measured {factor:.3g} times too large, which is '
                       'another unit or another drive constant, to be written into the model file')
        elif effect is BaseTilt and abs(one.value) > decisions.most_tilt:
            yield (f'a base that leans by {np.degrees(abs(one.value)):.3g} degrees was put up so: '
                   'gravity in the model file says how')
