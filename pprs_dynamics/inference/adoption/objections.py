# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Acceptance checks of an adoption: held-out error, evidence, rivals, bounds; each a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.inference.adoption.fit_effect import SURE, EffectFit
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.quantities import (
    as_fitted,
    change,
    with_uncertainty,
)
from pprs_dynamics.inference.residuals.residuals import Residuals, rms_by_drive
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.inference.search.held_out import PredictiveGain
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.force_model import (
    ACTIVE_FRICTION,
    PASSIVE_FRICTION,
    ForceModel,
)

MOVING = 5.0  # widths in which friction turns over
PUSHES = 0.1  # of the moving time, in which a drive's friction may give power back
# Standard errors by which the first effect, and further ones, must gain.
FIRST_ERRORS, FURTHER_ERRORS = 1.0, 2.0
OWN_SHARE = 1e-6  # of a column's whitened square, below which nothing tells its coefficient


def of_other_effects(request: EffectRequest, fitted: EffectFit, diagnosis: Diagnosis) -> list[str]:
    """Return whether the recordings call for another effect, or for none."""
    mine = next((one for one in diagnosis.effects if one.name == request.name), None)
    if mine is not None and mine.course is not None:
        return [f'it is there{mine.when}, and a model has it throughout: record the machine as it '
                'is now']
    if mine is not None:
        missed = [drive for drive in fitted.drives or () if drive not in (mine.drives or ())]
        if mine.drives and missed:
            return [f'the recordings show {request.name} on {", ".join(mine.drives)}, not on '
                    f'{", ".join(missed)}']
        return _evidence(fitted, diagnosis)
    if any(request.name in names for names in diagnosis.indistinguishable):
        return _evidence(fitted, diagnosis)
    if diagnosis.effects:
        best = diagnosis.effects[0]
        on = f' on {", ".join(best.drives)}' if best.drives else ''
        return [f'{best.name}{on} explains these recordings better: evidence '
                f'{best.evidence:.3g} against {fitted.evidence:.3g}']
    if diagnosis.depends_on:
        return [f'no effect of the catalogue has the form of the error: '
                f'{diagnosis.depends_on[0].text}']
    if request.present(fitted.plain):
        return [f'{request.name} is in the model already, and these recordings call for no other '
                f'numbers: evidence {fitted.evidence:.3g}, where 0 is the threshold']
    suspect = any(one.name == request.name for one in diagnosis.suspects)
    if fitted.evidence > 0 and not suspect:
        return ['it does not predict parts of the recordings that it was not fitted to']
    why = ': slow noise would explain it as well; repeat the recording' if suspect else ''
    return [f'these recordings do not call for it: evidence {fitted.evidence:.3g}, where 0 is the '
            f'threshold{why}']


def _evidence(fitted: EffectFit, diagnosis: Diagnosis) -> list[str]:
    if fitted.evidence > 0:
        return []
    first = diagnosis.effects[0]
    if first.name != fitted.request.name:
        return [f'it shows only beside {first.name}: adopt that first (evidence '
                f'{fitted.evidence:.3g} without it, where 0 is the threshold)']
    return [f'on {", ".join(fitted.drives or ("the structure",))} the evidence is '
            f'{fitted.evidence:.3g}, where 0 is the threshold']


def of_prediction(gain: PredictiveGain, before: Residuals, after: Residuals, model: ForceModel,
                  where: str) -> list[str]:
    """Return why an effect does not lower the error beyond its uncertainty; nothing if it does.

    Parameters
    ----------
    gain : PredictiveGain
        Of the model with the effect.
    before, after : Residuals
        Of the two models, for the sentence.
    model : ForceModel
        As given: more is asked where it has effects already.
    where : str
        What was predicted, for the sentence.
    """
    asked = FURTHER_ERRORS if any(
        isinstance(effect, CatalogueEffect) for effect in model.effects) else FIRST_ERRORS
    if gain.confirms(asked):
        return []
    if gain.losing:
        drive = min(gain.losing, key=lambda name: gain.by_drive[name])
        return [f'{word_change(drive, where, before, after)}, and is predicted worse by '
                f'{-gain.by_drive[drive]:.2g} standard errors']
    drive = max(gain.by_drive, key=lambda name: gain.by_drive[name])
    return [f'{word_change(drive, where, before, after)}; all drives are predicted better by '
            f'{gain.certainty:.2g} standard errors, must be more than {asked:g}']


def word_change(drive: str, where: str, before: Residuals, after: Residuals) -> str:
    """Return 'the error of DRIVE on WHERE falls from A to B', or that it does not fall."""
    given, found = (rms_by_drive(one)[drive] for one in (before, after))
    return f'the error of {drive} on {where} {change(given, found, before.units_of(drive).effort)}'


def of_identifiability(fitted: EffectFit) -> list[str]:
    """Return whether the recordings tell the parameters at all."""
    if fitted.own_share < OWN_SHARE:
        return [f'these recordings cannot tell {fitted.request.name} from what the model has: of '
                f'its square only {fitted.own_share:.1e} is its own']
    if fitted.nothing_left:
        return []  # that is what they tell
    effect = fitted.request.effect
    angles = {p.name for p in fitted.request.effect.parameters if p.is_angle}

    def is_angle(key: str) -> bool:
        return effect.place_and_parameter(key)[1] in angles

    told = {key: one for key, one in fitted.parameters.items()
            if not is_angle(key) and one.value != 0.0}
    vague = [key for key, one in told.items() if abs(one.value) < SURE * one.std]
    linear = {p.name for p in fitted.request.effect.linear or fitted.request.effect.shape}
    sizes = [key for key in told if effect.place_and_parameter(key)[1] in linear] or list(told)
    if sizes and all(key in vague for key in sizes):
        scales = {p.name: p.scale for p in effect.parameters}
        shown = '; '.join(f'{key} = ' + as_fitted(
            told[key].value, told[key].std, told[key].unit,
            scales[effect.place_and_parameter(key)[1]]) for key in sizes[:3])
        return [f'its parameters are not identifiable from these recordings: {shown}']
    return []


def of_physics(fitted: EffectFit, after: Residuals) -> list[str]:
    """Return whether friction would push, or a stiffness or inertia be negative."""
    bounds = {} if fitted.nothing_left else fitted.request.effect.unphysical_below
    low = {}
    for key, one in fitted.parameters.items():
        bound = bounds.get(fitted.request.effect.place_and_parameter(key)[1])
        if bound is not None and one.value + SURE * one.std < bound:
            low[key] = one
    if not low:
        return []
    first = next(iter(low))
    told = f'{first} would be {_with_interval(low[first])}'
    if not fitted.request.effect.is_friction:
        return [f'{told}, must not be negative']
    pushing = _pushing_drives(fitted.model, after)
    if fitted.drives is None:
        shares = pushing.get('', 0.0)
        return [] if shares < PUSHES else [
            f'{told}: with all friction of the model, the joints would give power back in '
            f'{shares:.0%} of the moving time']
    worst = {drive: pushing[drive] for drive in fitted.drives
             if pushing[drive] >= PUSHES and any(key.startswith(f'{drive}.') for key in low)}
    if not worst:
        return []
    drive = max(worst, key=lambda name: worst[name])
    return [f'{told}: with all friction of the model, friction on {drive} would push along the '
            f'motion in {worst[drive]:.0%} of the moving time']


def _pushing_drives(model: ForceModel, residuals: Residuals) -> dict[str, float]:
    """Return the share of the moving time with negative friction power, by drive; '' is all."""
    own = np.zeros(residuals.model.shape)
    passive = np.zeros(residuals.model.shape)
    for effect in model.effects:
        part = residuals.parts.get(effect.name)
        if part is None:
            continue
        if effect.name == ACTIVE_FRICTION:
            own += part
        elif effect.name == PASSIVE_FRICTION:
            passive += part
        elif (isinstance(effect, CatalogueEffect) and effect.unphysical_below
              and effect.is_friction):
            if isinstance(effect, DriveEffect):
                own += part
            else:
                passive += part
    velocity = residuals.variables['velocity']
    moving = np.abs(velocity) > MOVING * np.asarray(model.reversal.velocity)
    shares = {drive: _share(own[:, d] * velocity[:, d] < 0, moving[:, d])
              for d, drive in enumerate(residuals.drives)}
    power = ((own + passive) * velocity).sum(axis=1)
    return {**shares, '': _share(power < 0, np.any(moving, axis=1))}


def _share(true: Any, among: Any) -> float:
    count = int(among.sum())
    return float((true & among).sum()) / count if count else 0.0


def _with_interval(one: Estimate) -> str:
    return with_uncertainty(one.value, one.std, one.unit)
