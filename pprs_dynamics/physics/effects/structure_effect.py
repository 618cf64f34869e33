# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Effects on the tool, on links and in passive joints: one set of parameters each."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from math import inf
from typing import Any, ClassVar, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.effect import CatalogueEffect, Parameter, Product
from pprs_dynamics.physics.mechanism.description import Frame, body_at, inertial_in
from pprs_dynamics.physics.mechanism.state import BodyPlace, MechanismState, StructureLoad

# Linear parameters and variants of an effect at one place.
OfPlace = tuple[tuple[Parameter, ...], Sequence[tuple[str, ...]]]
AXES, MOMENTS, PRODUCTS = ('x', 'y', 'z'), ('xx', 'yy', 'zz'), ('xy', 'xz', 'yz')
OF_MOMENTS = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])  # places of MOMENTS and PRODUCTS
KEPT = 0.05  # of a body that cannot be taken off it
LARGEST = 1e3  # [kg]


class StructureEffect(CatalogueEffect):
    """An effect that is not in the drives.

    Parameters
    ----------
    values : mapping
        By name of the parameter.
    """

    # Where it acts on a robot: the name of each link or joint, and what a law has to know of it.
    places: ClassVar[tuple[Any, ...]] = ()

    def __init__(self, values: Mapping[str, float]) -> None:
        self.values = dict(values)
        self.exact = self.to_coefficients(self.values)

    @classmethod
    @cache
    def at_places(cls, places: tuple[Any, ...], alike: tuple[tuple[str, ...], ...] = (),
                  moved: float = inf) -> type[Self]:
        """Return the effect with its parameters at each place of a robot.

        Parameters
        ----------
        places : tuple of tuple
            A name, and what a law has to know of the place.
        alike : tuple of tuple of str
            Names of places at which the effect does the same; the first represents all.
        moved : float
            Mass of all that the robot moves [kg].
        """
        stand_ins = {name for group in alike for name in group[1:]}
        bodies = [cls.of_place(place, place[0] in stand_ins, moved) for place in places]
        return type(cls.__name__, (cls,), {
            'places': places, 'linear': tuple(p for linear, _ in bodies for p in linear),
            'variants': tuple(names for _, variants in bodies for names in variants),
            'alike': alike, '__module__': cls.__module__,
            'made_by': (cls.at_places, (places, alike, moved))})

    @classmethod
    def of_place(cls, place: Any, is_alike: bool, moved: float) -> OfPlace:
        """Return linear parameters and variants at a place; see `at_places`.

        Parameters
        ----------
        place : tuple
        is_alike : bool
            Whether an earlier place represents it.
        moved : float
            [kg]
        """
        return (), ()

    @classmethod
    def checked(cls, values: Mapping[str, Any], is_complete: bool = True,
                turning: Collection[str] = ()) -> Mapping[str, Any]:
        """Return the checked values by name of the parameter."""
        return cls._checked(f'effects.{cls.name}', values, is_complete)

    @classmethod
    def at(cls, coefficients: Mapping[str, float]) -> Self:
        """Return the effect with exactly these coefficients; those not given are zero.

        Parameters may not exist for them: a moment without a mass has no centre.
        """
        every = {c.name: float(coefficients.get(c.name, 0.0)) for c in cls.coefficients}
        effect = cls(cls.from_coefficients(every))
        effect.exact = every
        return effect


class BodyEffect(StructureEffect):
    """An effect on the rigid body: masses, gravity, forces on the bodies.

    It changes the loads of the guides and joints, too, and with them the friction that follows
    loads: the model applies it before it evaluates friction.
    """

    def changed(self, robot: Any) -> Any:
        """Return the robot, a `Robot` or a `Mechanism`, with the effect; by default as it was."""
        return robot

    def load(self, state: MechanismState) -> StructureLoad | None:
        """Return a load in addition to bodies and gravity, or None (default)."""
        return None

    def apply(self, state: MechanismState) -> Any:
        """Return the state with the effect in its bodies."""
        load, shape = self.load(state), (len(state.velocity), 6)
        if load is not None and load.wrench.shape != shape:
            raise ValueError(f'the wrench has shape {load.wrench.shape}, must be {shape}')
        return state.with_load(self.changed(state.robot), load)

    def force(self, state: MechanismState, memory: Any = None) -> Array:
        """Return the change of the rigid body's drive forces [N, N m], (N, D)."""
        added: Array = self.apply(state).rigid_force - state.rigid_force
        return added


def with_bodies(robot: Any, effects: Iterable[object]) -> Any:
    """Return a robot with what those of some effects that act on bodies make of it."""
    for effect in effects:
        if isinstance(effect, BodyEffect):
            robot = effect.changed(robot)
    return robot


class PassiveJointEffect(StructureEffect):
    """Friction in the passive joints: a force in addition to the rigid body's."""


def body_parameters(prefix: str, link: str, centre: tuple[float, ...], mass: float,
                    moved: float = inf) -> tuple[Parameter, ...]:
    """Return the parameters of a body on a link of some mass; `prefix` is before their names.

    Efforts are linear in the first moment about the link's centre, not in the body's place.
    `moved` is the mass of all that the mechanism moves, as which a body is usually no heavier:
    on a link that turns about a fixed axis a recording decides the first moment, not the mass.
    """
    return (
        Parameter(f'{prefix}mass', 'm_+', 'kg', f'added mass on {link}',
                  max(-(1 - KEPT) * mass, -LARGEST), LARGEST, 0.0 if prefix else None, scale=0.1,
                  expected=(moved, moved) if 0 < moved < inf else None),
        *(Parameter(f'{prefix}{axis}', f'c_{axis}', 'm', f'its centre along {axis} of {link}',
                    -1e2, 1e2, at, scale=0.05, product=Product(
                        Parameter(f'{prefix}moment_{axis}', f'm c_{axis}', 'kg m',
                                  f'first moment along {axis} of {link}', -1e3, 1e3, 0.0,
                                  scale=0.05), f'{prefix}mass', at))
          for axis, at in zip(AXES, centre, strict=True)),
        *(Parameter(f'{prefix}{axes}', f'I_{axes}', 'kg m^2', f'its inertia {axes} about its '
                    f'centre, in {link}', -1e4, 1e4, 0.0, scale=0.05)
          for axes in (*MOMENTS, *PRODUCTS)))


class AddedBody(BodyEffect):
    """Bodies more on links.

    Class attributes
    ----------------
    places : tuple of BodyPlace
    """

    places: ClassVar[tuple[BodyPlace, ...]] = ()
    idealised = False

    @classmethod
    def of_place(cls, place: BodyPlace, is_alike: bool, moved: float) -> OfPlace:
        """Return the parameters and variants of a body on a link.

        Of links that are alike the first represents all, with a body anywhere. With a mass more
        at its own centre each of them is a hypothesis of its own.
        """
        link, centre, weight, is_spread, _ = place
        prefix, count = cls.prefix_of(place), 1 if is_spread else None
        mass, moment = f'{prefix}mass', tuple(f'{prefix}moment_{axis}' for axis in AXES)
        variants: list[tuple[str, ...]] = [(mass,)]
        if not (is_alike or is_spread):
            variants.append((mass, *moment))
        if not (prefix or is_spread):
            variants += [(mass, *moment, *MOMENTS), (mass, *moment, *MOMENTS, *PRODUCTS)]
        return body_parameters(prefix, link, centre, weight, moved)[:count], variants

    @classmethod
    def moments_about_links(cls) -> dict[str, dict[str, float]]:
        """Return the first moments that a body adds to its link, about the link's frame.

        By name of a coefficient: weights of coefficients.
        """
        return {f'{prefix}moment_{axis}': {f'{prefix}moment_{axis}': 1.0, f'{prefix}mass': at}
                for prefix, centre in cls.bodies()
                for axis, at in zip(AXES, centre, strict=True)}

    @classmethod
    def prefix_of(cls, place: BodyPlace) -> str:
        """Return the prefix of the parameter names of a place."""
        return f'{place.link}.' if cls.is_of_one_place else ''

    @classmethod
    def bodies(cls) -> list[tuple[str, tuple[float, float, float]]]:
        """Return prefix and centre of the places at which a body has a centre and an inertia."""
        return [(cls.prefix_of(place), place.centre) for place in cls.places if not place.is_spread]

    @classmethod
    def around(cls, rows: Mapping[int, Array], coefficients: Mapping[str, float],
               ) -> dict[int, Array]:
        """Return columns by drive, exact for the bodies of some coefficients."""
        found = dict(rows)
        for prefix, _ in cls.bodies():
            if mass := coefficients.get(f'{prefix}mass', 0.0):
                away = np.array([coefficients.get(f'{prefix}moment_{axis}', 0.0) / mass
                                 for axis in AXES])
                found = {d: cls.rows_about(prefix, columns, away) for d, columns in found.items()}
        return found

    @classmethod
    def rows_about(cls, prefix: str, rows: Array, away: Array) -> Array:
        """Return the columns of a body's coefficients where its centre is elsewhere.

        Efforts are linear in mass, first moment and inertia, but the inertia of a body grows with
        the square of its distance: m [I(c)], homogeneous in m and m c. Its derivatives are
        therefore columns without a constant, exact for a body whose centre is at `away`.

        Parameters
        ----------
        prefix : str
            Of the place.
        rows : (k, ...) array
            By coefficient, for a body at the place's centre.
        away : (3,) array
            From that centre [m].
        """
        known = [c.name for c in cls.coefficients]
        turning = rows[[known.index(f'{prefix}{axes}') for axes in (*MOMENTS, *PRODUCTS)]]
        found = rows.copy()
        half = _turned(away, away)[OF_MOMENTS] / 2
        found[known.index(f'{prefix}mass')] -= np.tensordot(half, turning, 1)
        for k, axis in enumerate(AXES):
            found[known.index(f'{prefix}moment_{axis}')] += np.tensordot(
                _turned(away, np.eye(3)[k])[OF_MOMENTS], turning, 1)
        return found

    @classmethod
    def about_own_centre(cls, names: tuple[str, ...], coefficients: Array,
                         away: tuple[float, ...]) -> Array:
        """Return coefficients of a body whose columns are about another centre than its own.

        Parameters
        ----------
        names : tuple of str
            Of the coefficients that are fitted, its mass first.
        coefficients : (k,) array
            All of the effect.
        away : (3,) tuple
            Centre of its columns, from that of its place [m]; see `rows_about`.
        """
        prefix, known = names[0].removesuffix('mass'), [c.name for c in cls.coefficients]
        inertia = [known.index(f'{prefix}{axes}') for axes in (*MOMENTS, *PRODUCTS)]
        mass = coefficients[known.index(names[0])]
        found: Array = coefficients.copy()
        if mass and f'{prefix}xx' in names:
            moment = coefficients[[known.index(f'{prefix}moment_{axis}') for axis in AXES]]
            apart = moment / mass - np.array(away)
            found[inertia] -= mass * _turned(apart, apart)[OF_MOMENTS] / 2
        return found

    def changed(self, robot: Any) -> Any:
        """Return the robot with the bodies."""
        for place in self.places:
            prefix, link = self.prefix_of(place), place.link
            if place.is_spread:
                robot = robot.heavier(link, self.exact[f'{prefix}mass'])
                continue
            c = [self.exact[f'{prefix}{name}'] for name in (
                'mass', *(f'moment_{axis}' for axis in AXES), *MOMENTS, *PRODUCTS)]
            if not any(c):
                continue
            mass, moment = c[0], np.array(c[1:4])
            xx, yy, zz, xy, xz, yz = c[4:]
            if mass:  # of which the inertia is about its own centre
                body = body_at(mass, np.array(place.centre) + moment / mass,
                               np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
            else:  # what a body of some mass changes by where its centre does
                body = inertial_in(Frame(p=np.array(place.centre)), np.array(
                    [0.0, *moment, xx, xy, yy, xz, yz, zz]))
            robot = robot.with_body(link, body)
        return robot


def _turned(centre: Array, moment: Array) -> Array:
    """Return by how much an inertia about a point grows as a first moment is added, (3, 3)."""
    both = np.outer(centre, moment)
    grown: Array = 2 * np.trace(both) * np.eye(3) - both - both.T
    return grown
