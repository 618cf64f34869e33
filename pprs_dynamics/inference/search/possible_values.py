# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a fit may say of an effect and no machine can have: then it is no finding.

A base that leans as none does, and a gain that is another unit. Negative friction and inertia are
a matter of cost (`constraints`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pprs_dynamics.inference.search.candidates import CandidateSet
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.estimates import Estimate, estimate
from pprs_dynamics.inference.search.fitted_sets import FittedSets
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


def is_possible(fits: FittedSets, fitted: CandidateSet) -> bool:
    """Return whether a machine can have all that a set says."""
    return not any(why_impossible(one.effect, estimate(fits, fitted, one).parameters,
                                  fits.decisions)
                   for one in fitted.effects if one.effect in (EffortGain, BaseTilt))


def _sizes(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
           ) -> dict[str, Estimate]:
    """Return the numbers that make an effect as large as it is, without those left at 0."""
    linear = {parameter.name for parameter in effect.linear}
    return {key: number for key, number in parameters.items()
            if effect.place_and_parameter(key)[1] in linear and number.value}


def _reasons(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
             decisions: Decisions) -> Iterator[str]:
    for key, number in _sizes(effect, parameters).items():
        drive, _ = effect.place_and_parameter(key)
        at = f' of {drive}' if drive else ''
        if effect is EffortGain:
            factor = 1 + number.value
            if max(factor, 1 / factor if factor > 0 else np.inf) > decisions.most_gain:
                yield (f'the effort{at} would be measured {factor:.3g} times too large, which is '
                       'another unit or another drive constant, to be written into the model file')
        elif effect is BaseTilt and abs(number.value) > decisions.most_tilt:
            yield (f'a base that leans by {np.degrees(abs(number.value)):.3g} degrees was put up '
                   'so: gravity in the model file says how')
