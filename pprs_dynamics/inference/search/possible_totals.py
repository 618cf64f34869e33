# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fits in which no drive has less than no friction or inertia, the model's own included.

Where least squares leave that, the nearest numbers that can be, in the metric of the fit, take
their place (non-negative least squares), everything else is fitted beside them, and the deviance
rises by what that costs. Whether an effect stands where it can only be nothing is then a matter of
its cost, drive by drive.

References
----------
C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, chapter 23.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.candidates import CandidateSet, Component
from pprs_dynamics.physics.effects.laws.asymmetric_friction import (
    FORCES,
    VISCOUS,
    AsymmetricFriction,
)
from pprs_dynamics.physics.effects.laws.axis_friction import AxisFriction
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.force_model import RIGID_BODY
from pprs_dynamics.physics.three_pprs.active_friction import ActiveFriction

# Coefficients that add to what the model itself has in a drive, and of what.
INERTIA, VISCOUS_FRICTION, DRY_FRICTION = 'inertia', 'viscous friction', 'dry friction'
ADDS_TO = {(DriveInertia.name, 'mass'): INERTIA,
           (ViscousFriction.name, 'coefficient'): VISCOUS_FRICTION,
           (CoulombFriction.name, 'force'): DRY_FRICTION,
           **{(AsymmetricFriction.name, name): VISCOUS_FRICTION for name in VISCOUS},
           **{(AsymmetricFriction.name, name): DRY_FRICTION for name in FORCES}}
MASSES = ('masses.platform', 'masses.payload', 'masses.slides', 'masses.lifts', 'masses.rods')


def with_possible_totals(design: Design, regression: Regression, fit: JointFit,
                         blocks: Iterable[tuple[Component, Block]]) -> JointFit:
    """Return a fit whose effects leave every drive with at least no friction and no inertia.

    Parameters
    ----------
    design : Design
    regression : Regression
    fit : JointFit
    blocks : iterable of (Component, Block)
        The components of the fit with their columns.
    """
    index, least = [], []
    for component, block in blocks:
        for name, value in least_values(design, component, fit.of(block)).items():
            index.append(fit.places[block].start + component.names.index(name))
            least.append(value)
    at, bound = np.array(index, dtype=int), np.array(least)
    if not np.any(fit.coefficients[at] < bound):
        return fit
    from scipy.optimize import nnls  # here: commands start without it

    covariance = fit.covariance[np.ix_(at, at)]
    scale = np.sqrt(np.diag(covariance))
    root = np.linalg.inv(np.linalg.cholesky(covariance / np.outer(scale, scale)))
    beyond: Array = nnls(root, root @ ((fit.coefficients[at] - bound) / scale))[0]
    held = beyond == 0
    return regression.held(fit, at[held], bound[held])


def least_values(design: Design, component: Component, c: Array) -> dict[str, float]:
    """Return the least that coefficients may be, by name, of those that take anything away.

    Parameters
    ----------
    design : Design
    component : Component
    c : (k,) array
        Of its names, or more.
    """
    given = dict(zip((coefficient.name for coefficient in component.effect.coefficients),
                     component.given, strict=False))
    return {name: -_own_total(design, component.drive, ADDS_TO[component.effect.name, name])
            - given.get(name, 0.0) for name, value in zip(component.names, c, strict=False)
            if component.drive is not None and (component.effect.name, name) in ADDS_TO
            and value + given.get(name, 0.0) < 0}


def left_at_nothing(design: Design, fitted: CandidateSet, component: Component) -> tuple[str, ...]:
    """Return of what a set leaves nothing at all in a drive with a component of it."""
    c = fitted.coefficients(component)
    return tuple(ADDS_TO[component.effect.name, name]
                 for name, least in least_values(design, component, c).items()
                 if np.isclose(c[component.names.index(name)], least, rtol=1e-9, atol=0.0))


def _own_total(design: Design, drive: int, of: str) -> float:
    """Return what the given model itself has in a drive of inertia or friction."""
    if of == INERTIA:
        return _own_inertia(design, drive)
    friction = next((effect for effect in design.given.effects
                     if isinstance(effect, ActiveFriction | AxisFriction)), None)
    if friction is None:
        return 0.0
    if of == VISCOUS_FRICTION:
        return float(np.broadcast_to(friction.viscous, len(design.drives))[drive])
    usual = np.zeros(len(design.drives))
    if 'load' in design.residuals.variables:
        usual = np.median(np.abs(design.residuals.variables['load']), axis=0)
    return float(friction.dry(usual)[drive])


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
