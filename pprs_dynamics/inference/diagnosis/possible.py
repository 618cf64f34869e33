# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""What a fit may say of an effect and no machine can have: then it is no finding.

Inertia and friction that are negative together with what the model has, a base that leans as none
does, a gain that is another unit, and values whose interval holds nothing at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pprs_dynamics.inference.diagnosis.quantities import INTERVAL, with_uncertainty
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.search.decisions import Decisions
from pprs_dynamics.inference.search.estimates import Estimate
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.effects.laws.asymmetric_friction import AsymmetricFriction
from pprs_dynamics.physics.effects.laws.base_tilt import BaseTilt
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.effort_gain import EffortGain
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import RIGID_BODY

# Parameters that add to the model's own friction of a drive.
VISCOUS = {ViscousFriction.name: ('coefficient',),
           AsymmetricFriction.name: ('viscous_forward', 'viscous_backward')}
DRY = {CoulombFriction.name: ('force',),
       AsymmetricFriction.name: ('force_forward', 'force_backward')}

MASSES = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods')


def why_impossible(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate],
                   design: Design, decisions: Decisions) -> str:
    """Return why what a fit says of an effect cannot be, as a clause; '' where it can.

    Parameters
    ----------
    effect : type of CatalogueEffect
    parameters : mapping of str to Estimate
        By drive.parameter, or parameter.
    design : Design
        Of the model and the recordings.
    decisions : Decisions
    """
    return next(_reasons(effect, parameters, design, decisions), '')


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
    linear = {one.name for one in effect.linear}
    return {key: one for key, one in parameters.items()
            if effect.place_and_parameter(key)[1] in linear and one.value}


def _reasons(effect: type[CatalogueEffect], parameters: Mapping[str, Estimate], design: Design,
             decisions: Decisions) -> Iterator[str]:
    for key, one in _sizes(effect, parameters).items():
        drive, name = effect.place_and_parameter(key)
        at = f' of {drive}' if drive else ''
        if effect is EffortGain:
            factor = 1 + one.value
            if max(factor, 1 / factor if factor > 0 else np.inf) > decisions.most_gain:
                yield (f'the effort{at} would be measured {factor:.3g} times too large, which is '
                       'another unit or another drive constant, to be written into the model file')
        elif effect is BaseTilt and abs(one.value) > decisions.most_tilt:
            yield (f'a base that leans by {np.degrees(abs(one.value)):.3g} degrees was put up so: '
                   'gravity in the model file says how')
        elif drive in design.drives:
            yield from _negative(effect, name, drive, one, design)


def _negative(effect: type[CatalogueEffect], name: str, drive: str, one: Estimate,
              design: Design) -> Iterator[str]:
    """Yield where the model and an effect together have less than nothing, for certain."""
    d = design.drives.index(drive)
    if effect is DriveInertia:
        own, what = _own_inertia(design, d), 'inertia'
    elif name in VISCOUS.get(effect.name, ()):
        own, what = _own_viscous(design, d), 'viscous friction'
    elif name in DRY.get(effect.name, ()):
        own, what = _own_dry(design, d), 'dry friction'
    else:
        return
    if own + one.value + INTERVAL * one.std < 0:
        unit = design.residuals.units_of(drive)
        total = with_uncertainty(own + one.value, one.std, unit.of(one.unit))
        yield f'{drive} would have {what} of {total} with what the model has'


def _own_viscous(design: Design, drive: int) -> float:
    """Return the model's own viscous friction of a drive [N s/m, N m s/rad]."""
    friction = design.friction()
    return 0.0 if friction is None else float(
        np.broadcast_to(friction.viscous, len(design.drives))[drive])


def _own_dry(design: Design, drive: int) -> float:
    """Return the model's own dry friction of a drive, under its usual load [N, N m]."""
    friction, usual = design.friction(), np.zeros(len(design.drives))
    if 'load' in design.residuals.variables:
        usual = np.median(np.abs(design.residuals.variables['load']), axis=0)
    return 0.0 if friction is None else float(friction.dry(usual)[drive])


def _own_inertia(design: Design, drive: int) -> float:
    """Return the most that the model has of inertia, as one drive moves alone [kg, kg m^2]."""
    model = design.given
    if isinstance(model, DriveModel):  # at most all of its masses
        return float(sum(np.sum(model.values[key]) for key in MASSES))
    position = design.residuals.variables['position']
    still, pushed = np.zeros_like(position), np.zeros_like(position)
    pushed[:, drive] = 1.0
    moved, held = (model.drive_forces(JointMotion(position, still, one)).parts[RIGID_BODY]
                   for one in (pushed, still))
    return float(np.max((moved - held)[:, drive]))
