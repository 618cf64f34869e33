# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Acceptance checks of an adoption: held-out error, evidence, rivals, bounds; each a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from pprs_dynamics.inference.adoption.fit_effect import EffectFit
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.diagnosis.quantities import change
from pprs_dynamics.inference.residuals.residuals import Residuals, rms_by_drive
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.held_out import PredictiveGain
from pprs_dynamics.physics.effects.drive_effect import DriveEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.forces import ACTIVE_FRICTION, PASSIVE_FRICTION

MOVING = 5.0  # widths in which friction turns over
PUSHES = 0.1  # of the moving time, in which a drive's friction may give power back
# Standard errors by which the first effect, and further ones, must gain.
FIRST_ERRORS, FURTHER_ERRORS = 1.0, 2.0


def of_other_effects(request: EffectRequest, fitted: EffectFit, diagnosis: Diagnosis) -> list[str]:
    """Return why the diagnosis does not report this effect where it was asked for.

    A rival within the margin of the diagnosis is no reason: the recordings cannot separate it from
    the reported effect.
    """
    mine = next((one for one in diagnosis.effects if one.name == request.name), None)
    if mine is not None and mine.course is not None:
        return [f'it is there{mine.when}, and a model has it throughout: record the machine as it '
                'is now']
    missed = [] if mine is None or not mine.drives else [
        drive for drive in fitted.drives or () if drive not in mine.drives]
    if mine is not None and missed:
        return [f'the recordings show {request.name} on {", ".join(mine.drives or ())}, not on '
                f'{", ".join(missed)}']
    if fitted.evidence > 0 and (mine is not None or is_rival(request, fitted, diagnosis)):
        return []
    if diagnosis.effects and fitted.evidence <= 0 and diagnosis.effects[0] is not mine and mine:
        return [f'it shows only beside {diagnosis.effects[0].name}: adopt that first (evidence '
                f'{fitted.evidence:.3g} without it, where 0 is the threshold)']
    if diagnosis.effects and mine is None:
        best = diagnosis.effects[0]
        on = f' on {", ".join(best.drives)}' if best.drives else ''
        return [f'{best.name}{on} explains these recordings better: evidence '
                f'{_evidence_alone(best.name, diagnosis):.5g} against {fitted.evidence:.5g}']
    if mine is None and diagnosis.depends_on:
        return [f'no effect of the catalogue has the form of the error: '
                f'{diagnosis.depends_on[0].text}']
    if request.present(fitted.plain):
        return [f'{request.name} is in the model already, and these recordings call for no other '
                f'numbers: evidence {fitted.evidence:.3g}, where 0 is the threshold']
    return [f'these recordings do not call for {request.name}: evidence {fitted.evidence:.3g}, '
            'where 0 is the threshold']


def is_rival(request: EffectRequest, fitted: EffectFit, diagnosis: Diagnosis) -> bool:
    """Return whether an effect explains the recordings as well as the first reported one."""
    if not diagnosis.effects:
        return False
    return any(request.name in names for names in diagnosis.indistinguishable) or (
        fitted.evidence > _evidence_alone(diagnosis.effects[0].name, diagnosis)
        - diagnosis.decisions.rival_margin)


def _evidence_alone(name: str, diagnosis: Diagnosis) -> float:
    """Return the evidence for a reported effect as the only one."""
    return next((one.evidence for one in diagnosis.candidates if one.name == name),
                next(one.evidence for one in diagnosis.effects if one.name == name))


def of_prediction(gain: PredictiveGain, before: Residuals, after: Residuals, model: DriveModel,
                  where: str) -> list[str]:
    """Return why an effect does not lower the error beyond its uncertainty; nothing if it does.

    Parameters
    ----------
    gain : PredictiveGain
        Of the model with the effect.
    before, after : Residuals
        Of the two models, for the sentence.
    model : DriveModel
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


def of_constraints(fitted: EffectFit, after: Residuals, decisions: Decisions) -> list[str]:
    """Return whether the recordings call for values that no machine has."""
    if fitted.nothing_left:
        return []
    cost = fitted.fitted.terms.feasibility
    if cost > decisions.rival_margin:
        return [f'the recordings call for values of {fitted.request.name} that no machine has: '
                f'possible values cost {cost:.3g} more']
    if not fitted.request.effect.is_friction:
        return []
    shares = _pushing(fitted.model, after)
    places = fitted.drives or ('',)
    worst = max(places, key=lambda place: shares[place])
    where = f'friction on {worst} would push along the motion' if worst else (
        'the joints would give power back')
    return [] if shares[worst] < PUSHES else [
        f'with {fitted.request.name}, {where} in {shares[worst]:.0%} of the moving time']


def _pushing(model: DriveModel, residuals: Residuals) -> dict[str, float]:
    """Return the share of the moving time with negative friction power, by drive; '' is all."""
    own, passive = np.zeros((2, *residuals.model.shape))
    for effect in model.effects:
        if effect.name not in residuals.parts:
            continue
        is_friction = isinstance(effect, CatalogueEffect) and effect.is_friction
        if effect.name == ACTIVE_FRICTION or (is_friction and isinstance(effect, DriveEffect)):
            own += residuals.parts[effect.name]
        elif effect.name == PASSIVE_FRICTION or is_friction:
            passive += residuals.parts[effect.name]
    velocity = residuals.variables['velocity']
    moving = np.abs(velocity) > MOVING * np.asarray(model.reversal.velocity)
    shares = {drive: _share(own[:, d] * velocity[:, d] < 0, moving[:, d])
              for d, drive in enumerate(residuals.drives)}
    power = ((own + passive) * velocity).sum(axis=1)
    return {**shares, '': _share(power < 0, np.any(moving, axis=1))}


def _share(true: Any, among: Any) -> float:
    count = int(among.sum())
    return float((true & among).sum()) / count if count else 0.0
