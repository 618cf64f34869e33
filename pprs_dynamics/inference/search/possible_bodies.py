# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Fits in which bodies that are added or taken away, and what is left, are bodies that can be.

A fit by least squares knows masses, moments and inertias as numbers, and noise makes impossible
bodies of them. Where it does, the possible body nearest in the metric of the fit takes its place,
everything else is fitted anew beside it, and the deviance rises by what that costs.

References
----------
P. M. Wensing, S. Kim, J.-J. E. Slotine, Linear matrix inequalities for physically consistent
inertial parameter identification, IEEE Robotics and Automation Letters 3 (2018).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.body_centres import reach_of
from pprs_dynamics.inference.search.candidates import Component
from pprs_dynamics.physics.effects.added_body import AXES, KEPT, MOMENTS, AddedBody
from pprs_dynamics.physics.effects.structure_effect import with_bodies
from pprs_dynamics.physics.mechanism.description import body_at, inertial_in, pseudo_inertia
from pprs_dynamics.physics.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from pprs_dynamics.physics.model.force_model import ForceModel

MARGIN = 1e-6  # of a body's size, by which it is possible: values are rounded
THIN = 1e-6  # of a body's largest second moment, which its least is taken to have
MOST_STEPS, MOST_HALVINGS = 40, 20
HEAVIEST = 1e9  # [kg, kg m, kg m^2]: beyond it nothing is a body
RADIUS, LEAST_MASS = 0.02, 1e-6  # [m, kg], of a small ball, and of a body that is any
DOUBTED = 2.0  # deviations, within which it may be added or taken away
POINT = {'mass', *(f'moment_{axis}' for axis in AXES)}  # what makes a body without extent


def with_possible_bodies(model: ForceModel, regression: Regression, fit: JointFit,
                         bodies: dict[Component, Block]) -> JointFit | None:
    """Return a fit whose bodies can be; None where none can.

    Parameters
    ----------
    model : ForceModel
        As given.
    regression : Regression
    fit : JointFit
    bodies : dict of Component to Block
        Columns of the components of the fit that add a body.
    """
    for component, block in bodies.items():
        place = fit.places[block]
        # What is changed of a body that the model has is none: all of it has to be one.
        there = [effect for effect in model.effects
                 if not (component.given and effect.name == component.effect.name)]
        before = given_body(component)
        robot = with_bodies(model.robot, there)
        found = nearest_possible(robot, component, before + fit.of(block),
                                 fit.covariance[place, place])
        if found is None:
            return None
        found = found - before
        if not np.allclose(found, fit.of(block), rtol=1e-12, atol=0.0):
            fit = regression.held(fit, fit.index_of([block]), found)
    return fit


def given_body(component: Component) -> Array:
    """Return what the given model has of a component's coefficients, (k,)."""
    known = dict(zip((c.name for c in component.effect.coefficients), component.given,
                     strict=False))
    return np.array([known.get(name, 0.0) for name in component.names])


def nearest_possible(robot: Mechanism, component: Component, c: Array, covariance: Array,
                     ) -> Array | None:
    """Return the coefficients nearest to some with which all bodies can be; None for none.

    Parameters
    ----------
    robot : Mechanism
        To which a body is added.
    component : Component
        Of an `AddedBody`.
    c : (k,) array
    covariance : (k, k) array
        Of their fit, which says what is near.
    """
    sign = 1.0 if c[0] >= 0 else -1.0
    found = _nearest(robot, component, c, covariance, sign)
    if found is c or abs(c[0]) > DOUBTED * covariance[0, 0] ** 0.5:
        return found
    other = _nearest(robot, component, c, covariance, -sign)
    known = [one for one in (found, other) if one is not None]
    return min(known, key=lambda one: float(
        (one - c) @ np.linalg.solve(covariance, one - c)), default=None)


def _nearest(robot: Mechanism, component: Component, c: Array, covariance: Array, sign: float,
             ) -> Array | None:
    """Return the same for a body that is added (1), or taken away (-1)."""
    margins = _margins(robot, component, sign)
    if np.all(margins(c) >= 0):
        return c
    root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
    # From a small ball of about the fitted weight, as heavy as may be.
    ball = [name.rpartition('.')[2] in MOMENTS for name in component.names]
    start = np.where(ball, RADIUS ** 2, 0.0)
    start[0] = 1.0
    start *= sign * max(abs(c[0]), float(root[0, 0]))
    for _ in range(MOST_HALVINGS):
        if np.all(margins(start) >= 0):
            break
        start /= 2
    else:
        return None

    from scipy.optimize import NonlinearConstraint, minimize  # here: commands start without it

    impossible = np.full(len(margins(start)), -1.0)

    def distance(u: Array) -> float:
        return float(u @ u)

    def is_body(values: Array) -> bool:
        return bool(np.max(np.abs(values)) < HEAVIEST)  # which NaN is not

    def possible(u: Array) -> Array:
        values: Array = c + root @ u
        return margins(values) if is_body(values) else impossible

    u = minimize(distance, np.linalg.solve(root, start - c), method='SLSQP',
                 constraints=NonlinearConstraint(possible, 0.0, np.inf),
                 options={'maxiter': MOST_STEPS}).x
    # Steps run away where a body weighs next to nothing, or the fit says nothing of it.
    found: Array = c + root @ u
    if not is_body(found):
        found = start
    # What rounding leaves outside is brought back towards the ball.
    for share in (0.0, 1e-6, 1e-4, 1e-2, 0.1, 0.3, 1.0):
        within: Array = found + share * (start - found)
        if np.all(margins(within) >= -MARGIN / 2):
            return within
    return None


def _margins(robot: Mechanism, component: Component, sign: float) -> Callable[[Array], Array]:
    """Return what tells by how much bodies can be: at least 0 where they can, of order 1."""
    kind = component.effect
    assert issubclass(kind, AddedBody)
    names = [name.rpartition('.') for name in component.names]
    prefix, has_extent = ''.join(names[0][:2]), not {last for _, _, last in names} <= POINT
    link, centre = next((link, np.array(centre)) for before, link, centre, *_ in kind.places
                        if before == prefix)
    row, frame = robot.structure.links[link]
    values, axes = np.linalg.eigh(pseudo_inertia(robot.by_joint[row]))
    scaled = axes / np.sqrt(np.maximum(values, THIN * values[-1]))
    order = [name for _, _, name in names]
    tensor = [order.index(name) if name in order else -1
              for name in ('xx', 'xy', 'xz', 'xy', 'yy', 'yz', 'xz', 'yz', 'zz')]

    def margins(c: Array) -> Array:
        padded = np.append(c, 0.0)
        mass = c[0] if sign * c[0] > 0 else sign * LEAST_MASS  # else it is infinitely far away
        away = c[1:4] / mass if len(c) > 1 else np.zeros(3)
        inertia = padded[tensor].reshape(3, 3)
        found = [np.array([sign * c[0] / LEAST_MASS - 1,
                           1 - float(np.linalg.norm(away)) / reach_of(robot)])]
        if has_extent:
            about = sign * (np.trace(inertia) / 2 * np.eye(3) - inertia)
            extent = np.asarray(np.linalg.eigvalsh(about), dtype=float)
            found.append(extent / max(float(np.abs(extent).sum()), 1e-12) - MARGIN)
        if sign < 0:
            # What is left keeps a share of the body in every direction.
            body = inertial_in(frame, body_at(mass, tuple(centre + away), inertia))
            taken = scaled.T @ pseudo_inertia(body) @ scaled
            found.append(np.asarray(np.linalg.eigvalsh(taken), dtype=float) + 1 - KEPT)
        return np.concatenate(found)
    return margins
