# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Constraints on the coefficients of a set: linear inequalities, solved at once.

- Each parameter is within the bounds of its effect.
- No drive has less than no inertia, viscous, dry or load friction, the model's own included, in any
  state: cold or warm, creeping, after a reversal or driven back. No gear loses less where its motor
  drives than where the load does.
- An added body is a body, and a link from which one is taken away remains one.

Inequalities of the first two kinds are linear. Possible bodies form a convex set, which tangent
planes enclose (Wensing et al.).

References
----------
P. M. Wensing, S. Kim, J.-J. E. Slotine, Linear matrix inequalities for physically consistent
inertial parameter identification, IEEE Robotics and Automation Letters 3 (2018).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from pprs_dynamics.arrays import Array, Integers
from pprs_dynamics.inference.regression.base_columns import units_of
from pprs_dynamics.inference.regression.constrained import Constrained, Inequalities, nearest
from pprs_dynamics.inference.regression.design import Design
from pprs_dynamics.inference.regression.joint_fit import JointFit, Regression
from pprs_dynamics.inference.regression.normal_equations import Block
from pprs_dynamics.inference.search.body_centres import REACH, reach_of
from pprs_dynamics.inference.search.candidates import Component
from pprs_dynamics.physics.effects.catalogue import catalogue
from pprs_dynamics.physics.effects.laws.asymmetric_friction import (
    FORCES,
    VISCOUS,
    AsymmetricFriction,
)
from pprs_dynamics.physics.effects.laws.coulomb_friction import CoulombFriction
from pprs_dynamics.physics.effects.laws.drive_inertia import DriveInertia
from pprs_dynamics.physics.effects.laws.friction_drift import FrictionDrift
from pprs_dynamics.physics.effects.laws.gear_efficiency import GearEfficiency
from pprs_dynamics.physics.effects.laws.hysteresis import Hysteresis
from pprs_dynamics.physics.effects.laws.load_friction import LoadFriction
from pprs_dynamics.physics.effects.laws.stribeck_friction import StribeckFriction
from pprs_dynamics.physics.effects.laws.viscous_friction import ViscousFriction
from pprs_dynamics.physics.effects.structure_effect import (
    KEPT,
    MOMENTS,
    PRODUCTS,
    AddedBody,
    with_bodies,
)
from pprs_dynamics.physics.mechanism.description import Frame, pseudo_inertia
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.model.forces import RIGID_BODY

if TYPE_CHECKING:
    from pprs_dynamics.physics.mechanism.mechanism import Mechanism

# What coefficients add to in a drive: its inertia, or its friction in some directions.
INERTIA, VISCOUS_FRICTION, DRY_FRICTION = 'inertia', 'viscous friction', 'dry friction'
LOAD_FRICTION = 'friction coefficient'
FORWARD, BACKWARD = 'forward', 'backward'
BOTH = (FORWARD, BACKWARD)
Total = tuple[str, str]  # of what, in which direction
ADDS_TO: Mapping[tuple[str, str], tuple[Total, ...]] = {
    (DriveInertia.name, 'mass'): ((INERTIA, ''),),
    (ViscousFriction.name, 'coefficient'): tuple((VISCOUS_FRICTION, way) for way in BOTH),
    (LoadFriction.name, 'coefficient'): ((LOAD_FRICTION, ''),),
    (CoulombFriction.name, 'force'): tuple((DRY_FRICTION, way) for way in BOTH),
    **{(AsymmetricFriction.name, name): ((VISCOUS_FRICTION, way),)
       for name, way in zip(VISCOUS, BOTH, strict=True)},
    **{(AsymmetricFriction.name, name): ((DRY_FRICTION, way),)
       for name, way in zip(FORCES, BOTH, strict=True)}}
# Friction of some states: of what it is a part there, and the coefficient whose column has the
# largest share. What builds up after a reversal is then lacking.
IN_SOME_STATES: Mapping[tuple[str, str], tuple[str, str, float]] = {
    (StribeckFriction.name, 'force'): (DRY_FRICTION, 'force', 1.0),
    (StribeckFriction.name, 'coefficient'): (LOAD_FRICTION, 'force', 1.0),
    (FrictionDrift.name, 'force'): (DRY_FRICTION, 'force', 1.0),
    (FrictionDrift.name, 'worked'): (DRY_FRICTION, 'worked', 1.0),
    (FrictionDrift.name, 'thinned'): (VISCOUS_FRICTION, 'worked', 1.0),
    (GearEfficiency.name, 'driven_back'): (DRY_FRICTION, 'driven_back', 1.0),
    (Hysteresis.name, 'force'): (DRY_FRICTION, 'force', -0.5),
    (Hysteresis.name, 'coefficient'): (LOAD_FRICTION, 'force', -0.5)}

# Of a body's size: how far inside the set of possible bodies a plane is, so that few planes
# suffice; and what rounding may violate.
MARGIN, ROUNDING = 1e-3, 1e-9
NEAR = 0.3  # radius of gyration of a small body, of the distance between joints
THIN = 1e-6  # of a link's largest second moment, which its least is taken to have
LEAST_MASS = 1e-6  # [kg] of a body
TENSOR = 'xx', 'xy', 'yy', 'xz', 'yz', 'zz'  # of inertial parameters, from the fifth on
DOUBTED = 2.0  # standard deviations of a mass within which it may be added or taken away


class Constraints:
    """Constraints on the coefficients of the effects of a design.

    Parameters
    ----------
    design : Design
    """

    def __init__(self, design: Design) -> None:
        self.design = design
        self._bounds: dict[Component, Array] = {}
        self._totals: dict[tuple[int, Total], float] = {}
        self._shares: dict[Hashable, float] = {}
        self._planes: dict[tuple[Component, float], BodyPlanes] = {}

    def applied(self, regression: Regression, fit: JointFit, blocks: Mapping[Component, Block],
                ) -> JointFit | None:
        """Return a fit moved to the nearest possible coefficients; None where none are possible.

        The fit itself where its coefficients are possible. The noise does not change, so that it
        cannot absorb an impossible value.

        Parameters
        ----------
        regression : Regression
        fit : JointFit
        blocks : mapping of Component to Block
            Columns of its effects.
        """
        places, index = _places(fit, blocks)
        if not len(index):
            return fit
        found = self._nearest(places, fit.coefficients[index],
                              fit.covariance[np.ix_(index, index)])
        if found is None:
            return None
        return regression.conditioned(fit, index, found.active) if len(found.active.b) else fit

    def refused(self, free: JointFit, fit: JointFit, blocks: Mapping[Component, Block],
                sure: float) -> list[Component]:
        """Return the components that no machine has in the values that fit best.

        Where a coefficient is 0 at its limit, nothing is claimed that could be refused.

        Parameters
        ----------
        free, fit : JointFit
            Without the constraints and with them.
        blocks : mapping of Component to Block
            Columns of its effects.
        sure : float
            Standard deviations by which a free value must be beyond a limit.
        """
        places, index = _places(free, blocks)
        if not len(index):
            return []
        limits, covariance = self._linear(places, len(index)), free.covariance[np.ix_(index, index)]
        short = limits.b - limits.A @ free.coefficients[index]
        std = np.sqrt(np.sum(limits.A @ covariance * limits.A, axis=1))
        claimed = np.abs(fit.coefficients[index]) > ROUNDING * np.sqrt(np.diag(covariance))
        beyond = np.any(limits.A[short > sure * std] * claimed, axis=0)
        return [component for component, place in places.items() if np.any(beyond[place])]

    def _nearest(self, places: Mapping[Component, slice], mean: Array, covariance: Array,
                 ) -> Constrained | None:
        """Return the nearest possible coefficients, for each sign that a doubtful mass may have."""
        linear = self._linear(places, len(mean))
        bodies = [component for component in places if issubclass(component.effect, AddedBody)
                  and component.effect.bodies()]
        signs = []
        for component in bodies:
            at = places[component].start
            mass = mean[at] + _given(component)[0]
            sign = 1.0 if mass >= 0 else -1.0
            doubted = abs(mass) < DOUBTED * covariance[at, at] ** 0.5
            signs.append((sign, -sign) if doubted else (sign,))
        best: Constrained | None = None
        for choice in product(*signs):
            sets = [(places[component], _given(component), self._planes_of(component, sign))
                    for component, sign in zip(bodies, choice, strict=True)]

            def planes(c: Array, sets: list[tuple[slice, Array, BodyPlanes]] = sets,
                       ) -> Inequalities:
                found = Inequalities.none(len(c))
                for place, given, of_body in sets:
                    more = of_body(c[place] + given)
                    A = np.zeros((len(more.b), len(c)))
                    A[:, place] = more.A
                    found = found.and_also(Inequalities(A, more.b - more.A @ given))
                return found
            best = nearest(mean, covariance, linear, planes, best.rise if best else np.inf) or best
        return best

    def _planes_of(self, component: Component, sign: float) -> BodyPlanes:
        key = (component, sign)
        if key not in self._planes:
            # What is changed of a body of the input model is no body: all of it has to be one.
            robot = with_bodies(self.design.given.robot, [
                effect for effect in self.design.given.effects
                if not (component.given and effect.name == component.effect.name)])
            self._planes[key] = body_planes(robot, component, sign)
        return self._planes[key]

    def _linear(self, places: Mapping[Component, slice], size: int) -> Inequalities:
        """Return the bounds of parameters and of the totals of every drive."""
        unit = np.eye(size)
        bounds = np.concatenate([self._bounds_of(component) for component in places], axis=1)
        rows, least = [unit, -unit], [bounds[0], -bounds[1]]
        totals: dict[tuple[int, Total], tuple[Array, float]] = {}
        in_states: list[tuple[int, Total, Array, float]] = []
        for component, place in places.items():
            given = _given(component)
            for more, less in component.effect.at_least.items():
                if {more, less} <= {*component.names}:
                    order = np.zeros(len(component.names))
                    order[[component.names.index(key) for key in (more, less)]] = 1.0, -1.0
                    rows.append(order[None] @ unit[place])
                    least.append(-order[None] @ given)
            if (d := component.drive) is None:
                continue
            for k, name in enumerate(component.names):
                for total in ADDS_TO.get((component.effect.name, name), ()):
                    row, own = totals.get((d, total), (np.zeros(size), self.own(d, total)))
                    totals[d, total] = (row + unit[place.start + k], own)
                if (component.effect.name, name) in IN_SOME_STATES:
                    of, column, sign = IN_SOME_STATES[component.effect.name, name]
                    share = sign * self._largest(component, column)
                    in_states += [(d, (of, way), share * unit[place.start + k], share * given[k])
                                  for way in (('',) if of == LOAD_FRICTION else BOTH)]
        for d, of_state, part, there in in_states:
            row, own = totals.get((d, of_state), (np.zeros(size), self.own(d, of_state)))
            rows.append((row + part)[None])
            least.append(np.array([-own - there]))
        for row, own in totals.values():
            rows.append(row[None])
            least.append(np.array([-own]))
        b = np.concatenate(least)
        finite = np.isfinite(b)
        return Inequalities(np.concatenate(rows)[finite], b[finite])

    def _bounds_of(self, component: Component) -> Array:
        """Return the least and largest of each coefficient minus the input model's, (2, k)."""
        if component not in self._bounds:
            turns = units_of(self.design.given, component.drive).turns
            kinds = {p.name: p.of(turns) for p in (*component.effect.coefficients,
                                                   *component.effect.linear)}
            bounds = np.array([(kinds[name].lower, kinds[name].upper)
                               for name in component.names]).T
            if issubclass(component.effect, AddedBody) and not component.effect.bodies():
                robot, (place,) = self.design.given.robot, component.effect.places
                rows = [robot.structure.links[link][0] for link in place.links or (place.link,)]
                bounds[0] = np.maximum(bounds[0], -(1 - KEPT) * robot.by_joint[rows, 0].min())
            self._bounds[component] = bounds - _given(component)
        return self._bounds[component]

    def _largest(self, component: Component, name: str) -> float:
        """Return the largest size of a column of an effect on a drive in the recordings."""
        key = component.effect, component.drive, component.shape, name
        if key not in self._shares:
            term = self.design.find_term(component.effect, component.drive, component.parameters)
            self._shares[key] = float(np.abs(
                term.rows[component.drive or 0][term.names.index(name)]).max())
        return self._shares[key]

    def own(self, drive: int, total: Total) -> float:
        """Return the inertia or friction that the input model has in a drive."""
        if (drive, total) not in self._totals:
            friction, variables = self.design.given.friction, self.design.residuals.variables
            if total[0] == INERTIA:
                own = _own_inertia(self.design, drive)
            elif total[0] == DRY_FRICTION:
                load = variables.get('load', np.zeros((1, len(self.design.drives))))
                own = float(friction.dry(np.median(np.abs(load), axis=0))[drive])
            else:
                of_each = (friction.viscous if total[0] == VISCOUS_FRICTION
                           else friction.coefficient)
                own = float(of_each[drive])
            for (name, coefficient), totals in ADDS_TO.items():
                effect = catalogue()[name]
                if total in totals and (values := self.design.present(effect, drive)):
                    own += effect.to_coefficients(values)[coefficient]
            self._totals[drive, total] = own
        return self._totals[drive, total]


def _places(fit: JointFit, blocks: Mapping[Component, Block],
            ) -> tuple[dict[Component, slice], Integers]:
    """Return the places of components among all their coefficients, and of these in a fit."""
    places, index = dict[Component, slice](), list[int]()
    for component, block in blocks.items():
        if count := len(component.names):
            start = fit.places[block].start
            places[component] = slice(len(index), len(index) + count)
            index += range(start, start + count)
    return places, np.array(index, dtype=int)


def _given(component: Component) -> Array:
    """Return the input model's values of a component's coefficients, (k,)."""
    known = dict(zip((c.name for c in component.effect.coefficients), component.given,
                     strict=False))
    return np.array([known.get(name, 0.0) for name in component.names])


def _own_inertia(design: Design, drive: int) -> float:
    """Return the largest inertia of a drive that moves alone [kg, kg m^2]."""
    model = design.given
    position = design.residuals.variables['position']
    still, pushed = np.zeros_like(position), np.zeros_like(position)
    pushed[:, drive] = 1.0
    moved, at_rest = (model.drive_forces(JointMotion(position, still, acceleration)).parts[
        RIGID_BODY] for acceleration in (pushed, still))
    return float(np.max((moved - at_rest)[:, drive]))


BodyPlanes = Callable[[Array], Inequalities]


def body_planes(robot: Mechanism, component: Component, sign: float) -> BodyPlanes:
    """Return a function from coefficients (k,) to the inequalities of a body that they violate.

    Parameters
    ----------
    robot : Mechanism
        To which the body is added.
    component : Component
        Of an `AddedBody`: mass, and perhaps first moment and inertia about the centre.
    sign : {1, -1}
        Added, or taken away.

    Notes
    -----
    With m the mass, h the first moment and S the second moments about the centre of what is added
    or taken away, m > 0, ||h|| <= m reach, and S is positive semidefinite. These are convex. What
    is taken away, S + h h^T / m, is convex in (m, h, S) as well, so that a link that retains a
    share in every direction is a convex constraint.
    """
    kind = component.effect
    assert issubclass(kind, AddedBody)
    names = [name.rpartition('.') for name in component.names]
    prefix, count = ''.join(names[0][:2]), len(names)
    link, centre = next((place.link, np.array(place.centre)) for place in kind.places
                        if kind.prefix_of(place) == prefix)
    reach, usual = reach_of(robot), float(np.abs(robot.inertial[:, 0]).mean())
    gyration = NEAR * reach / REACH
    order = [name for _, _, name in names]
    extended = [order.index(name) for name in (*MOMENTS, *PRODUCTS) if name in order]
    # Second moments tr(I) / 2 - I about the centre of mass per coefficient, (k, 3, 3).
    unit = np.eye(count)
    per_unit = np.zeros((count, 3, 3))
    for k in extended:
        per_unit[k] = pseudo_inertia(np.eye(10)[4 + TENSOR.index(order[k])])[:3, :3]
    row, frame = robot.structure.links[link]
    values, axes = np.linalg.eigh(pseudo_inertia(robot.by_joint[row]))
    placed = (frame @ Frame(p=centre)).matrix
    scaled = placed.T @ axes / np.sqrt(np.maximum(values, THIN * values[-1]))

    def violated(c: Array) -> Iterator[tuple[Array, float]]:
        if not sign * c[0] >= LEAST_MASS / 2:
            yield sign * unit[0], LEAST_MASS
        moment = np.linalg.norm(c[1:4])
        if count > 1 and moment > (1 + ROUNDING) * reach * max(sign * c[0], LEAST_MASS / 2):
            yield ((1 - MARGIN) * reach * sign * unit[0]
                   - np.concatenate(([0.0], c[1:4] / moment, np.zeros(count - 4)))), 0.0
        if extended:
            extents, directions = np.linalg.eigh(sign * np.tensordot(c, per_unit, 1))
            size = max(float(np.abs(extents).sum()), max(abs(c[0]), usual) * gyration ** 2)
            for extent, v in zip(extents, directions.T, strict=True):
                if extent < -ROUNDING * size:
                    # In proportion to the mass: any point of the plane may be a small body.
                    yield sign * (per_unit @ v @ v - MARGIN * gyration ** 2 * unit[0]), 0.0

    def taken(c: Array) -> Iterator[tuple[Array, float]]:
        """Yield planes of directions of the link of which too large a share would be taken."""
        h = c[1:4] if count > 1 else np.zeros(3)
        P = np.block([[np.tensordot(c, per_unit, 1) + np.outer(h, h) / c[0], h[:, None]],
                      [h, c[0]]])
        shares, directions = np.linalg.eigh(-scaled.T @ P @ scaled)
        for share, v in zip(shares, directions.T, strict=True):
            if share > 1 - KEPT + ROUNDING:
                # The share -(w' S w + (m w_4 + h' w)^2 / m) is homogeneous in (m, h, S).
                *w, w_4 = scaled @ v
                mean = w_4 + h @ w / c[0]
                slope = per_unit @ w @ w + mean * (2 * w_4 - mean) * unit[0]
                slope[1:4] += 2 * mean * np.array(w[:min(3, count - 1)])
                yield slope, -(1 - KEPT - MARGIN)

    def planes(c: Array) -> Inequalities:
        found = list(violated(c)) or (list(taken(c)) if sign < 0 else [])
        if not found:
            return Inequalities.none(count)
        return Inequalities(*map(np.array, zip(*found, strict=True)))
    return planes
