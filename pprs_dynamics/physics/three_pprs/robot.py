# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The 3-PPRS with its geometry and bodies, evaluated by the paper's closed form."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import COUNT, DRIVES
from pprs_dynamics.errors import ModelError, SingularityError, WorkspaceError
from pprs_dynamics.physics.mechanism import tree_equations as tree
from pprs_dynamics.physics.mechanism.description import (
    FLOATING,
    PARAMETERS,
    PRISMATIC,
    REVOLUTE,
    Description,
    Frame,
    Joint,
    Loop,
    about_centre,
    body_at,
)
from pprs_dynamics.physics.mechanism.evaluation import row_of, run
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.link_motion import LinkMotion
from pprs_dynamics.physics.mechanism.mechanism import Mechanism
from pprs_dynamics.physics.mechanism.motion import WIDTHS, PlatformMotion
from pprs_dynamics.physics.mechanism.state import (
    PLATFORM,
    BodyPlace,
    MechanismState,
    PassiveJoint,
    StructureLoad,
)
from pprs_dynamics.physics.mechanism.structure import Structure, build_structure
from pprs_dynamics.physics.mechanism.tree_equations import Integers, JointFriction
from pprs_dynamics.physics.mechanism.vectors import Vector
from pprs_dynamics.physics.three_pprs import closed_form

HOME_HEIGHT = 0.5  # [m], of the platform at home
SPHERICAL = 'spherical'  # the joints A_i; C_i are REVOLUTE
HINGES, BALLS, RODS = (tuple(f'{part}_{n}' for n in (1, 2, 3)) for part in ('hinge', 'ball', 'rod'))
PLACE, TURNS = np.s_[3:6], np.s_[6:9]  # in coordinates, see `closed_form`
NOT_WANTED = np.empty((0, closed_form.COORDINATES))
LINKS = (*DRIVES, *RODS, PLATFORM)  # that move, in the order of `ThreePprs.inertial`
OF_RODS = np.s_[6:9]  # in `LINKS`
ALIKE = {REVOLUTE: HINGES, SPHERICAL: BALLS}  # of the tree
# The condition number of a long trajectory is computed at this many samples, evenly spread:
# neighbours hardly differ, and a singular value decomposition costs more than the model.
MOST_CONDITIONS = 64


@dataclass(frozen=True)
class Geometry:
    """Lengths and angles of the mechanism.

    Parameters
    ----------
    base_radius, platform_radius, rod_length : float
        R, r and l [m].
    chain_angles, platform_angles : 3 floats
        delta_i on the base and delta'_i on the platform [rad].
    elbow : {'up', 'down'}
        Branch of the inverse kinematics: 'up' has sin u_i > 0, the carriage below the platform.
    """

    base_radius: float
    platform_radius: float
    rod_length: float
    chain_angles: tuple[float, float, float]
    platform_angles: tuple[float, float, float]
    elbow: str = 'up'

    def __post_init__(self) -> None:
        for name in ('chain_angles', 'platform_angles'):
            angles = np.asarray(getattr(self, name), dtype=float)
            distance = np.abs(np.exp(1j * angles) - np.exp(1j * np.roll(angles, 1)))
            _require(f'geometry.{name}', getattr(self, name), bool(np.all(distance > 1e-6)),
                     'hold three different directions')
        turned = np.subtract(self.platform_angles, self.chain_angles)
        span = np.abs(self.base_radius - self.platform_radius * np.cos(turned)).max()
        _require('geometry.rod_length', self.rod_length, bool(span < self.rod_length),
                 f'be greater than {span:.6g} m, for the platform to stand unturned above the '
                 'base')

    @property
    def elbow_sign(self) -> float:
        """Sign of sin u_i."""
        return 1.0 if self.elbow == 'up' else -1.0


@dataclass(frozen=True)
class Masses:
    """Masses and the inertia of the platform with its payload.

    Parameters
    ----------
    platform, payload : float
        M and m [kg].
    slides, lifts, rods : 3 floats each
        m_1..m_3, m_4..m_6 and m_b of each chain [kg].
    centre : 3 floats
        Centre of mass of platform and payload from o, in `platform` [m].
    inertia : 6 floats
        Elements xx, yy, zz, xy, xz, yz of the inertia tensor of both about that centre, in
        `platform` [kg m^2]; products as tensor elements (-integral of x y dm), as in a URDF.
    """

    platform: float
    payload: float
    slides: tuple[float, float, float]
    lifts: tuple[float, float, float]
    rods: tuple[float, float, float]
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        _require('masses.platform', self.platform, self.total > 0,
                 'with masses.payload be greater than 0 kg')
        # A body's tensor has principal moments that satisfy the triangle inequality; a point
        # mass has none at all. Tolerance: a thin disc lies exactly on the border.
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        slack = 1e-9 * max(float(moments[2]), 1e-300)
        _require('masses.inertia', self.inertia, bool(moments[0] >= -slack),
                 'be a positive semi-definite tensor')
        triangle = bool(moments[0] + moments[1] >= moments[2] - slack)
        _require('masses.inertia', self.inertia, triangle,
                 'have principal moments of which each two sum to at least the third')

    @property
    def total(self) -> float:
        """M + m [kg]."""
        return self.platform + self.payload

    @property
    def inertia_tensor(self) -> Array:
        """Inertia tensor about the centre of mass, in `platform`, (3, 3) [kg m^2]."""
        xx, yy, zz, xy, xz, yz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _require(key: str, value: Any, condition: bool, rule: str) -> None:
    if not condition:
        raise ModelError(key, value, rule)


Limits = tuple[tuple[float, ...], ...]
UNLIMITED: Limits = ((-inf,) * COUNT, (inf,) * COUNT, (inf,) * COUNT)


@lru_cache
def structure_of(geometry: Geometry, limits: Limits = UNLIMITED) -> Structure:
    """Return the joints and closures of a 3-PPRS, whose platform is a free body.

    Parameters
    ----------
    geometry : Geometry
    limits : three tuples of 6 floats
        Lowest and highest position of each drive [m], and its largest force [N].

    Raises
    ------
    ModelError
        Where the drives do not determine the platform's motion at home.
    """
    R, r, l = geometry.base_radius, geometry.platform_radius, geometry.rod_length  # noqa: E741
    links = {name: np.zeros(PARAMETERS) for name in ('base', *LINKS)}
    joints: dict[str, Joint] = {}
    loops: list[Loop] = []
    home: dict[str, float] = {}
    e_x, e_y, e_z = np.eye(3)

    def hang(joint: str, joint_kind: str, parent: str, child: str, frame: Frame, axis: Array,
             ) -> None:
        joints[joint] = Joint(joint, joint_kind, parent, child, frame, axis)

    for i in range(3):
        delta, beta = geometry.chain_angles[i], geometry.platform_angles[i]
        n = i + 1
        foot = Frame.of((R * math.cos(delta), R * math.sin(delta), 0.0), (0.0, 0.0, delta))
        hang(f'slide_{n}', PRISMATIC, 'base', f'slide_{n}', foot, e_y)
        hang(f'lift_{n}', PRISMATIC, f'slide_{n}', f'lift_{n}', Frame(), e_z)
        hang(f'hinge_{n}', REVOLUTE, f'lift_{n}', f'rod_{n}', Frame(), e_y)
        cos_u = (R - r * math.cos(beta - delta)) / l
        u = geometry.elbow_sign * math.acos(cos_u)
        home |= {f'slide_{n}': r * math.sin(beta - delta),
                 f'lift_{n}': HOME_HEIGHT - l * math.sin(u), f'hinge_{n}': u}
        end = Frame(p=np.array([r * math.cos(beta), r * math.sin(beta), 0.0]))
        loops.append(Loop(f'ball_{n}', 'spherical', f'rod_{n}', Frame(p=np.array([-l, 0.0, 0.0])),
                          PLATFORM, end))
    hang(PLATFORM, FLOATING, 'base', PLATFORM, Frame(), e_x)
    poses = {PLATFORM: Frame(p=np.array([0.0, 0.0, HOME_HEIGHT]))}
    for drive, lower, upper, effort in zip(DRIVES, *limits, strict=True):
        joints[drive] = replace(joints[drive], lower=lower, upper=upper, effort=effort)
    return build_structure(Description('', links, joints, ''), 'base', PLATFORM, DRIVES,
                           tuple(loops), home, poses)


def rod(length: float, mass: float) -> Array:
    """Return the inertial parameters of a rod in its frame, (10,)."""
    across = mass * length ** 2 / 12
    return body_at(mass, (-length / 2, 0.0, 0.0), np.diag([0.0, across, across]))


class SingularityBounds(NamedTuple):
    """Distances that poses must keep from singularities.

    Parameters
    ----------
    rod_sine : float
        Smallest abs(sin u_i); at 0 a rod is horizontal and the inverse kinematics singular.
    condition_number : float
        Largest condition number of the drive Jacobian, rotations times r.
    rod_cosine : float
        Smallest abs(cos u_i); infinitely small unless chains are independent, Eq. (13).
    """

    rod_sine: float = 1e-6
    condition_number: float = inf
    rod_cosine: float = 0.0


UNBOUNDED = SingularityBounds()


@dataclass(frozen=True, eq=False, kw_only=True)
class ThreePprs(Mechanism):
    """The 3-PPRS: a mechanism that the paper's closed form evaluates.

    Parameters
    ----------
    geometry : Geometry
    bounds : SingularityBounds
    printed : bool
        Take Eq. (7) to the letter.
    """

    geometry: Geometry
    bounds: SingularityBounds = UNBOUNDED
    printed: bool = False

    has_guides: ClassVar[bool] = True
    plans_poses: ClassVar[bool] = True
    kind: ClassVar[str] = PLATFORM
    # Joints and links are three of a kind; no two kinds are alike.
    alike_joints: ClassVar[tuple[tuple[str, ...], ...]] = ()
    alike_links: ClassVar[tuple[tuple[str, ...], ...]] = ()
    tool_place: ClassVar[BodyPlace] = BodyPlace(PLATFORM, (0.0, 0.0, 0.0), inf, is_spread=True)
    link_places: ClassVar[tuple[BodyPlace, ...]] = (
        BodyPlace('rods', (0.0, 0.0, 0.0), inf, is_spread=True, links=RODS),)

    @classmethod
    def of(cls, geometry: Geometry, masses: Masses,
           gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), limits: Limits = UNLIMITED,
           **more: Any) -> Self:
        """Return the robot with bodies of some masses; for `limits` see `structure_of`."""
        structure = structure_of(geometry, limits)
        inertial = np.array([
            *(body_at(mass, (0.0,) * 3, np.zeros((3, 3)))
              for mass in (*masses.slides, *masses.lifts)),
            *(rod(geometry.rod_length, mass) for mass in masses.rods),
            body_at(masses.total, masses.centre, masses.inertia_tensor)])
        return cls(structure=structure, bodies=np.array([
            structure.links[name][0] for name in LINKS]), inertial=inertial,
            armature=np.zeros(COUNT), gravity=gravity, geometry=geometry, **more)

    @cached_property
    def passive_joints(self) -> tuple[PassiveJoint, ...]:
        """The joints C_i, and the joints A_i."""
        return tuple(PassiveJoint(name, self.radii.get(name, 0.0), has_position=name == REVOLUTE,
                                  joints=joints) for name, joints in ALIKE.items())

    @property
    def moved_mass(self) -> float:
        """Mass of the platform and its payload [kg]."""
        return float(self.masses[-1])

    def heavier(self, link: str, mass: float) -> Self:
        """Return the robot with a payload, or with rods, that weigh more [kg]."""
        added = np.zeros_like(self.inertial)
        if link == PLATFORM:
            added[-1] = body_at(mass, tuple(self.centre_of(link)), np.zeros((3, 3)))
        else:
            added[OF_RODS] = rod(self.geometry.rod_length, mass)
        return replace(self, inertial=self.inertial + added)

    @cached_property
    def _chains(self) -> tuple[closed_form.Chain, ...]:
        """Constants of the chains."""
        geometry, masses = self.geometry, self.masses[:-1].reshape(3, 3)
        delta = np.asarray(geometry.chain_angles)
        cos, sin = np.cos(delta), np.sin(delta)
        joints = geometry.platform_radius * np.exp(1j * np.asarray(geometry.platform_angles))
        left = np.linalg.pinv(np.stack((-sin, cos), axis=1))
        # The weights with which the three directions n_i add up to nothing.
        balance = np.sin(np.roll(delta, -2) - np.roll(delta, -1))
        constants = np.stack((cos, sin, joints.real, joints.imag, *left, balance, *masses), axis=1)
        return tuple(closed_form.Chain(*chain) for chain in constants.tolist())

    def friction_parameters(self, joints: JointFriction, drives: Array | None = None) -> Any:
        """Return parameters for `one_pass`: first those of `closed_form.forces`.

        Parameters
        ----------
        joints : JointFriction
        drives : (OF_DRIVE, 6) array, optional
            Without it the drives have no friction.
        """
        geometry, bounds = self.geometry, self.bounds
        mass, centre, inertia = about_centre(self.inertial[-1])
        tables = super().friction_parameters(joints, drives)
        friction = tuple(closed_form.DriveParameters(*drive) for drive in tables[1][
            [tree.VISCOUS, tree.COEFFICIENT, tree.WIDTH]].T.tolist())
        first, second, third = self._chains
        width, *hinge = _of_three(joints, joints.joint)
        width_of_ball, *ball = _of_three(joints, joints.loop)
        own = row_of(closed_form.Parameters(
            geometry.base_radius, geometry.rod_length, geometry.platform_radius,
            geometry.elbow_sign, (first, second, third), mass, Vector(*centre),
            Vector(*np.diag(inertia)), Vector(inertia[0, 1], inertia[0, 2], inertia[1, 2]),
            Vector(*self.gravity), bounds.rod_sine, bounds.condition_number ** 2,
            closed_form.Joints(width or width_of_ball or 1.0, *hinge, *ball), friction))
        return own, *tables

    def one_pass(self, motion: Any, parameters: Any, closed: dict[Any, Array] | None,
                 start: Array | None = None) -> tree.InverseDynamicsResult | None:
        """Return the forces for a motion, friction included; see `Mechanism.one_pass`."""
        if self.printed:
            return None
        if not isinstance(motion, PlatformMotion):
            found = super().one_pass(motion, parameters[1:], closed, start)
            return found if found is not None and self._is_within_bounds(found.q) else None
        table, failed = _closed_form(parameters[0], motion.rows, NOT_WANTED)
        return None if failed >= 0 else tree.InverseDynamicsResult(
            None, table, table[tree.EFFORTS:])

    # --- motion --------------------------------------------------------------------------------

    def at_home(self, samples: int) -> PlatformMotion:
        """Return the platform at rest at its home pose."""
        return PlatformMotion.at_rest(np.tile([0.0, 0.0, HOME_HEIGHT], (samples, 1)))

    def drive_motion(self, motion: PlatformMotion, closed: object = None,
                     ) -> tuple[JointMotion, Array]:
        """Return the motion of the drives for that of the platform, and closed coordinates.

        Raises
        ------
        WorkspaceError
            For a pose out of reach.
        SingularityError
            For a pose nearer to a singularity than `bounds` allow.
        """
        start = np.empty((len(motion), closed_form.COORDINATES))
        # Very large numbers overflow; users of the result check that it is finite.
        with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
            table, failed = _closed_form(self._frictionless, motion.rows, start)
            position, velocity, acceleration = table[tree.EFFORTS:]
            moved = JointMotion(position, velocity, acceleration, motion.time)
            start[:, PLACE] -= self.structure.poses[PLATFORM].p
            if failed >= 0:
                self._require_reach(motion)
                self._require_regular(LinkMotion(
                    self.structure, self.structure.evaluation.forward_kinematics(
                        position, velocity, acceleration, start)[0]))
        return moved, start

    def kinematics(self, state: MechanismState) -> LinkMotion:
        """Return the motion of all links in a state within `bounds`.

        Closed coordinates from which to start, and one pass, are of poses within them.
        """
        links: LinkMotion = super().kinematics(state)
        if state.start is None and vars(state).get('inverse_dynamics') is None and not (
                self._is_within_bounds(links.motion.q)):
            self._require_regular(links)
        return links

    def platform_motion(self, links: LinkMotion) -> PlatformMotion:
        """Return the motion of the platform, without times."""
        m, row = links.motion, self.structure.links[PLATFORM][0]
        rows = self._poses(m.q)
        rows[:, 7:] = np.hstack((m.u[:, row], m.w[:, row], m.ud[:, row], m.wd[:, row]))
        return PlatformMotion.from_rows(rows)

    def _poses(self, q: Array) -> Array:
        """Return the poses of closed coordinates (N, C) at rest, as `PlatformMotion.rows`."""
        (z, y, x), (c_z, c_y, c_x) = (turn(q[:, TURNS].T / 2) for turn in (np.sin, np.cos))
        rows = np.zeros((len(q), sum(WIDTHS)))
        rows[:, :3] = q[:, PLACE] + self.structure.poses[PLATFORM].p
        rows[:, 3], rows[:, 4] = x * c_y * c_z - c_x * y * z, c_x * y * c_z + x * c_y * z
        rows[:, 5], rows[:, 6] = c_x * c_y * z - x * y * c_z, c_x * c_y * c_z + x * y * z
        return rows

    @cached_property
    def _frictionless(self) -> Array:
        parameters: Array = self.friction_parameters(tree.NO_FRICTION)[0]
        return parameters

    def under_loads(self, state: MechanismState, others: Sequence[MechanismState],
                    ) -> Iterator[MechanismState]:
        """Yield states of the same motion; those of the printed form one by one."""
        yield from others if self.printed else super().under_loads(state, others)

    def loads(self, links: LinkMotion, load: StructureLoad | None) -> tree.Loads:
        """Return the frictionless loads of joints and closures.

        Printed, the rod's term in Eq. (7) lacks the factor l.
        """
        found: tree.Loads = super().loads(links, load)
        if self.printed:
            u, u_dot, u_ddot = self.rods(links)
            rise = (u_ddot * np.cos(u) - u_dot ** 2 * np.sin(u)) / 2
            found.efforts[:, COUNT // 2:] += (1 - self.geometry.rod_length) * (
                self.masses[OF_RODS] * rise)                                   # Eq. (7)
        return found

    # --- rods and passive joints ------------------------------------------------------------------

    @cached_property
    def _hinges(self) -> Integers:
        """Rows of the joints C_i."""
        return np.array([self.structure.rows[name] for name in HINGES])

    def rods(self, links: LinkMotion) -> Array:
        """Return u_i with its first and second rate, (3, N, 3) [rad]."""
        found: Array = np.moveaxis(links.motion.motion[:, :, closed_form.RODS:], 1, 0)
        return found

    def jacobian(self, links: LinkMotion) -> Array:
        """Return [J], X_dot = J q_dot with X_dot = (v, omega) in `base`, (N, 6, 6)."""
        m, end = links.motion, self.structure.links[PLATFORM][0] + 1  # slides, then turns
        rates = m.drive_to_joint[:, closed_form.PLACE:closed_form.LIFTS].reshape(-1, 2, 3, COUNT)
        axes = m.z[:, end - COUNT:end].reshape(-1, 2, 3, 3)
        J: Array = (axes.transpose(0, 1, 3, 2) @ rates).reshape(-1, COUNT, COUNT)
        return J

    def rod_rates(self, state: MechanismState) -> tuple[Array, Array]:
        """Return n_i, and the rates u_dot_i n_i - omega of rods against the platform, (N, 3, 3)."""
        n = state.links.motion.z[:, self._hinges]
        return n, self.rods(state.links)[1][..., None] * n - state.tool_velocity[:, None, 3:]

    def resistances(self, state: MechanismState, friction: JointFriction) -> tuple[Array, Array]:
        """Return k_ri and k_si at the frictionless reactions, (N, 3) each, Eq. (9)."""
        n, turning = self.rod_rates(state)
        loads, found = state.reactions, []
        for rows, rate, force in (
                (friction.joint, self.rods(state.links)[1][..., None],
                 np.cross(loads.f[:, self._hinges], n)),
                (friction.loop, turning, loads.F)):
            width, viscous, torque, lever = _of_three(friction, rows)
            width = width or 1.0
            speed = np.maximum(np.linalg.norm(rate, axis=2), 1e-8 * width)  # below it the limit
            dry = torque + lever * np.linalg.norm(force, axis=2)               # Eq. (1)
            found.append(viscous + dry * np.tanh(speed / width) / speed)       # Eq. (2)
        return found[0], found[1]

    def load_of_friction(self, state: MechanismState, joints: JointFriction) -> StructureLoad:
        """Return friction of passive joints as a load on the platform and the rods, Eq. (9).

        The paper takes the reactions for friction without it, so that friction does not follow.
        """
        k_r, k_s = self.resistances(state, joints)
        n, turning = self.rod_rates(state)
        moment = -np.sum(k_s[..., None] * turning, axis=1)
        torques = k_r * self.rods(state.links)[1] + k_s * np.sum(turning * n, axis=2)
        return StructureLoad(np.hstack((np.zeros_like(moment), moment)),
                             dict(zip(HINGES, torques.T, strict=True)))

    # --- singularities ----------------------------------------------------------------------------

    def _is_within_bounds(self, q: Array) -> bool:
        """Return whether the closed form accepts the poses of closed coordinates, (N, C)."""
        return bool(np.all(np.sin(q[:, closed_form.RODS:]) * self.geometry.elbow_sign > 0)
                    and _closed_form(self._frictionless, self._poses(q), NOT_WANTED)[1] < 0)

    def _require_reach(self, motion: PlatformMotion) -> None:
        """Raise WorkspaceError where a rod is too short to reach: abs(R - A_i . e_i) > l."""
        geometry, chains = self.geometry, np.array(self._chains)
        arms = np.insert(chains[:, 2:4], 2, 0.0, axis=1)  # of A_i in `platform`
        A = motion.position[:, None] + arms @ motion.rotation.transpose(0, 2, 1)
        span = geometry.base_radius - np.sum(A[..., :2] * chains[:, :2], axis=2)
        beyond = ~(np.abs(span) <= geometry.rod_length)
        if np.any(beyond):
            sample, chain = (int(i) for i in np.argwhere(beyond)[0])
            raise WorkspaceError(
                sample, f'the rod of chain {chain + 1} would have to span '
                f'{abs(span[sample, chain]):.6g} m radially',
                f'its length is geometry.rod_length = {geometry.rod_length:g} m')

    def _require_regular(self, links: LinkMotion) -> None:
        """Raise SingularityError for poses nearer to a singularity than allowed.

        Where a rod lies horizontally, the drives cannot hold the platform, or the drive Jacobian
        is conditioned poorly.
        """
        bounds = self.bounds
        sine = np.sin(self.rods(links)[0]) * self.geometry.elbow_sign
        flat = sine < bounds.rod_sine
        if np.any(flat):
            sample, chain = (int(i) for i in np.argwhere(flat)[0])
            raise SingularityError(
                sample, f'|sin u| of chain {chain + 1} is {abs(sine[sample, chain]):.3g} '
                '(its rod lies horizontally)',
                f'it must be at least {bounds.rod_sine:g} (limits.rod_sine)')
        J = self.jacobian(links)
        singular = ~np.isfinite(J).all(axis=(1, 2))
        if np.any(singular):
            raise SingularityError(int(np.argmax(singular)), 'det [B] is 0',
                                   'the drives cannot hold the platform here')
        number = self.condition_number(J)
        over = ~(number <= bounds.condition_number)
        if np.any(over):
            worst = int(np.argmax(over))
            raise SingularityError(
                worst, f'the condition number of the drive Jacobian is {number[worst]:.4g}',
                f'limits.condition_number is {bounds.condition_number:g}')

    def condition_number(self, J: Array) -> Array:
        """Return the condition number of the drive Jacobian, (N,).

        Rotations are multiplied by the platform's radius r as characteristic length, so that both
        halves of a twist are in m/s.

        References
        ----------
        J. Angeles, Fundamentals of Robotic Mechanical Systems, on the characteristic length.
        """
        r = self.geometry.platform_radius
        number: Array = np.linalg.cond(J * np.array([1.0, 1.0, 1.0, r, r, r])[:, None])
        return number

    def singularity_margin(self, state: MechanismState) -> float:
        """Return 1 minus the largest of three shares, 0 at the limit.

        Condition number over its limit, smallest sine of a rod angle over that of the rods, and,
        with independent chains, the ratio for the cosine.
        """
        bounds, (u, *_) = self.bounds, self.rods(state.links)
        J = self.jacobian(state.links)[::-(-len(state) // MOST_CONDITIONS)]
        return float(1 - max(self.condition_number(J).max() / bounds.condition_number,
                             bounds.rod_sine / np.abs(np.sin(u)).min(),
                             bounds.rod_cosine / np.abs(np.cos(u)).min()))

    def variables(self, state: MechanismState) -> dict[str, Array]:
        """Return loads of the guides, rod angles, and where the platform is."""
        platform = state.links.frame_of(PLATFORM)
        (x, y, z), R = platform.p.T, platform.R
        return {'load': state.friction_load, 'rod_angle': np.tile(self.rods(state.links)[0], 2),
                'platform_x': x, 'platform_y': y, 'platform_z': z,
                'platform_tilt': np.arctan2(np.hypot(R[:, 0, 2], R[:, 1, 2]), R[:, 2, 2]),
                'platform_turn': np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])}


def _closed_form(parameters: Array, motion: Array, q: Array) -> tuple[Array, int]:
    """Return the results of `closed_form.forces`, and the first sample that it refuses or -1."""
    table = np.empty((closed_form.RESULTS, len(motion), COUNT))
    return table, run(closed_form.forces, parameters, motion, table, q)


def _of_three(friction: JointFriction, rows: Any) -> tuple[float, ...]:
    """Return width, viscous, torque and lever of three joints that are alike; 0 for none.

    `rows` are those of friction: of joints, or of loops.
    """
    return tuple(float(column[rows >= 0][:1].sum()) for column in (
        friction.width, friction.viscous, friction.torque, friction.lever))
